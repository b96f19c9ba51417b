//! Prior knowledge of a car and its logger, before any recording is used: a normal prior for every number around its value in the vehicle file.
//!
//! `tolerance` of `vehicle.json` gives one standard deviation of each number, absolute or relative, by which a real car differs. What a logger and a car do beyond that, and no
//! file declares, has the documented [`defaults`].

use crate::effects::{self, Act, PARAMETERS, Parameters, REGISTRY, param};
use crate::vehicle::{NUMBERS, Vehicle};
use serde_json::Value;

/// A signal that may be late, or early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Flywheel speed.
    OmegaF,
    /// Disc speed.
    OmegaC,
    /// Torque report: an input.
    Report,
    /// Position command: an input.
    Command,
}

/// A number that may differ from the vehicle file (nuisance parameter); its value is measured in standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct Nuisance {
    /// Name in `tolerance`, or of a default.
    pub name: String,
    /// One standard deviation, in the number's unit, or relative.
    pub sigma: f64,
    /// Whether `sigma` is relative.
    pub relative: bool,
    /// Whether only positive values occur: a sensor may be late, never early.
    pub one_sided: bool,
    /// Whether the vehicle file declares it; the rest are defaults.
    pub declared: bool,
    target: Target,
}

#[derive(Clone, Debug, PartialEq)]
enum Target {
    /// Numbers of the vehicle that move together.
    Numbers(Vec<usize>),
    /// An effect parameter stands for it: the plant has no number of that name.
    Effect(usize),
    /// Latency of a signal, s.
    Late(Signal),
}

/// A disturbance that comes and goes: standard deviation and correlation time of a first-order Gauss–Markov process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wander {
    /// Standard deviation.
    pub sigma: f64,
    /// Correlation time, s.
    pub time_s: f64,
}

/// All tolerances of a car and its logger.
#[derive(Clone, Debug)]
pub struct Tolerances {
    /// Numbers that all recordings share.
    pub shared: Vec<Nuisance>,
    /// Numbers that each recording has separately.
    pub own: Vec<Nuisance>,
    /// Slow error of the torque report, N·m.
    pub report: Wander,
    /// That error if the file declares it; otherwise its standard deviation is 0.
    pub declared_report: Wander,
}

/// Number of standard deviations of a latency within which a late sensor counts as normal. Half the square of this number is the price of an effect in nats (the odds of
/// `infer/prior.rs`).
pub const LATE_SIGMAS: f64 = 3.0;

impl Tolerances {
    /// Largest difference between the latencies of the two speeds that the tolerances allow, s.
    pub fn skew(&self) -> f64 {
        let latencies = self.shared.iter().filter(|n| n.name.ends_with("_latency"));
        LATE_SIGMAS * latencies.map(|n| n.sigma.powi(2)).sum::<f64>().sqrt()
    }
}

/// How recordings were logged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Logger {
    /// Typical interval, s.
    pub interval_s: f64,
    /// Whether it is not synchronous with the control unit: its stamps jitter, or it is slower than the control unit.
    pub loose: bool,
}

impl Logger {
    /// The logger of a bench: 100 Hz, synchronous with the control unit.
    pub const UNIFORM: Self = Self { interval_s: 0.01, loose: false };
}

/// Why a tolerance cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ToleranceError {
    /// The vehicle has no number of that name.
    #[error(
        "tolerance \"{0}\" names no number of the vehicle; correct its name or remove it, `kisspoint vehicle new` lists names that serve"
    )]
    Unknown(String),
    /// Not exactly one of `abs` and `rel`, or not positive.
    #[error("tolerance \"{0}\" needs one positive number, \"abs\" or \"rel\"")]
    Malformed(String),
    /// The slow error of the torque report lacks `abs` or `time_s`.
    #[error("tolerance \"{0}\" needs \"abs\" and \"time_s\", both positive")]
    Wander(String),
    /// Relative to a number that is 0.
    #[error("tolerance \"{0}\" is relative to a number that is 0, and allows nothing; give \"abs\", in the number's unit")]
    OfZero(String),
    /// `per` is something other than `"recording"`.
    #[error("tolerance \"{0}\": \"per\" can only be \"recording\"")]
    Per(String),
}

