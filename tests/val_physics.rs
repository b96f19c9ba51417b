//! Single equations compared with numbers computed by hand, where no scenario of the plant isolates them.

use kisspoint::effects::{self, PARAMETERS, REGISTRY, SIMULATED, Subsystem, Tyre, param};
use kisspoint::physics::cushion::{self, CushionSpring};
use kisspoint::physics::friction::{self, Friction};
use kisspoint::physics::lag::{self, Lag, LagState};
use kisspoint::physics::{driveline, map, thermal};
use kisspoint::plant::history::{CAPACITY, History, SIGNALS, Signal};
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::{Vehicle, VehicleError};
use serde_json::json;

fn close(what: &str, found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{what}: {found} against {expected}");
}

#[test]
fn contact_begins_at_the_largest_root_below_one() {
    let root = |beta_1, beta_2, beta_3| cushion::contact_point(&CushionSpring { beta_1, beta_2, beta_3 });
    close("a parabola", root(-100.0, 400.0, 0.0), 0.25);
    close("a parabola that begins at once", root(100.0, 400.0, 0.0), 0.0);
    close("a line", root(100.0, 0.0, 0.0), 0.0);
    // ξ (ξ − 0.1)(ξ − 0.3), and variants with either root outside of 0 to 1.
    close("two roots inside", root(30.0, -400.0, 1000.0), 0.3);
    close("one root beyond the closed point", root(200.0, -2100.0, 1000.0), 0.1);
    close("one root at the open end", root(0.0, -300.0, 1000.0), 0.3);
    close("both roots below zero", root(30.0, 400.0, 1000.0), 0.0);
    close("no real root", root(500.0, 100.0, 1000.0), 0.0);
    close("a root at the closed point is none", root(-1000.0, 0.0, 1000.0), 0.0);
}

#[test]
fn a_spring_is_inverted_within_its_travel() {
    let spring = CushionSpring { beta_1: 0.0, beta_2: 0.0, beta_3: 5000.0 };
    close("half way", cushion::inverse(&spring, 0.0, 625.0), 0.5);
    close("no force", cushion::inverse(&spring, 0.2, 0.0), 0.2);
    close("a pull", cushion::inverse(&spring, 0.2, -1.0), 0.2);
    close("more than it has", cushion::inverse(&spring, 0.2, 6000.0), 1.0);
    close("below contact", cushion::force(&spring, 0.2, 0.2), 0.0);
    close("above contact", cushion::force(&spring, 0.2, 0.4), 320.0);
}

#[test]
fn the_inverse_map_gives_the_slope_of_the_torque_where_it_sends_the_bearing() {
    let v = Vehicle::paper();
    let xi_0 = cushion::contact_point(&v.cushion_spring);
    for (torque, omega, theta) in [(5.0, 40.0, 25.0), (60.0, 3.0, 140.0), (150.0, 90.0, 80.0)] {
        let carried = |x: f64| {
            let xi = map::normalised_position(map::contact(&v.actuator, theta), x);
            map::torque_capacity(&v.friction, cushion::force(&v.cushion_spring, xi_0, xi), omega, theta)
        };
        let (x, slope) = map::inverse_with_slope(&v.friction, &v.actuator, &v.cushion_spring, xi_0, torque, omega, theta);
        assert!((carried(x) - torque).abs() < 1e-9, "{} of {torque} N·m", carried(x));
        let by_differences = (carried(x + 1e-4) - carried(x - 1e-4)) / 2e-4;
        assert!((slope - by_differences).abs() < 1e-6 * slope, "{slope} against {by_differences} N·m/mm at {torque} N·m");
    }
    // F = 5000 ξ³.
    close("slope of a cube", cushion::slope(&CushionSpring { beta_1: 0.0, beta_2: 0.0, beta_3: 5000.0 }, 0.4), 15_000.0 * 0.16);
}

#[test]
fn friction_is_that_of_equation_4() {
    let p = Friction { R_1: 0.07, R_2: 0.11, mu_0: 0.15, alpha_1: 0.02, alpha_2: 0.3, m_0: 0.2, m_1: 0.001, m_2: -2e-6 };
    let mu_d = 0.2 + 0.1 - 0.02;
    close("dynamic", friction::dynamic_friction(&p, 100.0), mu_d);
    close("at rest", friction::friction_coefficient(&p, 0.0, 100.0), 0.15);
    let falling = (0.15 - mu_d + 0.02 * 4.0) * (-1.2_f64).exp();
    close("in slip", friction::friction_coefficient(&p, 4.0, 100.0), mu_d + falling);
    close("far outside", friction::friction_coefficient(&p, 100.0, 1e4), friction::MU_MIN);
    // At rest μ is constant over the facing, so its mean times the radius is μ times the mean radius.
    close("radius at rest", friction::equivalent_radius(&p, 0.0, 100.0), 0.15 * 0.09);
    close("mean radius", friction::mean_radius(&p), 0.09);
    close("torque of both faces", map::torque_of(&p, 500.0, 0.4), 2.0 * 0.09 * 0.4 * 500.0);
    close("capacity", map::torque_capacity(&p, 500.0, 0.0, 100.0), 2.0 * 0.09 * 0.15 * 500.0);
}

