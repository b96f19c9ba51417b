//! Brakes and a stalled engine compared with closed forms.

use kisspoint::effects::{self, Parameters, param};
use kisspoint::plant::{Inputs, Plant, Start, motion::index};
use kisspoint::vehicle::Vehicle;

const OPEN: f64 = 0.0;

fn plant(omega_f: f64, omega_c: f64, x_to: f64, change: impl FnOnce(&mut Parameters)) -> (Plant, Inputs) {
    let mut p = effects::null();
    change(&mut p);
    let inputs = Inputs { x_to, t_e_ref: 0.0, theta_h: 25.0, t_load: 0.0 };
    (Plant::new(&Vehicle::paper(), &p, &Start { omega_f, omega_c, theta_c: 25.0, theta_b: 25.0 }, &inputs), inputs)
}

fn grade_torque(grade: f64) -> f64 {
    Vehicle::paper().driveline.mgR_over_i * grade / grade.hypot(1.0)
}

#[test]
fn brakes_hold_a_car_on_a_grade_bit_for_bit_up_to_their_torque() {
    for compliance in [0.0, 0.006] {
        let hold = |brake: f64| {
            let (mut plant, inputs) = plant(100.0, 0.0, OPEN, |p| {
                p[param::road_load::grade] = 0.1;
                p[param::driveline_compliance::compliance] = compliance;
            });
            plant.set_brake(brake);
            (0..500).for_each(|_| plant.step(&inputs, 1e-3));
            plant.state().y[index::OMEGA_V]
        };
        assert_eq!(hold(1.01 * grade_torque(0.1)), 0.0, "compliance {compliance}");
        assert!(hold(0.99 * grade_torque(0.1)) < 0.0, "compliance {compliance}");
        assert!(hold(0.0) < -5.0, "compliance {compliance}");
    }
}

#[test]
fn a_car_whose_brakes_let_go_rolls() {
    let (mut plant, inputs) = plant(100.0, 0.0, OPEN, |p| p[param::road_load::grade] = 0.1);
    plant.set_brake(2.0 * grade_torque(0.1));
    plant.step(&inputs, 0.1);
    assert!(plant.state().rest.car && plant.state().y[index::OMEGA_C] == 0.0);
    plant.set_brake(0.0);
    plant.step(&inputs, 0.1);
    let d = Vehicle::paper().driveline;
    let expected = -(grade_torque(0.1) - d.T_L0) / d.J_c * 0.1;
    let found = plant.state().y[index::OMEGA_C];
    assert!((found / expected - 1.0).abs() < 0.02, "{found} against {expected}");
}

/// Through a closed clutch the engine pushes a braked car up a grade; the car moves once the engine torque exceeds brakes and grade.
#[test]
fn a_closed_clutch_pushes_a_car_against_its_brakes() {
    let grade = grade_torque(0.1);
    for compliance in [0.0, 1e-3] {
        for (torque, brake, moves) in [(grade + 15.0, 20.0, false), (grade + 15.0, 10.0, true), (grade - 15.0, 20.0, false)] {
            let (mut plant, inputs) = plant(0.0, 0.0, 9.0, |p| {
                p[param::road_load::grade] = 0.1;
                p[param::driveline_compliance::compliance] = compliance;
                p[param::driveline_compliance::damping] = 2.0;
            });
            plant.set_brake(brake);
            // Slowly, so that no oscillation is excited.
            for k in 1..=2000 {
                plant.step(&Inputs { t_e_ref: torque * 5e-4 * f64::from(k), ..inputs }, 1e-3);
            }
            let (speed, held) = (plant.state().y[index::OMEGA_V], plant.state().rest.car);
            assert_eq!((speed > 0.0, held), (moves, !moves), "{torque} N·m, brake {brake}, compliance {compliance}: {speed}");
        }
    }
}

#[test]
fn a_slipping_clutch_pushes_a_car_against_its_brakes() {
    let held = |brake: f64| {
        let (mut plant, inputs) = plant(150.0, 0.0, 6.6, |p| p[param::road_load::grade] = 0.1);
        plant.set_brake(brake);
        plant.step(&inputs, 1e-3);
        (plant.state().rest.car, plant.outputs().t_fc)
    };
    let (_, torque) = held(500.0);
    let left = torque - grade_torque(0.1);
    assert!(torque > 10.0 && left.abs() > 5.0, "{torque} N·m");
    assert!(held(left.abs() + 2.0).0 && !held(left.abs() - 2.0).0, "{left} N·m are left to the brakes");
}

