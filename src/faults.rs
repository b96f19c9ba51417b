//! Timed faults: parameters of effects that change at given times, with ramps. The plant's FMU and the launch apply them.
//!
//! ```json
//! [{"parameter": "effect.friction_level.factor", "time_s": 0.6, "ramp_s": 0.2, "value": 0.7}]
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `time_s` | onset, counted from the start of the simulation | s |
//! | `ramp_s` | time over which the parameter moves linearly from the value that it has at the onset to `value`; 0 or absent: a jump | s |
//! | `value` | final value, held until a later fault of the same parameter | that of the parameter |
//!
//! While a ramp runs, the plant updates the value every millisecond, counted from the onset, whatever the communication step.

use crate::effects::{PARAMETERS, Parameters};
use serde_json::Value;

/// Time between two values of a ramp, s.
const RASTER: f64 = 1e-3;

/// One change of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Index of the parameter in [`PARAMETERS`].
    pub parameter: usize,
    /// Onset, s.
    pub time: f64,
    /// Length of the ramp, s.
    pub ramp: f64,
    /// Value at its end.
    pub value: f64,
}

/// Faults in the order of their onsets.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Faults(Vec<Fault>);

/// What is wrong with a list of faults.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FaultError {
    /// Not a list of objects.
    #[error("faults are not a list of objects with parameter, time_s, ramp_s and value")]
    Shape,
    /// A key that no fault has.
    #[error("fault {0}: \"{1}\" is unknown; a fault has parameter, time_s, ramp_s and value")]
    Key(usize, String),
    /// No such parameter.
    #[error("fault {0}: {1} is no parameter of an effect; `effect.<id>.<parameter>` is expected, see docs/effects.md")]
    Parameter(usize, String),
    /// A number that is missing or out of its bounds.
    #[error("fault {0}: {1} is missing, or not between {2:?} and {3:?}")]
    Number(usize, &'static str, f64, f64),
    /// A fault begins while an earlier ramp of the same parameter is still running, or jumps at the instant at which another one begins.
    #[error(
        "fault {0} of {1} begins while an earlier one still moves, or jumps where an earlier one begins; let it begin later, when that has ended"
    )]
    Overlap(usize, &'static str),
}

impl Faults {
    /// Reads the `faults` of a document. If they are absent (null), there are none.
    ///
    /// # Errors
    /// The first invalid fault, or the first one that begins while an earlier ramp of its parameter is still running.
    pub fn from_value(document: &Value) -> Result<Self, FaultError> {
        let list = match document {
            Value::Null => return Ok(Self::default()),
            Value::Array(list) => list,
            _ => return Err(FaultError::Shape),
        };
        let numbered = |(k, entry): (usize, &Value)| Ok((k + 1, fault(k + 1, entry)?));
        let mut faults = list.iter().enumerate().map(numbered).collect::<Result<Vec<_>, _>>()?;
        faults.sort_by(|a, b| a.1.time.total_cmp(&b.1.time));
        for (k, (number, late)) in faults.iter().enumerate() {
            let undone = |early: &Fault| early.time == late.time && late.ramp == 0.0;
            let moves = |early: &Fault| early.time + early.ramp > late.time;
            if faults[..k].iter().any(|(_, early)| early.parameter == late.parameter && (moves(early) || undone(early))) {
                return Err(FaultError::Overlap(*number, PARAMETERS[late.parameter].variable));
            }
        }
        Ok(Self(faults.into_iter().map(|(_, fault)| fault).collect()))
    }

    /// The list in the form that [`Faults::from_value`] reads.
    pub fn to_value(&self) -> Value {
        let entry = |f: &Fault| serde_json::json!({"parameter": PARAMETERS[f.parameter].variable, "time_s": f.time, "ramp_s": f.ramp, "value": f.value});
        Value::Array(self.0.iter().map(entry).collect())
    }

    /// Whether there are none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The faults, in the order of their onsets.
    pub fn iter(&self) -> impl Iterator<Item = &Fault> {
        self.0.iter()
    }

    /// All numbers of the faults (parameter index, onset, ramp, value), for comparing two lists.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        self.0.iter().flat_map(|f| [f.parameter as f64, f.time, f.ramp, f.value])
    }

    /// Parameters at `time`: those of `start`, changed by the faults that have begun by then.
    pub fn at(&self, time: f64, start: &Parameters) -> Parameters {
        let mut now = *start;
        for f in self.0.iter().filter(|f| f.time <= time) {
            let share = if time >= f.time + f.ramp { 1.0 } else { (rasters(time - f.time) * RASTER / f.ramp).min(1.0) };
            now[f.parameter] += (f.value - now[f.parameter]) * share;
        }
        now
    }

    /// The first time after `time` at which a value changes; infinite if none does.
    pub fn next_change(&self, time: f64) -> f64 {
        let next = |f: &Fault| match f {
            f if time < f.time => f.time,
            f if time < f.time + f.ramp => {
                // The next point of the raster; the last one is the ramp's end.
                (f.time + (rasters(time - f.time) + 1.0) * RASTER).min(f.time + f.ramp)
            }
            _ => f64::INFINITY,
        };
        self.0.iter().map(next).filter(|next| *next > time).fold(f64::INFINITY, f64::min)
    }
}

