//! The model description: from its source to the file in an FMU.

use super::{Beside, Model};
use crate::effects::{PARAMETERS, Parameters};
use crate::fmi2::{guid, model::put_vehicle};
use crate::vehicle::{NUMBERS, Vehicle};

/// The text with GUID, version and the indices of ModelStructure filled in, and the vehicle's numbers as start values.
pub fn complete(model: &Model, vehicle: &Vehicle, effects: &Parameters) -> String {
    complete_with(model, vehicle, effects, &Beside::default())
}

/// Like [`complete`], for an FMU whose vehicle file holds more than its car.
pub fn complete_with(model: &Model, vehicle: &Vehicle, effects: &Parameters, beside: &Beside) -> String {
    let filled = model.xml.replace("@VERSION@", env!("CARGO_PKG_VERSION")).replace("@GUID@", &guid(model, vehicle, effects, beside));
    filled.lines().map(|line| with_index(model, &with_start(line, vehicle, effects)) + "\n").collect()
}

/// The GUID of an FMU with these start values.
pub fn guid(model: &Model, vehicle: &Vehicle, effects: &Parameters, beside: &Beside) -> String {
    let description = model.description;
    let mut starts: Vec<f64> = description.variables.iter().map(|v| v.start).collect();
    put_vehicle(description, vehicle, effects, &mut starts);
    let tail = guid::tail(starts.into_iter().chain(beside.numbers())).map(char::from);
    description.guid[..guid::OF_INTERFACE].chars().chain(tail).collect()
}

/// Replaces the names in an `Unknown` by indices; returns any other line unchanged.
fn with_index(model: &Model, line: &str) -> String {
    let Some(name) = attribute(line, "name").filter(|_| line.contains("<Unknown ")) else { return line.to_owned() };
    let index = |name: &str| {
        let place = model.description.variables.iter().position(|v| v.name == name);
        (place.unwrap_or_else(|| panic!("ModelStructure of {} names {name}, which is no variable", model.description.name)) + 1).to_string()
    };
    let dependencies = attribute(line, "dependencies").map(|names| names.split_whitespace().map(index).collect::<Vec<_>>().join(" "));
    let dependencies = dependencies.map_or(String::new(), |indices| format!(" dependencies=\"{indices}\""));
    format!("      <Unknown index=\"{}\"{dependencies}/>", index(name))
}

/// Sets the start value in the line of a vehicle's number or of an effect's parameter; returns any other line unchanged.
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
            assert!(!xml.contains('@') && xml.contains(&model.description.guid[..guid::OF_INTERFACE]));
            // The library serves this FMU, whose GUID differs from that of the paper's car.
            let read_guid = |xml: &str| xml.lines().find_map(|l| attribute(l, "guid").map(str::to_owned)).unwrap();
            let of_paper = read_guid(&complete(model, &Vehicle::paper(), &crate::effects::null()));
            assert_ne!(read_guid(&xml), of_paper);
            assert_eq!(of_paper, model.description.guid);
            for each in [read_guid(&xml), of_paper] {
                assert_eq!(crate::fmi2::model::find(&each).unwrap().description.name, model.description.name);
            }
            // The source holds the paper's car, so that nothing but GUID and version changes.
            let same = complete(model, &Vehicle::paper(), &crate::effects::null());
            let changed = same.lines().zip(model.xml.lines()).filter(|(a, b)| a != b && !b.contains('@') && !b.contains("<Unknown "));
            for (a, b) in changed {
                let number = |line| attribute(line, "start").and_then(|s: &str| s.parse::<f64>().ok());
                assert_eq!(number(a), number(b), "{a}");
            }
        }
    }
}
