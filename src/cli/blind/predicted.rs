//! Check of the predicted standard deviation of the clutch torque on recordings that the diagnosis never saw.
//!
//! The true car is driven by the torque and the position command of each recording. Wherever its clutch slips, its torque is compared with that of the retuned plant at the
//! same slip, temperature and bearing position, in units of the predicted standard deviation. Samples inside the domain that the campaign covered and samples outside are
//! counted separately.

use super::closed;
use crate::plant::clutch::{self, Branch, FaceCache};
use crate::plant::config::Config;
use crate::plant::motion::{Motion, index};
use crate::validated::{Place, Validated};
use crate::vehicle::Vehicle;
use realcar::{Real, Recording};
use serde_json::{Value, json};

/// Slip below which the clutch may be locked, rad/s.
const LEAST_SLIP: f64 = 2.0;
/// Torque below which the clutch is practically open, N·m.
const LEAST_TORQUE: f64 = 2.0;
/// Half width of the band, in standard deviations.
pub const BAND: f64 = 2.0;

/// Errors of the torque and their predicted variances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Number of samples.
    pub count: usize,
    /// Number of samples within the band.
    pub within: usize,
    /// Sum of squared errors, (N·m)².
    pub squares: f64,
    /// Sum of predicted variances, (N·m)².
    pub variances: f64,
}

impl Errors {
    fn add(&mut self, error: f64, sigma: f64) {
        self.count += 1;
        self.within += usize::from(error.abs() <= BAND * sigma);
        self.squares += error * error;
        self.variances += sigma * sigma;
    }

    /// Root mean square error over root mean square prediction.
    pub fn ratio(&self) -> f64 {
        (self.squares / self.variances).sqrt()
    }
}

/// Errors of one recording inside and outside the domain that the campaign covered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Predicted {
    /// Where the validity is 1.
    pub inside: Errors,
    /// Where the validity is below one half.
    pub outside: Errors,
}

/// Sums over all recordings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Errors inside and outside the domain.
    pub all: Predicted,
    /// Number of recordings with samples inside, and number of those whose ratio of root mean square error to root mean square prediction is within the band.
    pub recordings: [usize; 2],
}

impl Summary {
    /// Sums over these recordings.
    pub fn of<'a>(recordings: impl Iterator<Item = &'a Predicted>) -> Self {
        let mut sum = Self::default();
        for p in recordings {
            for (all, one) in [(&mut sum.all.inside, &p.inside), (&mut sum.all.outside, &p.outside)] {
                all.count += one.count;
                all.within += one.within;
                all.squares += one.squares;
                all.variances += one.variances;
            }
            if p.inside.count > 0 {
                sum.recordings[0] += 1;
                sum.recordings[1] += usize::from(p.inside.ratio() <= BAND);
            }
        }
        sum
    }

    /// The summary as JSON.
    pub fn as_json(&self) -> Value {
        let part = |e: &Errors| {
            let rms = |sum: f64| (e.count > 0).then(|| (sum / e.count as f64).sqrt());
            json!({"samples": e.count, "within_2_sigma": e.within, "rms_error_Nm": rms(e.squares), "rms_sigma_Nm": rms(e.variances)})
        };
        let [recordings, within] = self.recordings;
        json!({"inside": part(&self.all.inside), "outside": part(&self.all.outside), "recordings": recordings, "recordings_within_2_sigma": within})
    }

    /// The summary as text; empty if no recording has samples inside.
    pub fn as_text(&self) -> String {
        let part = |e: &Errors| {
            if e.count == 0 {
                return "no samples".to_owned();
            }
            let n = e.count as f64;
            let (share, error, sigma) = (100.0 * e.within as f64 / n, (e.squares / n).sqrt(), (e.variances / n).sqrt());
            format!("{share:.1} % of {} samples within 2 σ, error {error:.2} N·m, σ {sigma:.2} N·m", e.count)
        };
        let [recordings, within] = self.recordings;
        if recordings == 0 {
            return String::new();
        }
        format!(
            "clutch torque of unseen recordings where the plant says it is valid: {}; {within} of {recordings} whole recordings\n  outside: {}\n",
            part(&self.all.inside),
            part(&self.all.outside)
        )
    }
}

/// The validated domain of an answer, from its field `domain`; `None` if it is missing or malformed.
pub fn validated(domain: &Value) -> Option<Validated> {
    let table = domain["torque_sigma"]["sigma_Nm"].as_array()?;
    let sigma: Vec<&Value> = table.iter().flat_map(|t| t.as_array()).flatten().flat_map(|t| t.as_array()).flatten().collect();
    Validated::from_value(&json!({"places": domain["places"], "sigma_Nm": sigma})).ok()?
}

/// Errors for each of these recordings; empty without an answer.
pub fn on(unseen: &[Recording], vehicle_json: &str, answer: &Value, real: &Real) -> Vec<Predicted> {
    let retuned = || closed::retuned(&Vehicle::from_json(vehicle_json).ok()?, &answer["plant"]["parameters"]);
    let Some(((vehicle, effects), known)) = retuned().zip(validated(&answer["domain"])) else { return Vec::new() };
    let config = Config::new(&vehicle, &effects);
    unseen.iter().enumerate().map(|(number, r)| of(r, real.at_start_of(r, number as u64), &config, &known)).collect()
}

fn of(r: &Recording, mut car: realcar::Motion, config: &Config, known: &Validated) -> Predicted {
    let mut found = Predicted::default();
    let (mut memory, mut y, mut near) = (Branch { x: car.x, z: 0.0 }, Motion::default(), 0);
    for k in 1..r.time_s.len() {
        let h = r.time_s[k] - r.time_s[k - 1];
        car.drive(h, r.t_e_nm[k - 1], r.x_to_cmd_mm[k - 1]);
        let slip = car.omega_f - car.omega_d;
        memory = clutch::advance_branch(config, memory, car.x);
        y[index::THETA_C] = car.theta[0];
        y[index::ANGLE] += slip * h;
        y[index::E_D] += car.t_fc * slip * h;
        let torque = clutch::slipping(config, &FaceCache::EMPTY, car.x, memory, slip.signum(), slip, &y).total();
        if slip.abs() < LEAST_SLIP || torque.abs().max(car.t_fc.abs()) < LEAST_TORQUE {
            continue;
        }
        let place = Place { slip, theta: car.theta[0], closing: clutch::closing(config, car.x, car.theta[0]), torque };
        let validity = known.validity(&place, &mut near);
        let (error, sigma) = (car.t_fc - torque, known.sigma(&place));
        if validity >= 1.0 {
            found.inside.add(error, sigma);
        } else if validity < 0.5 {
            found.outside.add(error, sigma);
        }
    }
    found
}