/// Defaults for what no file declares: how far logger and car are trusted beyond their tolerances.
pub mod defaults {
    /// Slow error of the torque report, N·m, and its correlation time, s: an engine controller's model of torque is hardly better.
    pub const REPORT: super::Wander = super::Wander { sigma: 0.15, time_s: 1.0 };
    /// Bias of the torque report from recording to recording, N·m.
    pub const REPORT_DRIFT_NM: f64 = 0.3;
    /// Change of friction from recording to recording, relative.
    pub const FRICTION_DRIFT: f64 = 0.004;
    /// Error of the time of a torque report, s, which passes through a bus and a filter.
    pub const REPORT_TIMING_S: f64 = 0.008;
    /// Timing errors of command and speeds, in intervals of the logger.
    pub const TIMING_INTERVALS: f64 = 0.1;
    /// Timing error of the command, in intervals of a logger that is not synchronous with the control unit, because such a logger does not show when a command changed between two
    /// samples.
    pub const LOOSE_TIMING_INTERVALS: f64 = 0.2;
    /// Time constant of a lag between the torque report and the engine's torque, s: as uncertain as the report's timing.
    pub const REPORT_SMOOTHING_S: f64 = REPORT_TIMING_S;
    /// Time constant of a lag behind the command, in intervals of a logger that is not synchronous with the control unit, because the command may have taken any course between two
    /// samples.
    pub const LOOSE_SMOOTHING_INTERVALS: f64 = 0.5;
}

/// Reads the tolerances of a vehicle document, in the order of their names, and adds the defaults for this logger.
///
/// # Errors
/// A tolerance that names no number, has no positive size, or is relative to a number that is 0.
pub fn read(vehicle: &Value, logger: Logger) -> Result<Tolerances, ToleranceError> {
    let mut all =
        Tolerances { shared: Vec::new(), own: Vec::new(), report: defaults::REPORT, declared_report: Wander { sigma: 0.0, time_s: 1.0 } };
    let mut entries: Vec<(&String, &Value)> = vehicle.get("tolerance").and_then(Value::as_object).into_iter().flatten().collect();
    entries.sort_by(|a, b| a.0.cmp(b.0));
    let car = Vehicle::from_value(vehicle).ok().map(|v| Car::nominal(&v));
    for (name, size) in entries {
        if name == "engine.T_e_wander" {
            all.report = wander(name, size)?;
            all.declared_report = all.report;
            continue;
        }
        let one = nuisance(name, size)?;
        if car.as_ref().is_some_and(|car| one.allows_nothing(car)) {
            return Err(ToleranceError::OfZero(name.clone()));
        }
        match size.get("per").map(|p| p.as_str() == Some("recording")) {
            None => all.shared.push(one),
            Some(true) => all.own.push(one),
            Some(false) => return Err(ToleranceError::Per(name.clone())),
        }
    }
    let late = |name: &str, signal, sigma| Nuisance {
        name: name.to_owned(),
        sigma,
        relative: false,
        one_sided: false,
        declared: false,
        target: Target::Late(signal),
    };
    let timing = defaults::TIMING_INTERVALS * logger.interval_s;
    let command = if logger.loose { defaults::LOOSE_TIMING_INTERVALS * logger.interval_s } else { timing };
    let smooth = |name: &str, sigma| Nuisance {
        one_sided: true,
        target: target(name).expect("it is one of ours"),
        ..late(name, Signal::Command, sigma)
    };
    let smoothing = if logger.loose { defaults::LOOSE_SMOOTHING_INTERVALS * logger.interval_s } else { timing };
    let logger = [
        smooth("engine.T_e_smoothing", defaults::REPORT_SMOOTHING_S.max(command)),
        smooth("actuator.command_smoothing", smoothing),
        late("sensors.omega_f_latency", Signal::OmegaF, timing),
        late("sensors.omega_c_latency", Signal::OmegaC, timing),
        late("engine.T_e_timing", Signal::Report, defaults::REPORT_TIMING_S.max(command)),
        late("actuator.command_timing", Signal::Command, command),
    ];
    for one in logger {
        if !all.shared.iter().chain(&all.own).any(|n| n.name == one.name) {
            all.shared.push(one);
        }
    }
    let drift = |name: &str, of: &str, sigma, relative| {
        let target = target(of).expect("a number that every vehicle has");
        Nuisance { name: name.to_owned(), sigma, relative, one_sided: false, declared: false, target }
    };
    for (drift, of) in [
        (drift("engine.T_e_drift", "engine.T_e_bias", defaults::REPORT_DRIFT_NM, false), "engine.T_e_bias"),
        (drift("friction.mu_drift", "friction.mu", defaults::FRICTION_DRIFT, true), "friction.mu"),
    ] {
        if !all.own.iter().any(|n| n.name == of) {
            all.own.push(drift);
        }
    }
    Ok(all)
}

