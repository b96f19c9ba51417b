//! The plant: physics and effects, stepped through stick and slip.
//!
//! A [`Plant`] allocates its delay lines when it is made, and nothing after. [`Plant::step`] holds the inputs over the step and cuts it into
//! substeps of at most [`Plant::max_substep`]; events (a delayed command arriving, contact, lock-up, break-away) cut further, so that
//! the result does not depend on the communication step. Each substep is one Runge–Kutta step of fourth order.
//!
//! - [`config`]: vehicle and effects, compiled into constants and lists of what is active
//! - [`clutch`]: from throwout position to torque capacity
//! - [`actuation`]: from commands to engine torque and bearing position, solved exactly
//! - [`rate_limit`]: an actuator of limited speed, and a lag behind it
//! - [`carry_over`]: effects that are set while it runs
//! - [`motion`]: the balances as rates of the state, and the Runge–Kutta step
//! - [`events`]: the stick-slip state machine
//! - [`rest`]: brakes, and an engine that has stalled
//! - [`pace`]: how long a substep may be
//! - [`history`]: delay lines
//! - [`sensed`]: speeds behind filter and dead time

pub mod actuation;
pub mod carry_over;
pub mod clutch;
pub mod config;
pub mod events;
pub mod history;
pub mod motion;
pub mod pace;
pub mod rate_limit;
pub mod rest;
pub mod saved;
pub mod sensed;

use crate::effects::Parameters;
use crate::physics::lag::LagState;
pub use crate::physics::phase::Phase;
use crate::vehicle::Vehicle;
use clutch::Found;
use config::{Config, Coupling};
use history::{History, SIGNALS, Signal};
use motion::{Motion, index};
use pace::TooFast;
use rest::Rest;

/// Substep of the plant unless set otherwise, s.
pub const MAX_SUBSTEP: f64 = 1e-3;

/// Inputs, held over a step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inputs {
    /// Throwout position commanded, mm.
    pub x_to: f64,
    /// Engine torque asked for, or reported, N·m.
    pub t_e_ref: f64,
    /// Housing air temperature, °C.
    pub theta_h: f64,
    /// Load torque added, N·m.
    pub t_load: f64,
}

/// State at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Flywheel speed, rad/s.
    pub omega_f: f64,
    /// Disc speed, rad/s.
    pub omega_c: f64,
    /// Disc temperature, °C.
    pub theta_c: f64,
    /// Body temperature, °C.
    pub theta_b: f64,
}

/// Outputs at the present instant, with the inputs of the last step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Outputs {
    /// Flywheel speed as sensed, rad/s.
    pub omega_f: f64,
    /// Disc speed as sensed, rad/s.
    pub omega_c: f64,
    /// Engine torque as reported, N·m.
    pub t_e: f64,
    /// Clutch torque, N·m.
    pub t_fc: f64,
    /// Disc temperature, °C.
    pub theta_c: f64,
    /// Body temperature, °C.
    pub theta_b: f64,
    /// Bearing position, mm.
    pub x_to_actual: f64,
    /// Energy dissipated by the clutch since the start, J.
    pub e_d: f64,
    /// Phase.
    pub phase: Phase,
}

/// Energy books since the start, J: `work_in` = change of `stored` + `dissipated` + `losses`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Work of the engine.
    pub work_in: f64,
    /// Kinetic energy, and that of the shafts.
    pub stored: f64,
    /// Friction heat of the clutch.
    pub dissipated: f64,
    /// Damping and load.
    pub losses: f64,
}

/// Everything that changes while the plant runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Time since the start, s.
    pub time: f64,
    /// Continuous states, see [`motion::index`].
    pub y: Motion,
    /// Stuck: flywheel and disc turn as one.
    pub stuck: bool,
    /// Direction of slip, ±1, while not stuck.
    pub direction: f64,
    /// What stands still.
    pub rest: Rest,
    /// Engine torque behind its lag, N·m.
    pub engine: LagState,
    /// Position behind the rate limit, mm.
    pub limited: f64,
    /// Position behind the lag, mm.
    pub lagged: LagState,
    /// Position behind the learned law of the actuator, mm.
    pub led: f64,
    /// Position behind the play: the bearing's, mm.
    pub bearing: f64,
    /// Memory of the force hysteresis.
    pub memory: clutch::Branch,
    /// Memory of the release bearing's friction.
    pub presliding: actuation::Presliding,
    /// Inputs of the last step.
    pub inputs: Inputs,
    /// Speeds of flywheel and disc behind their sensors' filters, where there are any, rad/s.
    pub filtered: [f64; 2],
}

/// A driveline with a dry clutch.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// On the heap, for a task with a small stack makes plants too.
    config: Box<Config>,
    state: State,
    /// What the last substep found of the faces at its end, under this configuration.
    found: Found,
    history: History,
    max_substep: f64,
    iterations: u64,
}

