//! Behaviour of the plant beyond its equations: events inside a substep, corrections from outside. The bench of the effects' laws gives each number in closed form.

#[allow(dead_code)]
#[path = "val_effects/bench.rs"]
mod bench;

use bench::{Bench, MU, X_CNT, close, elastic, torque, with};
use kisspoint::effects::{self, param};
use kisspoint::plant::motion::index;
use kisspoint::plant::{Inputs, Phase, Plant, Start};
use kisspoint::vehicle::Vehicle;

/// With a kiss point beyond the closed point, the clutch is open below the kiss point and closed above it. It is never closed because of being open.
#[test]
fn a_kiss_point_beyond_the_closed_point_leaves_an_open_clutch_open() {
    let vehicle = Vehicle::paper();
    let offset = |mm: f64| with(&[(param::kiss_point_offset::offset, mm)]);
    let (start, travel) = (Start { omega_f: 100.0, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 }, 7.78 - 4.02);
    for (mm, x_to, carries) in
        [(4.0, 0.0, false), (4.0, 8.0, false), (4.0, 8.1, true), (5.0, 9.0, false), (travel, 7.7, false), (-5.0, 7.9, true)]
    {
        let inputs = Inputs { x_to, ..Inputs::default() };
        let mut plant = Plant::new(&vehicle, &offset(mm), &start, &inputs);
        plant.step(&inputs, 0.01);
        let (o, most) = (plant.outputs(), Plant::new(&vehicle, &effects::null(), &start, &Inputs { x_to: 20.0, ..inputs }).outputs().t_fc);
        assert_eq!((o.t_fc != 0.0, o.phase == Phase::Slipping), (carries, carries), "{mm} mm at {x_to} mm: {} N·m", o.t_fc);
        assert!(o.t_fc >= 0.0 && o.t_fc < 1.02 * most, "{} N·m of {most}", o.t_fc);
    }
    // If heat or an effect moves the kiss point at run time, a closed clutch opens.
    let inputs = Inputs { x_to: 7.9, ..Inputs::default() };
    let mut plant = Plant::new(&vehicle, &effects::null(), &start, &inputs);
    plant.step(&inputs, 0.01);
    assert!(plant.outputs().t_fc > 0.0);
    plant.set_effects(&vehicle, &offset(4.0)).unwrap();
    plant.step(&inputs, 0.01);
    assert_eq!((plant.outputs().phase, plant.outputs().t_fc), (Phase::Open, 0.0));
}

#[test]
fn contact_is_found_inside_a_substep() {
    // The bearing travels at 100 mm/s and passes the contact point within the first substep of 10 ms. Only while in contact does heat flow between disc and body.
    for (from, to) in [(X_CNT - 0.37, X_CNT + 1.0), (X_CNT + 0.37, X_CNT - 1.0)] {
        let mut bench = Bench::held(100.0, 100.0, 20.0, from).moved(0.0, to);
        let t = &mut bench.vehicle.thermal;
        (t.C_1, t.gamma_1, t.gamma_2) = (70.0, 2000.0, 5.0);
        bench.start.theta_c = 180.0;
        let mut plant = Plant::new(&bench.vehicle, &with(&[(param::actuator_rate_limit::inverse_speed, 0.01)]), &bench.start, &bench.rest);
        plant.set_max_substep(1e-2);
        plant.step(&bench.then[0].1, 1e-2);
        // Body and air are both at 20 °C, so the excess temperature of the disc decays with e^(−γ t/C_1), with γ of the body while engaged and of the air while open.
        let (first, second) = if from < to { (5.0, 2000.0) } else { (2000.0, 5.0) };
        let expected = 20.0 + 160.0 * (-(first * 3.7e-3 + second * 6.3e-3) / 70.0_f64).exp();
        close("disc", plant.outputs().theta_c, expected, 1e-4);
        assert_eq!(plant.outputs().phase == Phase::Open, from > to);
    }
}

