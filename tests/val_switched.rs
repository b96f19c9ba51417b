//! Effects that are switched on, switched off or changed while the plant runs: the current state continues without a jump. The bench is that of the effects' laws, so each
//! number is known in closed form.

#[allow(dead_code)]
#[path = "val_effects/bench.rs"]
mod bench;

use bench::{Bench, MU, close, elastic, torque, with};
use kisspoint::effects::{self, param};
use kisspoint::plant::Plant;
use kisspoint::plant::motion::index;

#[test]
fn hysteresis_that_is_switched_on_begins_between_its_branches() {
    let bench = Bench::held(100.0, 50.0, 25.0, 5.0).moved(0.0, 6.0);
    let mut plant = bench.run(&effects::null(), 0.01);
    let on = with(&[(param::cushion_hysteresis::width, 0.4), (param::cushion_hysteresis::stroke, 0.8)]);
    plant.set_effects(&bench.vehicle, &on).unwrap();
    close("at once", plant.outputs().t_fc, torque(6.0, MU), 1e-9);
    let closing = bench.then[0].1;
    plant.step(&kisspoint::plant::Inputs { x_to: 6.5, ..closing }, 1e-3);
    let z = 1.0 - (-2.0 * 0.5 / 0.8_f64).exp();
    close("after 0.5 mm", plant.outputs().t_fc, (1.0 + 0.2 * z) * torque(6.5, MU), 1e-9);
    // If it is set again while active, it keeps its memory.
    plant.set_effects(&bench.vehicle, &on).unwrap();
    close("set anew", plant.outputs().t_fc, (1.0 + 0.2 * z) * torque(6.5, MU), 1e-9);
}