impl Plant {
    /// A plant at rest at its start values.
    pub fn new(vehicle: &Vehicle, effects: &Parameters, start: &Start, inputs: &Inputs) -> Self {
        Self::of(Box::new(Config::new(vehicle, effects)), start, inputs)
    }

    /// As [`Plant::new`], of a configuration that stands.
    pub(crate) fn of(config: Box<Config>, start: &Start, inputs: &Inputs) -> Self {
        let mut plant = Self {
            config,
            state: events::initial(start, inputs),
            found: Found::NOTHING,
            history: History::new(),
            max_substep: MAX_SUBSTEP,
            iterations: 0,
        };
        plant.restart(start, inputs);
        plant
    }

    /// Back to time 0 at `start`; actuator and engine rest in the values of `inputs`. The effects that are set stay.
    pub fn restart(&mut self, start: &Start, inputs: &Inputs) {
        self.state = events::initial(start, inputs);
        for signal in SIGNALS {
            self.history.clear(signal);
        }
        actuation::rest(&self.config, &mut self.state);
        events::settle_phase(&self.config, &mut self.state);
        self.start_delay_lines(inputs.x_to);
    }

    /// Turns the flywheel against the disc to this slip angle in rad, which is 0 at a start: a torque that pulsates with it goes on from there.
    pub fn turn_to(&mut self, slip_angle: f64) {
        self.state.y[index::ANGLE] = slip_angle;
    }

    /// Slip angle of flywheel against disc since the start, rad.
    pub fn slip_angle(&self) -> f64 {
        self.state.y[index::ANGLE]
    }

    /// Greatest substep in s; the default serves 1e-6, a fit may take a longer one.
    pub fn max_substep(&self) -> f64 {
        self.max_substep
    }

    /// Sets the greatest substep in s; it must be positive.
    pub fn set_max_substep(&mut self, seconds: f64) {
        debug_assert!(seconds > 0.0, "a substep must be positive");
        self.max_substep = seconds;
    }

    /// Sets all effect parameters, also while running: states are kept, so nothing jumps where physics has no jump.
    ///
    /// # Errors
    /// A plant that is too fast to be followed; then the effects that were set before stay.
    pub fn set_effects(&mut self, vehicle: &Vehicle, effects: &Parameters) -> Result<(), TooFast> {
        let config = Config::new(vehicle, effects);
        config.pace.check()?;
        carry_over::carry_over(&self.config, &config, &mut self.state);
        *self.config = config;
        self.found = Found::NOTHING;
        let held = self.state.inputs.x_to;
        self.start_delay_lines(held);
        Ok(())
    }

    /// A delay line begins with the value that its signal has now, and ends with its delay.
    fn start_delay_lines(&mut self, command: f64) {
        let s = &self.state;
        let [flywheel, disc] = sensed::speeds(&self.config, s, &self.history);
        let [late_flywheel, late_disc] = [0, 1].map(|k| sensed::dead_time(&self.config, k) > 0.0);
        let lines = [
            (Signal::Command, self.config.constants.command_delay <= 0.0, command),
            (Signal::Flywheel, !late_flywheel, flywheel),
            (Signal::Disc, !late_disc, disc),
        ];
        for (signal, at_once, value) in lines {
            if at_once {
                self.history.clear(signal);
            } else if self.history.line(signal).is_empty() {
                self.history.push(signal, s.time, value);
            }
        }
    }

    /// Sets the greatest torque of the brakes in N·m at the clutch, from the next step on; 0 is no brake.
    pub fn set_brake(&mut self, torque: f64) {
        self.state.rest.brake = torque.max(0.0);
    }

    /// Advances by `h` seconds with the inputs held.
    pub fn step(&mut self, inputs: &Inputs, h: f64) {
        events::step(self, inputs, h);
    }

    /// Inner iterations of the last step: pieces integrated, and looks for a contact or a switch of stick and slip.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Inner iterations that a step of `h` seconds takes at most: the bound that a real-time bench relies on.
    pub fn most_iterations(&self, h: f64) -> u64 {
        events::substeps(self, h) as u64 * events::ITERATIONS_PER_SUBSTEP as u64
    }

