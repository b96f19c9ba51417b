//! Effects: what the nominal plant may be missing, one small file each.
//!
//! The list of effects and of their parameters (name, unit, null value, bounds) is `modelDescription/DrivelinePlant.xml`:
//! every `effect.<id>.<parameter>` there belongs to `src/effects/<id>.rs`, and `build.rs` derives [`REGISTRY`] from it. A new
//! effect is therefore one new file and its line there.
//!
//! An effect whose file is in `src/effects/simulated/` is listed in [`SIMULATED`] instead: the plant can simulate it, but no diagnosis searches for it. [`empirical`] alone is
//! in neither list, because a learned law is not a cause.
//!
//! An effect acts on the plant in one of a few ways ([`Act`]). While all its amplitudes are at their null values it has no influence at all, which leaves the plant
//! bit-identical to the nominal one.

use crate::physics::driveline::Driveline;
use crate::physics::lag::Lag;
use crate::physics::map::Contact;
use crate::physics::thermal::Thermal;
use crate::vehicle::{Vehicle, VehicleError};
use serde_json::Value;

include!(concat!(env!("OUT_DIR"), "/effects.rs"));

/// Part of the vehicle in which an effect lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[allow(missing_docs)]
pub enum Subsystem {
    Engine,
    Actuator,
    ClutchForce,
    Friction,
    Thermal,
    Driveline,
    Sensors,
}

impl Subsystem {
    /// All subsystems, in the order of the contract.
    pub const ALL: [Subsystem; 7] =
        [Self::Engine, Self::Actuator, Self::ClutchForce, Self::Friction, Self::Thermal, Self::Driveline, Self::Sensors];

    /// Name in diagnosis.json.
    pub fn id(self) -> &'static str {
        match self {
            Self::Engine => "engine",
            Self::Actuator => "actuator",
            Self::ClutchForce => "clutch_force",
            Self::Friction => "friction",
            Self::Thermal => "thermal",
            Self::Driveline => "driveline",
            Self::Sensors => "sensors",
        }
    }
}

/// Values of all effect parameters, in the order of [`PARAMETERS`].
pub type Parameters = [f64; N_PARAMETERS];

/// Parameters with every effect at its null value.
pub fn null() -> Parameters {
    std::array::from_fn(|k| PARAMETERS[k].null)
}

/// Effect parameters from the `effects` object of a vehicle document, by the FMU's variable names; parameters that are not named keep their null values.
///
/// # Errors
/// If a name is not that of an effect parameter, or a value is not a number within its bounds.
pub fn from_value(document: &Value) -> Result<Parameters, VehicleError> {
    let mut parameters = null();
    for (name, value) in document.get("effects").and_then(Value::as_object).into_iter().flatten() {
        let unknown = || VehicleError::Unknown(format!("effects.{name}"), "effects.effect.<id>.<parameter>".into());
        let k = PARAMETERS.iter().position(|p| p.variable == name).ok_or_else(unknown)?;
        let p = &PARAMETERS[k];
        let number = value.as_f64().ok_or_else(|| VehicleError::NotANumber(name.clone(), value.clone()))?;
        if !(number >= p.min && number <= p.max) {
            return Err(VehicleError::Bounds { name: name.clone(), value: number, unit: p.unit, min: p.min, max: p.max });
        }
        parameters[k] = number;
    }
    Ok(parameters)
}

/// The `effects` object of a vehicle document: every parameter that is not at its null value.
pub fn to_value(parameters: &Parameters) -> Value {
    let set = PARAMETERS.iter().zip(parameters).filter(|(p, v)| **v != p.null);
    Value::Object(set.map(|(p, v)| (p.variable.to_owned(), Value::from(*v))).collect())
}

/// One parameter of an effect, as the model description defines it.
pub struct Parameter {
    /// Id of the effect.
    pub effect: &'static str,
    /// Name within the effect.
    pub name: &'static str,
    /// Name of the FMU's variable.
    pub variable: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Meaning in words.
    pub meaning: &'static str,
    /// Null value: for an amplitude the value without effect, for a shape parameter a usual value.
    pub null: f64,
    /// Least value accepted.
    pub min: f64,
    /// Greatest value accepted.
    pub max: f64,
    /// Size of a noticeable effect.
    pub nominal: f64,
    /// Value reference in `DrivelinePlant`.
    pub value_reference: u32,
}

