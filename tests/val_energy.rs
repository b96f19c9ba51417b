//! The energy balance closes: work in equals kinetic energy, heat and losses; the result does not depend on the communication step.

use kisspoint::effects;
use kisspoint::plant::{Inputs, Phase, Plant, Start};
use kisspoint::vehicle::Vehicle;

const START: Start = Start { omega_f: 104.719_755_119_659_78, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };

/// A launch with prescribed inputs: the position closes in ramps that are held for 10 ms, and a torque step follows later.
fn inputs(t: f64) -> Inputs {
    let held = (t * 100.0 + 1e-6).floor() / 100.0;
    let x_to = if held < 1.6 { 4.5 + 1.2 * held.min(1.0) } else { 8.2 };
    Inputs { x_to, t_e_ref: if held < 1.9 { 30.0 } else { 60.0 }, theta_h: 25.0, t_load: 0.0 }
}

fn launch(effects: &effects::Parameters, step: impl Fn(usize) -> f64) -> Plant {
    let mut plant = Plant::new(&Vehicle::paper(), effects, &START, &inputs(0.0));
    let (mut t, mut k) = (0.0_f64, 0);
    while t < 2.5 - 1e-9 {
        let edge = ((t * 100.0 + 1e-6).floor() + 1.0) / 100.0;
        let h = step(k).min(edge - t);
        plant.step(&inputs(t), h);
        t += h;
        k += 1;
    }
    plant
}

#[test]
fn energy_balances_over_a_launch() {
    let mut compliant = effects::null();
    compliant[effects::param::driveline_compliance::compliance] = 1e-3;
    let mut soft = compliant;
    soft[effects::param::driveline_compliance::soft_angle] = 0.02;
    let mut slipping = effects::null();
    slipping[effects::param::tyre_slip::slip_per_torque] = 3e-4;
    slipping[effects::param::tyre_slip::grip] = 60.0;
    let mut both = soft;
    both[effects::param::tyre_slip::slip_per_torque] = 3e-4;
    both[effects::param::combustion_pulsation::share] = 0.3;
    both[effects::param::engine_torque_limit::inverse_torque] = 0.02;
    both[effects::param::surface_temperature::resistance] = 0.01;
    for parameters in [effects::null(), compliant, soft, slipping, both] {
        let begin = Plant::new(&Vehicle::paper(), &parameters, &START, &inputs(0.0)).energy();
        let plant = launch(&parameters, |_| 0.01);
        let end = plant.energy();
        assert_eq!(plant.outputs().phase, Phase::Locked);
        let out = end.stored - begin.stored + end.dissipated + end.losses;
        assert!((end.work_in - out).abs() < 1e-6 * end.work_in, "work in {} J, found {} J", end.work_in, out);
    }
}

#[test]
fn the_communication_step_does_not_matter() {
    let reference = launch(&effects::null(), |_| 0.01).outputs();
    let irregular = |k: usize| [1e-3, 3.3e-4, 7.1e-3, 2e-5][k % 4];
    for (what, other) in
        [("1 ms", launch(&effects::null(), |_| 1e-3).outputs()), ("irregular", launch(&effects::null(), irregular).outputs())]
    {
        assert!((other.omega_f - reference.omega_f).abs() < 1e-6, "{what}: {} against {}", other.omega_f, reference.omega_f);
        assert!((other.theta_c - reference.theta_c).abs() < 1e-6, "{what}: {} against {}", other.theta_c, reference.theta_c);
        assert!((other.e_d - reference.e_d).abs() < 1e-8 * reference.e_d, "{what}: {} against {}", other.e_d, reference.e_d);
    }
}

#[test]
fn a_locked_clutch_stays_locked_bit_for_bit() {
    let mut plant = launch(&effects::null(), |_| 0.01);
    for k in 0..1000 {
        plant.step(&Inputs { t_e_ref: 60.0 + f64::from(k % 7), ..inputs(2.4) }, 1.7e-3);
        let now = plant.outputs();
        assert_eq!(now.omega_f.to_bits(), now.omega_c.to_bits());
    }
}
