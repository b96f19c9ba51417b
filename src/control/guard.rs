//! Plausibility check of the controller's inputs: implausible ones never reach its states.
//!
//! | fault | what is seen | what the controller does |
//! |---|---|---|
//! | invalid | an input is not finite, or beyond ±10⁴ | bridges `fault_hold` with the last good values, then opens |
//! | jump | a speed moves by more than `speed_jump` + `acceleration_max` · h | the same |
//! | frozen | both speeds keep every bit for `freeze_time` while the clutch slips | opens |
//! | stall | the engine is below `stall_speed` | asks for no torque and opens (see the controller) |
//!
//! A closed clutch stays closed while its inputs are implausible: opening the clutch of a moving car without need is the greater risk. An implausible `theta_h` is replaced by
//! its last good value without further action. So is an implausible `t_grade`, but it is reported as invalid: brakes that hold a car continue to hold it. Any other wish that
//! is NaN counts as no wish. A fault that was bridged is over at once; after an opening, inputs must be plausible for `fault_recover` before a new engagement may begin. A jump
//! whose new level persists for as long is believed.

use super::settings::Settings;

/// Inputs of the controller, held over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// Flywheel speed, rad/s.
    pub omega_f: f64,
    /// Disc speed, rad/s.
    pub omega_c: f64,
    /// Engine torque as reported, N·m.
    pub t_e: f64,
    /// Housing air, °C.
    pub theta_h: f64,
    /// Engage the clutch; false opens it.
    pub engage: bool,
    /// Further requests of the car around the controller.
    pub wish: Wish,
}

/// Requests that an importer may leave unconnected: all zero means a launch as tuned.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Wish {
    /// Greatest torque that the engine can give at present, N·m; 0 if unknown.
    pub t_e_max: f64,
    /// The launch takes 2^−aggressiveness of its nominal time; −1 to 1.
    pub aggressiveness: f64,
    /// Torque of the grade according to an inclination sensor, N·m, positive where the car would roll back; 0 if there is no sensor.
    pub t_grade: f64,
    /// Creep instead of launching.
    pub creep: bool,
    /// Resets what was learned to its start values.
    pub forget: bool,
}

impl Wish {
    /// Whether the torque of the grade is a plausible measurement.
    fn has_grade(&self) -> bool {
        self.t_grade.abs() <= PLAUSIBLE_LIMIT
    }

    /// The plausible part of the wishes: NaN becomes 0, values are limited to their ranges, and an implausible torque of the grade is replaced by the last `good` one.
    fn sane(self, good: &Self) -> Self {
        let sane = |x: f64, low: f64, high: f64| if x.is_nan() { 0.0 } else { x.max(low).min(high) };
        Self {
            t_e_max: sane(self.t_e_max, 0.0, PLAUSIBLE_LIMIT),
            aggressiveness: sane(self.aggressiveness, -1.0, 1.0),
            t_grade: if self.has_grade() { self.t_grade } else { good.t_grade },
            ..self
        }
    }
}

/// Fault of the inputs, numbered as in the FMU's enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Fault {
    /// Nothing.
    #[default]
    None = 1,
    /// An input is not finite, or beyond the plausible range.
    Invalid = 2,
    /// A speed jumped.
    Jump = 3,
    /// Both speeds are unchanged to the last bit.
    Frozen = 4,
    /// The engine is about to stall.
    Stall = 5,
}

/// Magnitude beyond which a speed in rad/s or a torque in N·m is not a plausible measurement.
const PLAUSIBLE_LIMIT: f64 = 1e4;

/// Magnitude beyond which an air temperature is not a plausible measurement, °C.
const ABSURD_TEMPERATURE: f64 = 1e3;

/// State of the guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    /// Last inputs that were believed.
    pub good: Inputs,
    /// Last speeds that came in, believed or not, rad/s.
    pub last: [f64; 2],
    /// Whether any inputs have been believed so far.
    pub started: bool,
    /// Time for which inputs have been implausible, s.
    pub bad_for: f64,
    /// Time for which consecutive inputs have been consistent with each other, s.
    pub agree_for: f64,
    /// Time for which both speeds have been unchanged to the last bit, s.
    pub unchanged_for: f64,
    /// Whether the inputs of this step are believed.
    pub believed: bool,
    /// Current fault.
    pub fault: Fault,
}

