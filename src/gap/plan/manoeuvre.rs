//! Manoeuvres that a car or a bench can drive: their kind, torque and temperatures, their duration, and the time to prepare them. [`driver`](super::driver) drives them.

use crate::physics::{cushion, map};
use crate::vehicle::Vehicle;
use serde::{Deserialize, Serialize};

/// Kind of a manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Set off on a slipping clutch, lock up, pull, coast.
    Launch,
    /// Slow swings of the position through the lower half of the torque map while the car sets off.
    Creep,
    /// Slow ramps of the position through the kiss point and back, the disc free.
    KissPoint,
    /// Slow ramps of the position, the disc held by the brake.
    BrakedRamp,
    /// Fast swings of the position under slip.
    Chirp,
    /// Slip at one position from standstill until the speeds meet.
    ConstantPosition,
    /// Torque steps of the engine with the clutch open.
    OpenRev,
    /// Torque steps with the clutch locked.
    TipIn,
    /// The car rolls out with the clutch open.
    CoastDown,
    /// The clutch closes on a rolling car, as after a shift.
    Reengage,
    /// Slip against the brake, a rest with the clutch open, slip again, which shows how the clutch has cooled meanwhile.
    HeatAndRest,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 11] = [
        Self::Launch,
        Self::Creep,
        Self::KissPoint,
        Self::BrakedRamp,
        Self::Chirp,
        Self::ConstantPosition,
        Self::OpenRev,
        Self::TipIn,
        Self::CoastDown,
        Self::Reengage,
        Self::HeatAndRest,
    ];

    /// What to drive, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Launch => "a launch from standstill to lock-up, then pull and coast",
            Self::Creep => "slow swings of the position on the lower half of the torque map while setting off",
            Self::KissPoint => "slow ramps of the position through the kiss point and back, disc free",
            Self::BrakedRamp => "slow ramps of the position with the disc held by the brake",
            Self::Chirp => "fast swings of the position under slip",
            Self::ConstantPosition => "slip at one position from standstill until the speeds meet",
            Self::OpenRev => "torque steps with the clutch open",
            Self::TipIn => "torque steps with the clutch locked: tip-in, tip-out",
            Self::CoastDown => "a coast-down with the clutch open",
            Self::Reengage => "the clutch closes on a rolling car, as after a shift",
            Self::HeatAndRest => "slip against the brake, a rest with the clutch open, slip again",
        }
    }
}

/// A manoeuvre and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manoeuvre {
    /// Name, freely chosen.
    pub name: String,
    /// Kind.
    pub kind: Kind,
    /// Clutch torque of the manoeuvre, N·m; of torque steps, their scale.
    #[serde(rename = "torque_Nm")]
    pub torque_nm: f64,
    /// Disc temperature at the start, °C.
    #[serde(rename = "theta_c0_degC")]
    pub theta_c: f64,
    /// Body temperature at the start, °C.
    #[serde(rename = "theta_b0_degC")]
    pub theta_b: f64,
    /// Length of the recording, s.
    pub seconds: f64,
    /// Time to prepare it, s: warming up, coming to rest.
    pub prepare_s: f64,
}

impl Manoeuvre {
    /// Total time, preparation included, minutes.
    pub fn minutes(&self) -> f64 {
        (self.seconds + self.prepare_s) / 60.0
    }

    /// Description of a parameter that is out of range, if there is one.
    pub fn fault(&self) -> Option<String> {
        let number = |name: &str, value: f64, least: f64, most: f64, unit: &str| {
            let fits = value >= least && value <= most;
            (!fits).then(|| format!("{name} = {value} is not within {least} to {most} {unit}"))
        };
        (self.name.trim().is_empty())
            .then(|| "its name is empty".to_owned())
            .or_else(|| number("torque_Nm", self.torque_nm, 0.0, 2000.0, "N·m"))
            .or_else(|| number("theta_c0_degC", self.theta_c, -40.0, 400.0, "°C"))
            .or_else(|| number("theta_b0_degC", self.theta_b, -40.0, 300.0, "°C"))
            .or_else(|| number("seconds", self.seconds, 1.0, 600.0, "s"))
            .or_else(|| number("prepare_s", self.prepare_s, 0.0, 1e5, "s"))
    }
}

