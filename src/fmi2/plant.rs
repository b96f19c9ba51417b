//! `DrivelinePlant`: the plant behind the FMU.

use super::model::{Event, Model, take_vehicle};
use super::variables::{Causality, Description, Kind, Variability, Variable};
use super::words::{Reader, Words, Writer};
use crate::effects::{self, PARAMETERS, Parameters};
use crate::faults::Faults;
use crate::physics::lag::LagState;
use crate::physics::phase::Phase;
use crate::plant::actuation::Presliding;
use crate::plant::clutch::Branch;
use crate::plant::config::Config;
use crate::plant::history::{CAPACITY, SIGNALS};
use crate::plant::pace::TooFast;
use crate::plant::rest::Rest;
use crate::plant::saved::equal;
use crate::plant::{Inputs, Outputs, Plant, Start, State};
use crate::validated::{Place, UNKNOWN_NM, Validated};
use crate::vehicle::{NUMBERS, Vehicle};
use std::ops::Range;
use std::sync::LazyLock;

include!(concat!(env!("OUT_DIR"), "/DrivelinePlant.rs"));

/// Its model description.
pub static DESCRIPTION: Description = Description { name: "DrivelinePlant", guid: GUID, variables: &VARIABLES, lookup: &LOOKUP };

/// Least compliance of shafts that are not rigid, rad/(N·m).
const LEAST_COMPLIANCE: f64 = 1e-6;

/// Positions of the vehicle's numbers among the values.
const NUMBERS_AT: Range<usize> = at::friction_R_1..at::driveline_mgR_over_i + 1;

struct PlantModel {
    plant: Plant,
    vehicle: Vehicle,
    /// The values that `vehicle` was taken from.
    numbers: [f64; NUMBERS.len()],
    faults: Faults,
    /// Effects at the start, which faults then change.
    base: Parameters,
    validated: Option<Known>,
}

/// What a campaign has found, and the car to which it applies.
struct Known {
    found: Validated,
    vehicle: Vehicle,
    effects: Parameters,
    /// Whether the plant still is this car.
    applies: bool,
    /// Index of the place that was nearest last.
    near: usize,
}

/// A plant of the paper's car, not yet started.
pub fn make() -> Box<dyn Model> {
    // Only the configuration is shared: it owns no memory, so that nothing is left behind when the library is unloaded.
    static PAPER: LazyLock<Config> = LazyLock::new(|| Config::new(&Vehicle::paper(), &effects::null()));
    let start = Start { omega_f: 0.0, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };
    Box::new(PlantModel {
        plant: Plant::of(Box::new(PAPER.clone()), &start, &Inputs::default()),
        vehicle: Vehicle::paper(),
        numbers: [f64::NAN; NUMBERS.len()],
        faults: Faults::default(),
        base: effects::null(),
        validated: None,
    })
}

impl Model for PlantModel {
    fn start(&mut self, values: &mut [f64]) -> Result<(), String> {
        let vehicle = take_vehicle(&DESCRIPTION, values);
        vehicle.check().map_err(|e| e.to_string())?;
        let start = Start {
            omega_f: values[at::omega_f_start],
            omega_c: values[at::omega_c_start],
            theta_c: values[at::theta_c_start],
            theta_b: values[at::theta_b_start],
        };
        self.vehicle = vehicle;
        self.numbers.copy_from_slice(&values[NUMBERS_AT]);
        self.base = parameters(values);
        // In place, because a new plant would be built on the stack.
        let state = *self.plant.state();
        self.plant.take_up(&vehicle, &parameters(values), &state);
        self.plant.config().pace.check().map_err(|e| e.to_string())?;
        self.plant.restart(&start, &inputs(values));
        self.compare();
        self.publish(values);
        Ok(())
    }

    fn objection(&self, variable: &Variable, value: f64) -> Option<&'static str> {
        let shafts = variable.value_reference == vr::effect_driveline_compliance_compliance;
        (shafts && value != 0.0 && value < LEAST_COMPLIANCE).then_some("is neither 0 (rigid shafts) nor at least 1e-6")
    }

    fn tune(&mut self, values: &[f64]) -> Result<(), TooFast> {
        self.plant.set_effects(&self.vehicle, &parameters(values))?;
        self.compare();
        Ok(())
    }

    fn take_faults(&mut self, faults: Faults) {
        self.faults = faults;
    }

    fn take_validated(&mut self, found: Validated, values: &[f64]) {
        self.validated =
            Some(Known { found, vehicle: take_vehicle(&DESCRIPTION, values), effects: parameters(values), applies: false, near: 0 });
    }

    #[inline]
    fn step(&mut self, values: &mut [f64], h: f64) -> Result<(), TooFast> {
        self.plant.set_brake(values[at::T_brake]);
        if self.faults.is_empty() {
            self.plant.step(&inputs(values), h);
        } else {
            self.step_through_faults(values, h)?;
        }
        self.publish(values);
        Ok(())
    }

    fn save(&self, to: &mut Writer) {
        if !self.faults.is_empty() {
            walk_parameters(&mut self.base.clone(), to);
        }
        walk_parameters(&mut self.plant.config().parameters.clone(), to);
        walk_state(&mut self.plant.state().clone(), to);
        for signal in SIGNALS {
            let line = self.plant.history().line(signal).iter();
            to.word(&mut (line.len() as u64), |_| true);
            line.for_each(|(mut time, mut value)| {
                to.real(&mut time);
                to.real(&mut value);
            });
        }
    }

    fn load(&mut self, values: &[f64], from: &mut Reader) {
        if !self.faults.is_empty() {
            walk_parameters(&mut self.base, from);
        }
        let (mut parameters, mut state) = (self.plant.config().parameters, *self.plant.state());
        walk_parameters(&mut parameters, from);
        walk_state(&mut state, from);
        if !equal(&values[NUMBERS_AT], &self.numbers) {
            self.vehicle = take_vehicle(&DESCRIPTION, values);
            self.numbers.copy_from_slice(&values[NUMBERS_AT]);
        }
        self.plant.take_up(&self.vehicle, &parameters, &state);
        self.compare();
        let history = self.plant.history_mut();
        for signal in SIGNALS {
            history.clear(signal);
            let mut count = 0;
            from.word(&mut count, |n| n <= CAPACITY as u64);
            for _ in 0..count {
                let (mut time, mut value) = (0.0, 0.0);
                from.real(&mut time);
                from.real(&mut value);
                history.restore(signal, time, value);
            }
        }
    }

    fn most_words(&self) -> usize {
        2 * PARAMETERS.len() + 64 + 3 * (1 + 2 * CAPACITY)
    }

    fn event(&self, before: &dyn Fn(usize) -> f64, values: &[f64]) -> Option<Event> {
        super::model::phase_event(before(at::phase), values[at::phase])
    }
}

