//! Actuator: position of the bearing after its command has moved.

use crate::bench::{Bench, Law, bearing, remains};
use kisspoint::effects::param::{
    actuator_backlash as backlash, actuator_delay as delay, actuator_lag as lag, actuator_rate_limit as limit, release_friction as friction,
};

/// A bearing at rest at 2 mm, commanded to `x` mm from 0.1 s on.
fn told(x: f64) -> Bench {
    Bench::held(100.0, 50.0, 25.0, 2.0).moved(0.1, x)
}

pub fn laws() -> Vec<Law> {
    let law = Law::new;
    let slow = |k, a| vec![(lag::time_constant, 0.06), (lag::curvature, k), (lag::asymmetry, a)];
    let left = |tau: f64, kappa: f64, t: f64| remains(tau, kappa, t).0;
    let play = [(backlash::play, 0.4)];
    let speed = [(limit::inverse_speed, 0.1)];
    let approach = [(limit::inverse_speed, 0.1), (limit::approach, 0.4)];
    // 1 mm up from the middle, then 0.3 mm down, over a travel of 0.8 mm; the stiction part relaxes over a quarter of that travel.
    let sticking = |s| [(friction::width, 0.4), (friction::travel, 0.8), (friction::stiction, s)];
    let up = |rate: f64| 1.0 - (-rate / 0.8).exp();
    let back = |rate: f64| -1.0 + (up(rate) + 1.0) * (-0.3 * rate / 0.8).exp();
    vec![
        law("friction of the bearing", &sticking(0.0), told(3.0), 0.2, bearing, 3.0 - 0.2 * up(2.0)),
        law("friction of the bearing, back again", &sticking(0.0), told(3.0).moved(0.15, 2.7), 0.2, bearing, 2.7 - 0.2 * back(2.0)),
        law("stiction of the bearing", &sticking(0.7), told(3.0), 0.2, bearing, 3.0 - 0.2 * (0.3 * up(2.0) + 0.7 * up(8.0))),
        law("stiction of the bearing, back again", &sticking(0.7), told(3.0).moved(0.15, 2.7), 0.2, bearing, {
            2.7 - 0.2 * (0.3 * back(2.0) + 0.7 * back(8.0))
        }),
        law("friction of the bearing behind its lag", &[&sticking(0.7)[..], &slow(0.0, 0.0)].concat(), told(3.0), 0.15, bearing, {
            let way = 1.0 - left(0.06, 0.0, 0.05);
            let gone = |rate: f64| 1.0 - (-rate * way / 0.8).exp();
            2.0 + way - 0.2 * (0.3 * gone(2.0) + 0.7 * gone(8.0))
        }),
        law("far travel holds the bearing by half", &[(friction::width, 0.4), (friction::travel, 0.05)], told(3.0), 0.2, bearing, 2.8),
        law("before the delay", &[(delay::delay, 0.05)], told(3.0), 0.149_999, bearing, 2.0),
        law("after the delay", &[(delay::delay, 0.05)], told(3.0), 0.150_001, bearing, 3.0).limit(),
        law("the middle of the play", &play, told(2.15), 0.2, bearing, 2.0),
        law("upper flank of the play", &play, told(3.0), 0.2, bearing, 2.8),
        law("within the play", &play, told(3.0).moved(0.15, 2.7), 0.2, bearing, 2.8),
        law("lower flank of the play", &play, told(3.0).moved(0.15, 2.0), 0.2, bearing, 2.2),
        law("greatest speed up", &speed, told(6.0), 0.3, bearing, 4.0),
        law("greatest speed down", &speed, told(-2.0), 0.3, bearing, 0.0).absolute(1e-9),
        law("the limited bearing arrives", &speed, told(6.0), 0.51, bearing, 6.0).limit(),
        law("before the approach", &approach, told(6.0), 0.4, bearing, 5.0),
        law("in the approach", &approach, told(6.0), 0.5, bearing, 6.0 - 0.4 * (-1.0_f64).exp()),
        law("a small move is all approach", &approach, told(2.2), 0.12, bearing, 2.2 - 0.2 * (-0.5_f64).exp()),
        law("the lag of a limited bearing", &[speed[0], (lag::time_constant, 0.05)], told(6.0), 0.3, bearing, {
            2.0 + 10.0 * (0.2 - 0.05 * (1.0 - (-4.0_f64).exp()))
        }),
        // Delayed against the ramp by τ, plus the decaying transient of the start from rest.
        law(
            "the lag of two equal parts of a limited bearing",
            &[speed[0], (lag::time_constant, 0.06), (lag::curvature, 0.25)],
            told(6.0),
            0.17,
            bearing,
            {
                let p = 2.0 / 0.06;
                2.0 + 10.0 * (0.07 - 0.06 + (0.06 + (p * 0.06 - 1.0) * 0.07) * (-p * 0.07_f64).exp())
            },
        ),
        law("the play of a limited bearing", &[speed[0], play[0]], told(6.0), 0.3, bearing, 3.8),
        law("lag", &slow(0.0, 0.0), told(3.0), 0.17, bearing, 3.0 - (-0.07_f64 / 0.06).exp()),
        law("lag of two equal parts", &slow(0.25, 0.0), told(3.0), 0.17, bearing, 3.0 - left(0.06, 0.25, 0.07)),
        law("lag of two parts", &slow(0.1, 0.0), told(3.0), 0.17, bearing, 3.0 - left(0.06, 0.1, 0.07)),
        law("lag of a fast second part", &slow(0.002, 0.0), told(3.0), 0.102, bearing, 3.0 - left(0.06, 0.002, 0.002)),
        law("lag that overshoots", &slow(1.0, 0.0), told(3.0), 0.33, bearing, 3.0 - left(0.06, 1.0, 0.23)),
        law("slower up", &slow(0.0, 0.5), told(3.0), 0.17, bearing, 3.0 - (-0.07_f64 / 0.09).exp()),
        law("faster down", &slow(0.0, 0.5), told(1.0), 0.17, bearing, 1.0 + (-0.07_f64 / 0.03).exp()),
        // The law is linear, so the response to a second move is superposed on that to the first, which is still in progress.
        law("a second move of two parts", &slow(0.1, 0.0), told(3.0).moved(0.13, 2.5), 0.17, bearing, {
            2.5 - left(0.06, 0.1, 0.07) + 0.5 * left(0.06, 0.1, 0.04)
        }),
        law("a second move of two equal parts", &slow(0.25, 0.0), told(3.0).moved(0.13, 2.5), 0.17, bearing, {
            2.5 - left(0.06, 0.25, 0.07) + 0.5 * left(0.06, 0.25, 0.04)
        }),
        law("a second move that overshoots", &slow(1.0, 0.0), told(3.0).moved(0.13, 2.5), 0.17, bearing, {
            2.5 - left(0.06, 1.0, 0.07) + 0.5 * left(0.06, 1.0, 0.04)
        }),
        law("the play follows the lag", &[play[0], (lag::time_constant, 0.06)], told(3.0), 0.17, bearing, {
            3.0 - (-0.07_f64 / 0.06).exp() - 0.2
        }),
    ]
}