/// One line of the registry.
pub struct Entry {
    /// Id of the effect.
    pub id: &'static str,
    /// The effect.
    pub effect: &'static Effect,
    /// Index range of its parameters in [`PARAMETERS`].
    pub parameters: std::ops::Range<usize>,
}

impl Entry {
    /// Scale of parameter `k`: its largest deviation from the null value among the starts, or else its nominal size.
    pub fn scale(&self, k: usize) -> f64 {
        let departures =
            self.effect.starts.iter().flat_map(|s| s.iter()).filter(|(p, _)| *p == k).map(|(_, v)| (v - PARAMETERS[k].null).abs());
        let largest = departures.fold(0.0, f64::max);
        if largest > 0.0 { largest } else { PARAMETERS[k].nominal }
    }

    /// Whether every amplitude is at its null value, so that the effect has no influence.
    pub fn is_null(&self, p: &Parameters) -> bool {
        self.effect.amplitudes.iter().all(|&k| p[k] == PARAMETERS[k].null)
    }
}

/// Every effect that the plant has: the library's, then those that are simulated only.
pub fn all() -> impl Iterator<Item = &'static Entry> {
    REGISTRY.iter().chain(&SIMULATED)
}

/// Entry that owns parameter `k`; `None` for a parameter of a learned law.
pub fn owner(k: usize) -> Option<&'static Entry> {
    all().find(|entry| entry.parameters.contains(&k))
}

/// Index in [`REGISTRY`] of the effect `id`.
pub fn find(id: &str) -> Option<usize> {
    REGISTRY.iter().position(|entry| entry.id == id)
}

/// Definition of an effect.
pub struct Effect {
    /// Subsystem in which it lies.
    pub subsystem: Subsystem,
    /// Parameters whose null values switch the effect off; the others only shape it.
    pub amplitudes: &'static [usize],
    /// How it acts on the plant.
    pub act: Act,
    /// Sizes of a noticeable effect, each a list of (parameter, value), from which a search for the effect starts.
    pub starts: &'static [&'static [(usize, f64)]],
    /// Manoeuvre or channel that shows the effect best.
    pub shown_by: &'static str,
}

/// How an effect acts on the plant.
pub enum Act {
    /// Changes constants, once, when parameters are set.
    Constants(fn(&Parameters, &Vehicle, &mut Constants)),
    /// Moves contact points at a disc temperature in °C.
    Contact(fn(&Parameters, f64, &mut Contact)),
    /// Factor on the spring force at a disc temperature in °C.
    Force(fn(&Parameters, f64) -> f64),
    /// Factor on friction at a slip speed ≥ 0 in rad/s and a disc temperature in °C.
    Friction(fn(&Parameters, f64, f64) -> f64),
    /// Addition to the friction coefficient at a slip speed ≥ 0 in rad/s and a given friction coefficient.
    FrictionAdded(fn(&Parameters, f64, f64) -> f64),
    /// Factor on the torque capacity at a slip angle in rad and a slip speed ≥ 0 in rad/s.
    Pulsation(fn(&Parameters, f64, f64) -> f64),
    /// Drag torque in N·m, in addition to the torque capacity, at a signed slip speed in rad/s and a force on the faces in N.
    Drag(fn(&Parameters, f64, f64) -> f64),
    /// Additional load torque in N·m at a speed in rad/s.
    Load(fn(&Parameters, &Vehicle, f64) -> f64),
    /// Torque in N·m that the engine delivers for a requested torque in N·m, at a speed in rad/s and a crank angle in rad.
    Engine(fn(&Parameters, f64, f64, f64) -> f64),
    /// Factor on friction under a force on the faces in N.
    Pressure(fn(&Parameters, f64) -> f64),
    /// Factor on the torque capacity at the angles of engine and input shaft in rad.
    Shafts(fn(&Parameters, [f64; 2]) -> f64),
    /// Moves contact points as a function of the friction work in J that the clutch has done since the start.
    Worn(fn(&Parameters, f64, &mut Contact)),
}

/// A tyre, which slips between the car and the road. See `tyre_slip`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Tyre {
    /// Twist per torque while it grips, rad/(N·m); 0 means no tyre model.
    pub softness: f64,
    /// Angle over which it builds up its force, rad.
    pub relaxation: f64,
    /// Greatest torque that it transmits, N·m.
    pub grip: f64,
}