impl Guard {
    /// Guard before the first input; `theta` in °C is used as air temperature until one arrives.
    pub fn new(theta: f64) -> Self {
        Self {
            good: Inputs { omega_f: 0.0, omega_c: 0.0, t_e: 0.0, theta_h: theta, engage: false, wish: Wish::default() },
            last: [0.0; 2],
            started: false,
            bad_for: 0.0,
            agree_for: 0.0,
            unchanged_for: 0.0,
            believed: false,
            fault: Fault::None,
        }
    }

    /// Whether an engagement may begin or continue.
    pub fn trusted(&self, s: &Settings) -> bool {
        self.started && (self.fault == Fault::None || (self.fault != Fault::Frozen && self.bad_for <= s.fault_hold))
    }

    /// Checks the inputs of a step of `h` seconds; `slipping` means that the speeds should be changing.
    pub fn take(&mut self, s: &Settings, raw: &Inputs, slipping: bool, h: f64) {
        let reach = s.speed_jump + s.acceleration_max * h;
        let near = |from: [f64; 2]| (raw.omega_f - from[0]).abs() <= reach && (raw.omega_c - from[1]).abs() <= reach;
        let valid = [raw.omega_f, raw.omega_c, raw.t_e].iter().all(|x| x.abs() <= PLAUSIBLE_LIMIT);
        let same = raw.omega_f == self.last[0] && raw.omega_c == self.last[1];
        let agrees = valid && near(self.last) && !(same && self.fault == Fault::Frozen);
        self.agree_for = if agrees { self.agree_for + h } else { 0.0 };
        self.unchanged_for = if same && (slipping || self.fault == Fault::Frozen) { self.unchanged_for + h } else { 0.0 };
        if valid {
            self.last = [raw.omega_f, raw.omega_c];
        }
        let settled = self.agree_for >= s.fault_recover;
        let verdict = if !valid {
            Fault::Invalid
        } else if self.unchanged_for > s.freeze_time {
            Fault::Frozen
        } else if self.started && !near([self.good.omega_f, self.good.omega_c]) && !settled {
            Fault::Jump
        } else {
            Fault::None
        };
        self.believed = verdict == Fault::None;
        let wish = raw.wish.sane(&self.good.wish);
        if self.believed {
            self.believe(s, raw, settled);
        } else {
            self.fault = verdict;
            self.bad_for += h;
        }
        self.good.engage = raw.engage;
        self.good.wish = wish;
        // An implausible torque of the grade is only reported: speeds and torque stay trusted.
        if self.fault == Fault::None && !raw.wish.has_grade() {
            self.fault = Fault::Invalid;
        }
    }

    fn believe(&mut self, s: &Settings, raw: &Inputs, settled: bool) {
        let theta_h = if raw.theta_h.abs() <= ABSURD_TEMPERATURE { raw.theta_h } else { self.good.theta_h };
        self.good = Inputs { theta_h, ..*raw };
        self.started = true;
        let bridged = self.fault != Fault::Frozen && self.bad_for <= s.fault_hold;
        if bridged || settled {
            self.fault = Fault::None;
            self.bad_for = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds the guard with constant or with changing speeds for `seconds`.
    fn told(guard: &mut Guard, s: &Settings, slipping: bool, moving: bool, seconds: f64) {
        for k in 0..(seconds / 1e-3).round() as u32 {
            let omega_f = 100.0 + if moving { 0.01 * f64::from(k % 7 + 1) } else { 0.0 };
            guard.take(s, &Inputs { omega_f, omega_c: 20.0, t_e: 5.0, ..Guard::new(25.0).good }, slipping, 1e-3);
        }
    }

    #[test]
    fn speeds_that_stand_still_are_frozen_where_they_should_move() {
        let s = Settings { freeze_time: 0.2, fault_recover: 0.5, ..Settings::robust() };
        let mut guard = Guard::new(25.0);
        told(&mut guard, &s, false, false, 3.0);
        assert!(guard.fault == Fault::None && guard.trusted(&s), "without slip a car may stand still");
        told(&mut guard, &s, true, false, 0.19);
        assert_eq!(guard.fault, Fault::None);
        told(&mut guard, &s, true, false, 0.02);
        assert!(guard.fault == Fault::Frozen && !guard.believed && !guard.trusted(&s));
        // With the clutch open again, the speeds still do not change.
        told(&mut guard, &s, false, false, 1.0);
        assert!(guard.fault == Fault::Frozen && !guard.believed);
        told(&mut guard, &s, false, true, 0.49);
        assert_eq!(guard.fault, Fault::Frozen, "they have moved for a moment alone");
        told(&mut guard, &s, false, true, 0.02);
        assert!(guard.fault == Fault::None && guard.trusted(&s));
    }
}
