//! The vehicle: the numbers of `vehicle.json`, read, checked and written.
//!
//! Units are those of the model description, which names every number once: `driveline.J_f`, `friction.m_0`, …
//! In the file, polynomials are arrays: `friction.mu_d` holds m_0, m_1, m_2, `cushion_spring.beta` β_1..β_3, and
//! `actuator.x_cnt`, `actuator.x_cls` up to three coefficients each.

use crate::json::{self, Fault};
use crate::physics::cushion::CushionSpring;
use crate::physics::driveline::Driveline;
use crate::physics::friction::Friction;
use crate::physics::map::Actuator;
use crate::physics::thermal::Thermal;
use serde_json::Value;

/// All numbers of one vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Vehicle {
    /// Friction function and facings.
    pub friction: Friction,
    /// Kiss point and closed point.
    pub actuator: Actuator,
    /// Cushion spring.
    pub cushion_spring: CushionSpring,
    /// Thermal model.
    pub thermal: Thermal,
    /// Driveline.
    pub driveline: Driveline,
}

/// One number of a `T`, such as a vehicle: its entry in the model description, and access to it.
pub struct Number<T> {
    /// Flat name, as the FMU has it.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Meaning in words.
    pub meaning: &'static str,
    /// Default value; for a vehicle, that of the paper's car.
    pub default: f64,
    /// Least value accepted.
    pub min: f64,
    /// Greatest value accepted.
    pub max: f64,
    /// Value reference in the FMU.
    pub value_reference: u32,
    /// Reads the number.
    pub get: fn(&T) -> f64,
    /// Mutable access to the number.
    pub get_mut: fn(&mut T) -> &mut f64,
}

/// A `T` whose numbers all have their defaults.
pub fn defaults<T: Default>(numbers: &[Number<T>]) -> T {
    let mut all = T::default();
    for number in numbers {
        *(number.get_mut)(&mut all) = number.default;
    }
    all
}

include!(concat!(env!("OUT_DIR"), "/vehicle.rs"));

/// What is wrong with a vehicle file.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum VehicleError {
    /// The text is not JSON.
    #[error("{0}; correct the JSON there")]
    Json(Fault),
    /// A number is missing.
    #[error("vehicle number \"{}\" is missing; add it (unit {})", .0, if *.1 == "1" { "1".to_owned() } else { written(.1) })]
    Missing(String, &'static str),
    /// A number has the wrong JSON type.
    #[error("vehicle number \"{}\" is {}, not a number; {}", .0, .1, if .1.is_string() { "write it without quotes" } else { "give one number" })]
    NotANumber(String, Value),
    /// A list has the wrong JSON type.
    #[error("vehicle number \"{}\" is {}, not a list; write its coefficients in brackets, e.g. [{}]", .0, .1, if .1.is_number() { .1.to_string() } else { "4.02".to_owned() })]
    NotAList(String, Value),
    /// An array has the wrong length.
    #[error("vehicle number \"{name}\" has {found} coefficients; {} expected", count(*.least, *.most))]
    Length {
        /// Path in the file.
        name: String,
        /// Coefficients found.
        found: usize,
        /// Least number of coefficients.
        least: usize,
        /// Greatest number of coefficients.
        most: usize,
    },
    /// A name that no vehicle has.
    #[error("unknown vehicle number \"{}\"{}. Remove it or correct its name", .0, meant(.1))]
    Unknown(String, String),
    /// A number is outside its bounds.
    #[error("vehicle number \"{name}\" = {} is outside {min} to {max}; check its unit", quantity(*.value, .unit))]
    Bounds {
        /// Flat name.
        name: String,
        /// Value found.
        value: f64,
        /// Unit.
        unit: &'static str,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// Numbers contradict each other.
    #[error("{0}")]
    Implausible(String),
}

/// A unit as it is usually written, such as N·m or °C, from that of the model description, which has ASCII characters only. Empty for the unit 1.
pub fn written(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        "degC" => "°C".to_owned(),
        other => {
            other.replace("N.m", "N·m").replace(".s/rad", "·s/rad").replace("kg.m2", "kg·m²").replace("/s2", "/s²").replace("/K2", "/K²")
        }
    }
}