/// Number of whole raster intervals in `elapsed` seconds. A time that falls short of the next interval by a rounding error counts as having reached it.
fn rasters(elapsed: f64) -> f64 {
    const ROUNDING: f64 = 1e-6;
    (elapsed / RASTER + ROUNDING).floor()
}

fn fault(k: usize, entry: &Value) -> Result<Fault, FaultError> {
    let object = entry.as_object().ok_or(FaultError::Shape)?;
    if let Some(key) = object.keys().find(|key| !matches!(key.as_str(), "parameter" | "time_s" | "ramp_s" | "value")) {
        return Err(FaultError::Key(k, key.clone()));
    }
    let name = object.get("parameter").and_then(Value::as_str).unwrap_or("");
    let parameter = PARAMETERS.iter().position(|p| p.variable == name).ok_or_else(|| FaultError::Parameter(k, name.to_owned()))?;
    let number = |key: &'static str, least: f64, most: f64, absent: Option<f64>| {
        let value = object.get(key).map_or(absent, Value::as_f64);
        value.filter(|x| *x >= least && *x <= most).ok_or(FaultError::Number(k, key, least, most))
    };
    let p = &PARAMETERS[parameter];
    Ok(Fault {
        parameter,
        time: number("time_s", 0.0, 1e9, None)?,
        ramp: number("ramp_s", 0.0, 1e6, Some(0.0))?,
        value: number("value", p.min, p.max, None)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{null, param};
    use serde_json::json;

    fn read(list: Value) -> Result<Faults, FaultError> {
        Faults::from_value(&list)
    }

    #[test]
    fn a_ramp_moves_from_what_was_and_stays() {
        let faults = read(json!([
            {"parameter": "effect.friction_level.factor", "time_s": 2.0, "value": 1.0},
            {"parameter": "effect.friction_level.factor", "time_s": 0.5, "ramp_s": 1.0, "value": 0.6}
        ]))
        .unwrap();
        let factor = |t| faults.at(t, &null())[param::friction_level::factor];
        assert_eq!((factor(0.4), factor(1.0), factor(1.5), factor(1.9), factor(2.0)), (1.0, 0.8, 0.6, 0.6, 1.0));
        assert_eq!((faults.next_change(0.0), faults.next_change(1.7), faults.next_change(2.0)), (0.5, 2.0, f64::INFINITY));
        assert!((faults.next_change(0.5) - 0.501).abs() < 1e-15);
        assert_eq!(Faults::from_value(&faults.to_value()), Ok(faults));
    }

    #[test]
    fn every_change_is_later_and_the_ramp_ends_in_time() {
        let faults = read(json!([{"parameter": "effect.friction_level.factor", "time_s": 0.3, "ramp_s": 0.0995, "value": 0.6}])).unwrap();
        let (mut time, mut count) = (0.0, 0);
        while faults.next_change(time) < f64::INFINITY {
            let next = faults.next_change(time);
            assert!(next > time);
            (time, count) = (next, count + 1);
        }
        assert_eq!((time, count), (0.3 + 0.0995, 101));
    }

    #[test]
    fn what_is_unsound_is_named() {
        let said = |list| read(list).unwrap_err().to_string();
        assert!(said(json!({})).contains("not a list"));
        assert!(said(json!([{"parameter": "effect.nothing.at_all", "time_s": 0.0, "value": 1.0}])).contains("effect.nothing.at_all"));
        assert!(said(json!([{"parameter": "effect.friction_level.factor", "time_s": 0.0, "value": 99.0}])).contains("value"));
        assert!(said(json!([{"parameter": "effect.friction_level.factor", "value": 1.0}])).contains("time_s"));
        assert!(said(json!([{"parameter": "effect.friction_level.factor", "time": 0.0, "value": 1.0}])).contains("\"time\""));
        let ramp = json!({"parameter": "effect.friction_level.factor", "time_s": 0.0, "ramp_s": 1.0, "value": 1.0});
        let late = json!({"parameter": "effect.friction_level.factor", "time_s": 0.9, "value": 1.0});
        // Faults are numbered in the order of the file, not in that of their onsets.
        assert!(said(json!([late, ramp])).starts_with("fault 1 of effect.friction_level.factor begins while an earlier one still moves"));
        // Of two jumps at one instant the first would do nothing; a ramp may begin where another fault has jumped.
        let jump = json!({"parameter": "effect.friction_level.factor", "time_s": 7.0, "ramp_s": 0.0, "value": 1.4});
        assert!(said(json!([jump, jump])).starts_with("fault 2 of effect.friction_level.factor begins while an earlier one"));
        let ramp_there = json!({"parameter": "effect.friction_level.factor", "time_s": 7.0, "ramp_s": 1.0, "value": 1.1});
        assert_eq!(Faults::from_value(&json!([jump, ramp_there])).unwrap().iter().count(), 2);
    }
}
