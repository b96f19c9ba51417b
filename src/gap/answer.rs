//! The answer: `diagnosis.json` as its schema has it, as a type.
//!
//! Numbers are rounded to six significant digits (plant parameters are exact), so that the same campaign gives the same bytes.

use super::verdict::Verdict;
use crate::effects::{PARAMETERS, Parameters, SIMULATED};
use crate::validated::{CLOSING, SLIPS, THETA, Validated};
use crate::vehicle::{NUMBERS, Vehicle};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A number as the answer prints it: six significant digits; what is not finite is null.
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
    /// Posterior probability of the verdict's content.
    pub confidence: Real,
    /// The verdict in a sentence.
    pub sentence: String,
    /// What a reader has to know beside it.
    pub notes: Vec<String>,
    /// Recordings that were not used.
    pub left_out: Vec<LeftOut>,
    /// Where.
    #[serde(rename = "where")]
    pub place: Where,
    /// Which.
    pub which: Which,
    /// How far.
    pub how_far: HowFar,
    /// The retuned car.
    pub plant: Plant,
    /// The normal posterior of what all recordings share.
    pub joint: Option<Joint>,
    /// Where the retuned plant was validated, and how well its clutch torque is known.
    pub domain: Domain,
    /// What would split what is still open; none where nothing is.
    pub measure_next: Option<MeasureNext>,
    /// Subsystems that hide because no recording says where the bearing is; left out where one does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hidden_without_position: Vec<&'static str>,
}

/// What would split the explanations that are still believed.
#[derive(Clone, Debug, Serialize)]
pub struct MeasureNext {
    /// The explanations, the most probable first.
    pub rivals: Vec<RivalSet>,
    /// Every manoeuvre that can be driven, by expected evidence per minute.
    pub manoeuvres: Vec<Planned>,
}

/// One of them.
#[derive(Clone, Debug, Serialize)]
pub struct RivalSet {
    /// Its effects; none is the car within its tolerances.
    pub effects: Vec<&'static str>,
    /// Probability among them.
    pub probability: Real,
}

/// A manoeuvre that can be driven, and what it is expected to be worth.
#[derive(Clone, Debug, Serialize)]
pub struct Planned {
    /// Its name.
    pub name: String,
    /// What to drive.
    pub drive: &'static str,
    /// Clutch torque that it is about, N·m.
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
    /// The same per minute, preparation included.
    pub nats_per_minute: Real,
    /// Probability that the best explanation is then told from all others.
    pub splits: Real,
}

/// The normal posterior of the unknowns that all recordings share, with the prior that is in it: the posterior without the prior is what the
/// recordings alone say, which is what may be pooled with other cars.
#[derive(Clone, Debug, Serialize)]
pub struct Joint {
    /// The unknowns, in the order of the matrices.
    pub unknowns: Vec<Unknown>,
    /// Inverse of their posterior covariance, in products of their units: rows of the lower triangle.
    pub precision: Vec<Vec<Real>>,
    /// The same where the likelihood is taken whole, as if the laws were exact: by noise alone, which differs from car to car, while an inexact law errs alike in all of them.
    pub precision_exact: Vec<Vec<Real>>,
    /// Their posterior covariance, in the same form.
    pub covariance: Vec<Vec<Real>>,
    /// Inverse of their prior covariance: row, column, value of what is not zero in the lower triangle.
    pub prior_precision: Vec<(usize, usize, Real)>,
}

/// One of them.
#[derive(Clone, Debug, Serialize)]
pub struct Unknown {
    /// Name of a tolerance, or FMU variable of an effect's parameter.
    pub name: String,
    /// `tolerance` of the vehicle file, `logger` (a default that no file declares), or `effect`.
    pub kind: &'static str,
    /// Posterior mode: of an effect's parameter in its unit, else in standard deviations `sigma`.
    pub value: Real,
    /// Prior centre, in the same unit.
    pub centre: Real,
    /// Unit of an effect's parameter.
    pub unit: Option<&'static str>,
    /// One standard deviation of the number: in its unit, or of its logarithm where `relative`.
    pub sigma: Option<Real>,
    /// Whether `sigma` is that of the logarithm.
    pub relative: bool,
    /// Whether it cannot be negative.
    pub one_sided: bool,
    /// The effect's parameter that does to the car what this number does, and by how much for one standard deviation.
    pub same_as: Option<SameAs>,
}

/// An effect's parameter that does to the car what a number of the vehicle file does.
#[derive(Clone, Debug, Serialize)]
pub struct SameAs {
    /// FMU variable.
    pub parameter: &'static str,
    /// Change of it that does the same as one standard deviation of the number.
    pub per_sigma: Real,
}