    /// Moves the speeds of flywheel and disc by `by` rad/s: the correction of an observer. A stuck clutch stays stuck and takes the mean that keeps its
    /// momentum. What the observer saw was the speed of the flywheel (`seen` 0) or the disc (1), as old as that sensor is late, and torques that it found
    /// missing have been moving the speeds by `rate` rad/s² since then.
    pub fn correct_speeds(&mut self, by: [f64; 2], rate: [f64; 2], seen: usize) {
        let d = &self.config.constants.driveline;
        let smoothing = [0, 1].map(|k| sensed::smoothing(&self.config, k, self.state.y[sensed::PLACES[k]]));
        let since = sensed::dead_time(&self.config, seen) + smoothing[seen];
        let common = |v: [f64; 2]| [events::common_speed([d.J_f, d.J_c], v); 2];
        let (by, rate) = if self.state.stuck { (common(by), common(rate)) } else { (by, rate) };
        events::correct_speeds(&mut self.state, by[0] + rate[0] * since, by[1] + rate[1] * since);
        let now = self.state.time;
        for (k, signal) in sensed::LINES.into_iter().enumerate() {
            // What was seen has been growing for longer than its filter remembers: a beginning within that would show as another size.
            let steady = |age: f64| since - smoothing[k] - age;
            let begun = |age: f64| sensed::ramp((since - age).max(0.0), smoothing[k]);
            let grown = |age: f64| rate[k] * if k == seen { steady(age) } else { begun(age) };
            self.state.filtered[k] += by[k] + grown(0.0);
            self.history.correct(signal, by[k], grown, now, sensed::dead_time(&self.config, k));
        }
    }

    /// Couples flywheel and disc rigidly, or by the torque that the clutch transmits now, in place of the clutch's own law from now on: for a replay whose position is
    /// not known. Sides that become one take the speed that keeps their momentum.
    pub fn couple(&mut self, rigidly: bool) {
        if rigidly && !self.state.stuck {
            events::join(&self.config, &mut self.state);
        }
        let torque = || events::clutch_torque(&self.config, &self.found, &self.state);
        self.config.coupling = Some(if rigidly { Coupling::Rigid } else { Coupling::Torque(torque()) });
        self.state.stuck = rigidly;
    }

    /// Makes sides that are coupled by a torque pass on what brings the flywheel to `omega_f` rad/s within a step of `h` seconds under these inputs.
    pub fn pass_on(&mut self, inputs: &Inputs, h: f64, omega_f: f64) {
        let state = State { inputs: *inputs, ..self.state };
        let way = actuation::way(&self.config, &state, inputs.x_to, h);
        let [begin, middle, end] = actuation::stages(&self.config, &state, inputs.x_to, h, &way);
        let t_e = (begin.t_e + 4.0 * middle.t_e + end.t_e) / 6.0;
        self.config.coupling = Some(Coupling::Torque(motion::torque_to(&self.config, &state.y, t_e, omega_f, h)));
    }

    /// Tells twisted shafts of `torque` N·m that an observer found on the car's side, see [`Config::misread_twist`]. Rigid shafts have no twist.
    pub fn correct_shafts(&mut self, torque: f64) {
        self.state.y[index::TWIST] -= self.config.misread_twist(self.state.stuck) * torque;
    }

    /// Tells elastic shafts that the car behind them stands, held by its brakes: they carry the clutch torque alone. Rigid shafts have no twist.
    pub fn hold_car(&mut self) {
        if self.config.compliant() {
            let torque = events::clutch_torque(&self.config, &self.found, &self.state);
            self.state.y[index::OMEGA_V] = 0.0;
            self.state.y[index::TWIST] = motion::twist_under(&self.config, torque);
        }
    }

    /// Outputs now.
    pub fn outputs(&self) -> Outputs {
        let s = &self.state;
        let [omega_f, omega_c] = sensed::speeds(&self.config, s, &self.history);
        Outputs {
            omega_f: sensed::shown(&self.config, 0, omega_f),
            omega_c: sensed::shown(&self.config, 1, omega_c),
            t_e: s.inputs.t_e_ref,
            t_fc: events::clutch_torque(&self.config, &self.found, s),
            theta_c: s.y[index::THETA_C],
            theta_b: s.y[index::THETA_B],
            x_to_actual: s.bearing,
            e_d: s.y[index::E_D],
            phase: events::phase(&self.config, &self.found, s),
        }
    }

    /// Slip now, engine over disc, rad/s.
    #[inline]
    pub fn slip(&self) -> f64 {
        motion::slip(&self.state.y)
    }

    /// How far the bearing has closed the clutch now: 0 at the true contact, 1 at the closed point.
    #[inline]
    pub fn closing(&self) -> f64 {
        let y = &self.state.y;
        clutch::closing_after(&self.config, self.state.bearing, y[index::THETA_C], y[index::E_D])
    }

    /// Energy books since the start.
    pub fn energy(&self) -> Energy {
        let y = &self.state.y;
        Energy {
            work_in: y[index::WORK_IN],
            stored: motion::stored_energy(&self.config, y),
            dissipated: y[index::E_D],
            losses: y[index::LOSSES],
        }
    }

    /// The state, to look at.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The compiled vehicle and effects, to look at.
    pub fn config(&self) -> &Config {
        &self.config
    }
}
