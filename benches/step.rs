//! Nanoseconds per step of plant and controller, compared with the same numerical schemes hand-written in C (`benches/peer`, gcc -O3).
//!
//! `cargo bench --bench step`. Without gcc only the Rust figures are printed. Both sides run the same inputs, and their final states are compared, so that neither can omit
//! work. Each figure is the best of nine medians over 200 launches; Rust and C alternate.

use kisspoint::control::{self, Controller, Settings};
use kisspoint::effects;
use kisspoint::plant::{self, Plant, Start};
use kisspoint::vehicle::Vehicle;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const LAUNCHES: usize = 200;
const STEP: f64 = 1e-3;

/// Median nanoseconds per step, and three numbers of the final state.
type Figures = (f64, [f64; 3]);

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn plant_in_rust() -> Figures {
    let inputs: Vec<plant::Inputs> = (0..2000)
        .map(|k| f64::from(k) * STEP)
        .map(|t| plant::Inputs {
            x_to: if t < 1.6 { 4.5 + 1.2 * t.min(1.0) } else { 8.2 },
            t_e_ref: if t < 1.9 { 30.0 } else { 60.0 },
            theta_h: 25.0,
            t_load: 0.0,
        })
        .collect();
    let start = Start { omega_f: 104.719_755_119_659_78, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };
    let mut plant = Plant::new(&Vehicle::paper(), &effects::null(), &start, &inputs[0]);
    let times = (0..LAUNCHES).map(|_| {
        plant.restart(&start, &inputs[0]);
        let begin = Instant::now();
        for u in &inputs {
            plant.step(black_box(u), STEP);
        }
        begin.elapsed().as_nanos() as f64 / inputs.len() as f64
    });
    let time = median(times.collect());
    let end = plant.outputs();
    (time, [end.omega_f, end.theta_c, end.e_d])
}

fn controller_in_rust() -> Figures {
    let inputs: Vec<control::Inputs> = (0..1100)
        .map(|k| f64::from(k) * STEP / 1.2)
        .map(|a| control::Inputs {
            omega_f: 104.7 + 4.0 * a,
            omega_c: 100.0 * a * a,
            t_e: 3.0 + 60.0 * a,
            theta_h: 25.0,
            engage: true,
            wish: control::Wish::default(),
        })
        .collect();
    let mut controller = Controller::new(&Vehicle::paper(), &Settings::robust());
    let times = (0..LAUNCHES).map(|_| {
        controller.restart();
        let begin = Instant::now();
        for u in &inputs {
            controller.step(black_box(u), STEP);
        }
        begin.elapsed().as_nanos() as f64 / inputs.len() as f64
    });
    let time = median(times.collect());
    let end = controller.outputs();
    (time, [end.x_to, end.theta_c, end.t_e_ref])
}

/// Compiles and runs the C program `name`; `None` if there is no C compiler.
fn in_c(name: &str) -> Option<Figures> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peer").join(name).with_extension("c");
    let program = std::env::temp_dir().join(format!("kisspoint_peer_{name}_{}", std::process::id()));
    let compiled = Command::new("gcc").args(["-O3", "-o"]).arg(&program).arg(&source).arg("-lm").status();
    if !compiled.is_ok_and(|status| status.success()) {
        return None;
    }
    let output = Command::new(&program).output().ok();
    let _ = std::fs::remove_file(&program);
    let text = String::from_utf8(output?.stdout).ok()?;
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|x| x.parse().ok()).collect();
    let [time, a, b, c] = numbers[..] else { return None };
    Some((time, [a, b, c]))
}

fn compare(name: &str, rust: fn() -> Figures) {
    // Nine alternating runs each. The best one counts, because other load on the machine can only add time.
    let mut best = rust();
    let mut peer = in_c(name);
    for _ in 0..8 {
        best.0 = best.0.min(rust().0);
        if let (Some(a), Some(b)) = (&mut peer, in_c(name)) {
            a.0 = a.0.min(b.0);
        }
    }
    let Some((time, end)) = peer else {
        println!("{name}: {:.0} ns per step; no gcc to compile the peer with", best.0);
        return;
    };
    for (r, c) in best.1.iter().zip(end) {
        assert!((r - c).abs() < 1e-6 * c.abs().max(1.0), "{name}: the peer ends elsewhere: {:?} against {end:?}", best.1);
    }
    println!("{name}: {:.0} ns per step, hand-written C {time:.0} ns: {:.2} times", best.0, best.0 / time);
}

fn main() {
    compare("plant", plant_in_rust);
    compare("controller", controller_in_rust);
}
