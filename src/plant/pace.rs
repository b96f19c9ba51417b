//! How long a substep may be, and which plants are too fast to be integrated.
//!
//! A Runge–Kutta step of fourth order is stable while λ h < 2.8, where λ is the fastest rate of the plant. λ is bounded by the sum of the rates at which each part would settle
//! alone (the trace of the system matrix), with the slopes of friction and load taken as difference quotients where they are steepest. For a car λ is some hundred per second,
//! and a substep is as long as requested; a small inertia behind steep friction shortens it, and so do elastic shafts. For a fit that requests more than [`MAX_SUBSTEP`], a
//! stability limit above [`MAX_SUBSTEP`] does not shorten the substep: the fit itself is responsible for resolving friction. [`SHORTEST_SUBSTEP`] bounds the work of a step; a
//! plant that would be unstable even then is [`TooFast`].

use super::MAX_SUBSTEP;
use super::clutch::{self, Branch, FaceCache};
use super::config::Config;
use super::motion;
use crate::effects::empirical;

/// Shortest substep to which the rates of a plant can shorten it, s: it bounds the work of a step.
pub const SHORTEST_SUBSTEP: f64 = 2e-5;

/// Upper limit of the shafts' rate times the substep: their oscillation is resolved, not only kept stable. A fit that requests more than [`MAX_SUBSTEP`] has a higher limit,
/// with an error of half a percent of phase and amplitude per radian.
const TURN_PER_SUBSTEP: f64 = 0.5;
const TURN_PER_SUBSTEP_OF_A_FIT: f64 = 1.0;

/// Speed for which the rate of a tyre is computed, rad/s: the greatest at which the tyre is resolved.
const TOP_SPEED: f64 = 300.0;

/// Upper limit of a pulsation's phase advance per substep, rad.
const PULSE_PER_SUBSTEP: f64 = 0.1;

/// Upper limits of the fastest rate times the substep. Above `STABLE` a step is no longer stable. `FOLLOWED` holds for a simulation, which also resolves decaying motions:
/// otherwise the stages overshoot, and their friction work is not that of the motion. `STABLE` suffices for a fit, and for a plant that needs the shortest substep.
const STABLE: f64 = 2.5;
const FOLLOWED: f64 = 1.0;

/// Rates at which the parts of a plant settle, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Flywheel, disc, vehicle behind the shafts, twist of the shafts; the latter two are 0 while the shafts are rigid.
    motion: [f64; 4],
    /// Disc, body.
    heat: [f64; 2],
    /// Greatest phase advance of the torque pulsations per radian of slip angle, of engine angle and of input-shaft angle.
    orders: [f64; 3],
}

/// Part of the plant that each rate belongs to, and what makes it fast.
const PARTS: [(&str, &str); 6] = [
    ("the flywheel", "driveline.J_f is small for driveline.b_f and the friction's slope over slip"),
    ("the disc", "driveline.J_c is small for its damping, its load's slope over speed and the friction's slope over slip"),
    ("the vehicle behind the shafts", "driveline.J_c is small for its damping, its load's slope over speed and the shafts' damping"),
    ("the twist of the shafts", "driveline.J_c is small for the shafts' compliance"),
    ("the heat of the disc", "thermal.C_1 is small for thermal.gamma_1 and thermal.gamma_2"),
    ("the heat of the body", "thermal.C_b is small for thermal.gamma_1 and thermal.gamma_2"),
];

/// A plant with a part that is faster than the shortest substep can follow.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{part} settles within {time:.1e} s, which the plant's shortest substep of {SHORTEST_SUBSTEP} s cannot follow: {reason}")]
pub struct TooFast {
    /// Part of the plant.
    pub part: &'static str,
    /// Its time constant, s.
    pub time: f64,
    /// Parameters that make it fast.
    pub reason: &'static str,
}

impl Pace {
    /// Pace of a plant that does not move: all rates are 0.
    pub const STILL: Self = Self { motion: [0.0; 4], heat: [0.0; 2], orders: [0.0; 3] };

