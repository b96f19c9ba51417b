//! Vehicle and effects compiled into the form that an integration step needs: constants, and a list of the active effects of each kind.

use super::pace::Pace;
use crate::effects::empirical::{self, Active};
use crate::effects::{self, Act, Constants, Parameters, REGISTRY, SIMULATED};
use crate::physics::cushion;
use crate::vehicle::Vehicle;

/// Number of effects: those of the library and those that are simulated only.
const EFFECTS: usize = REGISTRY.len() + SIMULATED.len();

/// Functions of the active effects of one kind, in the order of the registry.
#[derive(Clone, Copy, Debug)]
pub struct List<F: Copy> {
    /// The first `count` are active; the rest are never called.
    functions: [F; EFFECTS],
    count: usize,
}

impl<F: Copy> List<F> {
    /// An empty list; the unused slots hold `filler`.
    fn new(filler: F) -> Self {
        Self { functions: [filler; EFFECTS], count: 0 }
    }
    fn push(&mut self, function: F) {
        self.functions[self.count] = function;
        self.count += 1;
    }
    /// The active functions.
    #[inline]
    pub fn iter(&self) -> std::slice::Iter<'_, F> {
        self.functions[..self.count].iter()
    }
}

/// Coupling of flywheel and disc that replaces the clutch's own friction law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coupling {
    /// A given torque in N·m from flywheel to disc, independent of the slip.
    Torque(f64),
    /// Flywheel and disc turn as one.
    Rigid,
}

/// Configuration of the plant: everything that a step needs besides state and inputs.
#[derive(Clone, Debug)]
pub struct Config {
    /// The nominal vehicle.
    pub vehicle: Vehicle,
    /// Effect parameters.
    pub parameters: Parameters,
    /// Plant constants after the effects have changed them.
    pub constants: Constants,
    /// True contact point ξ_0 of the cushion spring.
    pub xi_0: f64,
    /// Rates of the plant's parts, which bound the substep.
    pub pace: Pace,
    /// See [`Act::Contact`].
    pub contact: List<fn(&Parameters, f64, &mut crate::physics::map::Contact)>,
    /// See [`Act::Force`].
    pub force: List<fn(&Parameters, f64) -> f64>,
    /// See [`Act::Friction`].
    pub friction: List<fn(&Parameters, f64, f64) -> f64>,
    /// See [`Act::FrictionAdded`].
    pub friction_added: List<fn(&Parameters, f64, f64) -> f64>,
    /// See [`Act::Pulsation`].
    pub pulsation: List<fn(&Parameters, f64, f64) -> f64>,
    /// See [`Act::Drag`].
    pub drag: List<fn(&Parameters, f64, f64) -> f64>,
    /// See [`Act::Load`].
    pub load: List<fn(&Parameters, &Vehicle, f64) -> f64>,
    /// See [`Act::Engine`].
    pub engine: List<fn(&Parameters, f64, f64, f64) -> f64>,
    /// See [`Act::Pressure`].
    pub pressure: List<fn(&Parameters, f64) -> f64>,
    /// See [`Act::Shafts`].
    pub shafts: List<fn(&Parameters, [f64; 2]) -> f64>,
    /// See [`Act::Worn`].
    pub worn: List<fn(&Parameters, f64, &mut crate::physics::map::Contact)>,
    /// Which learned laws are active.
    pub empirical: Active,
    /// Coupling that replaces the clutch law; `None` except in a replay in which the clutch torque does not follow from the bearing position.
    pub coupling: Option<Coupling>,
}

impl PartialEq for Config {
    fn eq(&self, other: &Self) -> bool {
        self.vehicle == other.vehicle && self.parameters == other.parameters
    }
}

