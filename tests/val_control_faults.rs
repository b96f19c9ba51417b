//! Inputs that freeze, drop out, jump or become NaN: outputs stay finite and safe, the fault is reported, and the controller recovers.

#[allow(dead_code)]
mod coupled;

use coupled::{Coupled, STANDSTILL};
use kisspoint::control::{Controller, Fault, Inputs, Settings, Wish};
use kisspoint::effects;
use kisspoint::plant::Phase;
use kisspoint::vehicle::Vehicle;

fn launch() -> Coupled {
    Coupled::new(&effects::null(), &Settings::robust(), STANDSTILL)
}

fn within(t: f64, from: f64, to: f64) -> bool {
    t > from + 1e-9 && t <= to + 1e-9
}

fn assert_sane(run: &Coupled, what: &str) {
    let s = Settings::robust();
    for (t, plant, c) in &run.rows {
        let all = [c.x_to, c.t_fc_hat, c.theta_c, c.theta_b, c.t_e_ref, c.x_to_fb, c.t_c_ref, c.e_d];
        assert!(all.iter().all(|x| x.is_finite()), "{what} at {t} s: {c:?}");
        assert!(c.x_to >= s.x_open && c.x_to <= s.x_max && c.t_e_ref >= s.engine_torque_min && c.t_e_ref <= s.engine_torque_max);
        assert!(plant.omega_f > 40.0 && plant.omega_f < 250.0, "{what} at {t} s: engine at {} rad/s", plant.omega_f);
    }
}

type Wire = fn(&mut Inputs);
type Spoiler = Box<dyn FnMut(&mut Inputs)>;

#[test]
fn a_short_drop_out_is_bridged() {
    let bad: [Wire; 3] = [|i| i.omega_f = f64::NAN, |i| i.t_e = f64::INFINITY, |i| i.omega_c += 200.0];
    for (k, spoil) in bad.into_iter().enumerate() {
        let mut run = launch();
        run.run(2.5, |t, told| {
            if within(t, 0.6, 0.63) {
                spoil(told)
            }
        });
        assert_sane(&run, "short drop-out");
        assert!(run.rows.iter().any(|r| r.2.fault != Fault::None), "case {k} is reported");
        assert!(run.rows.iter().filter(|r| r.0 > 0.1 && r.0 < 1.0).all(|r| r.2.phase == Phase::Slipping), "case {k} goes on");
        assert_eq!((run.last().2.fault, run.last().1.phase), (Fault::None, Phase::Locked), "case {k}");
    }
}

#[test]
fn a_long_fault_in_slip_opens_and_recovers() {
    let mut frozen: Option<Inputs> = None;
    let cases: [(&str, Fault, Spoiler); 4] = [
        ("NaN", Fault::Invalid, Box::new(|i| i.omega_c = f64::NAN)),
        ("absurd torque", Fault::Invalid, Box::new(|i| i.t_e = -1e300)),
        ("toggling jump", Fault::Jump, {
            let mut sign = 1.0;
            Box::new(move |i| {
                sign = -sign;
                i.omega_f += 150.0 * sign
            })
        }),
        ("frozen", Fault::Frozen, Box::new(move |i| *i = *frozen.get_or_insert(*i))),
    ];
    for (what, fault, mut spoil) in cases {
        let mut run = launch();
        run.run(5.0, |t, told| {
            if within(t, 0.6, 1.2) {
                spoil(told)
            }
        });
        assert_sane(&run, what);
        let at = run.rows.iter().find(|r| r.0 > 1.15).unwrap();
        assert_eq!(at.2.fault, fault, "{what}");
        assert_eq!((at.1.phase, at.2.x_to), (Phase::Open, Settings::robust().x_open), "{what}: open");
        assert_eq!((run.last().2.fault, run.last().1.phase), (Fault::None, Phase::Locked), "{what}: recovers");
    }
}

#[test]
fn a_closed_clutch_holds_through_a_fault() {
    let mut run = launch();
    run.run(2.5, |_, _| ()).run(3.5, |_, told| {
        told.omega_f = f64::NAN;
        told.omega_c = f64::NAN;
    });
    assert_sane(&run, "fault while closed");
    assert_eq!(run.last().2.fault, Fault::Invalid);
    assert!(run.rows.iter().filter(|r| r.0 > 2.5).all(|r| r.1.phase == Phase::Locked && r.2.x_to == Settings::robust().x_max));
    run.run(3.6, |_, told| told.engage = false);
    assert!(run.last().2.x_to < Settings::robust().x_max, "engage still opens it");
}

#[test]
fn a_new_level_that_stays_is_believed() {
    let mut run = launch();
    run.run(0.5, |t, told| {
        if t > 0.2 {
            told.omega_f += 40.0
        }
    });
    assert_eq!(run.last().2.fault, Fault::None);
    assert!(run.rows.iter().any(|r| r.2.fault == Fault::Jump));
}

#[test]
fn bad_air_temperature_changes_nothing() {
    let mut clean = launch();
    let mut spoiled = launch();
    clean.run(1.0, |_, _| ());
    spoiled.run(1.0, |t, told| {
        if t > 0.3 {
            told.theta_h = f64::NAN
        }
    });
    assert_eq!(clean.last(), spoiled.last());
}