#[test]
fn the_radius_in_slip_is_the_mean_of_equation_3() {
    let p = Friction { R_1: 0.06, R_2: 0.12, mu_0: 0.15, alpha_1: 0.02, alpha_2: 0.3, m_0: 0.2, m_1: 0.001, m_2: -2e-6 };
    const PARTS: usize = 20_000;
    for omega in [1e-9, 0.3, 4.0, 30.0, 250.0, 1e4] {
        let rho = |k: usize| p.R_1 + (p.R_2 - p.R_1) * (k as f64 + 0.5) / PARTS as f64;
        let mean =
            (0..PARTS).map(|k| rho(k) * friction::friction_coefficient(&p, omega * rho(k) / 0.09, 100.0)).sum::<f64>() / PARTS as f64;
        let found = friction::equivalent_radius(&p, omega, 100.0);
        assert!((found - mean).abs() < 1e-4 * mean, "{omega} rad/s: {found} against {mean}");
        // The four nodes of Gauss–Legendre quadrature, each evaluated separately.
        let nodes = [(0.861_136_311_594_052_6, 0.347_854_845_137_453_85), (0.339_981_043_584_856_26, 0.652_145_154_862_546_1)];
        let both = nodes.iter().flat_map(|(x, w)| [(0.09 - 0.03 * x, w), (0.09 + 0.03 * x, w)]);
        let sum: f64 = both.map(|(rho, w)| 0.5 * w * rho * friction::friction_coefficient(&p, omega * rho / 0.09, 100.0)).sum();
        assert!((found - sum).abs() < 1e-15, "{omega} rad/s: {found} against {sum}");
    }
}

#[test]
fn the_rolling_load_is_a_tanh_to_the_last_places() {
    let d = driveline::Driveline { T_L0: 1.0, omega_L: 1.0, ..Vehicle::paper().driveline };
    for k in -6000..=6000 {
        let z = 0.005 * f64::from(k);
        let (found, expected) = (driveline::load_torque(&driveline::Driveline { k_L: 0.0, ..d }, z), z.tanh());
        assert!((found - expected).abs() <= 6e-16 * expected.abs(), "tanh({z}): {found} against {expected}");
    }
    let at = |z: f64| driveline::load_torque(&driveline::Driveline { k_L: 0.0, ..d }, z);
    assert_eq!((at(-1e300), at(1e300), at(-0.0).is_sign_negative()), (-1.0, 1.0, true));
}

#[test]
fn the_rate_of_a_lag_is_the_slope_of_its_output() {
    let from = LagState { value: 0.2, rate: 3.0 };
    for curvature in [0.0, 0.1, 0.25, 1.0] {
        for slope in [0.0, 2.0] {
            let at = |t: f64| lag::advance(&Lag { time_constant: 0.1, curvature, asymmetry: 0.0 }, from, 1.0, slope, t);
            let by_differences = (at(0.05 + 1e-5).value - at(0.05 - 1e-5).value) / 2e-5;
            assert!((at(0.05).rate - by_differences).abs() < 1e-6, "κ = {curvature}: {} against {by_differences}", at(0.05).rate);
        }
    }
}

#[test]
fn balances_are_those_of_equation_7() {
    let d = Vehicle::paper().driveline;
    let hold = driveline::holding_torque(&d, 0.5, 100.0, 60.0, 12.0);
    let common = driveline::flywheel_acceleration(&d, 100.0, 60.0, hold);
    close("the balance the other way round", driveline::clutch_torque(&d, 60.0, 100.0, common), hold);
    close("both sides accelerate alike", driveline::driveline_acceleration(0.5, hold, 12.0), common);
    close("as one inertia", (0.5 + d.J_f) * common, 60.0 - d.b_f * 100.0 - 12.0);
}