/// A rolling car turns a stalled engine through its clutch if the clutch torque exceeds the engine's resistance.
#[test]
fn a_stalled_engine_is_pushed_on_by_a_clutch_that_takes_hold() {
    let turns = |drag: f64, x_to: f64| {
        let (mut plant, inputs) = plant(0.0, 20.0, OPEN, |_| ());
        plant.step(&Inputs { t_e_ref: -drag, ..inputs }, 0.01);
        assert_eq!(plant.state().y[index::OMEGA_F], 0.0, "nothing turns it yet");
        plant.step(&Inputs { t_e_ref: -drag, x_to, ..inputs }, 0.01);
        (plant.state().y[index::OMEGA_F] > 0.0, plant.outputs().t_fc)
    };
    let (pushed, torque) = turns(5.0, 6.0);
    assert!(pushed && torque < -10.0, "{torque} N·m");
    assert!(!turns(10.0 - torque, 6.0).0, "it resists more than that");
}

/// J_c ω̇ = −T_B − b_c ω − T_L(ω): the time to standstill by quadrature, forwards and backwards.
#[test]
fn brakes_stop_a_rolling_car_and_keep_it() {
    let (brake, from) = (80.0, 20.0);
    for direction in [1.0, -1.0] {
        let (mut plant, inputs) = plant(100.0, direction * from, OPEN, |_| ());
        plant.set_brake(brake);
        let d = Vehicle::paper().driveline;
        let slowing = |w: f64| (brake + kisspoint::physics::driveline::resistance(&d, w, 0.0)) / d.J_c;
        let n = 20_000;
        let expected: f64 = (0..n).map(|k| from / f64::from(n) / slowing(from * (f64::from(k) + 0.5) / f64::from(n))).sum();
        let mut time = None;
        for k in 0..10_000 {
            plant.step(&inputs, 1e-4);
            if plant.state().y[index::OMEGA_C] == 0.0 {
                time = time.or(Some(f64::from(k + 1) * 1e-4));
            } else {
                assert!(time.is_none(), "moves again");
            }
        }
        let time = time.expect("stops");
        assert!((time - expected).abs() < 1.5e-4, "{time} against {expected}");
        let e = plant.energy();
        assert!((e.work_in - e.dissipated - e.losses - (e.stored - 0.5 * (d.J_f * 1e4 + d.J_c * from * from))).abs() < 1e-6, "{e:?}");
    }
}

/// A locked car that rolls back on a grade stalls its engine, which then blocks the clutch side and does not run backwards.
#[test]
fn an_engine_stalls_and_does_not_run_backwards() {
    for compliance in [0.0, 0.006] {
        let (mut plant, mut inputs) = plant(30.0, 30.0, 9.0, |p| {
            p[param::road_load::grade] = 0.1;
            p[param::driveline_compliance::compliance] = compliance;
        });
        let mut least = f64::INFINITY;
        for _ in 0..5000 {
            plant.step(&inputs, 1e-3);
            least = least.min(plant.state().y[index::OMEGA_F]);
        }
        assert_eq!((least, plant.state().y[index::OMEGA_F]), (0.0, 0.0), "compliance {compliance}");
        assert!((plant.outputs().t_fc - grade_torque(0.1)).abs() < 1e-3, "{} N·m", plant.outputs().t_fc);
        // With half the torque of the grade the engine stands still; with more than the torque of the grade it runs again.
        inputs.t_e_ref = 0.5 * grade_torque(0.1);
        (0..500).for_each(|_| plant.step(&inputs, 1e-3));
        assert!(plant.state().rest.engine && plant.state().y[index::OMEGA_F] == 0.0, "compliance {compliance}");
        inputs.t_e_ref = grade_torque(0.1) + 20.0;
        (0..500).for_each(|_| plant.step(&inputs, 1e-3));
        assert!(plant.state().y[index::OMEGA_F] > 1.0, "compliance {compliance}");
    }
}

#[test]
fn the_communication_step_does_not_matter() {
    let run = |step: f64| {
        let (mut plant, inputs) = plant(60.0, 8.0, 7.0, |p| p[param::road_load::grade] = 0.15);
        plant.set_brake(30.0);
        (0..(0.6 / step).round() as usize).for_each(|_| plant.step(&inputs, step));
        plant.state().y
    };
    let (coarse, fine) = (run(1e-2), run(1e-4));
    for (k, (a, b)) in coarse.iter().zip(&fine).enumerate() {
        assert!((a - b).abs() <= 1e-6 * (1.0 + b.abs()), "state {k}: {a} against {b}");
    }
}
