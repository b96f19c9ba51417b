//! The plant: physics and effects, stepped through stick and slip.
//!
//! A [`Plant`] allocates its delay lines when it is created, and nothing afterwards. [`Plant::step`] holds the inputs over the step and cuts it into
//! substeps of at most [`Plant::max_substep`]; events (a delayed command arriving, contact, lock-up, break-away) cut these further, so that
//! the result does not depend on the communication step. Each substep is one Runge–Kutta step of fourth order.
//!
//! - [`config`]: vehicle and effects, compiled into constants and lists of the active effects
//! - [`clutch`]: from throwout position to torque capacity
//! - [`actuation`]: from commands to engine torque and bearing position, solved exactly
//! - [`rate_limit`]: an actuator of limited speed, and a lag behind it
//! - [`carry_over`]: transfer of the state when effects are set while the plant runs
//! - [`motion`]: the balances as rates of the state, and the Runge–Kutta step
//! - [`events`]: the stick-slip state machine
//! - [`rest`]: brakes, and a stalled engine
//! - [`pace`]: how long a substep may be
//! - [`history`]: delay lines
//! - [`sensed`]: speeds as sensed, behind filter and dead time
//! - [`saved`]: saving and restoring the state

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
use clutch::FaceCache;
use config::{Config, Coupling};
use history::{History, SIGNALS, Signal};
use motion::{Motion, index};
use pace::TooFast;
use rest::Rest;

/// Default maximum substep of the plant, s.
pub const MAX_SUBSTEP: f64 = 1e-3;

/// Inputs, held over a step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inputs {
    /// Commanded throwout position, mm.
    pub x_to: f64,
    /// Requested or reported engine torque, N·m.
    pub t_e_ref: f64,
    /// Housing air temperature, °C.
    pub theta_h: f64,
    /// Additional load torque, N·m.
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

/// Energy balance since the start, J: `work_in` = change of `stored` + `dissipated` + `losses`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Work of the engine.
    pub work_in: f64,
    /// Kinetic energy plus the elastic energy of shafts and tyres.
    pub stored: f64,
    /// Energy dissipated by the clutch, by friction and drag.
    pub dissipated: f64,
    /// Energy lost to damping and load.
    pub losses: f64,
}

/// Everything that changes while the plant runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Time since the start, s.
    pub time: f64,
    /// Continuous states, see [`motion::index`].
    pub y: Motion,
    /// Whether the clutch sticks: flywheel and disc turn as one.
    pub stuck: bool,
    /// Direction of slip, ±1, while not stuck.
    pub direction: f64,
    /// Standstill of car and engine, and the brakes.
    pub rest: Rest,
    /// Engine torque behind its lag, N·m.
    pub engine: LagState,
    /// Position behind the rate limit, mm.
    pub limited: f64,
    /// Position behind the lag, mm.
    pub lagged: LagState,
    /// Position behind the learned law of the actuator, mm.
    pub led: f64,
    /// Bearing position, behind release friction, offset and play, mm.
    pub bearing: f64,
    /// Memory of the force hysteresis.
    pub memory: clutch::Branch,
    /// Memory of the release bearing's friction.
    pub presliding: actuation::Presliding,
    /// Inputs of the last step.
    pub inputs: Inputs,
    /// Speeds of flywheel and disc behind the filters of their sensors, if there are any, rad/s.
    pub filtered: [f64; 2],
}

/// A driveline with a dry clutch.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// On the heap, because tasks with a small stack create plants too.
    config: Box<Config>,
    state: State,
    /// Cached position and radius of the faces at the end of the last substep, valid for this configuration.
    found: FaceCache,
    history: History,
    max_substep: f64,
    iterations: u64,
}

impl Plant {
    /// Creates a plant at its start values, with actuator and engine torque settled at `inputs`.
    pub fn new(vehicle: &Vehicle, effects: &Parameters, start: &Start, inputs: &Inputs) -> Self {
        Self::of(Box::new(Config::new(vehicle, effects)), start, inputs)
    }