fn positive(size: &Value, key: &str) -> Option<f64> {
    size.get(key).and_then(Value::as_f64).filter(|x| *x > 0.0 && x.is_finite())
}

fn wander(name: &str, size: &Value) -> Result<Wander, ToleranceError> {
    let both = positive(size, "abs").zip(positive(size, "time_s"));
    both.map(|(sigma, time_s)| Wander { sigma, time_s }).ok_or_else(|| ToleranceError::Wander(name.to_owned()))
}

fn nuisance(name: &str, size: &Value) -> Result<Nuisance, ToleranceError> {
    let (sigma, relative) = match (size.get("abs"), size.get("rel")) {
        (Some(_), None) => (positive(size, "abs"), false),
        (None, Some(_)) => (positive(size, "rel"), true),
        _ => (None, false),
    };
    let sigma = sigma.ok_or_else(|| ToleranceError::Malformed(name.to_owned()))?;
    let target = target(name).ok_or_else(|| ToleranceError::Unknown(name.to_owned()))?;
    // A sensor may be late, never early.
    let one_sided = name.ends_with("_latency");
    Ok(Nuisance { name: name.to_owned(), sigma, relative, one_sided, declared: true, target })
}

fn target(name: &str) -> Option<Target> {
    let group =
        |names: &[&str]| names.iter().map(|n| NUMBERS.iter().position(|m| m.name == *n)).collect::<Option<Vec<_>>>().map(Target::Numbers);
    match name {
        "engine.T_e_bias" => Some(Target::Effect(param::engine_torque_bias::torque)),
        "engine.T_e_gain" => Some(Target::Effect(param::engine_torque_gain::gain)),
        "driveline.grade" => Some(Target::Effect(param::road_load::grade)),
        "sensors.omega_f_latency" => Some(Target::Effect(param::engine_speed_delay::delay)),
        "sensors.omega_c_latency" => Some(Target::Effect(param::clutch_speed_delay::delay)),
        "engine.T_e_smoothing" => Some(Target::Effect(param::engine_torque_lag::time_constant)),
        "actuator.command_smoothing" => Some(Target::Effect(param::actuator_lag::time_constant)),
        "engine.T_e_timing" => Some(Target::Late(Signal::Report)),
        "actuator.command_timing" => Some(Target::Late(Signal::Command)),
        // μ of eq. (4) is linear in these, so that one factor on all is a factor on μ.
        "friction.mu" => group(&["friction.mu_0", "friction.alpha_1", "friction.m_0", "friction.m_1", "friction.m_2"]),
        "cushion_spring.beta" => group(&["cushion_spring.beta_1", "cushion_spring.beta_2", "cushion_spring.beta_3"]),
        "actuator.x_cnt" => group(&["actuator.x_cnt_0"]),
        "actuator.x_cls" => group(&["actuator.x_cls_0"]),
        _ => group(&[name]),
    }
}

/// A car at a point of the prior, and the latencies of its signals, s.
#[derive(Clone, Copy, Debug)]
pub struct Car {
    /// Numbers of the vehicle.
    pub vehicle: Vehicle,
    /// Parameters of the effects.
    pub effects: Parameters,
    /// Latency of each [`Signal`], s.
    pub late: [f64; 4],
}

impl Car {
    /// The car as the vehicle file gives it, without effects.
    pub fn nominal(vehicle: &Vehicle) -> Self {
        Self { vehicle: *vehicle, effects: effects::null(), late: [0.0; 4] }
    }

    /// Whether its clutch torque pulsates.
    pub fn pulsates(&self) -> bool {
        let amplitudes = REGISTRY.iter().filter(|e| matches!(e.effect.act, Act::Pulsation(_))).flat_map(|e| e.effect.amplitudes);
        amplitudes.into_iter().any(|&k| self.effects[k] != PARAMETERS[k].null)
    }