/// The permitted number of coefficients, as the subject of a sentence: "3 are", "1 to 3 are".
fn count(least: usize, most: usize) -> String {
    if least == most { format!("{most} are") } else { format!("{least} to {most} are") }
}

/// The question whether the nearest known name was meant; empty if no name is near.
fn meant(nearest: &str) -> String {
    if nearest.is_empty() { String::new() } else { format!("; did you mean \"{nearest}\"?") }
}

/// A number with its unit, if it has one.
fn quantity(value: f64, unit: &str) -> String {
    format!("{value} {}", written(unit)).trim_end().to_owned()
}

/// Arrays of the file: group, key, flat names of the coefficients, least number of coefficients.
const ARRAYS: [(&str, &str, [&str; 3], usize); 4] = [
    ("friction", "mu_d", ["m_0", "m_1", "m_2"], 3),
    ("actuator", "x_cnt", ["x_cnt_0", "x_cnt_1", "x_cnt_2"], 1),
    ("actuator", "x_cls", ["x_cls_0", "x_cls_1", "x_cls_2"], 1),
    ("cushion_spring", "beta", ["beta_1", "beta_2", "beta_3"], 3),
];

impl Vehicle {
    /// The paper's car; misprints of the paper are read as described in `docs/model.md`.
    pub fn paper() -> Self {
        defaults(&NUMBERS)
    }

    /// Reads and checks the text of a `vehicle.json`.
    ///
    /// # Errors
    /// The text is not JSON; or the first number that is missing, misnamed, not a number, out of bounds or in contradiction with another one.
    pub fn from_json(text: &str) -> Result<Self, VehicleError> {
        Self::from_value(&json::parse(text).map_err(VehicleError::Json)?)
    }

    /// As [`Vehicle::from_json`], for a parsed document. `tolerance`, `effects`, `faults`, `validated` and keys that begin with `_` or `$` are not read here.
    ///
    /// # Errors
    /// As [`Vehicle::from_json`].
    pub fn from_value(value: &Value) -> Result<Self, VehicleError> {
        let (mut vehicle, mut given) = (Self::paper(), [false; NUMBERS.len()]);
        let root = value.as_object().ok_or_else(|| {
            implausible(
                "the document is not an object; write one with the groups friction, actuator, cushion_spring, thermal and driveline".into(),
            )
        })?;
        for (group, content) in root
            .iter()
            .filter(|(k, _)| !matches!(k.as_str(), "tolerance" | "effects" | "faults" | "validated") && !k.starts_with(['_', '$']))
        {
            let content = content.as_object().ok_or_else(|| VehicleError::Unknown(group.clone(), nearest(group)))?;
            for (key, value) in content.iter().filter(|(k, _)| !k.starts_with(['_', '$'])) {
                set_from_file(&mut vehicle, &mut given, group, key, value)?;
            }
        }
        if let Some(missing) = given.iter().position(|given| !given) {
            let number = &NUMBERS[missing];
            let (group, key) = number.name.split_once('.').unwrap_or((number.name, ""));
            let key = ARRAYS.iter().find(|a| a.0 == group && a.2.contains(&key)).map_or(key, |a| a.1);
            return Err(VehicleError::Missing(format!("{group}.{key}"), number.unit));
        }
        vehicle.check()?;
        Ok(vehicle)
    }

    /// The document of a `vehicle.json`, without tolerances.
    pub fn to_value(&self) -> Value {
        let mut root = serde_json::Map::new();
        for number in &NUMBERS {
            let (group, key) = number.name.split_once('.').unwrap_or((number.name, ""));
            let slot = root.entry(group).or_insert_with(|| Value::Object(serde_json::Map::new()));
            let value = Value::from((number.get)(self));
            match ARRAYS.iter().find(|a| a.0 == group && a.2.contains(&key)) {
                None => slot[key] = value,
                Some(array) => match &mut slot[array.1] {
                    Value::Array(list) => list.push(value),
                    empty => *empty = Value::Array(vec![value]),
                },
            }
        }
        Value::Object(root)
    }