    /// As [`Plant::new`], from a compiled configuration.
    pub(crate) fn of(config: Box<Config>, start: &Start, inputs: &Inputs) -> Self {
        let mut plant = Self {
            config,
            state: events::initial(start, inputs),
            found: FaceCache::EMPTY,
            history: History::new(),
            max_substep: MAX_SUBSTEP,
            iterations: 0,
        };
        plant.restart(start, inputs);
        plant
    }

    /// Resets the plant to time 0 and `start`, with actuator and engine torque settled at `inputs`. The effects stay set.
    pub fn restart(&mut self, start: &Start, inputs: &Inputs) {
        self.state = events::initial(start, inputs);
        for signal in SIGNALS {
            self.history.clear(signal);
        }
        actuation::rest(&self.config, &mut self.state);
        events::settle_phase(&self.config, &mut self.state);
        self.start_delay_lines(inputs.x_to);
    }

    /// Sets the slip angle between flywheel and disc in rad, which is 0 at a start: a torque that pulsates with it continues from there.
    pub fn turn_to(&mut self, slip_angle: f64) {
        self.state.y[index::ANGLE] = slip_angle;
    }

    /// Slip angle of flywheel against disc since the start, rad.
    pub fn slip_angle(&self) -> f64 {
        self.state.y[index::ANGLE]
    }

    /// Maximum substep in s; the default gives an accuracy of 1e-6, a fit may use a longer one.
    pub fn max_substep(&self) -> f64 {
        self.max_substep
    }

    /// Sets the maximum substep in s; it must be positive.
    pub fn set_max_substep(&mut self, seconds: f64) {
        debug_assert!(seconds > 0.0, "a substep must be positive");
        self.max_substep = seconds;
    }

    /// Sets all effect parameters, also while the plant runs: the states are kept, so a quantity jumps only where the physics has a jump.
    ///
    /// # Errors
    /// If the plant is too fast to be integrated; the effects that were set before then stay.
    pub fn set_effects(&mut self, vehicle: &Vehicle, effects: &Parameters) -> Result<(), TooFast> {
        let config = Config::new(vehicle, effects);
        config.pace.check()?;
        carry_over::carry_over(&self.config, &config, &mut self.state);
        *self.config = config;
        self.found = FaceCache::EMPTY;
        let held = self.state.inputs.x_to;
        self.start_delay_lines(held);
        Ok(())
    }

    /// Starts the delay line of each delayed signal with the signal's current value, and clears the lines of the others.
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

    /// Sets the greatest torque of the brakes in N·m, referred to the clutch, from the next step on; 0 means no brakes.
    pub fn set_brake(&mut self, torque: f64) {
        self.state.rest.brake = torque.max(0.0);
    }

    /// Advances by `h` seconds with the inputs held.
    pub fn step(&mut self, inputs: &Inputs, h: f64) {
        events::step(self, inputs, h);
    }

    /// Number of inner iterations of the last step: pieces integrated, and steps of the searches for contact and for switches of stick and slip.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Maximum number of inner iterations of a step of `h` seconds: the bound that a real-time bench relies on.
    pub fn most_iterations(&self, h: f64) -> u64 {
        events::substeps(self, h) as u64 * events::ITERATIONS_PER_SUBSTEP as u64
    }