    /// Moves the numbers by `z` standard deviations; for relative ones, their logarithms.
    pub fn apply(&mut self, nuisances: &[Nuisance], z: &[f64]) {
        for (n, z) in nuisances.iter().zip(z).filter(|(_, z)| **z != 0.0) {
            let moved = |value: f64| if n.relative { value * (n.sigma * z).exp() } else { value + n.sigma * z };
            match &n.target {
                Target::Effect(k) => self.effects[*k] = moved(self.effects[*k]),
                Target::Late(signal) => self.late[*signal as usize] += n.sigma * z,
                Target::Numbers(numbers) => {
                    for &k in numbers {
                        let slot = (NUMBERS[k].get_mut)(&mut self.vehicle);
                        *slot = moved(*slot);
                    }
                }
            }
        }
    }
}

impl Nuisance {
    /// Whether it is relative to numbers that are all 0, so that it allows no deviation.
    fn allows_nothing(&self, car: &Car) -> bool {
        self.relative
            && match &self.target {
                Target::Numbers(numbers) => numbers.iter().all(|&k| (NUMBERS[k].get)(&car.vehicle) == 0.0),
                Target::Effect(k) => car.effects[*k] == 0.0,
                Target::Late(_) => true,
            }
    }

    /// The effect parameter, if there is one, that changes the car in exactly the same way as this number.
    fn parameter(&self) -> Option<usize> {
        Some(match self.name.as_str() {
            "engine.T_e_bias" | "engine.T_e_drift" => param::engine_torque_bias::torque,
            "engine.T_e_gain" => param::engine_torque_gain::gain,
            // The torque is the product of force and friction, so a factor on either does the same.
            "friction.mu" | "friction.mu_drift" | "cushion_spring.beta" => param::friction_level::factor,
            "actuator.x_cnt" => param::kiss_point_offset::offset,
            "actuator.x_cls" => param::kiss_point_offset::closed_offset,
            "driveline.T_L0" => param::road_load::rolling_torque,
            "driveline.J_c" => param::vehicle_mass::factor,
            "driveline.grade" => param::road_load::grade,
            "sensors.omega_f_latency" if self.declared => param::engine_speed_delay::delay,
            "sensors.omega_c_latency" if self.declared => param::clutch_speed_delay::delay,
            "engine.T_e_smoothing" => param::engine_torque_lag::time_constant,
            "actuator.command_smoothing" => param::actuator_lag::time_constant,
            "thermal.gamma_1" => param::clutch_cooling::body_factor,
            "thermal.gamma_2" => param::clutch_cooling::air_factor,
            _ => return None,
        })
    }

    /// Index of the effect parameter that does the same as this number, and how far it moves for one standard deviation at this car.
    pub fn same_as(&self, car: &Car) -> Option<(usize, f64)> {
        let k = self.parameter()?;
        let rate = match &self.target {
            Target::Late(_) => return None,
            Target::Numbers(_) if PARAMETERS[k].null == 1.0 && !self.relative => return None,
            _ if !self.relative => self.sigma,
            Target::Numbers(numbers) if PARAMETERS[k].null != 1.0 => self.sigma * (NUMBERS[numbers[0]].get)(&car.vehicle),
            _ => self.sigma * car.effects[k],
        };
        Some((k, rate))
    }