/// If an inclination sensor fails on a hill, the car must not roll away.
#[test]
fn a_grade_that_is_no_number_keeps_the_brakes_on_and_is_reported() {
    let mut controller = Controller::new(&Vehicle::paper(), &Settings::robust());
    let told = |t_grade: f64| {
        let wish = Wish { t_grade, ..Wish::default() };
        Inputs { omega_f: 104.7, omega_c: 0.0, t_e: 3.0, theta_h: 25.0, engage: false, wish }
    };
    let mut after = |t_grade: f64, steps: u32| {
        (0..steps).for_each(|_| controller.step(&told(t_grade), 1e-3));
        let o = controller.outputs();
        (o.t_brake, o.fault)
    };
    assert_eq!(after(40.0, 100), (80.0, Fault::None));
    for bad in [f64::NAN, f64::INFINITY, -1e300, 1.1e4] {
        // For longer than any fault is bridged.
        assert_eq!(after(bad, 3000), (80.0, Fault::Invalid), "{bad}");
    }
    assert_eq!(after(30.0, 1), (60.0, Fault::None));
    // A launch continues without the grade, and a grade that never arrived applies no brake.
    let mut run = launch();
    run.run(2.5, |t, told| told.wish.t_grade = if within(t, 0.3, 2.0) { f64::NAN } else { 0.0 });
    assert_sane(&run, "no grade");
    assert!(run.rows.iter().filter(|r| within(r.0, 0.31, 1.9)).all(|r| r.2.fault == Fault::Invalid && r.2.t_brake == 0.0));
    assert_eq!((run.last().2.fault, run.last().1.phase), (Fault::None, Phase::Locked));
}

#[test]
fn no_sequence_of_garbage_makes_an_output_that_is_not_finite() {
    let garbage = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1e308, -1e308, 5e-324, 104.7, -300.0, 9999.0, 1e4];
    let s = Settings::robust();
    let mut controller = Controller::new(&Vehicle::paper(), &s);
    let mut seed = 7_u64;
    let mut pick = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize
    };
    for _ in 0..20_000 {
        let mut value = || garbage[pick() % garbage.len()];
        let wish = Wish { t_e_max: value(), aggressiveness: value(), t_grade: value(), creep: value() > 0.0, forget: value() > 0.0 };
        let inputs = Inputs { omega_f: value(), omega_c: value(), t_e: value(), theta_h: value(), engage: value() > 0.0, wish };
        controller.step(&inputs, [1e-6, 1e-3, 0.02, 0.1][pick() % 4]);
        let c = controller.outputs();
        let all = [c.x_to, c.t_fc_hat, c.theta_c, c.theta_b, c.t_e_ref, c.x_to_fb, c.t_c_ref, c.e_d];
        assert!(all.iter().all(|x| x.is_finite()), "{inputs:?} gives {c:?}");
        assert!(c.x_to >= s.x_open && c.x_to <= s.x_max);
    }
}

#[test]
fn a_state_taken_up_goes_on_bit_for_bit() {
    let mut run = launch();
    run.run(0.7, |_, _| ());
    let mut other = Controller::new(&Vehicle::paper(), &Settings::robust());
    other.set_state(run.controller.state());
    let mut first = run.controller;
    let inputs = Inputs { omega_f: 105.0, omega_c: 40.0, t_e: 60.0, theta_h: 25.0, engage: true, wish: Wish::default() };
    for k in 0..200 {
        let inputs = Inputs { omega_c: 40.0 + 0.01 * f64::from(k), ..inputs };
        first.step(&inputs, 1e-3);
        other.step(&inputs, 1e-3);
        assert_eq!(first.state(), other.state());
    }
    first.restart();
    assert_eq!(first.state(), Controller::new(&Vehicle::paper(), &Settings::robust()).state());
}

#[test]
fn values_that_arrive_late_only_delay() {
    // Late by a fixed time, and by a jitter that repeats old values and then catches up.
    for (what, late) in [("20 ms", [20, 20, 20]), ("50 ms", [50, 50, 50]), ("0 to 20 ms", [0, 7, 20])] {
        let mut sent: Vec<Inputs> = Vec::new();
        let mut run = launch();
        run.run(4.0, |_, told| {
            sent.push(*told);
            let lateness = late[sent.len() / 13 % 3];
            *told = sent[(sent.len() - 1).saturating_sub(lateness)];
        });
        assert_sane(&run, what);
        assert_eq!((run.last().2.fault, run.last().1.phase), (Fault::None, Phase::Locked), "{what}");
        assert!(run.rows.iter().all(|r| r.2.fault == Fault::None), "{what}: late values are no fault");
    }
}

#[test]
fn one_sensor_that_stands_still_or_falls_to_nothing_is_survived() {
    let mut held = [None; 2];
    let cases: [(&str, Spoiler); 4] = [
        ("ω_f frozen", Box::new(move |i| i.omega_f = *held[0].get_or_insert(i.omega_f))),
        ("ω_c frozen", Box::new(move |i| i.omega_c = *held[1].get_or_insert(i.omega_c))),
        ("ω_f drops to 0", Box::new(|i| i.omega_f = 0.0)),
        ("all drop to 0", Box::new(|i| (i.omega_f, i.omega_c, i.t_e) = (0.0, 0.0, 0.0))),
    ];
    for (what, mut spoil) in cases {
        let mut run = launch();
        run.run(6.0, |t, told| {
            if within(t, 0.5, 1.0) {
                spoil(told)
            }
        });
        assert_sane(&run, what);
        assert_eq!((run.last().2.fault, run.last().1.phase), (Fault::None, Phase::Locked), "{what}: recovers");
    }
}