    /// Corrects the speeds of flywheel and disc by `by` rad/s, as required by an observer. A stuck clutch stays stuck: both of its sides take the common correction that
    /// conserves momentum. The measurement that the observer used was the speed of the flywheel (`seen` 0) or the disc (1), as old as the delay of that sensor; the missing
    /// torques that the observer found have been changing the speeds by `rate` rad/s² since then.
    pub fn correct_speeds(&mut self, by: [f64; 2], rate: [f64; 2], seen: usize) {
        let d = &self.config.constants.driveline;
        let smoothing = [0, 1].map(|k| sensed::smoothing(&self.config, k, self.state.y[sensed::PLACES[k]]));
        let since = sensed::dead_time(&self.config, seen) + smoothing[seen];
        let common = |v: [f64; 2]| [events::common_speed([d.J_f, d.J_c], v); 2];
        let (by, rate) = if self.state.stuck { (common(by), common(rate)) } else { (by, rate) };
        events::correct_speeds(&mut self.state, by[0] + rate[0] * since, by[1] + rate[1] * since);
        let now = self.state.time;
        for (k, signal) in sensed::LINES.into_iter().enumerate() {
            // The error in the measured channel is assumed to have been growing for longer than its filter's memory; had it begun within that time, the measurement would show
            // a different size.
            let steady = |age: f64| since - smoothing[k] - age;
            let begun = |age: f64| sensed::ramp((since - age).max(0.0), smoothing[k]);
            let grown = |age: f64| rate[k] * if k == seen { steady(age) } else { begun(age) };
            self.state.filtered[k] += by[k] + grown(0.0);
            self.history.correct(signal, by[k], grown, now, sensed::dead_time(&self.config, k));
        }
    }

    /// From now on replaces the clutch's own law by a rigid coupling of flywheel and disc, or by the torque that the clutch transmits at present: for a replay whose bearing
    /// position is not known. Sides that are coupled rigidly take the common speed that conserves momentum.
    pub fn couple(&mut self, rigidly: bool) {
        if rigidly && !self.state.stuck {
            events::join(&self.config, &mut self.state);
        }
        let torque = || events::clutch_torque(&self.config, &self.found, &self.state);
        self.config.coupling = Some(if rigidly { Coupling::Rigid } else { Coupling::Torque(torque()) });
        self.state.stuck = rigidly;
    }

    /// Sets the coupling torque to the one that brings the flywheel to `omega_f` rad/s within a step of `h` seconds under these inputs.
    pub fn pass_on(&mut self, inputs: &Inputs, h: f64, omega_f: f64) {
        let state = State { inputs: *inputs, ..self.state };
        let way = actuation::way(&self.config, &state, inputs.x_to, h);
        let [begin, middle, end] = actuation::stages(&self.config, &state, inputs.x_to, h, &way);
        let t_e = (begin.t_e + 4.0 * middle.t_e + end.t_e) / 6.0;
        self.config.coupling = Some(Coupling::Torque(motion::torque_to(&self.config, &state.y, t_e, omega_f, h)));
    }

    /// Corrects the twist of elastic shafts for the `torque` in N·m that an observer found on the car's side, see [`Config::misread_twist`]. Rigid shafts have no twist.
    pub fn correct_shafts(&mut self, torque: f64) {
        self.state.y[index::TWIST] -= self.config.misread_twist(self.state.stuck) * torque;
    }

    /// Stops the car behind elastic shafts, as held by its brakes, and gives them the twist of the clutch torque alone. Rigid shafts have no twist.
    pub fn hold_car(&mut self) {
        if self.config.compliant() {
            let torque = events::clutch_torque(&self.config, &self.found, &self.state);
            self.state.y[index::OMEGA_V] = 0.0;
            self.state.y[index::TWIST] = motion::twist_under(&self.config, torque);
        }
    }

    /// Current outputs.
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

    /// Current slip ω_f − ω_c, rad/s.
    #[inline]
    pub fn slip(&self) -> f64 {
        motion::slip(&self.state.y)
    }

    /// Current closing ratio of the clutch: 0 at the true contact point, 1 at the closed point.
    #[inline]
    pub fn closing(&self) -> f64 {
        let y = &self.state.y;
        clutch::closing_after(&self.config, self.state.bearing, y[index::THETA_C], y[index::E_D])
    }

    /// Energy balance since the start.
    pub fn energy(&self) -> Energy {
        let y = &self.state.y;
        Energy {
            work_in: y[index::WORK_IN],
            stored: motion::stored_energy(&self.config, y),
            dissipated: y[index::E_D],
            losses: y[index::LOSSES],
        }
    }

    /// The state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The compiled vehicle and effects.
    pub fn config(&self) -> &Config {
        &self.config
    }
}