    /// Rates of a plant; the slopes are those of a closed clutch, cold and warm, from standstill to top speed.
    pub fn of(config: &Config) -> Self {
        let c = &config.constants;
        let (slip, load) = (steepest_friction(config), steepest_load(config));
        let engine = if config.empirical.engine { empirical::steepest_engine(&config.parameters) } else { 0.0 };
        let disc = config.disc_inertia();
        let (behind, shafts, vehicle) = if config.compliant() {
            let beyond = c.driveline.J_c - disc;
            let reduced = disc * beyond / c.driveline.J_c;
            let shafts = (1.0 / ((c.compliance + c.tyre.softness) * reduced)).sqrt().max(c.shaft_damping / reduced);
            // The deflection of a tyre decays over a rolled angle.
            let shafts = if c.tyre.softness > 0.0 { shafts + TOP_SPEED / c.tyre.relaxation } else { shafts };
            (c.shaft_damping, shafts, (c.shaft_damping + load) / beyond)
        } else {
            (load, 0.0, 0.0)
        };
        let t = &c.thermal;
        // Friction that depends on the faces' temperature may make that temperature settle a few times as fast.
        let surface = if c.surface.resistance > 0.0 { 3.0 / c.surface.time_constant } else { 0.0 };
        Self {
            motion: [(c.driveline.b_f + engine + slip) / c.driveline.J_f, (behind + slip) / disc, vehicle, shafts],
            heat: [t.gamma_1.max(t.gamma_2) / t.C_1 + surface, (t.gamma_1 + 2.0 * t.gamma_2) / t.C_b],
            orders: fastest_pulsations(config),
        }
    }

    /// Upper bound of the fastest rate, 1/s.
    #[inline]
    fn fastest(&self) -> f64 {
        self.motion.iter().sum::<f64>().max(self.heat.iter().sum())
    }

    /// Longest admissible substep in s if `most` is requested.
    #[inline]
    pub fn longest_substep(&self, most: f64) -> f64 {
        let shafts = self.motion[3];
        let turn = if most > MAX_SUBSTEP { TURN_PER_SUBSTEP_OF_A_FIT } else { TURN_PER_SUBSTEP };
        // No division by zero: an importer may trap it.
        let turning = if shafts > 0.0 { turn / shafts } else { f64::MAX };
        let stable = if most > MAX_SUBSTEP { STABLE } else { FOLLOWED } / self.fastest();
        let longest = if stable < MAX_SUBSTEP { turning.min(stable) } else { turning };
        most.min(longest.max(SHORTEST_SUBSTEP))
    }

    /// Longest substep in s that resolves torque pulsations with the angles of flywheel and disc at these speeds in rad/s, if `most` is requested; `f64::MAX` if they do not
    /// limit it.
    #[inline]
    pub fn pulse(&self, [omega_f, omega_c]: [f64; 2], most: f64) -> f64 {
        let [slip, engine, input] = self.orders;
        let rate = slip * (omega_f - omega_c).abs() + engine * omega_f.abs() + input * omega_c.abs();
        let turn = if most > MAX_SUBSTEP { TURN_PER_SUBSTEP_OF_A_FIT } else { PULSE_PER_SUBSTEP };
        if rate * most > turn { (turn / rate).max(SHORTEST_SUBSTEP) } else { f64::MAX }
    }

    /// Whether the shortest substep is short enough.
    ///
    /// # Errors
    /// The fastest part, if it is not.
    pub fn check(&self) -> Result<(), TooFast> {
        let rate = self.fastest();
        if rate * SHORTEST_SUBSTEP <= STABLE {
            return Ok(());
        }
        let all = self.motion.iter().chain(&self.heat).zip(PARTS);
        let (_, (part, reason)) = all.fold((&0.0, PARTS[0]), |most, one| if one.0 > most.0 { one } else { most });
        Err(TooFast { part, time: 1.0 / rate, reason })
    }
}

/// Greatest slope of the clutch torque over slip, N·m·s/rad.
fn steepest_friction(config: &Config) -> f64 {
    const SLIPS: [f64; 10] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 150.0];
    // The temperature range in which the equations are valid, from end to end.
    const TEMPERATURES: [f64; 4] = [-20.0, 25.0, 120.0, 250.0];
    let mut most = 0.0_f64;
    for theta in TEMPERATURES {
        let y = motion::warm(theta);
        let closed = crate::physics::map::contact(&config.vehicle.actuator, theta).x_cls;
        let found = FaceCache::EMPTY.with_position(config, closed, &y);
        let torque = |slip| clutch::slipping(config, &found, closed, Branch { x: closed, z: 1.0 }, 1.0, slip, &y).total();
        let tabled = config.empirical.friction.then(|| empirical::slips_and_speeds().0);
        for slip in SLIPS.into_iter().chain(tabled.into_iter().flatten()) {
            let step = 0.01 + 0.01 * slip;
            most = most.max(((torque(slip + step) - torque(slip)) / step).abs());
        }
    }
    most
}

