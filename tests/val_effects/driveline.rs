//! Driveline: a coasting disc with the clutch open, J_c ω̇_c = −T_L.

use crate::bench::{Bench, Law, omega_c};
use kisspoint::effects::param::{driveline_compliance as shafts, road_load as road, tyre_slip as tyre, vehicle_mass as mass};

const J: f64 = 0.5;
const START: f64 = 100.0;

fn coasting(start: f64, t_load: f64) -> Bench {
    let mut bench = Bench::held(0.0, start, 25.0, 0.0);
    bench.vehicle.driveline.J_c = J;
    bench.rest.t_load = t_load;
    bench.step = 1e-4;
    bench
}

const DISC: f64 = 0.2 * J;
const BEYOND: f64 = 0.8 * J;
const LOAD: f64 = 50.0;
const COMPLIANCE: f64 = 1e-3;

/// Disc speed after `t` s, from the momentum of both inertias and the twisting speed `twisting` of the shafts, rad/s.
fn disc(t: f64, twisting: f64) -> f64 {
    START + (BEYOND * twisting - LOAD * t) / J
}

/// Twisting speed `t` s after a step of the load, for a stiffness (N·m/rad) and damping (N·m·s/rad): a damped oscillator.
fn twisting(stiffness: f64, damping: f64, t: f64) -> f64 {
    let reduced = DISC * BEYOND / J;
    let decay = 0.5 * damping / reduced;
    let turn = (stiffness / reduced - decay * decay).sqrt();
    LOAD / BEYOND / turn * (-decay * t).exp() * (turn * t).sin()
}

/// The same for a lash of ± `angle` rad without damping: free motion until the lash is taken up, then an oscillator with an initial speed.
fn lashing(angle: f64, t: f64) -> f64 {
    let pull = LOAD / BEYOND;
    let taken_up = (2.0 * angle / pull).sqrt();
    let turn = (J / (COMPLIANCE * DISC * BEYOND)).sqrt();
    let phase = turn * (t - taken_up);
    pull / turn * phase.sin() + pull * taken_up * phase.cos()
}

/// A tyre: slip per torque, relaxation (rad), grip (N·m), damping (N·m·s/rad); and the compliance of the shafts in series with it.
#[derive(Clone, Copy)]
struct Tyre {
    slip: f64,
    relaxation: f64,
    grip: f64,
    damping: f64,
    compliance: f64,
}

impl Tyre {
    /// Steady-state slip of a tyre under a torque.
    fn slip(&self, torque: f64) -> f64 {
        self.slip * torque / (1.0 - torque.abs() / self.grip)
    }

