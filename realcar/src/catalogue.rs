//! Every effect that a car can carry, with its subsystem.

use crate::draw::Place;

/// The effects of the library: id and subsystem.
pub const LIBRARY: [(&str, &str); 24] = [
    ("engine_torque_bias", "engine"),
    ("engine_torque_gain", "engine"),
    ("engine_torque_lag", "engine"),
    ("actuator_lag", "actuator"),
    ("actuator_delay", "actuator"),
    ("actuator_backlash", "actuator"),
    ("actuator_rate_limit", "actuator"),
    ("kiss_point_offset", "clutch_force"),
    ("kiss_point_thermal", "clutch_force"),
    ("cushion_stiffness_thermal", "clutch_force"),
    ("cushion_hysteresis", "clutch_force"),
    ("friction_level", "friction"),
    ("friction_fade", "friction"),
    ("friction_slip_gradient", "friction"),
    ("clutch_drag", "friction"),
    ("judder", "friction"),
    ("heat_partition", "thermal"),
    ("clutch_cooling", "thermal"),
    ("driveline_compliance", "driveline"),
    ("road_load", "driveline"),
    ("vehicle_mass", "driveline"),
    ("clutch_speed_delay", "sensors"),
    ("clutch_speed_gain", "sensors"),
    ("engine_speed_delay", "sensors"),
];

/// Effects that no library holds: id and subsystem.
///
/// Each can be placed by its channels, in principle. Friction that falls with pressure can't, and is left out: without a force sensor it is a function of
/// the bearing's position, as a cushion spring with another curve is.
pub const OUTSIDE: [(&str, &str); 19] = [
    ("misfire", "engine"),
    ("tip_in_dip", "engine"),
    ("torque_ceiling", "engine"),
    ("bearing_stiction", "actuator"),
    ("actuator_hunting", "actuator"),
    ("actuator_leak", "actuator"),
    ("plate_wobble", "clutch_force"),
    ("cushion_settling", "clutch_force"),
    ("cushion_knee", "clutch_force"),
    ("wear_in", "friction"),
    ("damp_facing", "friction"),
    ("plate_heat_soak", "thermal"),
    ("flash_temperature", "thermal"),
    ("gusts", "driveline"),
    ("dragging_brake", "driveline"),
    ("surging_load", "driveline"),
    ("tone_wheel_runout", "sensors"),
    ("speed_dropout", "sensors"),
    ("blind_pickup", "sensors"),
];

/// Effects that no library holds and that nobody had drawn while the diagnosis was made: id and subsystem. They have a row of their own in its scores.
pub const NEW: [(&str, &str); 10] = [
    ("compressor_cycling", "engine"),
    ("knock_retard", "engine"),
    ("stepped_bearing", "actuator"),
    ("centrifugal_clamp", "clutch_force"),
    ("squeeze_film", "clutch_force"),
    ("groan", "friction"),
    ("moisture_plateau", "thermal"),
    ("wheel_spin", "driveline"),
    ("undulating_road", "driveline"),
    ("slew_limited_pickup", "sensors"),
];

/// The catalogue's own copy of an id, its subsystem, and whether the library holds it.
pub fn find(id: &str) -> Option<(&'static str, &'static str, bool)> {
    let held = LIBRARY.iter().map(|e| (e.0, e.1, true));
    let other = OUTSIDE.iter().chain(&NEW).map(|e| (e.0, e.1, false));
    held.chain(other).find(|e| e.0 == id)
}

/// The library's effects that are drawn: on the road some hide behind what is declared there.
pub fn drawn(place: Place) -> Vec<(&'static str, &'static str)> {
    let hides = |id: &str| place == Place::Road && matches!(id, "engine_speed_delay" | "road_load");
    LIBRARY.into_iter().filter(|e| !hides(e.0)).collect()
}

/// Whether launches alone, of this bench or not, can show the effect at all.
pub fn shows_in_launches(id: &str, bench: bool) -> bool {
    match id {
        "clutch_drag" => false,
        "heat_partition" | "clutch_cooling" | "plate_heat_soak" | "moisture_plateau" => bench,
        _ => true,
    }
}