/// Greatest phase advance of the torque pulsations per radian of slip angle, of engine angle and of input-shaft angle.
fn fastest_pulsations(config: &Config) -> [f64; 3] {
    let p = &config.parameters;
    let slip = config.pulsation.iter().map(|effect| fastest(|angle| effect(p, angle, 0.0)));
    // An engine with a requested torque of 20 N·m, at 150 rad/s.
    let engine = config.engine.iter().map(|effect| fastest(|angle| effect(p, 20.0, 150.0, angle)));
    let engine = engine.chain(config.shafts.iter().map(|effect| fastest(|angle| effect(p, [angle, 0.0]))));
    let input = config.shafts.iter().map(|effect| fastest(|angle| effect(p, [0.0, angle])));
    [slip.fold(0.0, f64::max), engine.fold(0.0, f64::max), input.fold(0.0, f64::max)]
}

/// Greatest change of a pulsation's phase per radian: its steepest slope over its amplitude.
fn fastest(pulsation: impl Fn(f64) -> f64) -> f64 {
    const SAMPLES: usize = 720;
    const SPACING: f64 = std::f64::consts::TAU / SAMPLES as f64;
    let (mut low, mut high, mut steepest) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    let mut last = pulsation(0.0);
    for k in 1..=SAMPLES {
        let now = pulsation(k as f64 * SPACING);
        (low, high, steepest) = (low.min(now), high.max(now), steepest.max((now - last).abs() / SPACING));
        last = now;
    }
    if high > low { 2.0 * steepest / (high - low) } else { 0.0 }
}