impl Config {
    /// Compiles vehicle and effect parameters; effects at their null values are left out.
    pub fn new(vehicle: &Vehicle, parameters: &Parameters) -> Self {
        let mut config = Self {
            vehicle: *vehicle,
            parameters: *parameters,
            constants: Constants::nominal(vehicle),
            xi_0: cushion::contact_point(&vehicle.cushion_spring),
            pace: Pace::STILL,
            contact: List::new(|_, _, _| {}),
            force: List::new(|_, _| 1.0),
            friction: List::new(|_, _, _| 1.0),
            friction_added: List::new(|_, _, _| 0.0),
            pulsation: List::new(|_, _, _| 1.0),
            drag: List::new(|_, _, _| 0.0),
            load: List::new(|_, _, _| 0.0),
            engine: List::new(|_, asked, _, _| asked),
            pressure: List::new(|_, _| 1.0),
            shafts: List::new(|_, _| 1.0),
            worn: List::new(|_, _, _| {}),
            empirical: Active::of(parameters),
            coupling: None,
        };
        for entry in effects::all().filter(|entry| !entry.is_null(parameters)) {
            match entry.effect.act {
                Act::Constants(apply) => apply(parameters, vehicle, &mut config.constants),
                Act::Contact(apply) => config.contact.push(apply),
                Act::Force(apply) => config.force.push(apply),
                Act::Friction(apply) => config.friction.push(apply),
                Act::FrictionAdded(apply) => config.friction_added.push(apply),
                Act::Pulsation(apply) => config.pulsation.push(apply),
                Act::Drag(apply) => config.drag.push(apply),
                Act::Load(apply) => config.load.push(apply),
                Act::Engine(apply) => config.engine.push(apply),
                Act::Pressure(apply) => config.pressure.push(apply),
                Act::Shafts(apply) => config.shafts.push(apply),
                Act::Worn(apply) => config.worn.push(apply),
            }
        }
        if config.empirical.direction && config.constants.hysteresis_width == 0.0 {
            config.constants.hysteresis_stroke = empirical::STROKE_MM;
        }
        config.pace = Pace::of(&config);
        config
    }

    /// Whether the force on the faces depends on the direction in which the bearing has moved (force hysteresis or its learned counterpart).
    #[inline]
    pub fn remembers(&self) -> bool {
        self.constants.hysteresis_width != 0.0 || self.empirical.direction
    }

    /// Whether either speed sensor has a filter.
    #[inline]
    pub fn filters(&self) -> bool {
        (0..2).any(|k| super::sensed::filters(self, k))
    }

    /// Whether there is an elastic element between disc and car: shafts or tyres.
    #[inline]
    pub fn compliant(&self) -> bool {
        self.constants.compliance > 0.0 || self.constants.tyre.softness > 0.0
    }

    /// Inertia on the disc side of the elastic element, kg·m²; all of J_c if the driveline is rigid.
    #[inline]
    pub fn disc_inertia(&self) -> f64 {
        let j = self.constants.driveline.J_c;
        if self.compliant() { self.constants.disc_share * j } else { j }
    }

    /// Excess twist of the shafts in rad per N·m of torque that an observer with a rigid driveline model found on the car's side, while the clutch is `stuck` or not. The
    /// observer derived that torque from an acceleration of the whole car, but behind elastic shafts the acceleration first appears at the inertia before the shafts.
    pub fn misread_twist(&self, stuck: bool) -> f64 {
        let c = &self.constants;
        let with = if stuck { c.driveline.J_f } else { 0.0 };
        c.compliance * (with + self.disc_inertia()) / (with + c.driveline.J_c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::param;

    #[test]
    fn a_list_has_room_for_every_effect() {
        let mut list: List<fn() -> f64> = List::new(|| 0.0);
        effects::all().for_each(|_| list.push(|| 1.0));
        assert_eq!(list.iter().map(|effect| effect()).sum::<f64>(), effects::all().count() as f64);
    }

    #[test]
    fn configurations_are_told_apart_by_vehicle_and_effects() {
        let (vehicle, null) = (Vehicle::paper(), effects::null());
        let (mut heavier, mut faded) = (vehicle, null);
        heavier.driveline.J_c *= 1.01;
        faded[param::friction_level::factor] = 0.9;
        let plain = Config::new(&vehicle, &null);
        assert!(plain == Config::new(&vehicle, &null));
        assert!(plain != Config::new(&heavier, &null) && plain != Config::new(&vehicle, &faded));
    }
}
