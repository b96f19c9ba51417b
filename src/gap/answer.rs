//! The answer: types that serialise to `diagnosis.json` as its schema describes it.
//!
//! Numbers are rounded to six significant digits (plant parameters are exact), so that the same campaign gives the same bytes.

use super::verdict::Verdict;
use crate::effects::{PARAMETERS, Parameters, SIMULATED};
use crate::validated::{CLOSING, SLIPS, THETA, Validated};
use crate::vehicle::{NUMBERS, Vehicle};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A number as the answer prints it: with six significant digits, or null if it is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Real(pub f64);

impl Serialize for Real {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match format!("{:.5e}", self.0).parse::<f64>().ok().filter(|x| x.is_finite()) {
            Some(x) => s.serialize_f64(x),
            None => s.serialize_none(),
        }
    }
}

/// The whole answer.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// Version of the schema.
    pub schema: &'static str,
    /// Verdict.
    pub verdict: Verdict,
    /// Posterior probability of what the verdict says, e.g. that nothing is wrong, that these effects are present, or that a law is missing there.
    pub confidence: Real,
    /// The verdict in a sentence.
    pub sentence: String,
    /// Notes for the reader.
    pub notes: Vec<String>,
    /// Recordings that were not used.
    pub left_out: Vec<LeftOut>,
    /// Where the gap lies.
    #[serde(rename = "where")]
    pub place: Where,
    /// Which effects cause the gap.
    pub which: Which,
    /// How far the gap shrinks.
    pub how_far: HowFar,
    /// The retuned car.
    pub plant: Plant,
    /// The normal posterior of the unknowns that all recordings share; none if its curvature is not positive definite.
    pub joint: Option<Joint>,
    /// Where the retuned plant was validated, and how well its clutch torque is known.
    pub domain: Domain,
    /// What to measure to decide between the explanations that are still open; none if nothing is open.
    pub measure_next: Option<MeasureNext>,
    /// Subsystems that are hidden because no recording has a position; omitted if one has.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hidden_without_position: Vec<&'static str>,
}

/// Explanations that are still probable, and the manoeuvres that could decide between them.
#[derive(Clone, Debug, Serialize)]
pub struct MeasureNext {
    /// The explanations, the most probable first.
    pub rivals: Vec<RivalSet>,
    /// Every manoeuvre that can be driven, the one with the most expected evidence per minute first.
    pub manoeuvres: Vec<Planned>,
}

/// One of the rival explanations.
#[derive(Clone, Debug, Serialize)]
pub struct RivalSet {
    /// Its effects; an empty list is the car within its tolerances.
    pub effects: Vec<&'static str>,
    /// Probability among the rivals.
    pub probability: Real,
}

/// A manoeuvre that can be driven, and the evidence that is expected from it.
#[derive(Clone, Debug, Serialize)]
pub struct Planned {
    /// Its name.
    pub name: String,
    /// What to drive.
    pub drive: &'static str,
    /// Clutch torque of the manoeuvre, N·m; for torque steps, their scale.
    #[serde(rename = "torque_Nm")]
    pub torque_nm: Real,
    /// Disc temperature at the start, °C.
    #[serde(rename = "theta_c0_degC")]
    pub theta_c: Real,
    /// Length of the recording, s.
    pub seconds: Real,
    /// Time to prepare it, s.
    pub prepare_s: Real,
    /// Expected evidence for the explanation that is true, nats.
    pub nats: Real,
    /// Expected evidence per minute, preparation included, nats.
    pub nats_per_minute: Real,
    /// Probability that the recording distinguishes the best explanation from another one: the smallest over all others.
    pub splits: Real,
}

/// The normal posterior of the unknowns that all recordings share, and the prior contained in it. The posterior without the prior is the information of the recordings alone, which
/// may be pooled with that of other cars.
#[derive(Clone, Debug, Serialize)]
pub struct Joint {
    /// The unknowns, in the order of the matrices.
    pub unknowns: Vec<Unknown>,
    /// Inverse of the posterior covariance, in reciprocal products of the units: rows of the lower triangle.
    pub precision: Vec<Vec<Real>>,
    /// Posterior precision with the full likelihood, as if the laws were exact, in the same form. It reflects noise alone, which differs from car to car, whereas an inexact law
    /// has the same error in all cars.
    pub precision_exact: Vec<Vec<Real>>,
    /// Posterior covariance, in products of the units: rows of the lower triangle.
    pub covariance: Vec<Vec<Real>>,
    /// Inverse of the prior covariance: row, column and value of the non-zero elements of the lower triangle.
    pub prior_precision: Vec<(usize, usize, Real)>,
}