impl PlantModel {
    /// Steps from one change of the faults to the next. From its onset on, a fault controls its parameter, including its value among the variables.
    fn step_through_faults(&mut self, values: &mut [f64], h: f64) -> Result<(), TooFast> {
        let mut left = h;
        loop {
            let now = self.plant.state().time;
            let driven = self.faults.at(now, &self.base);
            let mut changed = false;
            for fault in self.faults.iter().filter(|fault| fault.time <= now) {
                if let Some(index) = DESCRIPTION.find(PARAMETERS[fault.parameter].value_reference) {
                    changed |= values[index] != driven[fault.parameter];
                    values[index] = driven[fault.parameter];
                }
            }
            if changed {
                self.tune(values)?;
            }
            let piece = self.faults.next_change(now) - now;
            if piece >= left {
                self.plant.step(&inputs(values), left);
                return Ok(());
            }
            self.plant.step(&inputs(values), piece);
            left -= piece;
        }
    }

    #[inline]
    fn publish(&mut self, values: &mut [f64]) {
        let o = self.plant.outputs();
        values[at::omega_f] = o.omega_f;
        values[at::omega_c] = o.omega_c;
        values[at::T_e] = o.t_e;
        values[at::T_fc] = o.t_fc;
        values[at::theta_c] = o.theta_c;
        values[at::theta_b] = o.theta_b;
        values[at::x_to_actual] = o.x_to_actual;
        values[at::E_d] = o.e_d;
        values[at::phase] = o.phase as u8 as f64;
        values[at::phase_code] = values[at::phase];
        (values[at::validity], values[at::T_fc_sigma]) = self.known(&o);
    }
}

impl PlantModel {
    /// Updates whether the plant still is the car to which a campaign's findings apply.
    fn compare(&mut self) {
        if let Some(known) = &mut self.validated {
            let config = self.plant.config();
            known.applies = config.parameters == known.effects && config.vehicle == known.vehicle;
        }
    }

    /// Validity, and σ of the clutch torque in N·m. A plant in which any number or effect differs from the retuned one has been validated nowhere.
    #[inline]
    fn known(&mut self, now: &Outputs) -> (f64, f64) {
        let Some(known) = &mut self.validated else { return (0.0, UNKNOWN_NM) };
        if !known.applies {
            return (0.0, UNKNOWN_NM);
        }
        let place = Place { slip: self.plant.slip(), theta: now.theta_c, closing: self.plant.closing(), torque: now.t_fc };
        (known.found.validity(&place, &mut known.near), known.found.sigma(&place))
    }
}

#[inline]
fn inputs(values: &[f64]) -> Inputs {
    Inputs { x_to: values[at::x_to], t_e_ref: values[at::T_e_ref], theta_h: values[at::theta_h], t_load: values[at::T_load] }
}

fn parameters(values: &[f64]) -> Parameters {
    let value = |k: usize| DESCRIPTION.find(PARAMETERS[k].value_reference).map_or(PARAMETERS[k].null, |index| values[index]);
    std::array::from_fn(value)
}

fn walk_parameters(parameters: &mut Parameters, words: &mut impl Words) {
    words.reals_within(parameters, PARAMETERS.iter().map(|p| (p.min, p.max)));
}

/// Names every field, so that a new field does not compile until it is saved, too.
fn walk_state(state: &mut State, words: &mut impl Words) {
    let State { time, y, stuck, direction, rest, engine, limited, lagged, led, bearing, memory, presliding, filtered, inputs } = state;
    let Inputs { x_to, t_e_ref, theta_h, t_load } = inputs;
    words.real(time);
    words.reals(y);
    words.reals(filtered);
    let Presliding { x, slow, quick } = presliding;
    for z in [x, slow, quick] {
        words.real(z);
    }
    words.flag(stuck);
    words.real(direction);
    let Rest { brake, car, rolling, engine: engine_stands } = rest;
    words.real(brake);
    words.real(rolling);
    words.flag(car);
    words.flag(engine_stands);
    for LagState { value, rate } in [engine, lagged] {
        words.real(value);
        words.real(rate);
    }
    let Branch { x, z } = memory;
    for x in [limited, led, bearing, x, z, x_to, t_e_ref, theta_h, t_load] {
        words.real(x);
    }
}

/// All phases, in the order of the enumerations.
pub(super) const PHASES: [Phase; 3] = [Phase::Open, Phase::Slipping, Phase::Locked];