#[test]
fn what_a_step_found_is_forgotten_where_it_no_longer_holds() {
    let vehicle = Vehicle::paper();
    let mut weak = vehicle;
    (weak.friction.mu_0, weak.friction.m_0, weak.actuator.x_cnt_0) = (0.1, 0.12, 3.8);
    let start = Start { omega_f: 150.0, omega_c: 20.0, theta_c: 60.0, theta_b: 40.0 };
    let inputs = Inputs { x_to: 6.0, t_e_ref: 60.0, theta_h: 30.0, t_load: 0.0 };
    let mut plant = Plant::new(&vehicle, &effects::null(), &start, &inputs);
    let as_new = |vehicle: &Vehicle, plant: &Plant| {
        let mut new = Plant::new(vehicle, &effects::null(), &start, &inputs);
        new.take_up(vehicle, &effects::null(), plant.state());
        new
    };
    plant.step(&inputs, 1e-3);
    assert_eq!(plant.outputs(), as_new(&vehicle, &plant).outputs());
    plant.correct_speeds([3.0, 0.5], [0.0; 2], 0);
    assert_eq!(plant.outputs(), as_new(&vehicle, &plant).outputs());
    plant.set_effects(&weak, &effects::null()).unwrap();
    assert_eq!(plant.outputs(), as_new(&weak, &plant).outputs());
    // The next step begins with the current values.
    let mut new = as_new(&weak, &plant);
    plant.step(&inputs, 1e-3);
    new.step(&inputs, 1e-3);
    assert_eq!(plant.state(), new.state());
    let state = *plant.state();
    plant.take_up(&vehicle, &effects::null(), &state);
    assert_eq!(plant.outputs(), as_new(&vehicle, &plant).outputs());
}

#[test]
fn lags_too_short_for_any_step_are_none() {
    use param::{actuator_lag, engine_torque_lag};
    let bench = Bench::held(100.0, 50.0, 25.0, X_CNT + 0.5).moved(0.0, X_CNT + 1.0);
    let run = |set: &[(usize, f64)]| {
        let mut plant = Plant::new(&bench.vehicle, &with(set), &bench.start, &bench.rest);
        let input = Inputs { t_e_ref: 80.0, ..bench.then[0].1 };
        (0..50).for_each(|_| plant.step(&input, 1e-3));
        plant.outputs()
    };
    let none = run(&[]);
    for curvature in [0.0, 0.25, 1.0] {
        let shortest = |lag: usize, kappa: usize| [(lag, 5e-324), (kappa, curvature)];
        let engine = shortest(engine_torque_lag::time_constant, engine_torque_lag::curvature);
        let bearing = shortest(actuator_lag::time_constant, actuator_lag::curvature);
        let found = run(&[engine, bearing].concat());
        close("flywheel", found.omega_f, none.omega_f, 1e-9);
        close("bearing", found.x_to_actual, none.x_to_actual, 0.0);
        close("clutch torque", found.t_fc, none.t_fc, 1e-9);
    }
}

/// Lags of 1 ms: 30 N·m and 1 mm have decayed to 10⁻⁹ after ln(3·10¹⁰) and ln(10⁹) time constants, that is 24.1 and 20.7 ms.
#[test]
fn a_lag_is_followed_in_pieces_until_it_has_arrived() {
    for (lag, from, to) in [(param::engine_torque_lag::time_constant, 20, 26), (param::actuator_lag::time_constant, 18, 22)] {
        let bench = Bench::held(100.0, 50.0, 25.0, 0.0);
        let moved = Inputs { t_e_ref: 30.0, x_to: 1.0, ..bench.rest };
        let mut plant = Plant::new(&bench.vehicle, &with(&[(lag, 1e-3)]), &bench.start, &bench.rest);
        for k in 1..=30 {
            plant.step(&moved, 1e-3);
            assert!(
                if k <= from { plant.iterations() > 5 } else { k < to || plant.iterations() == 1 },
                "{} in step {k}",
                plant.iterations()
            );
        }
        // A fit, which asks for longer substeps, needs only one piece.
        let mut fitted = Plant::new(&bench.vehicle, &with(&[(lag, 1e-3)]), &bench.start, &bench.rest);
        fitted.set_max_substep(5e-3);
        fitted.step(&moved, 5e-3);
        assert_eq!(fitted.iterations(), 1);
    }
}

