//! `ClutchController`: the controller behind the FMU.
//!
//! Its Real inputs accept any value, including one that is not finite: judging them is the task of the controller's guard, which the values of a failing sensor must reach.

use super::model::{Event, Model, phase_event, take_vehicle};
use super::plant::PHASES;
use super::variables::{Causality, Description, Kind, Variability, Variable};
use super::words::{Reader, Words, Writer};
use crate::control::governed::Governed;
use crate::control::guard::Guard;
use crate::control::learning::Learning;
use crate::control::load::Load;
use crate::control::observer::Estimate;
use crate::control::pi::Pi;
use crate::control::reference::Plan;
use crate::control::settings::SETTINGS;
use crate::control::state::{Mode, State};
use crate::control::temperature::Temperatures;
use crate::control::{Controller, Fault, Inputs, Outputs, Settings, Wish};
use crate::plant::pace::TooFast;
use crate::vehicle::Vehicle;

include!(concat!(env!("OUT_DIR"), "/ClutchController.rs"));

/// Its model description.
pub static DESCRIPTION: Description = Description { name: "ClutchController", guid: GUID, variables: &VARIABLES, lookup: &LOOKUP };

const MODES: [Mode; 4] = [Mode::Open, Mode::Engaging, Mode::Closed, Mode::Closing];
const FAULTS: [Fault; 5] = [Fault::None, Fault::Invalid, Fault::Jump, Fault::Frozen, Fault::Stall];

struct ControllerModel {
    controller: Controller,
    vehicle: Vehicle,
}

/// A controller for the paper's car, not yet started.
pub fn make() -> Box<dyn Model> {
    let vehicle = Vehicle::paper();
    Box::new(ControllerModel { controller: Controller::new(&vehicle, &Settings::robust()), vehicle })
}

impl Model for ControllerModel {
    fn start(&mut self, values: &mut [f64]) -> Result<(), String> {
        let vehicle = take_vehicle(&DESCRIPTION, values);
        vehicle.check().map_err(|e| e.to_string())?;
        self.vehicle = vehicle;
        self.controller = Controller::new(&vehicle, &settings(values));
        self.publish(values);
        Ok(())
    }

    fn tune(&mut self, values: &[f64]) -> Result<(), TooFast> {
        self.controller.set_settings(&settings(values));
        Ok(())
    }

    #[inline]
    fn step(&mut self, values: &mut [f64], h: f64) -> Result<(), TooFast> {
        let inputs = Inputs {
            omega_f: values[at::omega_f],
            omega_c: values[at::omega_c],
            t_e: values[at::T_e],
            theta_h: values[at::theta_h],
            engage: values[at::engage] != 0.0,
            wish: Wish {
                t_e_max: values[at::T_e_max],
                aggressiveness: values[at::aggressiveness],
                t_grade: values[at::T_grade],
                creep: values[at::creep] != 0.0,
                forget: values[at::forget] != 0.0,
            },
        };
        self.controller.step(&inputs, h);
        self.publish(values);
        Ok(())
    }

    fn save(&self, to: &mut Writer) {
        walk_settings(&mut self.controller.settings().clone(), to);
        walk_state(&mut self.controller.state().clone(), to);
    }

    fn load(&mut self, values: &[f64], from: &mut Reader) {
        let (mut settings, mut state) = (*self.controller.settings(), *self.controller.state());
        walk_settings(&mut settings, from);
        walk_state(&mut state, from);
        let vehicle = take_vehicle(&DESCRIPTION, values);
        if vehicle != self.vehicle {
            self.vehicle = vehicle;
            self.controller = Controller::new(&vehicle, &settings);
        } else if settings != *self.controller.settings() {
            self.controller.set_settings(&settings);
        }
        self.controller.set_state(&state);
    }

    fn most_words(&self) -> usize {
        SETTINGS.len() + 128
    }

    fn event(&self, before: &dyn Fn(usize) -> f64, values: &[f64]) -> Option<Event> {
        let fault = values[at::fault];
        if before(at::fault) == fault {
            return phase_event(before(at::phase), values[at::phase]);
        }
        let what = match FAULTS.iter().find(|f| **f as u8 as f64 == fault) {
            Some(Fault::Invalid) => {
                "an input is not finite or absurd: its last good value is held, and the clutch opens if it is a speed or torque and stays so"
            }
            Some(Fault::Jump) => "a speed jumped further than it can: its last good value is held, then the clutch opens",
            Some(Fault::Frozen) => "both speeds stand still while the clutch slips: the clutch opens",
            Some(Fault::Stall) => "the engine is about to stall: the clutch opens",
            _ => return Some(Event { what: "inputs are plausible again", warning: false }),
        };
        Some(Event { what, warning: true })
    }
}