/// One unknown that all recordings share.
#[derive(Clone, Debug, Serialize)]
pub struct Unknown {
    /// Name of a tolerance, or FMU variable of an effect's parameter.
    pub name: String,
    /// `tolerance` of the vehicle file, `logger` (a default that no file declares), or `effect`.
    pub kind: &'static str,
    /// Posterior mode: for an effect's parameter in its unit, otherwise in standard deviations `sigma`.
    pub value: Real,
    /// Prior centre, in the same unit.
    pub centre: Real,
    /// Unit of an effect's parameter.
    pub unit: Option<&'static str>,
    /// Prior standard deviation of a number of the vehicle file or of the logger: in its unit, or that of its logarithm if `relative`; none for an effect's parameter.
    pub sigma: Option<Real>,
    /// Whether `sigma` is that of the logarithm.
    pub relative: bool,
    /// Whether the unknown cannot be negative.
    pub one_sided: bool,
    /// The effect's parameter that changes the car in the same way as this number, if there is one.
    pub same_as: Option<SameAs>,
}

/// An effect's parameter that changes the car in the same way as a number of the vehicle file.
#[derive(Clone, Debug, Serialize)]
pub struct SameAs {
    /// FMU variable.
    pub parameter: &'static str,
    /// Change of the parameter that is equivalent to one standard deviation of the number.
    pub per_sigma: Real,
}