#[test]
fn two_discs_and_a_body_exchange_what_they_lose() {
    let t = Vehicle::paper().thermal;
    let (disc, body) = thermal::dual_rates(&thermal::DualThermal::equal(&t), [150.0, 90.0], 60.0, 25.0, [true, false], [800.0, 0.0]);
    close("engaged disc", disc[0], (t.gamma_1 * (60.0 - 150.0) + t.gamma_3 * 800.0) / t.C_1);
    close("open disc", disc[1], t.gamma_2 * (25.0 - 90.0) / t.C_1);
    close("body", body, (t.gamma_1 * 90.0 + t.gamma_2 * (25.0 - 60.0) + (1.0 - t.gamma_3) * 800.0) / t.C_b);
    let losing = thermal::DualThermal { body_loss: 7.0, C_2: 2.0 * t.C_1, ..thermal::DualThermal::equal(&t) };
    let (slower, cooler) = thermal::dual_rates(&losing, [150.0, 90.0], 60.0, 25.0, [true, false], [800.0, 0.0]);
    close("a body that gives to the air by itself", cooler, body + 7.0 * (25.0 - 60.0) / t.C_b);
    close("a second disc of twice the capacity", slower[1], 0.5 * disc[1]);
    let closed = thermal::Thermal { gamma_2: 0.0, gamma_3: 0.3, ..t };
    let (disc, body) = thermal::dual_rates(&thermal::DualThermal::equal(&closed), [150.0, 90.0], 60.0, 25.0, [true, true], [800.0, 300.0]);
    close("all heat is kept", t.C_1 * (disc[0] + disc[1]) + t.C_b * body, 1100.0);
}

#[test]
fn a_tyre_gives_way_the_more_the_nearer_its_grip() {
    let tyre = Tyre { softness: 2e-3, relaxation: 15.0, grip: 100.0 };
    for (torque, deflection) in
        [(0.0, 0.0), (20.0, 0.04 / 0.8), (50.0, 0.1 / 0.5), (-50.0, -0.1 / 0.5), (99.0, 0.198 / 0.01), (200.0, 0.4 / 0.01)]
    {
        close("deflection", tyre.deflection(torque), deflection);
    }
}

#[test]
fn effects_of_a_vehicle_file_are_read_within_their_bounds_and_written_back() {
    for (k, p) in PARAMETERS.iter().enumerate() {
        for value in [p.min, p.max] {
            let read = effects::from_value(&json!({"effects": {p.variable: value}})).unwrap();
            assert_eq!(read[k], value);
            assert_eq!(effects::from_value(&json!({"effects": effects::to_value(&read)})).unwrap(), read, "{}", p.variable);
        }
        for value in [p.min - 1e-6, p.max + 1e-6] {
            let refused = effects::from_value(&json!({"effects": {p.variable: value}}));
            assert!(matches!(refused, Err(VehicleError::Bounds { .. })), "{} = {value}", p.variable);
        }
    }
    assert_eq!(effects::to_value(&effects::null()), json!({}));
    assert!(matches!(effects::from_value(&json!({"effects": {"effect.judder.size": 1.0}})), Err(VehicleError::Unknown(..))));
    assert!(matches!(effects::from_value(&json!({"effects": {"effect.judder.sine": "1"}})), Err(VehicleError::NotANumber(..))));
}

#[test]
fn the_registry_finds_its_effects_and_says_how_large_they_are() {
    for (place, entry) in REGISTRY.iter().enumerate() {
        assert_eq!(effects::find(entry.id), Some(place));
    }
    // Effects that can only be simulated are not found by the diagnosis.
    assert!(SIMULATED.iter().all(|entry| effects::find(entry.id).is_none()));
    for entry in effects::all() {
        assert!(entry.is_null(&effects::null()), "{}", entry.id);
        for &k in entry.effect.amplitudes {
            let mut set = effects::null();
            set[k] = if PARAMETERS[k].null < PARAMETERS[k].max { PARAMETERS[k].max } else { PARAMETERS[k].min };
            assert!(!entry.is_null(&set), "{}", PARAMETERS[k].variable);
        }
    }
    let ids = ["engine", "actuator", "clutch_force", "friction", "thermal", "driveline", "sensors"];
    assert_eq!(Subsystem::ALL.map(Subsystem::id), ids);
    assert_eq!(effects::find("no_such_effect"), None);
    let scale = |k: usize| effects::owner(k).unwrap().scale(k);
    close("of the larger start", scale(param::actuator_delay::delay), 0.05);
    close("of a departure", scale(param::cushion_hysteresis::stroke), 0.2);
    close("of either sign", scale(param::friction_level::factor), 0.15);
    let shape = param::friction_slip_gradient::proportional_share;
    close("without a start", scale(shape), PARAMETERS[shape].nominal);
}