    /// Checks the bounds of every number and the relations that must hold between numbers.
    ///
    /// # Errors
    /// The first number out of bounds, or a contradiction: an inner radius of the facings that is not less than the outer one, a kiss point that is not below the closed point at
    /// 25 °C, a closed point that is not positive (learned laws of the actuator take shares of it), or a cushion spring without force at the closed point.
    /// `kisspoint vehicle check` also reports doubtful numbers that can be simulated.
    pub fn check(&self) -> Result<(), VehicleError> {
        for number in &NUMBERS {
            let value = (number.get)(self);
            if !(value >= number.min && value <= number.max) {
                let (name, unit) = (number.name.to_owned(), number.unit);
                return Err(VehicleError::Bounds { name, value, unit, min: number.min, max: number.max });
            }
        }
        let f = &self.friction;
        if f.R_1 >= f.R_2 {
            return Err(implausible(format!("friction.R_1 = {} m is not less than friction.R_2 = {} m", f.R_1, f.R_2)));
        }
        let a = &self.actuator;
        if a.x_cnt_0 >= a.x_cls_0 {
            return Err(implausible(format!(
                "actuator.x_cnt = {} mm is not below actuator.x_cls = {} mm; larger is more closed",
                a.x_cnt_0, a.x_cls_0
            )));
        }
        if a.x_cls_0 <= 0.0 {
            return Err(implausible(format!(
                "actuator.x_cls = {} mm is not positive; positions count from an open clutch, so add the same to x_cnt, x_cls and x_to",
                a.x_cls_0
            )));
        }
        let spring = &self.cushion_spring;
        if spring.beta_1 + spring.beta_2 + spring.beta_3 <= 0.0 {
            return Err(implausible("cushion_spring.beta gives no force at the closed point (their sum is not positive)".into()));
        }
        Ok(())
    }
}

fn implausible(what: String) -> VehicleError {
    VehicleError::Implausible(what)
}

/// Index of `group.key` in [`NUMBERS`].
fn place(group: &str, key: &str) -> Option<usize> {
    let is = |name: &str| {
        name.len() == group.len() + 1 + key.len()
            && name.ends_with(key)
            && name.strip_prefix(group).is_some_and(|rest| rest.starts_with('.'))
    };
    NUMBERS.iter().position(|n| is(n.name))
}

/// Sets the number, or the coefficients, that the file has at `group.key`, and marks them as given.
fn set_from_file(vehicle: &mut Vehicle, given: &mut [bool], group: &str, key: &str, value: &Value) -> Result<(), VehicleError> {
    let path = || format!("{group}.{key}");
    let not_a_number = |value: &Value, path: String| VehicleError::NotANumber(path, value.clone());
    let mut set = |place: usize, number: f64| {
        *(NUMBERS[place].get_mut)(vehicle) = number;
        given[place] = true;
    };
    let Some(array) = ARRAYS.iter().find(|a| a.0 == group && a.1 == key) else {
        let in_array = ARRAYS.iter().any(|a| a.0 == group && a.2.contains(&key));
        let place = place(group, key).filter(|_| !in_array).ok_or_else(|| VehicleError::Unknown(path(), nearest(&path())))?;
        set(place, value.as_f64().ok_or_else(|| not_a_number(value, path()))?);
        return Ok(());
    };
    let list = value.as_array().ok_or_else(|| VehicleError::NotAList(path(), value.clone()))?;
    if list.len() < array.3 || list.len() > 3 {
        return Err(VehicleError::Length { name: path(), found: list.len(), least: array.3, most: 3 });
    }
    for (k, name) in array.2.iter().enumerate() {
        let number = list.get(k).map_or(Some(0.0), Value::as_f64).ok_or_else(|| not_a_number(&list[k], format!("{}[{k}]", path())))?;
        set(place(group, name).expect("ARRAYS name numbers of the model description"), number);
    }
    Ok(())
}