#[test]
fn a_delay_that_is_switched_on_begins_with_what_is_there() {
    let mut bench = Bench::held(200.0, 100.0, 25.0, 2.0).moved(0.0, 3.0);
    (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (0.5, 0.5);
    for inputs in [&mut bench.rest, &mut bench.then[0].1] {
        (inputs.t_e_ref, inputs.t_load) = (20.0, 20.0);
    }
    let mut plant = bench.run(&effects::null(), 0.5);
    let delays = [param::actuator_delay::delay, param::engine_speed_delay::delay, param::clutch_speed_delay::delay];
    plant.set_effects(&bench.vehicle, &with(&delays.map(|delay| (delay, 0.05)))).unwrap();
    let now = kisspoint::plant::Inputs { x_to: 2.5, ..bench.then[0].1 };
    (0..49).for_each(|_| plant.step(&now, 1e-3));
    assert_eq!(plant.outputs().x_to_actual, 3.0, "the command that held before");
    close("the speed of then", plant.outputs().omega_c, 80.0, 1e-6);
    close("the engine's", plant.outputs().omega_f, 220.0, 1e-6);
    (0..51).for_each(|_| plant.step(&now, 1e-3));
    assert_eq!(plant.outputs().x_to_actual, 2.5);
    close("the speed of 50 ms ago", plant.outputs().omega_c, 80.0 - 40.0 * 0.05, 1e-6);
    close("the engine's", plant.outputs().omega_f, 220.0 + 40.0 * 0.05, 1e-6);
}

#[test]
fn faces_stay_hot_when_another_effect_is_set_and_are_as_the_disc_once_theirs_is_switched_off() {
    let bench = Bench::held(100.0, 50.0, 25.0, 6.0);
    let faces = [(param::surface_temperature::resistance, 0.02), (param::surface_temperature::time_constant, 0.08)];
    let mut plant = bench.run(&with(&faces), 0.05);
    let hotter = plant.state().y[index::SURFACE];
    assert!(hotter > 1.0, "{hotter} K");
    let another = [&faces[..], &[(param::vehicle_mass::factor, 1.1)]].concat();
    plant.set_effects(&bench.vehicle, &with(&another)).unwrap();
    assert_eq!(plant.state().y[index::SURFACE], hotter);
    plant.set_effects(&bench.vehicle, &effects::null()).unwrap();
    assert_eq!(plant.state().y[index::SURFACE], 0.0);
}

#[test]
fn a_filter_that_is_switched_on_begins_with_the_speed_and_set_anew_goes_on() {
    use param::{clutch_speed_delay, engine_speed_delay};
    let mut bench = Bench::held(200.0, 100.0, 25.0, 0.0);
    (bench.vehicle.driveline.J_f, bench.vehicle.driveline.J_c) = (0.2, 0.5);
    (bench.rest.t_e_ref, bench.rest.t_load) = (-20.0, 20.0);
    let mut plant = bench.run(&effects::null(), 0.5);
    let speeds = |plant: &Plant| [plant.outputs().omega_f, plant.outputs().omega_c];
    let before = speeds(&plant);
    let filtered = [(engine_speed_delay::smoothing, 0.05), (clutch_speed_delay::smoothing, 0.02)];
    plant.set_effects(&bench.vehicle, &with(&filtered)).unwrap();
    assert_eq!(speeds(&plant), before, "switched on");
    (0..10).for_each(|_| plant.step(&bench.rest, 1e-3));
    // A ramp that begins now lags by its time constant, minus the decayed part of the transient.
    let trails = |tau: f64| tau * -(-0.01_f64 / tau).exp_m1();
    let late = speeds(&plant);
    close("flywheel", late[0], before[0] - 100.0 * (0.01 - trails(0.05)), 1e-6);
    close("disc", late[1], before[1] - 40.0 * (0.01 - trails(0.02)), 1e-6);
    let anew = [&filtered[..], &[(param::engine_torque_gain::gain, 1.01)]].concat();
    plant.set_effects(&bench.vehicle, &with(&anew)).unwrap();
    assert_eq!(speeds(&plant), late, "set anew");
}

/// The twist of the shafts, also within their lash, is kept when other effects are set.
#[test]
fn shafts_stay_as_they_are_when_another_effect_is_set() {
    use param::driveline_compliance::{soft_angle, soft_share};
    let (mut bench, soft) = elastic(100.0, 60.0, 6.0);
    bench.rest.t_load = 15.0;
    let mut lash = soft;
    (lash[soft_angle], lash[soft_share]) = (0.05, 0.0);
    for (set, h) in [(soft, 0.013), (lash, 2e-3)] {
        let mut plant = bench.run(&set, h);
        let before = *plant.state();
        assert!(before.y[index::TWIST] != 0.0 && before.y[index::OMEGA_V] != before.y[index::OMEGA_C], "{before:?}");
        let mut other = set;
        other[param::friction_level::factor] = 0.9;
        plant.set_effects(&bench.vehicle, &other).unwrap();
        assert_eq!(*plant.state(), before);
    }
}

/// Only delayed signals are stored: a sensor that is delayed later than another has no history of the time before either.
#[test]
fn a_second_delay_begins_with_what_is_there_as_well() {
    let mut bench = Bench::held(200.0, 100.0, 25.0, 0.0);
    bench.vehicle.driveline.J_c = 0.5;
    bench.rest.t_load = 20.0;
    let engine = [(param::engine_speed_delay::delay, 0.05)];
    let mut plant = bench.run(&with(&engine), 0.5);
    let both = [&engine[..], &[(param::clutch_speed_delay::delay, 0.05)]].concat();
    plant.set_effects(&bench.vehicle, &with(&both)).unwrap();
    close("at once", plant.outputs().omega_c, 80.0, 1e-6);
    (0..49).for_each(|_| plant.step(&bench.rest, 1e-3));
    close("49 ms later", plant.outputs().omega_c, 80.0, 1e-6);
}

/// Tyres, or shafts before them, that become soft while the car coasts under a load carry the torque of the rigid driveline.
#[test]
fn tyres_that_are_switched_on_carry_what_there_is() {
    use param::{driveline_compliance as shafts, tyre_slip as tyre};
    let mut bench = Bench::held(0.0, 100.0, 25.0, 0.0);
    bench.vehicle.driveline.J_c = 0.5;
    bench.rest.t_load = 20.0;
    let tyres =
        [(tyre::slip_per_torque, 3e-4), (tyre::relaxation, 15.0), (tyre::grip, 300.0), (tyre::wheel_share, 0.2), (tyre::damping, 0.0)];
    let both = [&tyres[..], &[(shafts::compliance, 2e-3), (shafts::disc_share, 0.2), (shafts::damping, 0.0)]].concat();
    for set in [&tyres[..], &both] {
        let mut plant = bench.run(&effects::null(), 0.1);
        plant.set_effects(&bench.vehicle, &with(set)).unwrap();
        let before = plant.outputs().omega_c;
        plant.step(&bench.rest, 1e-5);
        close("deceleration", (before - plant.outputs().omega_c) / 1e-5, 20.0 / 0.5, 0.05);
        if set.len() > tyres.len() {
            continue;
        }
        // Shafts that become soft in addition.
        plant.set_effects(&bench.vehicle, &with(&both)).unwrap();
        plant.set_effects(&bench.vehicle, &with(&both[5..])).unwrap();
        let before = plant.outputs().omega_c;
        plant.step(&bench.rest, 1e-5);
        close("deceleration without tyres", (before - plant.outputs().omega_c) / 1e-5, 20.0 / 0.5, 0.5);
    }
}

/// When shafts or tyres become rigid, their two ends keep their momentum and gain no energy.
#[test]
fn shafts_that_become_rigid_make_one_speed_of_two() {
    let tyre = with(&[(param::tyre_slip::slip_per_torque, 1e-3), (param::tyre_slip::wheel_share, 0.2)]);
    for (x_to, stuck) in [(0.0, false), (5.0, false), (8.0, true)] {
        let (mut bench, shafts) = elastic(if stuck { 100.0 } else { 55.0 }, 100.0, x_to);
        bench.rest.t_load = 60.0;
        for effects in [shafts, tyre] {
            let mut plant = Plant::new(&bench.vehicle, &effects, &bench.start, &bench.rest);
            while (plant.state().y[index::OMEGA_C] - plant.state().y[index::OMEGA_V]).abs() < 0.05 {
                plant.step(&bench.rest, 1e-4);
            }
            let (before, disc) = (*plant.state(), plant.config().disc_inertia());
            assert_eq!(before.stuck, stuck);
            plant.set_effects(&bench.vehicle, &effects::null()).unwrap();
            let after = *plant.state();
            let momentum = |y: &[f64]| 0.2 * y[index::OMEGA_F] + disc * y[index::OMEGA_C] + (0.5 - disc) * y[index::OMEGA_V];
            let energy = |y: &[f64]| {
                0.5 * (0.2 * y[index::OMEGA_F].powi(2) + disc * y[index::OMEGA_C].powi(2) + (0.5 - disc) * y[index::OMEGA_V].powi(2))
            };
            close("momentum", momentum(&after.y), momentum(&before.y), 1e-11);
            assert!(energy(&after.y) < energy(&before.y), "{} J and {} J", energy(&before.y), energy(&after.y));
            assert_eq!(after.y[index::OMEGA_C], after.y[index::OMEGA_V]);
            assert_eq!(after.y[index::OMEGA_F], if stuck { after.y[index::OMEGA_C] } else { before.y[index::OMEGA_F] });
            plant.step(&bench.rest, 1e-6);
            close("disc", plant.state().y[index::OMEGA_C], after.y[index::OMEGA_C], 1e-2);
        }
    }
    // If this makes the disc slower than the flywheel, the clutch drives it from then on; an engine that stood still beside it turns.
    let (mut bench, effects) = elastic(99.0, 100.0, 5.0);
    bench.start.omega_c = 100.0;
    let mut plant = Plant::new(&bench.vehicle, &effects, &bench.start, &bench.rest);
    plant.hold_car();
    assert_eq!(plant.state().direction, -1.0);
    plant.set_effects(&bench.vehicle, &effects::null()).unwrap();
    close("a fifth of the momentum", plant.state().y[index::OMEGA_C], 20.0, 1e-12);
    assert_eq!(plant.state().direction, 1.0);
}