/// Greatest slope of damping and load over speed, N·m·s/rad.
fn steepest_load(config: &Config) -> f64 {
    const SPEEDS: [f64; 4] = [0.0, 1.0, 300.0, 2000.0];
    let resistance = |speed| motion::vehicle_resistance(config, speed, 0.0);
    let tabled = config.empirical.load.then(|| empirical::slips_and_speeds().1);
    SPEEDS.into_iter().chain(tabled.into_iter().flatten()).fold(0.0, |most: f64, speed| {
        let step = 1e-3 * (1.0 + speed);
        most.max(((resistance(speed + step) - resistance(speed)) / step).abs())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{self, param};
    use crate::vehicle::Vehicle;

    #[test]
    fn a_car_takes_the_substep_asked_for() {
        let config = Config::new(&Vehicle::paper(), &effects::null());
        assert_eq!(config.pace.longest_substep(1e-2), 1e-2);
        assert_eq!(config.pace.check(), Ok(()));
    }

    /// Pace of a vehicle with these changes and effects; without them its friction and load do not depend on speed.
    fn pace(change: impl Fn(&mut Vehicle), set: &[(usize, f64)]) -> Pace {
        let (mut vehicle, mut effects) = (Vehicle::paper(), effects::null());
        (vehicle.friction.alpha_1, vehicle.friction.mu_0, vehicle.friction.m_0) = (0.0, 0.3, 0.3);
        (vehicle.friction.m_1, vehicle.friction.m_2) = (0.0, 0.0);
        let d = &mut vehicle.driveline;
        (d.J_f, d.J_c, d.b_f, d.b_c, d.T_L0, d.k_L) = (0.2, 0.5, 0.03, 0.02, 0.0, 0.0);
        change(&mut vehicle);
        set.iter().for_each(|&(k, value)| effects[k] = value);
        Config::new(&vehicle, &effects).pace
    }

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-6 * expected.abs().max(1e-6), "{found} against {expected}");
    }

    #[test]
    fn each_part_settles_at_its_rate() {
        let plain = pace(|_| (), &[]);
        [0.03 / 0.2, 0.02 / 0.5, 0.0, 0.0].into_iter().zip(plain.motion).for_each(|(expected, found)| close(found, expected));
        let t = Vehicle::paper().thermal;
        close(plain.heat[0], t.gamma_2 / t.C_1);
        close(plain.heat[1], (t.gamma_1 + 2.0 * t.gamma_2) / t.C_b);
        // The excess temperature of the faces settles up to three times as fast as it would by itself.
        let hotter = [(param::surface_temperature::resistance, 0.01), (param::surface_temperature::time_constant, 0.05)];
        close(pace(|_| (), &hotter).heat[0], t.gamma_2 / t.C_1 + 60.0);
        // A drag per slip acts on both sides of the clutch.
        let dragged = pace(|_| (), &[(param::clutch_drag::viscosity, 0.4)]);
        close(dragged.motion[0], 0.43 / 0.2);
        close(dragged.motion[1], 0.42 / 0.5);
        // Friction that changes with slip: 2 R F μ' of a closed clutch, on the stiffer branch of the hysteresis.
        let slope = [(param::friction_slip_gradient::slope, -0.001), (param::cushion_hysteresis::width, 0.4)];
        let graded = pace(|_| (), &slope);
        let force = 1.2 * (26.1195 - 1304.6 + 5818.5);
        close(graded.motion[0], (0.03 + 2.0 * 0.091 * force * 0.001) / 0.2);
        // If dynamic friction depends on temperature, the slope is taken at the cold or at the hot end, whichever is steeper.
        let facings = |m_0: f64, m_1: f64| pace(|v| (v.friction.m_0, v.friction.m_1) = (m_0, m_1), &[]).motion[0];
        close(facings(0.35, -1e-4), facings(0.352, 0.0));
        close(facings(0.35, 1e-4), facings(0.375, 0.0));
        // Friction whose steepest fall is at zero slip.
        use param::friction_slip_gradient::{exponent, speed, stribeck};
        let falling = pace(|_| (), &[(stribeck, 0.3), (speed, 1.0), (exponent, 1.0)]).motion[0];
        close(falling, (0.03 + 2.0 * 0.091 * force / 1.2 * 0.3 * -(-0.01_f64).exp_m1() / 0.01) / 0.2);
        // A load that grows over speed: k (ω + s)² − k ω² over s, at 2000 rad/s; and T/ω_L at standstill.
        close(pace(|v| v.driveline.k_L = 1e-3, &[]).motion[1], (0.02 + 1e-3 * (4000.0 + 2.001)) / 0.5);
        let rolling = pace(|v| (v.driveline.T_L0, v.driveline.omega_L) = (8.0, 0.5), &[]).motion[1];
        assert!((rolling * 0.5 - 0.02 - 16.0).abs() < 1e-4, "{rolling}");
    }

    /// The load is 0 up to 50 rad/s and 6 N·m from 100 rad/s on: none of the fixed sampling speeds lies in between.
    #[test]
    fn a_learned_load_is_as_steep_as_between_its_breakpoints() {
        use param::empirical::{load_speed_5, load_speed_6, load_speed_7};
        let learned = pace(|_| (), &[(load_speed_5, 6.0), (load_speed_6, 6.0), (load_speed_7, 6.0)]);
        close(learned.motion[1], (0.02 + 6.0 / 50.0) / 0.5);
    }

    #[test]
    fn a_pulsation_is_as_fast_as_its_order_and_a_constant_torque_is_none() {
        for order in [1.0, 7.0] {
            let found = fastest(|angle: f64| 3.0 + 0.2 * (order * angle + 0.3).cos());
            assert!((found / order - 1.0).abs() < 2e-3, "{found} for {order}");
        }
        assert_eq!(fastest(|_| 3.0), 0.0);
    }

    /// All phases together may advance by a tenth of a radian per substep, or by one radian in a fit.
    #[test]
    fn pulsations_bound_the_substep_by_the_turn_of_their_phases() {
        let pulse = |orders: [f64; 3], speeds: [f64; 2], most: f64| Pace { orders, ..Pace::STILL }.pulse(speeds, most);
        close(pulse([4.0, 0.0, 0.0], [100.0, 50.0], 1e-3), 0.1 / 200.0);
        close(pulse([4.0, 0.0, 0.0], [50.0, 100.0], 1e-3), 0.1 / 200.0);
        close(pulse([0.0, 2.0, 0.0], [-150.0, 50.0], 1e-3), 0.1 / 300.0);
        close(pulse([0.0, 0.0, 3.0], [100.0, -50.0], 1e-3), 0.1 / 150.0);
        close(pulse([4.0, 2.0, 3.0], [100.0, 50.0], 1e-3), 0.1 / (200.0 + 200.0 + 150.0));
        close(pulse([4.0, 2.0, 3.0], [100.0, 50.0], 1e-2), 1.0 / (200.0 + 200.0 + 150.0));
        close(pulse([4.0, 0.0, 0.0], [1e5, 0.0], 1e-3), SHORTEST_SUBSTEP);
        assert_eq!(pulse([0.0; 3], [300.0, 50.0], 1e-3), f64::MAX);
        assert_eq!(pulse([1.0, 0.0, 0.0], [110.0, 20.0], 1e-3), f64::MAX, "0.09 rad within what is asked for");
    }

    #[test]
    fn shafts_divide_the_driveline() {
        use param::driveline_compliance::{compliance, damping, disc_share};
        let soft = pace(|_| (), &[(compliance, 1e-3), (disc_share, 0.2), (damping, 0.7)]);
        // 0.1 and 0.4 kg·m², with a reduced inertia of 0.08 kg·m².
        close(soft.motion[1], 0.7 / 0.1);
        close(soft.motion[2], 0.72 / 0.4);
        close(soft.motion[3], (1.0_f64 / (1e-3 * 0.08)).sqrt());
        close(pace(|_| (), &[(compliance, 1e-3), (disc_share, 0.2), (damping, 40.0)]).motion[3], 40.0 / 0.08);
    }

    /// A tyre twists in series with the shafts, and its deflection decays over 15 rad at up to 300 rad/s.
    #[test]
    fn a_tyre_is_a_spring_that_forgets() {
        use param::driveline_compliance::{compliance, damping as shaft_damping, disc_share};
        use param::tyre_slip::{damping, relaxation, slip_per_torque, wheel_share};
        let tyre = [(slip_per_torque, 3e-4), (relaxation, 15.0), (wheel_share, 0.2), (damping, 0.0)];
        close(pace(|_| (), &tyre).motion[3], (1.0_f64 / (4.5e-3 * 0.08)).sqrt() + 20.0);
        let both = [&tyre[..], &[(compliance, 1e-3), (disc_share, 0.2), (shaft_damping, 0.0)]].concat();
        close(pace(|_| (), &both).motion[3], (1.0_f64 / (5.5e-3 * 0.08)).sqrt() + 20.0);
    }

    #[test]
    fn what_cannot_be_followed_is_told_with_its_time() {
        for (motion, heat, part) in [
            ([2e5, 1.0, 0.0, 0.0], [0.0; 2], "the flywheel"),
            ([1.0, 2e5, 0.0, 0.0], [0.0; 2], "the disc"),
            ([1.0, 1.0, 2e5, 0.0], [0.0; 2], "the vehicle behind the shafts"),
            ([1.0, 0.0, 0.0, 2e5], [0.0; 2], "the twist of the shafts"),
            ([0.0; 4], [2e5, 0.0], "the heat of the disc"),
            ([0.0; 4], [0.0, 2e5], "the heat of the body"),
        ] {
            let refused = Pace { motion, heat, ..Pace::STILL }.check().unwrap_err();
            assert_eq!(refused.part, part);
            close(refused.time, 1.0 / motion.iter().sum::<f64>().max(heat.iter().sum()));
        }
        // The limit is a rate of 2.5 per shortest substep of 20 µs.
        assert!(Pace { motion: [1.249e5, 0.0, 0.0, 0.0], ..Pace::STILL }.check().is_ok());
        assert!(Pace { motion: [1.251e5, 0.0, 0.0, 0.0], ..Pace::STILL }.check().is_err());
        // The same bound shortens a substep.
        close(Pace { motion: [5e3, 0.0, 0.0, 0.0], ..Pace::STILL }.longest_substep(1e-2), 5e-4);
        close(Pace { motion: [5e3, 0.0, 0.0, 0.0], ..Pace::STILL }.longest_substep(1e-3), 2e-4);
        close(Pace { motion: [1e9, 0.0, 0.0, 0.0], ..Pace::STILL }.longest_substep(1e-3), SHORTEST_SUBSTEP);
        // The oscillation of the shafts may advance by one radian per substep in a fit, by half a radian in a simulation.
        close(Pace { motion: [1.0, 1.0, 0.0, 50.0], ..Pace::STILL }.longest_substep(1e-1), 1.0 / 50.0);
        close(Pace { motion: [1.0, 1.0, 0.0, 800.0], ..Pace::STILL }.longest_substep(1e-3), 0.5 / 800.0);
    }

    #[test]
    fn fast_shafts_shorten_it_and_the_impossible_is_named() {
        let (mut vehicle, mut effects) = (Vehicle::paper(), effects::null());
        effects[param::driveline_compliance::compliance] = 1e-4;
        let pace = Config::new(&vehicle, &effects).pace;
        // 1/√(1e-4 · 0.0578 · 0.9) = 438 rad/s.
        assert!((pace.longest_substep(5e-3) - 1.0 / 438.0).abs() < 1e-5 && pace.check().is_ok());
        effects[param::driveline_compliance::compliance] = 2e-5;
        assert!(Config::new(&vehicle, &effects).pace.longest_substep(MAX_SUBSTEP) < 0.5 / 980.0 + 1e-5);
        vehicle.driveline.J_c = 1e-3;
        vehicle.driveline.T_L0 = 1000.0;
        let refused = Config::new(&vehicle, &effects::null()).pace.check().unwrap_err();
        assert_eq!(refused.part, "the disc");
        assert!(refused.to_string().contains("driveline.J_c is small"), "{refused}");
    }
}