impl ControllerModel {
    #[inline]
    fn publish(&self, values: &mut [f64]) {
        let o = self.controller.outputs();
        values[at::x_to] = o.x_to;
        values[at::T_fc_hat] = o.t_fc_hat;
        values[at::theta_c] = o.theta_c;
        values[at::theta_b] = o.theta_b;
        values[at::T_e_ref] = o.t_e_ref;
        values[at::x_to_fb] = o.x_to_fb;
        values[at::T_c_ref] = o.t_c_ref;
        values[at::E_d] = o.e_d;
        values[at::phase] = o.phase as u8 as f64;
        values[at::fault] = o.fault as u8 as f64;
        values[at::phase_code] = values[at::phase];
        values[at::fault_code] = values[at::fault];
        values[at::T_load_hat] = o.t_load_hat;
        values[at::touch_point_offset] = o.touch_point_offset;
        values[at::friction_factor] = o.friction_factor;
        values[at::T_brake] = o.t_brake;
    }
}

fn settings(values: &[f64]) -> Settings {
    let mut settings = Settings::robust();
    for setting in &SETTINGS {
        if let Some(index) = DESCRIPTION.find(setting.value_reference) {
            *(setting.get_mut)(&mut settings) = values[index];
        }
    }
    settings
}

fn walk_settings(settings: &mut Settings, words: &mut impl Words) {
    for s in &SETTINGS {
        words.reals_within(std::slice::from_mut((s.get_mut)(settings)), std::iter::once((s.min, s.max)));
    }
}

/// Names every field, so that a new field does not compile until it is saved, too.
fn walk_state(state: &mut State, words: &mut impl Words) {
    let State {
        mode,
        elapsed,
        plan,
        engine,
        clutch,
        feedback,
        observing,
        estimate,
        temperatures,
        last_slip,
        last_omega_c,
        soaked,
        governed,
        learning,
        guard,
        outputs,
    } = state;
    words.choice(mode, |m| m as u64, &MODES);
    for flag in [observing, soaked] {
        words.flag(flag);
    }
    let Plan { duration, omega_c_start, omega_f_start, end, slope } = plan;
    let Estimate { omega_f, t_fc } = estimate;
    let Temperatures { theta_c, theta_b } = temperatures;
    for x in [elapsed, duration, omega_c_start, omega_f_start, end, slope, omega_f, t_fc, theta_c, theta_b, last_slip, last_omega_c] {
        words.real(x);
    }
    for Pi { integral } in [engine, clutch, feedback] {
        words.real(integral);
    }
    walk_governed(governed, words);
    walk_learning(learning, words);
    walk_guard(guard, words);
    walk_outputs(outputs, words);
}

fn walk_governed(governed: &mut Governed, words: &mut impl Words) {
    let Governed {
        load,
        inertia,
        speed,
        slip,
        wanted,
        carried,
        expected,
        lacking,
        hold_back,
        slip_gone_for,
        closing_for,
        landing_for,
        bitten_for,
        engaged_for,
        from,
        slope,
        landing,
        takes_over,
        floor,
        rate,
        held,
        free_for,
    } = governed;

    words.flag(held);
    let Load { omega, torque } = load;
    for x in [
        omega,
        torque,
        hold_back,
        slip_gone_for,
        closing_for,
        landing_for,
        bitten_for,
        engaged_for,
        from,
        slope,
        &mut landing.slip,
        &mut landing.torque,
        takes_over,
        floor,
        rate,
        free_for,
    ] {
        words.real(x);
    }
    let lags = [
        &mut inertia.0[..],
        &mut speed.0[..],
        &mut slip.0[..],
        &mut wanted.0[..],
        &mut carried.0[..],
        &mut expected.0[..],
        &mut lacking.0[..],
    ];
    lags.into_iter().flatten().for_each(|x| words.real(x));
}

fn walk_learning(learning: &mut Learning, words: &mut impl Words) {
    let Learning { touch_point, friction, torque, slope, sums } = learning;
    for x in [touch_point, friction] {
        words.real(x);
    }
    [&mut torque.0[..], &mut slope.0[..], &mut sums[..]].into_iter().flatten().for_each(|x| words.real(x));
}

fn walk_guard(guard: &mut Guard, words: &mut impl Words) {
    let Guard { good, last: [last_f, last_c], started, bad_for, agree_for, unchanged_for, believed, fault } = guard;
    let Inputs { omega_f, omega_c, t_e, theta_h, engage, wish } = good;
    let Wish { t_e_max, aggressiveness, t_grade, creep, forget } = wish;
    for x in [omega_f, omega_c, t_e, theta_h, last_f, last_c, bad_for, agree_for, unchanged_for, t_e_max, aggressiveness, t_grade] {
        words.real(x);
    }
    for flag in [engage, started, believed, creep, forget] {
        words.flag(flag);
    }
    words.choice(fault, |f| f as u64, &FAULTS);
}

fn walk_outputs(outputs: &mut Outputs, words: &mut impl Words) {
    let Outputs {
        x_to,
        t_fc_hat,
        theta_c,
        theta_b,
        t_e_ref,
        x_to_fb,
        t_c_ref,
        e_d,
        phase,
        fault,
        t_load_hat,
        touch_point_offset,
        friction_factor,
        t_brake,
    } = outputs;
    for x in [x_to, t_fc_hat, theta_c, theta_b, t_e_ref, x_to_fb, t_c_ref, e_d, t_load_hat, touch_point_offset, friction_factor, t_brake] {
        words.real(x);
    }
    words.choice(phase, |p| p as u64, &PHASES);
    words.choice(fault, |f| f as u64, &FAULTS);
}