/// Where the retuned plant was validated, and how well its clutch torque is known. The plant's outputs `validity` and `T_fc_sigma` are computed from these data.
#[derive(Clone, Debug, Serialize)]
pub struct Domain {
    /// Names and units of the four numbers of a place, in their order.
    pub quantities: [[&'static str; 2]; 4],
    /// Places that represent all those covered by the recordings of the fit; empty if the plant was validated nowhere.
    pub places: Vec<[Real; 4]>,
    /// Standard deviation of the clutch torque.
    pub torque_sigma: TorqueSigma,
}

/// Table of standard deviations, linear between its breakpoints and held constant outside.
#[derive(Clone, Debug, Serialize)]
pub struct TorqueSigma {
    /// Breakpoints over closing.
    pub closing: &'static [f64],
    /// Breakpoints over the disc temperature, °C.
    #[serde(rename = "theta_c_degC")]
    pub theta_c: &'static [f64],
    /// Breakpoints over the magnitude of the slip, rad/s.
    pub slip_rad_s: &'static [f64],
    /// Values by closing, temperature and slip, N·m.
    #[serde(rename = "sigma_Nm")]
    pub sigma_nm: Vec<Vec<Vec<Real>>>,
}

impl Domain {
    /// The domain in the form in which the answer prints it.
    pub fn of(v: &Validated) -> Self {
        let real = |values: &[f64]| values.iter().copied().map(Real).collect::<Vec<_>>();
        let by_theta = |part: &[f64]| part.chunks(SLIPS.len()).map(real).collect::<Vec<_>>();
        Self {
            quantities: [["slip", "rad/s"], ["theta_c", "degC"], ["closing", "1"], ["T_fc", "N.m"]],
            places: v.places().iter().map(|p| p.numbers().map(Real)).collect(),
            torque_sigma: TorqueSigma {
                closing: &CLOSING,
                theta_c: &THETA,
                slip_rad_s: &SLIPS,
                sigma_nm: v.sigmas().chunks(THETA.len() * SLIPS.len()).map(by_theta).collect(),
            },
        }
    }
}

/// A recording that was not used.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    /// Its name.
    pub recording: String,
    /// Why.
    pub reason: String,
}

/// Where the gap lies.
#[derive(Clone, Debug, Serialize)]
pub struct Where {
    /// Subsystem with the largest share.
    pub primary: Option<&'static str>,
    /// All subsystems with a share of the gap, largest first.
    pub subsystems: Vec<Share>,
    /// Residual map without effects.
    pub equations: Vec<Equation>,
    /// Residual map with the effects of the explanation that stands.
    pub equations_after: Vec<Equation>,
    /// Probability that any cell is marked in the map of a car without a gap.
    pub family_wise_error: Real,
    /// Subsystem of a structured remainder, or of an unexplained gap.
    pub unexplained_at: Option<&'static str>,
    /// Subsystems in which the gap or its remainder may lie instead.
    pub ambiguous_with: Vec<&'static str>,
    /// Irregular disturbances, in words with their size; omitted if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub irregular: Vec<String>,
    /// Posterior probability that a law is missing, by subsystem.
    pub missing_law: BTreeMap<&'static str, Real>,
}

/// A subsystem's share of the gap.
#[derive(Clone, Debug, Serialize)]
pub struct Share {
    /// Subsystem.
    pub id: &'static str,
    /// Share.
    pub share: Real,
}

/// One cell of the residual map.
#[derive(Clone, Debug, Serialize)]
pub struct Equation {
    /// Balance.
    pub equation: &'static str,
    /// Phase.
    pub phase: &'static str,
    /// Operating region.
    pub region: &'static str,
    /// Gap in standard deviations of its noise.
    pub sigma: Real,
    /// Root mean square of the innovations.
    pub rms: Real,
    /// Unit of `rms`.
    pub unit: &'static str,
    /// Number of observations.
    pub samples: usize,
    /// Whether the gap is statistically significant.
    pub significant: bool,
}

/// Which effects cause the gap, and what is known of the other candidates.
#[derive(Clone, Debug, Serialize)]
pub struct Which {
    /// The effects that are named, most important first.
    pub effects: Vec<Effect>,
    /// Effects that account for the innovations but are not named, because free replays with them are further off.
    pub taken_back: Option<TakenBack>,
    /// All effects of the library, those with the most evidence first.
    pub ranked: Vec<Ranked>,
    /// Effects that the recordings cannot show.
    pub not_assessable: Vec<NotAssessable>,
    /// Fitted values of the unknowns that all recordings share (tolerances and timing of the logger), in standard deviations.
    pub tolerances: BTreeMap<String, Real>,
    /// The most probable explanations.
    pub explanations: Vec<Weighed>,
    /// Probability that none of the compared explanations holds, because the probable ones strain the tolerances of the vehicle file.
    pub beyond: Real,
    /// Strongest correlations of a parameter of a named effect with another unknown.
    pub correlations: Vec<Correlation>,
}

/// Effects that were withdrawn, and why.
#[derive(Clone, Debug, Serialize)]
pub struct TakenBack {
    /// Ids.
    pub effects: Vec<&'static str>,
    /// Mean gap of both speeds in free replays of the recordings of the fit with the car of the file, rad/s.
    pub before: Real,
    /// Mean gap of both speeds in these replays with the effects, rad/s.
    pub after: Real,
}

/// Posterior correlation of two unknowns.
#[derive(Clone, Debug, Serialize)]
pub struct Correlation {
    /// A parameter of a named effect.
    pub parameter: &'static str,
    /// Another effect's parameter, or a number that all recordings share (a tolerance or a timing of the logger).
    pub with: String,
    /// Coefficient.
    pub coefficient: Real,
}

/// An effect that was named.
#[derive(Clone, Debug, Serialize)]
pub struct Effect {
    /// Id.
    pub id: &'static str,
    /// Posterior probability that the effect is present.
    pub probability: Real,
    /// Effects that may be present instead.
    pub ambiguous_with: Vec<&'static str>,
    /// The manoeuvre that best distinguishes the effect from those that may be present instead; empty if there are none.
    pub separated_by: String,
    /// How large the effect is, in sizes of a noticeable one.
    pub sizes: Real,
    /// Its parameters.
    pub parameters: BTreeMap<&'static str, Interval>,
}

/// Estimate and 95 % interval.
#[derive(Clone, Debug, Serialize)]
pub struct Interval {
    /// Estimate.
    pub value: Real,
    /// Lower end.
    pub low: Real,
    /// Upper end.
    pub high: Real,
    /// Unit.
    pub unit: &'static str,
}

/// An effect of the library as a candidate.
#[derive(Clone, Debug, Serialize)]
pub struct Ranked {
    /// Id.
    pub id: &'static str,
    /// Logarithm of the posterior odds of the best explanation with the effect against the best one without it, nats.
    pub evidence: Real,
    /// Result for the candidate: `chosen`, `not assessable`, `ambiguous` or `rejected`.
    pub verdict: &'static str,
    /// Why.
    pub reason: String,
    /// Limit of detection with these recordings; none if there is no limit below a thousand times the size of a usual fault.
    pub smallest_visible: Option<Visible>,
}

/// Limit of detection: the smallest size of an effect that recordings would show.
#[derive(Clone, Debug, Serialize)]
pub struct Visible {
    /// Parameter.
    pub parameter: &'static str,
    /// Departure from its null value.
    pub size: Real,
    /// Departure from the null value in a usual fault.
    pub usual: Real,
    /// Unit.
    pub unit: &'static str,
}

/// An effect that these recordings cannot show.
#[derive(Clone, Debug, Serialize)]
pub struct NotAssessable {
    /// Id.
    pub id: &'static str,
    /// What to measure.
    pub measure: String,
}

/// An explanation with its probability.
#[derive(Clone, Debug, Serialize)]
pub struct Weighed {
    /// Effects.
    pub effects: Vec<&'static str>,
    /// Subsystem of a missing law.
    pub missing_law: Option<&'static str>,
    /// Posterior probability.
    pub probability: Real,
    /// How far its log posterior is behind that of the best explanation, nats.
    pub behind: Real,
}

/// How far the gap shrinks.
#[derive(Clone, Debug, Serialize)]
pub struct HowFar {
    /// Definition of the gap, with its unit.
    pub metric: &'static str,
    /// Gap of the nominal plant.
    pub before: Real,
    /// Gap of the retuned plant.
    pub after: Real,
    /// Gap that the true car would be expected to leave.
    pub noise_floor: Real,
    /// Share of the gap above the floor that is closed.
    pub closed_fraction: Real,
    /// Names of the held-out data.
    pub held_out: Vec<String>,
    /// Gap by recording and channel.
    pub per_recording: Vec<PerRecording>,
    /// Engagement figures by recording and name of the figure.
    pub kpi: BTreeMap<String, BTreeMap<&'static str, Figures>>,
    /// What a learned law closes in addition; the numbers above are those without it. None if no law was tried, because too little is left or no law acts there.
    pub empirical: Option<Empirical>,
}

/// Laws that were learned together. They are not a cause, and the verdict does not depend on them.
#[derive(Clone, Debug, Serialize)]
pub struct Empirical {
    /// Subsystems in which something may be missing; if effects explain the gap, those of the effects as well.
    pub places: Vec<&'static str>,
    /// Subsystems of the laws, the first one added first.
    pub laws: Vec<&'static str>,
    /// Whether the retuned plant contains the laws.
    pub taken: bool,
    /// Why the laws were taken, or why not.
    pub reason: String,
    /// Gap on the held-out data without any law.
    pub without: Real,
    /// Gap on the held-out data with the laws.
    pub after: Real,
    /// Share of the gap of the nominal car above the floor that is closed with the laws.
    pub closed_fraction: Real,
    /// Share by which the mean gap that is left without a law falls on the other recordings, each replayed with a law that was learned from the rest.
    pub left_out_fraction: Real,
    /// Gap on the held-out data by channel, with the laws.
    pub per_recording: Vec<PerRecording>,
    /// Curves of the laws.
    pub curves: Vec<EmpiricalCurve>,
}

/// A curve of a learned law.
#[derive(Clone, Debug, Serialize)]
pub struct EmpiricalCurve {
    /// Name: that of the FMU's variables without the prefix `effect.empirical.` and without their number.
    pub id: &'static str,
    /// Independent variable, with its unit.
    pub over: &'static str,
    /// Unit of its values.
    pub unit: &'static str,
    /// Breakpoints.
    pub breakpoints: &'static [f64],
    /// Values at the breakpoints.
    pub values: Vec<Real>,
    /// Standard deviations of the values.
    pub sigma: Vec<Real>,
}

/// Gap of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct PerRecording {
    /// Recording.
    pub recording: String,
    /// Column.
    pub channel: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Root mean square error of the nominal plant.
    pub before: Real,
    /// Root mean square error of the retuned plant, or of the plant with the learned laws.
    pub after: Real,
    /// Standard deviation of the channel's noise.
    pub noise: Real,
}

/// One figure: real, before, after.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figures {
    /// As measured.
    pub real: Option<Real>,
    /// As the nominal plant has it.
    pub before: Option<Real>,
    /// As the retuned plant has it.
    pub after: Option<Real>,
}

/// The retuned car.
#[derive(Clone, Debug, Serialize)]
pub struct Plant {
    /// FMU variable and value.
    pub parameters: BTreeMap<&'static str, f64>,
    /// The same for the vehicle as its file gives it.
    pub nominal_parameters: BTreeMap<&'static str, f64>,
}

/// Variable names and values of DrivelinePlant.fmu that make it this car. Effects that no diagnosis searches for stay at their null values and are left out.
pub fn plant_parameters(vehicle: &Vehicle, effects: &Parameters) -> BTreeMap<&'static str, f64> {
    let numbers = NUMBERS.iter().map(|n| (n.name, (n.get)(vehicle)));
    let searched = PARAMETERS.iter().zip(effects).filter(|(p, _)| SIMULATED.iter().all(|entry| entry.id != p.effect));
    numbers.chain(searched.map(|(p, v)| (p.variable, *v))).collect()
}