#[test]
fn the_approach_of_a_limited_bearing_is_exact_in_long_substeps() {
    let limited = with(&[(param::actuator_rate_limit::inverse_speed, 0.1), (param::actuator_rate_limit::approach, 0.4)]);
    for (from, to) in [(2.0, 3.0), (3.0, 2.0)] {
        let bench = Bench::held(100.0, 50.0, 25.0, from).moved(0.0, to);
        let mut plant = Plant::new(&bench.vehicle, &limited, &bench.start, &bench.rest);
        plant.set_max_substep(1.0);
        for k in 1..=6 {
            // At full speed for 0.06 s; the last 0.4 mm decay with a time constant of 0.04 s.
            plant.step(&bench.then[0].1, 0.025);
            let t = 0.025 * f64::from(k);
            let left = if t < 0.06 { 1.0 - 10.0 * t } else { 0.4 * (-(t - 0.06) / 0.04).exp() };
            close("bearing", plant.outputs().x_to_actual, to - left * (to - from), 1e-12);
        }
    }
}

#[test]
fn a_clutch_that_opens_at_standstill_is_open() {
    let mut bench = Bench::held(0.0, 0.0, 25.0, 6.0).moved(0.0, 0.0);
    bench.vehicle.driveline.J_f = 0.2;
    let rest = bench.run(&effects::null(), 0.0).outputs();
    assert_eq!((rest.phase, rest.t_fc), (Phase::Locked, 0.0));
    assert_eq!(bench.run(&effects::null(), 0.01).outputs().phase, Phase::Open, "with no torque at all to break it away");
}

#[test]
fn a_delayed_command_arrives_inside_a_substep() {
    let mut bench = Bench::held(100.0, 50.0, 25.0, 2.0).moved(0.0, 5.0);
    bench.vehicle.driveline.J_f = 0.2;
    let mut plant = Plant::new(&bench.vehicle, &with(&[(param::actuator_delay::delay, 3.7e-3)]), &bench.start, &bench.rest);
    plant.set_max_substep(1e-2);
    plant.step(&bench.then[0].1, 1e-2);
    close("impulse of the clutch", 0.2 * (100.0 - plant.outputs().omega_f), torque(5.0, MU) * 6.3e-3, 1e-9);
}