/// The known path, or group, that is nearest to `path` in edit distance. Empty if more than a third of the letters differ in the group or in the key, unless the same key exists in
/// another group.
fn nearest(path: &str) -> String {
    let in_file = |n: &'static str| {
        let (group, key) = n.split_once('.').unwrap_or((n, ""));
        let array = ARRAYS.iter().find(|a| a.0 == group && a.2.contains(&key));
        (group, array.map_or(key, |a| a.1))
    };
    let (group, key) = path.split_once('.').unwrap_or((path, ""));
    let near = |(known_group, known_key): &(&str, &str)| {
        let (groups, keys) = (distance(group, known_group), if key.is_empty() { 0 } else { distance(key, known_key) });
        let is_near = keys <= key.len().div_ceil(3) && groups <= group.len().div_ceil(3);
        // A number may have been written into the wrong group.
        let is_elsewhere = keys == 0 && !key.is_empty();
        (is_near || is_elsewhere).then_some(keys + groups)
    };
    let all = NUMBERS.iter().map(|n| in_file(n.name)).filter_map(|known| Some((near(&known)?, known)));
    match all.min_by_key(|(far, _)| *far) {
        None => String::new(),
        Some((_, (group, _))) if key.is_empty() => group.to_owned(),
        Some((_, (group, key))) => format!("{group}.{key}"),
    }
}

/// Levenshtein distance between two words: the number of bytes to insert, delete or replace.
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.bytes().enumerate() {
            let here = (diagonal + usize::from(x != y)).min(row[j] + 1).min(row[j + 1] + 1);
            diagonal = std::mem::replace(&mut row[j + 1], here);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_survives_its_own_file() {
        let mut vehicle = Vehicle::paper();
        vehicle.actuator.x_cnt_1 = 1e-3;
        assert_eq!(Vehicle::from_value(&vehicle.to_value()), Ok(vehicle));
    }

    #[test]
    fn errors_name_number_and_remedy() {
        let mut value = Vehicle::paper().to_value();
        value["driveline"]["J_ff"] = 0.2.into();
        assert_eq!(Vehicle::from_value(&value), Err(VehicleError::Unknown("driveline.J_ff".into(), "driveline.J_f".into())));
        for (path, meant) in [
            ("driveline.J_x", "driveline.J_f"),
            ("drivelin", "driveline"),
            ("drivline.J_c", "driveline.J_c"),
            ("driveline.x_cnt", "actuator.x_cnt"),
            ("driveline.colour", ""),
            ("paint", ""),
        ] {
            assert_eq!(nearest(path), meant, "{path}");
        }
        for (key, wrong, said) in [
            ("x_cnt", serde_json::json!(4.02), "is 4.02, not a list; write its coefficients in brackets, e.g. [4.02]"),
            ("x_cnt", serde_json::json!(["4.02"]), "x_cnt[0]\" is \"4.02\", not a number; write it without quotes"),
            ("x_cnt", serde_json::json!([null]), "is null, not a number; give one number"),
            ("x_cnt", serde_json::json!([]), "has 0 coefficients; 1 to 3 are expected"),
        ] {
            let mut value = Vehicle::paper().to_value();
            value["actuator"][key] = wrong;
            let message = Vehicle::from_value(&value).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
        assert_eq!(Vehicle::from_json("").unwrap_err().to_string(), "line 1, column 1: the file is empty; correct the JSON there");
        let mut value = Vehicle::paper().to_value();
        value["driveline"].as_object_mut().unwrap().remove("J_c");
        assert_eq!(Vehicle::from_value(&value), Err(VehicleError::Missing("driveline.J_c".into(), "kg.m2")));
        let mut value = Vehicle::paper().to_value();
        value["actuator"]["x_cnt"] = serde_json::json!([9.0]);
        assert!(Vehicle::from_value(&value).unwrap_err().to_string().contains("actuator.x_cnt = 9"));
        for closed in [0.0, -1.0] {
            let mut value = Vehicle::paper().to_value();
            (value["actuator"]["x_cnt"], value["actuator"]["x_cls"]) = (serde_json::json!([-5.0]), serde_json::json!([closed]));
            let message = Vehicle::from_value(&value).unwrap_err().to_string();
            assert!(message.starts_with(&format!("actuator.x_cls = {closed} mm is not positive")), "{message}");
        }
        let mut value = Vehicle::paper().to_value();
        value["thermal"]["gamma_3"] = 50.into();
        assert!(Vehicle::from_value(&value).unwrap_err().to_string().contains("gamma_3\" = 50 is outside 0 to 1"));
    }
}