/// Disc and body temperature of a cold and of a hot clutch, °C.
const COLD: [f64; 2] = [25.0, 25.0];
const HOT: [f64; 2] = [120.0, 80.0];
/// Time that a test driver needs to bring a car to rest and into position, and to warm its clutch by some launches, s.
const SET_UP_S: f64 = 20.0;
const WARM_UP_S: f64 = 180.0;

/// The built-in manoeuvres for a vehicle; torques are shares of the capacity of its closed clutch.
pub fn built_in(vehicle: &Vehicle) -> Vec<Manoeuvre> {
    let most = capacity(vehicle);
    let one = |name: &str, kind, share: f64, [theta_c, theta_b]: [f64; 2], seconds: f64| {
        let hot = theta_c > COLD[0];
        let torque_nm = (share * most).round();
        let prepare_s = if hot { WARM_UP_S } else { SET_UP_S };
        Manoeuvre { name: name.to_owned(), kind, torque_nm, theta_c, theta_b, seconds, prepare_s }
    };
    vec![
        one("launch_soft", Kind::Launch, 0.28, COLD, 5.0),
        one("launch", Kind::Launch, 0.45, COLD, 4.0),
        one("launch_hard", Kind::Launch, 0.65, COLD, 3.5),
        one("launch_hot", Kind::Launch, 0.45, HOT, 4.0),
        one("creep", Kind::Creep, 0.25, COLD, 5.5),
        one("creep_hot", Kind::Creep, 0.25, HOT, 5.5),
        one("kiss_point", Kind::KissPoint, 0.1, COLD, 8.0),
        one("kiss_point_hot", Kind::KissPoint, 0.1, HOT, 8.0),
        one("braked_ramp", Kind::BrakedRamp, 0.2, COLD, 6.0),
        one("chirp", Kind::Chirp, 0.2, COLD, 4.5),
        one("constant_position", Kind::ConstantPosition, 0.2, COLD, 5.0),
        one("open_rev", Kind::OpenRev, 0.15, COLD, 4.0),
        one("tip_in", Kind::TipIn, 0.45, COLD, 4.0),
        one("coast_down", Kind::CoastDown, 0.0, COLD, 12.0),
        one("reengage", Kind::Reengage, 0.3, COLD, 3.5),
        one("heat_and_rest", Kind::HeatAndRest, 0.2, COLD, 20.0),
    ]
}

/// Torque capacity of the closed clutch at zero slip, N·m.
fn capacity(vehicle: &Vehicle) -> f64 {
    let spring = &vehicle.cushion_spring;
    map::torque_capacity(&vehicle.friction, cushion::force(spring, cushion::contact_point(spring), 1.0), 0.0, map::THETA_REFERENCE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_manoeuvres_are_sound_and_have_names_of_their_own() {
        let all = built_in(&Vehicle::paper());
        let names: std::collections::BTreeSet<&str> = all.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names.len(), all.len());
        assert!(all.iter().all(|m| m.fault().is_none()));
        assert!(Kind::ALL.iter().all(|k| all.iter().any(|m| m.kind == *k)));
    }

    #[test]
    fn a_number_that_nobody_can_drive_is_named() {
        let mut m = built_in(&Vehicle::paper()).remove(0);
        m.seconds = 0.0;
        assert!(m.fault().unwrap().contains("seconds = 0"));
        m = Manoeuvre { theta_c: f64::NAN, seconds: 4.0, ..m };
        assert!(m.fault().unwrap().contains("theta_c0_degC"));
    }
}