#[test]
fn a_plant_that_takes_up_state_and_delay_lines_goes_on_bit_for_bit() {
    let mut bench = Bench::held(200.0, 100.0, 25.0, 2.0).moved(0.1, 5.0).moved(0.16, 6.0);
    (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (0.2, 0.5);
    let late = with(&[(param::actuator_delay::delay, 0.05), (param::clutch_speed_delay::delay, 0.03)]);
    let mut plant = bench.run(&late, 0.18);
    let mut other = Plant::new(&bench.vehicle, &effects::null(), &bench.start, &bench.rest);
    other.take_up(&bench.vehicle, &late, plant.state());
    assert!(other.history() != plant.history(), "a state is without its delay lines");
    for signal in kisspoint::plant::history::SIGNALS {
        other.history_mut().clear(signal);
        for (time, value) in plant.history().line(signal).iter() {
            assert!(other.history_mut().restore(signal, time, value));
        }
    }
    assert!(other.history() == plant.history() && other.state() == plant.state());
    for _ in 0..60 {
        plant.step(&bench.then[1].1, 1e-3);
        other.step(&bench.then[1].1, 1e-3);
        assert_eq!(plant.outputs(), other.outputs());
    }
}

/// Steady state within the soft range of the shafts and beyond it, with and without tyres.
#[test]
fn the_twist_under_a_torque_carries_that_torque() {
    use kisspoint::plant::config::Config;
    use kisspoint::plant::motion::{spring_torque, twist_under, warm};
    use param::{driveline_compliance as shafts, tyre_slip as tyre};
    let shafts = [(shafts::compliance, 2e-3), (shafts::soft_angle, 0.03), (shafts::soft_share, 0.3)];
    let tyres = [(tyre::slip_per_torque, 3e-4), (tyre::relaxation, 15.0), (tyre::grip, 60.0)];
    for set in [&shafts[..1], &shafts, &tyres, &[&shafts[..], &tyres].concat()] {
        let config = Config::new(&Vehicle::paper(), &with(set));
        // The soft range ends at 0.3 · 0.03 / 0.002 = 4.5 N·m.
        for torque in [-50.0, -4.6, -4.4, -1.0, 0.5, 4.4, 4.6, 20.0, 55.0] {
            let mut y = warm(20.0);
            y[index::TWIST] = twist_under(&config, torque);
            close("torque", spring_torque(&config, &y), torque, 1e-9);
        }
    }
}

/// With lash in the shafts before a tyre, no torque is transmitted until the lash is used up: the car that is pushed moves ahead of its disc.
#[test]
fn lash_before_a_tyre_carries_nothing() {
    use param::{driveline_compliance as shafts, tyre_slip as tyre};
    let (mut bench, _) = elastic(100.0, 100.0, 0.0);
    bench.rest.t_load = -20.0;
    let lash = [
        (shafts::compliance, 2e-3),
        (shafts::disc_share, 0.2),
        (shafts::damping, 0.0),
        (shafts::soft_angle, 0.02),
        (shafts::soft_share, 0.0),
    ];
    for set in [&lash[..], &[&lash[..], &[(tyre::slip_per_torque, 3e-4), (tyre::relaxation, 15.0), (tyre::grip, 300.0)]].concat()] {
        let y = bench.run(&with(set), 0.02).state().y;
        assert_eq!(y[index::OMEGA_C], 100.0);
        close("car", y[index::OMEGA_V], 100.0 + 20.0 / 0.4 * 0.02, 1e-9);
        close("twist", y[index::TWIST], -0.5 * 20.0 / 0.4 * 4e-4, 1e-9);
    }
}

/// Learned laws that are constant over all breakpoints: additional torques (N·m) of the engine and against the car's motion, and relative changes of the faces' torque and of
/// the spring's force.
#[test]
fn learned_laws_act_beside_the_known_ones() {
    use effects::empirical::CURVES;
    let mut bench = Bench::held(150.0, 100.0, 60.0, 6.0).moved(0.0, 6.0);
    (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (0.2, 0.5);
    (bench.rest.t_e_ref, bench.then[0].1.t_e_ref) = (30.0, 30.0);
    let beside = [effects::Subsystem::Actuator, effects::Subsystem::Sensors];
    let apart = ["force_direction", "engine_time", "engine_slowing"];
    for curve in CURVES.iter().filter(|curve| !apart.contains(&curve.name) && !beside.contains(&curve.subsystem)) {
        let by = if ["engine_speed", "engine_torque", "load_speed"].contains(&curve.name) { 7.0 } else { 0.2 };
        let learned = with(&curve.parameters().map(|k| (k, by)).collect::<Vec<_>>());
        let (mut engine, mut clutch, mut load) = (30.0, torque(6.0, MU), 0.0);
        match curve.name {
            "engine_speed" | "engine_torque" => engine += by,
            "load_speed" => load = by,
            _ => clutch *= 1.0 + by,
        }
        let found = bench.run(&learned, 0.01).outputs();
        close(curve.name, found.t_fc, clutch, 1e-9);
        close(curve.name, found.omega_f, 150.0 + (engine - clutch) / 0.2 * 0.01, 1e-9);
        close(curve.name, found.omega_c, 100.0 + (clutch - load) / 0.5 * 0.01, 1e-9);
    }
}

/// Learned laws of the engine's time constants, of the actuator and of the sensors, if they are constant, act as the effect of that size; an offset moves the bearing.
#[test]
fn learned_laws_of_times_and_sensors_are_effects_where_they_are_flat() {
    use effects::empirical::CURVES;
    let mut bench = Bench::held(150.0, 100.0, 60.0, 5.0).moved(0.0, 6.0);
    bench.then[0].1.t_e_ref = 30.0;
    let flat = |name: &str, value: f64| {
        let curve = CURVES.iter().find(|c| c.name == name).unwrap();
        with(&curve.parameters().map(|k| (k, value)).collect::<Vec<_>>())
    };
    let pairs = [
        ("engine_time", 0.02, param::engine_torque_lag::time_constant, 0.02),
        ("engine_slowing", 0.03, param::engine_torque_lag::time_constant, 0.03),
        ("actuator_time", 0.02, param::actuator_lag::time_constant, 0.02),
        ("actuator_slowing", 0.03, param::actuator_lag::time_constant, 0.03),
        ("actuator_play", 0.05, param::actuator_backlash::play, 0.1),
        ("disc_scale", 0.03, param::clutch_speed_gain::gain, 1.03),
        ("disc_filter", 0.02, param::clutch_speed_delay::smoothing, 0.02),
        ("flywheel_filter", 0.02, param::engine_speed_delay::smoothing, 0.02),
    ];
    let nominal = bench.run(&effects::null(), 0.05).outputs();
    for (curve, value, effect, size) in pairs {
        let (learned, expected) = (bench.run(&flat(curve, value), 0.05).outputs(), bench.run(&with(&[(effect, size)]), 0.05).outputs());
        assert!(learned != nominal, "{curve} does something");
        for (what, a, b) in [
            ("flywheel", learned.omega_f, expected.omega_f),
            ("disc", learned.omega_c, expected.omega_c),
            ("bearing", learned.x_to_actual, expected.x_to_actual),
            ("torque", learned.t_fc, expected.t_fc),
        ] {
            close(&format!("{what} under {curve}"), a, b, 1e-7);
        }
    }
    let moved = bench.run(&flat("actuator_offset", 0.2), 0.05).outputs();
    close("offset", moved.x_to_actual, nominal.x_to_actual + 0.2, 1e-12);
    let shown = bench.run(&flat("flywheel_scale", -0.02), 0.05).outputs();
    close("flywheel's scale", shown.omega_f, 0.98 * nominal.omega_f, 1e-9);
    assert_eq!((shown.omega_c, shown.t_fc), (nominal.omega_c, nominal.t_fc));
}

#[test]
fn corrections_move_both_sides_apart_or_together() {
    let mut bench = Bench::held(100.0, 50.0, 25.0, 5.0);
    (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (0.2, 0.6);
    let mut slipping = bench.run(&effects::null(), 0.0);
    slipping.correct_speeds([2.0, -3.0], [0.0; 2], 0);
    assert_eq!((slipping.outputs().omega_f, slipping.outputs().omega_c, slipping.state().y[index::OMEGA_V]), (102.0, 47.0, 47.0));
    // Once the disc is faster, the clutch torque has the opposite sign.
    slipping.correct_speeds([-60.0, 0.0], [0.0; 2], 0);
    close("torque", slipping.outputs().t_fc, -torque(5.0, MU), 1e-9);
    // At equal speeds the torque keeps its sign.
    slipping.correct_speeds([5.0, 0.0], [0.0; 2], 0);
    assert_eq!(slipping.slip(), 0.0);
    close("torque", slipping.outputs().t_fc, -torque(5.0, MU), 1e-9);
    bench.start.omega_c = 100.0;
    let mut stuck = bench.run(&effects::null(), 0.0);
    assert_eq!(stuck.outputs().phase, Phase::Locked);
    stuck.correct_speeds([4.0, 1.0], [0.0; 2], 0);
    // The momentum of both corrections: 0.2 · 4 + 0.6 · 1 = 0.8 · 1.75.
    for speed in [stuck.outputs().omega_f, stuck.outputs().omega_c, stuck.state().y[index::OMEGA_V]] {
        close("common speed", speed, 101.75, 1e-12);
    }
}

/// A correction of the shafts for a torque on the car sets the twist at which the whole car accelerates, so that no oscillation is left.
#[test]
fn shafts_that_are_told_of_a_torque_on_the_car_do_not_swing() {
    for (x_to, together) in [(0.0, 0.5), (8.0, 0.7)] {
        let (bench, effects) = elastic(100.0, 100.0, x_to);
        let mut plant = Plant::new(&bench.vehicle, &effects, &bench.start, &bench.rest);
        plant.correct_shafts(30.0);
        let pushed = Inputs { t_load: -30.0, ..bench.rest };
        for k in 1..=50 {
            plant.step(&pushed, 1e-3);
            let expected = 100.0 + 30.0 / together * 1e-3 * f64::from(k);
            close("disc", plant.state().y[index::OMEGA_C], expected, 1e-6);
            close("car", plant.state().y[index::OMEGA_V], expected, 1e-6);
        }
        // Rigid shafts have no twist to correct.
        let mut rigid = bench.run(&effects::null(), 0.0);
        rigid.correct_shafts(30.0);
        assert_eq!(rigid.state().y[index::TWIST], 0.0);
    }
}

#[test]
fn a_car_that_is_held_stands_and_its_shafts_carry_what_the_clutch_does() {
    let (bench, effects) = elastic(100.0, 4.0, 5.0);
    let mut plant = Plant::new(&bench.vehicle, &effects, &bench.start, &bench.rest);
    plant.hold_car();
    assert_eq!(plant.state().y[index::OMEGA_V], 0.0);
    close("twist", plant.state().y[index::TWIST], 2e-3 * torque(5.0, MU), 1e-12);
    // A rigid car turns with its disc, so it cannot be held separately.
    let mut rigid = bench.run(&effects::null(), 0.0);
    rigid.hold_car();
    assert_eq!((rigid.state().y[index::OMEGA_V], rigid.state().y[index::TWIST]), (4.0, 0.0));
}

/// An observer with a delayed speed measurement estimates the error at the time of measurement and its growth. After the correction, a delayed or filtered sensor shows that
/// error at once and its growth as an ideal sensor would. With the stored past cut off at the filter's mean age, the observer of a braked car became unstable.
#[test]
fn a_correction_of_a_moment_ago_shows_as_it_would_without_delay() {
    let (by, rate, h, inertia) = (0.4, 30.0, 0.01, 0.5);
    let [flywheel, disc] = [
        (param::engine_speed_delay::delay, param::engine_speed_delay::smoothing),
        (param::clutch_speed_delay::delay, param::clutch_speed_delay::smoothing),
    ];
    for (side, (delay, filter)) in [flywheel, disc].into_iter().enumerate() {
        for (dead_time, smoothing) in [(0.0, 0.0), (0.06, 0.0), (0.03, 0.04), (0.0, 0.02)] {
            let mut bench = Bench::held(90.0, 80.0, 25.0, 0.0);
            (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (inertia, inertia);
            let late = with(&[(delay, dead_time), (filter, smoothing)]);
            let mut seen = bench.run(&late, 0.3);
            let mut before = bench.run(&late, 0.3);
            let of = |x: f64| [[x, 0.0], [0.0, x]][side];
            seen.correct_speeds(of(by), of(rate), side);
            let shown = |plant: &Plant| [plant.outputs().omega_f, plant.outputs().omega_c][side];
            let ahead = |seen: &Plant, before: &Plant| shown(seen) - shown(before);
            close("now", ahead(&seen, &before), by, 1e-9);
            let mut pushed = bench.rest;
            pushed.t_e_ref += of(rate)[0] * inertia;
            pushed.t_load -= of(rate)[1] * inertia;
            // Until the changes made now become visible.
            for k in 1..=20 {
                seen.step(&pushed, h);
                before.step(&bench.rest, h);
                close("then", ahead(&seen, &before), by + rate * f64::from(k) * h, 1e-6);
            }
        }
    }
}

#[test]
fn damping_and_load_follow_their_laws_in_both_directions() {
    for direction in [1.0, -1.0] {
        let coasting = |change: fn(&mut kisspoint::physics::driveline::Driveline)| {
            let mut bench = Bench::held(0.0, direction * 100.0, 25.0, 0.0);
            bench.vehicle.driveline.J_c = 0.5;
            change(&mut bench.vehicle.driveline);
            direction * bench.run(&effects::null(), 0.5).outputs().omega_c
        };
        close("air", coasting(|d| d.k_L = 0.01), 100.0 / (1.0 + 0.01 * 100.0 * 0.5 / 0.5), 1e-7);
        close("damping", coasting(|d| d.b_c = 0.7), 100.0 * (-0.7_f64).exp(), 1e-7);
        close("rolling", coasting(|d| d.T_L0 = 8.0), 100.0 - 8.0 * 0.5 / 0.5, 1e-7);
    }
}

/// With a prescribed torque in place of the clutch torque, the flywheel follows its target speed despite the engine's lag within the step, and momentum is conserved. Coupled
/// rigidly, both sides take the common speed that conserves momentum.
#[test]
fn a_torque_in_the_place_of_the_clutch_loses_no_momentum() {
    let bench = Bench::held(150.0, 40.0, 20.0, X_CNT + 1.0);
    let mut vehicle = bench.vehicle;
    let d = &mut vehicle.driveline;
    (d.J_f, d.J_c, d.b_f, d.b_c, d.T_L0, d.k_L) = (0.2, 0.5, 0.0, 0.0, 0.0, 0.0);
    let effects = with(&[(param::engine_torque_lag::time_constant, 0.02)]);
    let (lag, report) = (0.02, 60.0);
    let mut plant = Plant::new(&vehicle, &effects, &bench.start, &bench.rest);
    let engine_at_rest = plant.state().engine.value;
    let inputs = Inputs { t_e_ref: report, ..bench.rest };
    let h = 1e-3;
    plant.couple(false);
    for k in 1..=100 {
        let target = 150.0 - 0.3 * f64::from(k);
        plant.pass_on(&inputs, h, target);
        plant.step(&inputs, h);
        close("flywheel", plant.outputs().omega_f, target, 1e-3);
        assert_eq!(plant.outputs().phase, Phase::Slipping);
    }
    let impulse = report * 0.1 - (report - engine_at_rest) * lag * (1.0 - (-0.1_f64 / lag).exp());
    let momentum = |p: &Plant| 0.2 * p.outputs().omega_f + 0.5 * p.outputs().omega_c;
    close("momentum", momentum(&plant), 0.2 * 150.0 + 0.5 * 40.0 + impulse, 1e-3);
    let before = momentum(&plant);
    plant.couple(true);
    close("momentum of one", momentum(&plant), before, 1e-9);
    assert_eq!((plant.outputs().phase, plant.slip()), (Phase::Locked, 0.0));
    plant.step(&inputs, h);
    assert_eq!(plant.slip(), 0.0);
}

/// When coupled by a torque, even repeatedly, both sides keep the clutch's torque. Damping is taken into account when the flywheel is steered to a target speed.
#[test]
fn a_coupled_clutch_keeps_its_torque_wherever_the_bearing_goes() {
    let mut bench = Bench::held(150.0, 40.0, 20.0, 6.0);
    bench.vehicle.driveline.J_f = 0.2;
    let mut plant = bench.run(&effects::null(), 0.0);
    let open = Inputs { x_to: 0.0, ..bench.rest };
    for _ in 0..2 {
        plant.couple(false);
        (0..5).for_each(|_| plant.step(&open, 1e-3));
        close("torque", plant.outputs().t_fc, torque(6.0, MU), 1e-9);
    }
    close("flywheel", plant.outputs().omega_f, 150.0 - torque(6.0, MU) / 0.2 * 0.01, 1e-9);
    // The coupling torque heats the faces as the clutch torque would.
    bench.vehicle.thermal.C_1 = 70.0;
    let mut coupled = bench.run(&effects::null(), 0.0);
    coupled.couple(false);
    coupled.step(&bench.rest, 0.01);
    let heated = bench.run(&effects::null(), 0.01).outputs().theta_c;
    assert!(heated > 20.1, "{heated}");
    close("disc", coupled.outputs().theta_c, heated, 1e-9);
    bench.vehicle.driveline.b_f = 0.1;
    let mut damped = bench.run(&effects::null(), 0.0);
    damped.couple(false);
    damped.pass_on(&open, 0.01, 145.0);
    damped.step(&open, 0.01);
    close("damped flywheel", damped.outputs().omega_f, 145.0, 1e-4);
}

/// Speeds that oscillate with τω = 2: a first-order filter leaves 1/√5 of the amplitude, with a lag of 63°.
#[test]
fn a_filtered_speed_has_the_gain_and_the_phase_of_a_first_order_filter() {
    use kisspoint::effects::param::{clutch_speed_delay, engine_speed_delay};
    const TURN: f64 = 100.0;
    const TAU: f64 = 0.02;
    let mut p = effects::null();
    (p[engine_speed_delay::smoothing], p[clutch_speed_delay::smoothing]) = (TAU, TAU);
    let start = Start { omega_f: 150.0, omega_c: 60.0, theta_c: 25.0, theta_b: 25.0 };
    let mut plant = Plant::new(&Vehicle::paper(), &p, &start, &Inputs::default());
    // Cosine and sine parts of both speeds and of the sensed speeds, over whole periods after the filter has settled.
    let h = TAU_OF_A_TURN / TURN / 400.0;
    let mut parts = [[0.0; 2]; 4];
    for k in 0..400 * 30 {
        let t = h * (k as f64 + 0.5);
        let push = 40.0 * (TURN * t).cos();
        plant.step(&Inputs { t_e_ref: 4.5 + push, t_load: -3.9 - push, theta_h: 25.0, ..Inputs::default() }, h);
        if k >= 400 * 10 {
            let (o, y) = (plant.outputs(), &plant.state().y);
            let (sin, cos) = (TURN * (t + 0.5 * h)).sin_cos();
            for (part, value) in parts.iter_mut().zip([y[index::OMEGA_F], o.omega_f, y[index::OMEGA_C], o.omega_c]) {
                (part[0], part[1]) = (part[0] + value * cos, part[1] + value * sin);
            }
        }
    }
    for [(x, y), (u, v)] in [[0, 1], [2, 3]].map(|pair: [usize; 2]| pair.map(|i| (parts[i][0], parts[i][1]))) {
        let gain = u.hypot(v) / x.hypot(y);
        let late = (v.atan2(u) - y.atan2(x)).rem_euclid(TAU_OF_A_TURN).to_degrees();
        println!("gain {gain:.4}, {late:.2} degrees late");
        assert!((gain - 1.0 / 5.0_f64.sqrt()).abs() < 1e-3, "{gain}");
        assert!((late - 2.0_f64.atan().to_degrees()).abs() < 0.1, "{late}");
    }
}

const TAU_OF_A_TURN: f64 = std::f64::consts::TAU;