impl Tyre {
    /// Deflection in rad under `torque` N·m. It grows without bound as the torque approaches the grip, so the ratio of torque to grip in the denominator is limited to 99 %.
    pub fn deflection(&self, torque: f64) -> f64 {
        self.softness * torque / (1.0 - (torque.abs() / self.grip).min(0.99))
    }
}

/// Friction of the release bearing. See `release_friction`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Release {
    /// Difference between its positions when opening and when closing, mm; 0 means no friction.
    pub width: f64,
    /// Travel from one to the other after a reversal, mm.
    pub travel: f64,
    /// Weight of the additional friction just after a reversal.
    pub stiction: f64,
}

/// Excess temperature of the faces over the disc. See `surface_temperature`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Surface {
    /// Temperature rise per friction power at low slip speed, K/W; 0 means no rise.
    pub resistance: f64,
    /// Slip speed at which the rise is 1/√2 of that, rad/s.
    pub speed: f64,
    /// Time constant with which the rise builds up, s.
    pub time_constant: f64,
}

/// Delay of a signal: a dead time and a first-order filter, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SignalDelay {
    /// Dead time.
    pub dead_time: f64,
    /// Time constant of the filter.
    pub smoothing: f64,
}

/// Constants of the plant that effects may change; the nominal ones come from the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Torque on the crankshaft is gain · report + bias (N·m).
    pub engine_gain: f64,
    /// See `engine_gain`.
    pub engine_bias: f64,
    /// Power that an accessory takes from the crankshaft, W.
    pub accessory_power: f64,
    /// Lag of the engine torque.
    pub engine_lag: Lag,
    /// Transport delay of the position command, s.
    pub command_delay: f64,
    /// Inverse of the bearing's greatest speed, s/mm; 0 means no limit.
    pub inverse_speed: f64,
    /// Distance from its target over which the bearing slows down, mm.
    pub approach: f64,
    /// Lag of the bearing.
    pub actuator_lag: Lag,
    /// Play between command and bearing, mm.
    pub play: f64,
    /// Shift of contact and closed point, mm.
    pub contact_shift: Contact,
    /// Factor on friction.
    pub friction_factor: f64,
    /// Relative width of the force hysteresis.
    pub hysteresis_width: f64,
    /// Travel from one branch of the hysteresis to the other, mm.
    pub hysteresis_stroke: f64,
    /// Thermal coefficients.
    pub thermal: Thermal,
    /// Driveline parameters.
    pub driveline: Driveline,
    /// Compliance of the shafts, rad/(N·m); 0 means rigid.
    pub compliance: f64,
    /// Share of J_c on the disc side of the shafts.
    pub disc_share: f64,
    /// Damping of the shafts, N·m·s/rad.
    pub shaft_damping: f64,
    /// Twist in either direction up to which the shafts are softer, rad.
    pub soft_angle: f64,
    /// Stiffness within that angle, as a share of the stiffness beyond it.
    pub soft_share: f64,
    /// Delay of the disc speed signal.
    pub clutch_speed_delay: SignalDelay,
    /// Delay of the engine speed signal.
    pub engine_speed_delay: SignalDelay,
    /// Ratio of the sensed to the actual disc speed.
    pub clutch_speed_gain: f64,
    /// Tyres.
    pub tyre: Tyre,
    /// Excess temperature of the faces.
    pub surface: Surface,
    /// Friction of the release bearing.
    pub release: Release,
}

impl Constants {
    /// Constants of the nominal plant.
    pub fn nominal(vehicle: &Vehicle) -> Self {
        Self {
            engine_gain: 1.0,
            engine_bias: 0.0,
            accessory_power: 0.0,
            engine_lag: Lag::default(),
            command_delay: 0.0,
            inverse_speed: 0.0,
            approach: 0.0,
            actuator_lag: Lag::default(),
            play: 0.0,
            contact_shift: Contact { x_cnt: 0.0, x_cls: 0.0 },
            friction_factor: 1.0,
            hysteresis_width: 0.0,
            hysteresis_stroke: 1.0,
            thermal: vehicle.thermal,
            driveline: vehicle.driveline,
            compliance: 0.0,
            disc_share: 1.0,
            shaft_damping: 0.0,
            soft_angle: 0.0,
            soft_share: 1.0,
            clutch_speed_delay: SignalDelay::default(),
            engine_speed_delay: SignalDelay::default(),
            clutch_speed_gain: 1.0,
            tyre: Tyre::default(),
            surface: Surface::default(),
            release: Release::default(),
        }
    }
}