#[test]
fn a_delay_line_is_what_it_holds() {
    let signal = Signal::Flywheel;
    let mut line = History::new();
    assert!(line.line(signal).is_empty());
    for (time, value) in [(0.0, 1.0), (0.5, 3.0), (1.0, 2.0)] {
        line.push(signal, time, value);
    }
    let mut copy = History::new();
    assert!(line.line(signal).iter().all(|(time, value)| copy.restore(signal, time, value)));
    assert!(copy == line && copy.clone() == line);
    assert!(SIGNALS.iter().filter(|other| !line.line(**other).is_empty()).eq([&signal]), "the lines are kept apart");
    copy.push(signal, 1.5, 0.0);
    assert!(copy != line);
    close("between two values", line.line(signal).interpolate(0.25, 2.0, 9.0), 2.0);
    close("before the first", line.line(signal).interpolate(-1.0, 2.0, 9.0), 1.0);
    close("after the last", line.line(signal).interpolate(1.5, 2.0, 9.0), 5.5);
    close("beyond now", line.line(signal).interpolate(3.0, 2.0, 9.0), 9.0);
    line.clear(signal);
    assert!(line.line(signal).is_empty() && line == History::new());
    close("of an empty line", line.line(signal).interpolate(0.0, 2.0, 9.0), 9.0);
    // The newest value is replaced by one that follows shortly after; the oldest value is dropped when the line is full.
    line.push(signal, 0.0, 1.0);
    for k in 1..=3 {
        line.push(signal, f64::from(k) * 5e-5, f64::from(k));
    }
    assert_eq!(line.line(signal).iter().collect::<Vec<_>>(), [(0.0, 1.0), (3.0 * 5e-5, 3.0)]);
    for k in 1..=CAPACITY as u32 {
        line.push(signal, f64::from(k) * 1e-3, f64::from(k));
    }
    assert_eq!((line.line(signal).iter().count(), line.line(signal).iter().next()), (CAPACITY, Some((1e-3, 1.0))));
    assert!(!line.restore(signal, 9.0, 9.0), "a full line takes nothing up");
}

#[test]
fn a_state_is_taken_up_under_the_vehicle_and_effects_that_come_with_it() {
    let (start, inputs) =
        (Start { omega_f: 100.0, omega_c: 20.0, theta_c: 80.0, theta_b: 50.0 }, Inputs { x_to: 6.3, ..Inputs::default() });
    let mut heavy = Vehicle::paper();
    heavy.driveline.J_c *= 2.0;
    let mut hot = effects::null();
    hot[param::friction_level::factor] = 0.8;
    for (vehicle, parameters) in [(heavy, effects::null()), (Vehicle::paper(), hot), (Vehicle::paper(), effects::null())] {
        let mut origin = Plant::new(&vehicle, &parameters, &start, &inputs);
        origin.step(&inputs, 0.05);
        let mut other = Plant::new(&Vehicle::paper(), &effects::null(), &Start { omega_f: 0.0, ..start }, &Inputs::default());
        other.take_up(&vehicle, &parameters, origin.state());
        origin.step(&inputs, 0.05);
        other.step(&inputs, 0.05);
        assert_eq!(origin.outputs(), other.outputs());
    }
}

#[test]
fn a_substep_is_what_was_asked_for() {
    let inputs = Inputs { x_to: 2.0, ..Inputs::default() };
    let start = Start { omega_f: 100.0, omega_c: 20.0, theta_c: 80.0, theta_b: 50.0 };
    let mut plant = Plant::new(&Vehicle::paper(), &effects::null(), &start, &inputs);
    assert_eq!(plant.max_substep(), kisspoint::plant::MAX_SUBSTEP);
    for (substep, pieces) in [(1e-3, 10), (2e-3, 5), (3e-3, 4), (1e-1, 1)] {
        plant.set_max_substep(substep);
        plant.step(&inputs, 1e-2);
        assert_eq!((plant.max_substep(), plant.iterations()), (substep, pieces));
    }
    // 64 pieces with one integration and one search for contact each, 8 searches for switches and one for the last time at which both sides meet, and the pieces before and
    // after that.
    assert_eq!(plant.most_iterations(1e-2), 64 * 61 + 9 * 60 + 2);
}

/// A quarter of the pulsation's period later its cosine is zero; half a period later it has the opposite sign.
#[test]
fn a_plant_goes_on_from_the_slip_angle_to_which_it_is_turned() {
    let mut p = effects::null();
    (p[param::judder::cosine], p[param::judder::order]) = (0.3, 2.0);
    let start = Start { omega_f: 150.0, omega_c: 20.0, theta_c: 60.0, theta_b: 40.0 };
    let mut plant = Plant::new(&Vehicle::paper(), &p, &start, &Inputs { x_to: 6.3, ..Inputs::default() });
    let mut at = |angle: f64| {
        plant.turn_to(angle);
        plant.outputs().t_fc
    };
    let [none, quarter, half] = [0.0, std::f64::consts::FRAC_PI_4, std::f64::consts::FRAC_PI_2].map(&mut at);
    assert!(quarter > 1.0 && (none / quarter - 1.3).abs() < 1e-12 && (half / quarter - 0.7).abs() < 1e-12, "{none} {quarter} {half}");
}
