//! A synthetic campaign with its answer, for tests of the report and for its picture in the docs.
//!
//! The car is the plant with a friction fade and noise; "before" is the plant without the fade, "after" the plant with the fade as a diagnosis might have found it. Gaps and
//! engagement figures are computed from these curves; evidence, probabilities and the residual map are invented, since the report only shows them.

use kisspoint::effects::{Parameters, null, param};
use kisspoint::plant::{Inputs, Outputs, Phase, Plant, Start};
use kisspoint::report::{Overlay, OverlayChannel};
use kisspoint::vehicle::Vehicle;
use serde_json::{Map, Value, json};

const DT: f64 = 0.01;
const SAMPLES: usize = 450;

/// Standard deviation of the noise of flywheel speed, disc speed and clutch torque.
const NOISE: [f64; 3] = [0.35, 0.3, 1.2];

/// All data of the report.
pub struct Campaign {
    pub diagnosis: Value,
    pub overlays: Vec<Overlay>,
    pub provenance: Vec<(String, String)>,
}

/// Name, manoeuvre, disc temperature at the start in °C, target clutch torque in N·m, held out.
const RECORDINGS: [(&str, &str, f64, f64, bool); 10] = [
    ("r01", "launch", 32.0, 45.0, false),
    ("r02", "launch", 38.0, 65.0, false),
    ("r03", "launch", 45.0, 90.0, true),
    ("r04", "launch", 96.0, 55.0, false),
    ("r05", "launch", 138.0, 70.0, false),
    ("r06", "launch", 150.0, 85.0, true),
    ("r07", "creep", 28.0, 14.0, false),
    ("r08", "creep", 125.0, 16.0, true),
    ("r09", "modulate", 60.0, 40.0, false),
    ("r10", "open_rev", 45.0, 0.0, false),
];

fn fade(depth: f64, onset: f64, width: f64) -> Parameters {
    let mut p = null();
    p[param::friction_fade::depth] = depth;
    p[param::friction_fade::onset] = onset;
    p[param::friction_fade::width] = width;
    p
}

/// Builds the campaign, with the same bytes every time.
pub fn campaign() -> Campaign {
    let vehicle = Vehicle::paper();
    let (car, found) = (fade(0.31, 128.0, 42.0), fade(0.304, 126.0, 45.0));
    let mut overlays = Vec::new();
    let (mut per_recording, mut kpi) = (Vec::new(), Map::new());
    let mut noise = Noise(7);
    for (name, manoeuvre, theta, aim, held_out) in RECORDINGS {
        let start = Start { omega_f: 104.7, omega_c: 0.0, theta_c: theta, theta_b: 25.0 + 0.6 * (theta - 25.0) };
        let (inputs, real) = drive(&vehicle, &car, &start, manoeuvre, aim);
        let [before, after] = [null(), found].map(|p| replay(&vehicle, &p, &start, &inputs));
        let channels = channels(&real, &before, &after, &mut noise);
        for (channel, sigma) in channels.iter().zip(NOISE) {
            per_recording.push(json!({ "recording": name, "channel": channel.column, "unit": channel.unit, "noise": sigma,
                "before": rms(&channel.real, &channel.before), "after": rms(&channel.real, &channel.after) }));
        }
        if manoeuvre == "launch" {
            kpi.insert(name.to_owned(), engagement([&real, &before, &after]));
        }
        overlays.push(Overlay {
            recording: name.to_owned(),
            manoeuvre: manoeuvre.to_owned(),
            held_out,
            dt: DT,
            theta: [25.0; 2],
            slip_angle: 0.0,
            channels,
        });
    }
    Campaign { diagnosis: diagnosis(per_recording, kpi), overlays, provenance: provenance() }
}

/// A driver model: the engine torque controls the engine speed, and the bearing controls the clutch torque and closes at lock-up.
fn drive(vehicle: &Vehicle, effects: &Parameters, start: &Start, manoeuvre: &str, aim: f64) -> (Vec<Inputs>, Vec<Outputs>) {
    let mut input = Inputs { x_to: 3.4, t_e_ref: 0.0, theta_h: 25.0, t_load: 0.0 };
    let mut plant = Plant::new(vehicle, effects, start, &input);
    let (mut inputs, mut outputs, mut integral) = (Vec::new(), Vec::new(), 0.0);
    for k in 0..SAMPLES {
        let now = plant.outputs();
        let time = k as f64 * DT;
        let speed = if manoeuvre == "creep" { 100.0 } else { 105.0 + 45.0 * (time / 0.7).min(1.0) + 12.0 * (time - 2.6).clamp(0.0, 2.0) };
        let pulse = if manoeuvre == "modulate" { 0.75 + 0.5 * (6.0 * time).sin() } else { (time / 0.5).min(1.0) };
        let error = speed - now.omega_f;
        integral += 4.0 * error * DT;
        input.t_e_ref = (2.0 * error + integral + now.t_fc).clamp(-20.0, 220.0);
        input.x_to = match now.phase {
            _ if aim == 0.0 => 3.4,
            Phase::Locked => (input.x_to + 0.06).min(8.2),
            _ => (input.x_to + (0.0022 * (aim * pulse - now.t_fc)).clamp(-0.03, 0.05)).clamp(3.4, 8.2),
        };
        inputs.push(input);
        outputs.push(now);
        plant.step(&input, DT);
    }
    (inputs, outputs)
}