    /// The torque at which tyres and shafts together have this twist, by bisection.
    fn torque(&self, twist: f64) -> f64 {
        let (mut low, mut high) = (-self.grip, self.grip);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if self.compliance * middle + self.relaxation * self.slip(middle) < twist { low = middle } else { high = middle }
        }
        low
    }

    /// Disc speed `t` s after a step of the load: the balances of both inertias, in many small steps of Heun's method.
    fn disc(&self, share: f64, t: f64) -> f64 {
        const STEPS: usize = 20_000;
        let h = t / STEPS as f64;
        let rates = |[disc, car, twist]: [f64; 3]| {
            let torque = self.torque(twist);
            let turning = disc - car - 0.5 * (disc + car) * self.slip(torque);
            let passed = torque + self.damping * turning;
            [-passed / (share * J), (passed - LOAD) / ((1.0 - share) * J), turning]
        };
        let mut y = [START, START, 0.0];
        for _ in 0..STEPS {
            let first = rates(y);
            let second = rates(std::array::from_fn(|i| y[i] + h * first[i]));
            y = std::array::from_fn(|i| y[i] + 0.5 * h * (first[i] + second[i]));
        }
        y[0]
    }
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let twist = |damping, angle, share| {
        let sizes = [(shafts::compliance, COMPLIANCE), (shafts::disc_share, 0.2), (shafts::damping, damping)];
        [&sizes[..], &[(shafts::soft_angle, angle), (shafts::soft_share, share)]].concat()
    };
    let rolled = |t: f64| 0.5 * ((1.0_f64 / 0.5).sinh() * (-8.0 * t / (J * 0.5)).exp()).asinh();
    let grade = |g: f64| 400.0 * g.atan().sin() / J;
    let gripping = Tyre { slip: 1e-3, relaxation: 8.0, grip: 200.0, damping: 0.3, compliance: 0.0 };
    let weak = Tyre { slip: 4e-4, relaxation: 8.0, grip: 9.0, ..gripping };
    let behind = Tyre { compliance: 2e-3, ..gripping };
    let of = |t: Tyre, share| {
        let sizes = [(tyre::slip_per_torque, t.slip), (tyre::relaxation, t.relaxation), (tyre::grip, t.grip)];
        let before = [(tyre::damping, t.damping), (tyre::wheel_share, share)];
        let elastic = [(shafts::compliance, t.compliance), (shafts::damping, t.damping), (shafts::disc_share, share)];
        [&sizes[..], if t.compliance > 0.0 { &elastic } else { &before }].concat()
    };
    vec![
        law("tyres", &of(gripping, 0.2), coasting(START, LOAD), 0.3, omega_c, gripping.disc(0.2, 0.3)),
        law("tyres that lose their grip", &of(weak, 0.3), coasting(START, LOAD), 0.2, omega_c, weak.disc(0.3, 0.2)),
        law("tyres backwards", &of(gripping, 0.2), coasting(-START, -LOAD), 0.3, omega_c, -gripping.disc(0.2, 0.3)),
        law("tyres behind elastic shafts", &of(behind, 0.2), coasting(START, LOAD), 0.1, omega_c, behind.disc(0.2, 0.1)),
        law("shafts", &twist(0.3, 0.0, 0.3), coasting(START, LOAD), 0.05, omega_c, disc(0.05, twisting(1.0 / COMPLIANCE, 0.3, 0.05))),
        law(
            "damped shafts",
            &twist(5.0, 0.0, 0.3),
            coasting(START, LOAD),
            0.03,
            omega_c,
            disc(0.03, twisting(1.0 / COMPLIANCE, 5.0, 0.03)),
        ),
        law(
            "soft shafts",
            &twist(0.3, 1.0, 0.25),
            coasting(START, LOAD),
            0.05,
            omega_c,
            disc(0.05, twisting(0.25 / COMPLIANCE, 0.3, 0.05)),
        ),
        law("lash", &twist(0.0, 0.004, 0.0), coasting(START, LOAD), 0.05, omega_c, disc(0.05, lashing(0.004, 0.05))).within(1e-6),
        law("lash the other way", &twist(0.0, 0.004, 0.0), coasting(-START, -LOAD), 0.05, omega_c, -disc(0.05, lashing(0.004, 0.05)))
            .within(1e-6),
        law("uphill", &[(road::grade, 0.05)], coasting(START, 0.0), 0.5, omega_c, START - grade(0.05) * 0.5),
        law("downhill", &[(road::grade, -0.05)], coasting(START, 0.0), 0.5, omega_c, START + grade(0.05) * 0.5),
        law("45 degrees", &[(road::grade, 1.0)], coasting(START, 0.0), 0.1, omega_c, START - 400.0 / 2.0_f64.sqrt() * 0.1 / J),
        law("uphill backwards", &[(road::grade, 0.05)], coasting(-START, 0.0), 0.5, omega_c, -START - grade(0.05) * 0.5),
        law("rolling", &[(road::rolling_torque, 8.0)], coasting(START, 0.0), 0.5, omega_c, START - 8.0 * 0.5 / J),
        law("rolling backwards", &[(road::rolling_torque, 8.0)], coasting(-START, 0.0), 0.5, omega_c, -START + 8.0 * 0.5 / J),
        law("rolling to a halt", &[(road::rolling_torque, 8.0)], coasting(1.0, 0.0), 0.03, omega_c, rolled(0.03)),
        law("mass", &[(mass::factor, 1.4)], coasting(START, 20.0), 0.5, omega_c, START - 20.0 * 0.5 / (1.4 * J)),
    ]
}
