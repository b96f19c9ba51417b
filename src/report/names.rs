//! Plain names of effects, subsystems and numbers for readers; programs use the ids.

use super::text::{alternatives, capitalised, words};

/// Name of each effect of the library within a sentence.
pub const EFFECTS: [(&str, &str); 24] = [
    ("actuator_backlash", "play in the actuator"),
    ("actuator_delay", "delay of the position command"),
    ("actuator_lag", "actuator lag"),
    ("actuator_rate_limit", "speed limit of the actuator"),
    ("clutch_cooling", "cooling of the clutch"),
    ("clutch_drag", "drag of the open clutch"),
    ("clutch_speed_delay", "late disc-speed signal"),
    ("clutch_speed_gain", "scale error of the disc-speed signal"),
    ("cushion_hysteresis", "hysteresis of the cushion spring"),
    ("cushion_stiffness_thermal", "thermal change of the cushion stiffness"),
    ("driveline_compliance", "elastic drive shafts"),
    ("engine_speed_delay", "late flywheel-speed signal"),
    ("engine_torque_bias", "offset of the engine torque"),
    ("engine_torque_gain", "scale error of the engine torque"),
    ("engine_torque_lag", "lag of the engine torque"),
    ("friction_fade", "friction fade when hot"),
    ("friction_level", "friction level"),
    ("friction_slip_gradient", "friction that changes with slip speed"),
    ("heat_partition", "split of the friction heat"),
    ("judder", "judder"),
    ("kiss_point_offset", "shifted kiss point"),
    ("kiss_point_thermal", "thermal drift of the kiss point"),
    ("road_load", "road load"),
    ("vehicle_mass", "vehicle mass"),
];

/// Name within a sentence of each effect that can be simulated but not diagnosed.
pub const SIMULATED: [(&str, &str); 8] = [
    ("combustion_pulsation", "pulsation of the engine torque"),
    ("engine_torque_limit", "limit of the engine torque"),
    ("friction_pressure", "friction that changes with pressure"),
    ("release_friction", "friction of the release bearing"),
    ("shaft_judder", "judder locked to a shaft"),
    ("surface_temperature", "faces hotter than the disc"),
    ("touch_point_wear", "wear of the facings"),
    ("tyre_slip", "slip of the tyres"),
];

/// Name of each subsystem within a sentence.
pub const SUBSYSTEMS: [(&str, &str); 7] = [
    ("engine", "engine torque"),
    ("actuator", "actuator"),
    ("clutch_force", "clutch force"),
    ("friction", "friction"),
    ("thermal", "heat balance"),
    ("driveline", "driveline"),
    ("sensors", "speed sensors"),
];

/// The plain name of an effect; an unknown id is returned as words.
pub fn effect(id: &str) -> String {
    EFFECTS.iter().chain(&SIMULATED).find(|(known, _)| *known == id).map_or_else(|| words(id), |(_, name)| (*name).to_owned())
}

/// Whether the name of an effect is a plural.
pub fn is_plural(id: &str) -> bool {
    matches!(id, "driveline_compliance" | "surface_temperature")
}

/// Title of each curve of a learned law.
pub const CURVES: [(&str, &str); 20] = [
    ("friction_slip", "Friction over slip"),
    ("friction_temperature", "Friction over disc temperature"),
    ("friction_pressure", "Friction over pressure"),
    ("friction_work", "Friction over work done"),
    ("force_position", "Clutch force over position"),
    ("force_direction", "Clutch force, closing against opening"),
    ("force_temperature", "Clutch force over disc temperature"),
    ("engine_speed", "Engine torque over speed"),
    ("engine_torque", "Engine torque over torque asked for"),
    ("load_speed", "Load over speed"),
    ("actuator_time", "Actuator’s time constant over distance to the command"),
    ("actuator_slowing", "Actuator’s time constant over position"),
    ("actuator_offset", "Actuator’s offset over position"),
    ("actuator_play", "Actuator’s play over position, half of it"),
    ("disc_scale", "Scale error of the disc-speed signal"),
    ("disc_filter", "Filter of the disc-speed signal"),
    ("flywheel_scale", "Scale error of the flywheel-speed signal"),
    ("flywheel_filter", "Filter of the flywheel-speed signal"),
    ("engine_time", "Engine’s lag over torque still missing, added"),
    ("engine_slowing", "Engine’s lag over torque asked for, added"),
];

/// The title of a learned curve.
pub fn curve(id: &str) -> String {
    CURVES.iter().find(|(known, _)| *known == id).map_or_else(|| words(id), |(_, name)| (*name).to_owned())
}

/// The plain name of a subsystem.
pub fn subsystem(id: &str) -> String {
    SUBSYSTEMS.iter().find(|(known, _)| *known == id).map_or_else(|| words(id), |(_, name)| (*name).to_owned())
}

/// A subsystem with its article, if it needs one, as in "lies in the driveline".
pub fn place(id: &str) -> String {
    match id {
        "friction" => subsystem(id),
        _ => format!("the {}", subsystem(id)),
    }
}

/// An effect and its rivals as alternatives: "A or B".
pub fn with_rivals(id: &str, rivals: &[&str]) -> String {
    alternatives(&std::iter::once(id).chain(rivals.iter().copied()).map(effect).collect::<Vec<_>>())
}

/// Name of an effect, capitalised for the beginning of a line.
pub fn effect_title(id: &str) -> String {
    capitalised(&effect(id))
}

/// Name of a subsystem, capitalised for the beginning of a line.
pub fn subsystem_title(id: &str) -> String {
    capitalised(&subsystem(id))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{self, Subsystem};

    #[test]
    fn everything_has_a_plain_name_and_the_documentation_has_the_same() {
        let page = include_str!("../../docs/effects.md");
        for entry in effects::all() {
            let name = EFFECTS
                .iter()
                .chain(&SIMULATED)
                .find(|(id, _)| *id == entry.id)
                .unwrap_or_else(|| panic!("{} has no plain name", entry.id))
                .1;
            let row = page.lines().find(|line| line.contains(&format!("| `{}` |", entry.id))).expect("every effect is documented");
            assert!(row.contains(&format!("| {name} |")), "docs/effects.md: {} is called {name}", entry.id);
        }
        assert_eq!((EFFECTS.len(), SIMULATED.len()), (effects::REGISTRY.len(), effects::SIMULATED.len()));
        assert_eq!(CURVES.map(|c| c.0), crate::effects::empirical::CURVES.each_ref().map(|c| c.name));
        for s in Subsystem::ALL {
            assert!(SUBSYSTEMS.iter().any(|(id, _)| *id == s.id()), "{} has no plain name", s.id());
        }
    }
}
