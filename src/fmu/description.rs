//! The model description: from its source to the one in an FMU.

use super::Model;
use crate::effects::{PARAMETERS, Parameters};
use crate::fmi2::model::GUID_OF_INTERFACE;
use crate::vehicle::{NUMBERS, Vehicle};
use sha2::{Digest, Sha256};

/// The text with GUID and version filled in, and the vehicle's numbers as start values.
pub fn complete(model: &Model, vehicle: &Vehicle, effects: &Parameters) -> String {
    let filled = model.xml.replace("@VERSION@", env!("CARGO_PKG_VERSION"));
    let mut text: String = filled.lines().map(|line| with_start(line, vehicle, effects) + "\n").collect();
    text.truncate(text.trim_end().len());
    text.replace("@GUID@", &guid(model, &text)) + "\n"
}

/// The GUID of an FMU with this text: the interface's, and in its last twelve digits a hash of all start values.
fn guid(model: &Model, text: &str) -> String {
    let digest = Sha256::digest(text.as_bytes());
    let tail: String = digest.iter().take(6).map(|byte| format!("{byte:02x}")).collect();
    format!("{}{tail}", &model.description.guid[..GUID_OF_INTERFACE])
}

/// The line of a vehicle's number or of an effect's parameter with its start value; any other line as it is.
fn with_start(line: &str, vehicle: &Vehicle, effects: &Parameters) -> String {
    let value = |name: &str| {
        let number = NUMBERS.iter().find(|n| n.name == name).map(|n| (n.get)(vehicle));
        number.or_else(|| PARAMETERS.iter().position(|p| p.variable == name).map(|k| effects[k]))
    };
    let value = attribute(line, "name").filter(|_| line.contains("<ScalarVariable")).and_then(value);
    match (value, attribute(line, "start")) {
        (Some(value), Some(old)) => line.replace(&format!(" start=\"{old}\""), &format!(" start=\"{value:?}\"")),
        _ => line.to_owned(),
    }
}

/// Value of an attribute in a line of XML.
pub fn attribute<'a>(line: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = line.split_once(&format!(" {name}=\""))?;
    rest.split_once('"').map(|(value, _)| value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fmu::MODELS;

    #[test]
    fn start_values_are_the_vehicles() {
        let mut vehicle = Vehicle::paper();
        vehicle.friction.m_2 = -1.25e-7;
        vehicle.driveline.J_c = 0.75;
        for model in &MODELS {
            let xml = complete(model, &vehicle, &crate::effects::null());
            let start = |name: &str| {
                let line = xml.lines().find(|l| attribute(l, "name") == Some(name)).unwrap();
                attribute(line, "start").unwrap().parse::<f64>().unwrap()
            };
            assert_eq!((start("friction.m_2"), start("driveline.J_c")), (-1.25e-7, 0.75));
            assert!(!xml.contains('@') && xml.contains(&model.description.guid[..GUID_OF_INTERFACE]));
            // The library serves this FMU, and it is told from the paper's car.
            let guid = |xml: &str| xml.lines().find_map(|l| attribute(l, "guid").map(str::to_owned)).unwrap();
            let of_paper = guid(&complete(model, &Vehicle::paper(), &crate::effects::null()));
            assert_ne!(guid(&xml), of_paper);
            for each in [guid(&xml), of_paper] {
                assert_eq!(crate::fmi2::model::find(&each).unwrap().description.name, model.description.name);
            }
            // The paper's car is what the source holds: nothing but GUID and version changes.
            let same = complete(model, &Vehicle::paper(), &crate::effects::null());
            let changed = same.lines().zip(model.xml.lines()).filter(|(a, b)| a != b && !b.contains('@'));
            for (a, b) in changed {
                let number = |line| attribute(line, "start").and_then(|s: &str| s.parse::<f64>().ok());
                assert_eq!(number(a), number(b), "{a}");
            }
        }
    }
}