fn replay(vehicle: &Vehicle, effects: &Parameters, start: &Start, inputs: &[Inputs]) -> Vec<Outputs> {
    let mut plant = Plant::new(vehicle, effects, start, &inputs[0]);
    let step = |input: &Inputs| {
        let now = plant.outputs();
        plant.step(input, DT);
        now
    };
    inputs.iter().map(step).collect()
}

/// A small pseudo-random generator, so that the picture never changes; normal deviates are sums of twelve uniform numbers.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }
}

/// Column, unit, and accessor.
type Pick = (&'static str, &'static str, fn(&Outputs) -> f64);

fn channels(real: &[Outputs], before: &[Outputs], after: &[Outputs], noise: &mut Noise) -> Vec<OverlayChannel> {
    let picks: [Pick; 3] =
        [("omega_f_rad_s", "rad/s", |o| o.omega_f), ("omega_c_rad_s", "rad/s", |o| o.omega_c), ("T_fc_Nm", "N·m", |o| o.t_fc)];
    let channel = |((column, unit, pick), sigma): (Pick, f64)| OverlayChannel {
        column,
        unit,
        real: real.iter().map(|o| pick(o) + sigma * noise.next()).collect(),
        before: before.iter().map(pick).collect(),
        after: after.iter().map(pick).collect(),
    };
    picks.into_iter().zip(NOISE).map(channel).collect()
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt()
}

/// Time of lock-up, energy, and slip acceleration just before lock-up; null without lock-up.
fn engagement(runs: [&[Outputs]; 3]) -> Value {
    let (mut time, mut energy, mut acceleration) = (Map::new(), Map::new(), Map::new());
    for (name, run) in ["real", "before", "after"].into_iter().zip(runs) {
        let locked = run.iter().position(|o| o.phase == Phase::Locked).filter(|&k| k > 12);
        let slip = |k: usize| run[k].omega_f - run[k].omega_c;
        time.insert(name.to_owned(), json!(locked.map(|k| k as f64 * DT)));
        energy.insert(name.to_owned(), json!(run.last().map(|o| o.e_d)));
        acceleration.insert(name.to_owned(), json!(locked.map(|k| (slip(k - 2) - slip(k - 12)) / (10.0 * DT))));
    }
    json!({ "engagement_time_s": time, "dissipated_energy_J": energy, "slip_acceleration_rad_s2": acceleration })
}

fn diagnosis(per_recording: Vec<Value>, kpi: Map<String, Value>) -> Value {
    let mut whole: Value = serde_json::from_str(include_str!("diagnosis.json")).expect("the fixture is JSON");
    let held = ["r03", "r06", "r08"];
    let mean = |key: &str| {
        let of_held = per_recording.iter().filter(|r| held.contains(&r["recording"].as_str().unwrap()));
        let squares: Vec<f64> = of_held.map(|r| (r[key].as_f64().unwrap() / r["noise"].as_f64().unwrap()).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let (before, after) = (mean("before"), mean("after"));
    whole["how_far"] = json!({ "metric": "RMS of real − model on held-out recordings, in multiples of each channel’s noise", "before": before,
        "after": after, "noise_floor": 1.0, "closed_fraction": ((before - after) / (before - 1.0)).min(1.0), "held_out": held, "kpi": kpi, "per_recording": per_recording });
    whole
}

fn provenance() -> Vec<(String, String)> {
    [
        ("Kisspoint", "0.1.0"),
        ("Campaign", "made up for the docs: 10 recordings, 4500 samples at 100 Hz"),
        ("Data fingerprint (SHA-256)", "5a2c7e0d6b8f41933f0a9d27c4be1186e07d5312fa98c64b70e1d3a2956fbc48"),
        ("Settings", "prediction horizon 0.3 s, false-alarm rate 0.01 per campaign, tolerances as priors"),
        ("Held out", "every third recording within its manoeuvre, chosen before any fit"),
        ("Plant", "substep 1 ms, inputs held over a sample"),
    ]
    .map(|(name, value)| (name.to_owned(), value.to_owned()))
    .to_vec()
}