    /// Transfers a deviation of `z` standard deviations to the effect parameter that does the same, for a car to which this nuisance is not applied. Returns whether there is such
    /// a parameter.
    pub fn hand_over(&self, z: f64, car: &mut Car) -> bool {
        let Some((k, rate)) = self.same_as(car) else { return false };
        let grown = if self.relative { ((self.sigma * z).exp() - 1.0) / self.sigma } else { z };
        car.effects[k] = (car.effects[k] + rate * grown).clamp(PARAMETERS[k].min, PARAMETERS[k].max);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read_of(tolerance: Value, logger: Logger) -> Result<Tolerances, ToleranceError> {
        read(&json!({ "tolerance": tolerance }), logger)
    }

    fn sigma(t: &Tolerances, name: &str) -> f64 {
        t.shared.iter().chain(&t.own).find(|n| n.name == name).unwrap_or_else(|| panic!("no {name}")).sigma
    }

    #[test]
    fn what_no_file_declares_depends_on_the_logger() {
        let bench = read_of(json!({}), Logger::UNIFORM).unwrap();
        let slow = read_of(json!({}), Logger { interval_s: 0.1, loose: true }).unwrap();
        for (name, of_bench, of_slow) in [
            ("engine.T_e_smoothing", 0.008, 0.02),
            ("actuator.command_smoothing", 0.001, 0.05),
            ("sensors.omega_f_latency", 0.001, 0.01),
            ("sensors.omega_c_latency", 0.001, 0.01),
            ("engine.T_e_timing", 0.008, 0.02),
            ("actuator.command_timing", 0.001, 0.02),
            ("engine.T_e_drift", 0.3, 0.3),
            ("friction.mu_drift", 0.004, 0.004),
        ] {
            assert!((sigma(&bench, name) - of_bench).abs() < 1e-12 && (sigma(&slow, name) - of_slow).abs() < 1e-12, "{name}");
        }
        assert!(bench.shared.iter().chain(&bench.own).all(|n| !n.declared && n.one_sided == n.name.ends_with("_smoothing")));
        assert_eq!((bench.shared.len(), bench.own.len(), bench.declared_report.sigma), (6, 2, 0.0));
        assert!((bench.skew() - 3.0 * 0.001 * 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_a_file_declares_takes_the_place_of_a_default() {
        let file = json!({
            "sensors.omega_f_latency": {"abs": 0.004}, "friction.mu": {"rel": 0.01, "per": "recording"}, "engine.T_e_bias": {"abs": 1.0},
            "engine.T_e_wander": {"abs": 0.5, "time_s": 2.0},
        });
        let t = read_of(file, Logger::UNIFORM).unwrap();
        let declared: Vec<&str> = t.shared.iter().filter(|n| n.declared).map(|n| n.name.as_str()).collect();
        assert_eq!(declared, ["engine.T_e_bias", "sensors.omega_f_latency"]);
        assert_eq!(t.own.iter().map(|n| n.name.as_str()).collect::<Vec<_>>(), ["friction.mu", "engine.T_e_drift"]);
        assert_eq!((t.report, t.declared_report), (Wander { sigma: 0.5, time_s: 2.0 }, Wander { sigma: 0.5, time_s: 2.0 }));
        assert!(t.shared.iter().find(|n| n.name == "sensors.omega_f_latency").unwrap().one_sided);
        let fault = |name: &str, size: Value| read_of(json!({ name: size }), Logger::UNIFORM).unwrap_err();
        assert_eq!(fault("friction.nu", json!({"abs": 1.0})), ToleranceError::Unknown("friction.nu".into()));
        for size in [json!({}), json!({"abs": 0.0}), json!({"abs": -1.0}), json!({"abs": 1.0, "rel": 0.1}), json!({"rel": "1"})] {
            assert_eq!(fault("friction.mu", size), ToleranceError::Malformed("friction.mu".into()));
        }
        assert_eq!(fault("friction.mu", json!({"rel": 0.1, "per": "car"})), ToleranceError::Per("friction.mu".into()));
        assert_eq!(fault("engine.T_e_wander", json!({"abs": 0.5})), ToleranceError::Wander("engine.T_e_wander".into()));
    }

    /// A relative tolerance of a number that is 0 allows nothing; one of several numbers that move together may be 0.
    #[test]
    fn a_tolerance_relative_to_nothing_is_refused() {
        let mut document = Vehicle::paper().to_value();
        document["driveline"]["b_c"] = json!(0.0);
        document["friction"]["alpha_1"] = json!(0.0);
        let mut read_of = |name: &str, size: Value| {
            document["tolerance"] = json!({ name: size });
            read(&document, Logger::UNIFORM).err()
        };
        for name in ["driveline.b_c", "engine.T_e_bias", "driveline.grade", "sensors.omega_c_latency", "engine.T_e_timing"] {
            assert_eq!(read_of(name, json!({"rel": 0.02})), Some(ToleranceError::OfZero(name.into())));
            assert_eq!(read_of(name, json!({"abs": 0.02})), None);
        }
        for name in ["friction.mu", "engine.T_e_gain", "driveline.J_c"] {
            assert_eq!(read_of(name, json!({"rel": 0.02})), None, "{name}");
        }
    }

    /// Moving the effect parameter by the rate does the same as moving the number by one standard deviation; handing over gives the parameter its equivalent value.
    #[test]
    fn an_effect_that_does_the_same_as_a_tolerance_takes_it_over() {
        let file = json!({
            "driveline.J_c": {"rel": 0.05}, "friction.mu": {"rel": 0.02}, "engine.T_e_bias": {"abs": 2.0}, "driveline.grade": {"abs": 0.01},
            "actuator.x_cnt": {"abs": 0.05}, "thermal.gamma_1": {"rel": 0.1}, "driveline.T_L0": {"abs": 3.0}, "driveline.J_f": {"rel": 0.02},
        });
        let vehicle = Vehicle::paper();
        let all = read_of(file, Logger::UNIFORM).unwrap().shared;
        let one = |name: &str| all.iter().find(|n| n.name == name).unwrap();
        for (name, parameter, z, to) in [
            ("driveline.J_c", param::vehicle_mass::factor, 2.0, (0.1_f64).exp()),
            ("friction.mu", param::friction_level::factor, -1.5, (-0.03_f64).exp()),
            ("engine.T_e_bias", param::engine_torque_bias::torque, 1.5, 3.0),
            ("driveline.grade", param::road_load::grade, -2.0, -0.02),
            ("actuator.x_cnt", param::kiss_point_offset::offset, 2.0, 0.1),
            ("driveline.T_L0", param::road_load::rolling_torque, 1.0, 3.0),
        ] {
            let mut car = Car::nominal(&vehicle);
            let (k, rate) = one(name).same_as(&car).unwrap();
            assert_eq!(k, parameter);
            assert!((rate - one(name).sigma).abs() < 1e-12, "{name}: {rate}");
            assert!(one(name).hand_over(z, &mut car));
            assert!((car.effects[parameter] - to).abs() < 1e-9, "{name}: {} {to}", car.effects[parameter]);
        }
        // Each of these has an equivalent effect parameter, which one standard deviation, relative or absolute, moves by its own size.
        let names = [
            ("engine.T_e_gain", "rel", param::engine_torque_gain::gain),
            ("cushion_spring.beta", "rel", param::friction_level::factor),
            ("actuator.x_cls", "abs", param::kiss_point_offset::closed_offset),
            ("thermal.gamma_1", "rel", param::clutch_cooling::body_factor),
            ("thermal.gamma_2", "rel", param::clutch_cooling::air_factor),
            ("sensors.omega_f_latency", "abs", param::engine_speed_delay::delay),
            ("sensors.omega_c_latency", "abs", param::clutch_speed_delay::delay),
            ("engine.T_e_smoothing", "abs", param::engine_torque_lag::time_constant),
            ("actuator.command_smoothing", "abs", param::actuator_lag::time_constant),
        ];
        for (name, kind, parameter) in names {
            let n = read_of(json!({ name: { kind: 0.01 } }), Logger::UNIFORM).unwrap().shared.into_iter().find(|n| n.name == name).unwrap();
            assert_eq!(n.same_as(&Car::nominal(&vehicle)), Some((parameter, 0.01)), "{name}");
        }
        // No factor is equivalent to an absolute tolerance; a relative tolerance of the contact position moves the offset by its share of the position.
        let absolute = read_of(json!({"driveline.J_c": {"abs": 0.1}, "actuator.x_cnt": {"rel": 0.1}}), Logger::UNIFORM).unwrap().shared;
        assert_eq!(absolute[1].same_as(&Car::nominal(&vehicle)), None);
        assert_eq!(absolute[0].same_as(&Car::nominal(&vehicle)), Some((param::kiss_point_offset::offset, 0.1 * vehicle.actuator.x_cnt_0)));
        let mut car = Car::nominal(&vehicle);
        assert!(!one("driveline.J_f").hand_over(1.0, &mut car) && one("engine.T_e_timing").same_as(&car).is_none());
        car.apply(&[one("driveline.J_f").clone(), one("driveline.T_L0").clone(), one("engine.T_e_timing").clone()], &[-1.0, 2.0, 0.5]);
        assert!((car.vehicle.driveline.J_f / vehicle.driveline.J_f - (-0.02_f64).exp()).abs() < 1e-12);
        assert!((car.vehicle.driveline.T_L0 - vehicle.driveline.T_L0 - 6.0).abs() < 1e-12);
        assert!((car.late[Signal::Report as usize] - 0.004).abs() < 1e-12);
    }
}