/// Where the retuned plant was validated, and how well its clutch torque is known: what its outputs `validity` and `T_fc_sigma` come from.
#[derive(Clone, Debug, Serialize)]
pub struct Domain {
    /// Names and units of a place's numbers, in their order.
    pub quantities: [[&'static str; 2]; 4],
    /// Places that stand for all that the recordings covered which taught it; none if the plant does not follow its car.
    pub places: Vec<[Real; 4]>,
    /// Standard deviation of the clutch torque.
    pub torque_sigma: TorqueSigma,
}

/// A table, linear between its breakpoints and held constant outside.
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
    /// As the answer prints it.
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
    /// All subsystems that share it.
    pub subsystems: Vec<Share>,
    /// Residual map.
    pub equations: Vec<Equation>,
    /// The same with the effects that were named.
    pub equations_after: Vec<Equation>,
    /// Probability of any false alarm in the map of a car without gap.
    pub family_wise_error: Real,
    /// Subsystem of a structured remainder.
    pub unexplained_at: Option<&'static str>,
    /// Subsystems in which it may lie instead.
    pub ambiguous_with: Vec<&'static str>,
    /// What is irregular, in words with its size; left out if nothing is.
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
    /// Root mean square.
    pub rms: Real,
    /// Unit of it.
    pub unit: &'static str,
    /// Observations.
    pub samples: usize,
    /// Whether it is beyond chance.
    pub significant: bool,
}

/// Which effects.
#[derive(Clone, Debug, Serialize)]
pub struct Which {
    /// The effects added, most important first.
    pub effects: Vec<Effect>,
    /// Effects that would account for the innovations and lead a free replay further off: they are not named.
    pub taken_back: Option<TakenBack>,
    /// Every candidate.
    pub ranked: Vec<Ranked>,
    /// What the recordings cannot show.
    pub not_assessable: Vec<NotAssessable>,
    /// Where the tolerances ended, in standard deviations.
    pub tolerances: BTreeMap<String, Real>,
    /// The most probable explanations.
    pub explanations: Vec<Weighed>,
    /// Probability that none of the explanations compared holds: those that are probable strain the tolerances of the vehicle file.
    pub beyond: Real,
    /// Strongest correlations of an effect's parameter with another unknown.
    pub correlations: Vec<Correlation>,
}

/// Effects that were taken back, and why.
#[derive(Clone, Debug, Serialize)]
pub struct TakenBack {
    /// Ids.
    pub effects: Vec<&'static str>,
    /// Mean gap of both speeds in free replays of the recordings of the fit, rad/s: of the file's car.
    pub before: Real,
    /// The same with the effects.
    pub after: Real,
}

/// Posterior correlation of two unknowns.
#[derive(Clone, Debug, Serialize)]
pub struct Correlation {
    /// A parameter of a named effect.
    pub parameter: &'static str,
    /// Another one, or a number of the vehicle file.
    pub with: String,
    /// Coefficient.
    pub coefficient: Real,
}

/// An effect that was named.
#[derive(Clone, Debug, Serialize)]
pub struct Effect {
    /// Id.
    pub id: &'static str,
    /// Posterior probability that it is there.
    pub probability: Real,
    /// Effects that may be there in its place.
    pub ambiguous_with: Vec<&'static str>,
    /// What would tell them apart.
    pub separated_by: String,
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

/// A candidate.
#[derive(Clone, Debug, Serialize)]
pub struct Ranked {
    /// Id.
    pub id: &'static str,
    /// Logarithm of the posterior odds that it is there, nats: the best explanation with it over the best without it.
    pub evidence: Real,
    /// What became of it.
    pub verdict: &'static str,
    /// Why.
    pub reason: String,
    /// The smallest size that these recordings would show.
    pub smallest_visible: Option<Visible>,
}

/// The smallest size of an effect that recordings would show.
#[derive(Clone, Debug, Serialize)]
pub struct Visible {
    /// Parameter.
    pub parameter: &'static str,
    /// Departure from its null value.
    pub size: Real,
    /// The same of a usual fault.
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
    /// Nats behind the best.
    pub behind: Real,
}

/// How far the gap shrinks.
#[derive(Clone, Debug, Serialize)]
pub struct HowFar {
    /// What is counted.
    pub metric: &'static str,
    /// Before.
    pub before: Real,
    /// After.
    pub after: Real,
    /// What the true car would be expected to leave.
    pub noise_floor: Real,
    /// Share of what stood above the floor that is gone.
    pub closed_fraction: Real,
    /// What took no part.
    pub held_out: Vec<String>,
    /// By recording and channel.
    pub per_recording: Vec<PerRecording>,
    /// Engagement figures.
    pub kpi: BTreeMap<String, BTreeMap<&'static str, Figures>>,
    /// What a law that was learned closes beside all that, which the numbers above leave out; none where nothing is left without a cause or no law acts there.
    pub empirical: Option<Empirical>,
}

/// Laws that were learned together: no cause, and no part of the verdict.
#[derive(Clone, Debug, Serialize)]
pub struct Empirical {
    /// Subsystems in which something is missing.
    pub places: Vec<&'static str>,
    /// Subsystems of the laws, the first one added first.
    pub laws: Vec<&'static str>,
    /// Whether the retuned plant holds it.
    pub taken: bool,
    /// Why, or why not.
    pub reason: String,
    /// Gap of what was held out without the law.
    pub without: Real,
    /// The same with it.
    pub after: Real,
    /// Share of what the nominal car leaves above the floor that is gone with it.
    pub closed_fraction: Real,
    /// Share of what is left without it that it closes on the other recordings, each by a law that was learned from the rest.
    pub left_out_fraction: Real,
    /// Gap of what was held out by channel, with the law.
    pub per_recording: Vec<PerRecording>,
    /// Its curves.
    pub curves: Vec<EmpiricalCurve>,
}

/// A curve of it.
#[derive(Clone, Debug, Serialize)]
pub struct EmpiricalCurve {
    /// Name: that of the FMU's variables without `effect.empirical.` and their number.
    pub id: &'static str,
    /// What it is over, with the unit.
    pub over: &'static str,
    /// Unit of its values.
    pub unit: &'static str,
    /// Breakpoints.
    pub breakpoints: &'static [f64],
    /// Values there.
    pub values: Vec<Real>,
    /// Their standard deviations.
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
    /// Before.
    pub before: Real,
    /// After.
    pub after: Real,
    /// Noise.
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
