//! The work of a step is bounded: whatever inputs and effects do, the number of the plant's inner iterations stays below the bound that the plant states, and that bound is
//! finite for every step and every plant that it accepts.

use kisspoint::effects::{self, PARAMETERS, Parameters};
use kisspoint::plant::events::ITERATIONS_PER_SUBSTEP;
use kisspoint::plant::pace::SHORTEST_SUBSTEP;
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::Vehicle;

mod random;
use random::Random;

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Some effects anywhere within their bounds, the others null.
fn some_effects(random: &mut Random) -> Parameters {
    let mut chosen = effects::null();
    let share = [0.0, 0.1, 0.5, 1.0][(random.next() * 4.0) as usize];
    for (value, p) in chosen.iter_mut().zip(&PARAMETERS) {
        if random.next() < share {
            *value = random.between(p.min, p.max);
        }
    }
    chosen
}

/// Inputs for difficult cases: around contact, around zero slip, reversals, steps.
fn some_inputs(random: &mut Random) -> Inputs {
    let t_e_ref = [0.0, 60.0, -60.0, 400.0, -400.0][(random.next() * 5.0) as usize] * random.next();
    Inputs { x_to: random.between(3.8, 8.0), t_e_ref, theta_h: random.between(-40.0, 120.0), t_load: random.between(-300.0, 300.0) }
}

#[test]
fn inner_iterations_stay_below_their_bound() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut most, mut share, mut steps) = (0, 0.0_f64, 0_u64);
    for _ in 0..400 {
        let omega_f = random.between(0.0, 300.0);
        let omega_c = if random.next() < 0.5 { omega_f } else { random.between(-100.0, 300.0) };
        let start = Start { omega_f, omega_c, theta_c: random.between(-20.0, 250.0), theta_b: 25.0 };
        let vehicle = Vehicle::paper();
        let mut plant = Plant::new(&vehicle, &some_effects(&mut random), &start, &some_inputs(&mut random));
        for k in 0..200 {
            if k % 50 == 49 {
                // A plant that is too fast to be integrated is refused, and the previous effects stay in force.
                let _ = plant.set_effects(&vehicle, &some_effects(&mut random));
            }
            let h = 10_f64.powf(random.between(-6.0, -2.0));
            let inputs = some_inputs(&mut random);
            plant.step(&inputs, h);
            let (found, bound) = (plant.iterations(), plant.most_iterations(h));
            assert!(found >= 1 && found <= bound, "{found} iterations in a step of {h} s, at most {bound} are promised");
            let promised = ((h / SHORTEST_SUBSTEP).ceil() + 1.0) * ITERATIONS_PER_SUBSTEP as f64;
            assert!(bound as f64 <= promised, "a step of {h} s may take {bound} iterations");
            (most, share, steps) = (most.max(found), share.max(found as f64 / bound as f64), steps + 1);
        }
    }
    println!("{steps} steps: at most {most} inner iterations in one, {:.1} % of its bound", 100.0 * share);
    // The test must contain difficult searches: without any search for a switch it would prove nothing.
    assert!(most > 50);
}
