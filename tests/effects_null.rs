//! Property of every registered effect: at its null value it leaves the plant bit-identical, and at its start values it does not.

use kisspoint::effects::empirical::CURVES;
use kisspoint::effects::{self, Act, Entry, PARAMETERS, Parameters, REGISTRY, Subsystem};
use kisspoint::plant::{Inputs, Phase, Plant, Start};
use kisspoint::vehicle::Vehicle;
use std::collections::BTreeSet;

const START: Start = Start { omega_f: 104.719_755_119_659_78, omega_c: 0.0, theta_c: 95.0, theta_b: 60.0 };
const STEP: f64 = 0.01;
const STEPS: usize = 320;

/// A launch in which the clutch reopens slightly, locks, and stays closed while the car drives on, so that every effect is exercised.
fn inputs(k: usize) -> Inputs {
    let t = k as f64 * STEP;
    let x_to = match t {
        t if t < 0.7 => 4.3 + 1.9 * t,
        t if t < 0.9 => 5.63 - 0.8 * (t - 0.7),
        t if t < 1.8 => 5.47 + 0.8 * (t - 0.9),
        _ => 8.2,
    };
    Inputs { x_to, t_e_ref: if (1.9..2.6).contains(&t) { 60.0 } else { 30.0 }, theta_h: 30.0, t_load: 0.0 }
}

/// Bit patterns of all outputs of the plant at every step.
type Trace = Vec<[u64; 13]>;

fn bits(plant: &Plant) -> [u64; 13] {
    let (o, e) = (plant.outputs(), plant.energy());
    [o.omega_f, o.omega_c, o.t_e, o.t_fc, o.theta_c, o.theta_b, o.x_to_actual, o.e_d, f64::from(o.phase as u8)]
        .into_iter()
        .chain([e.work_in, e.stored, e.dissipated, e.losses])
        .map(f64::to_bits)
        .collect::<Vec<_>>()
        .try_into()
        .expect("nine outputs and four energies")
}

/// Runs the launch; `change` may switch to other effects at a step.
fn run(effects: &Parameters, change: impl Fn(usize) -> Option<Parameters>) -> (Trace, Phase) {
    let vehicle = Vehicle::paper();
    let mut plant = Plant::new(&vehicle, effects, &START, &inputs(0));
    let trace = (0..STEPS)
        .map(|k| {
            if let Some(other) = change(k) {
                plant.set_effects(&vehicle, &other).unwrap();
            }
            plant.step(&inputs(k), STEP);
            bits(&plant)
        })
        .collect();
    (trace, plant.outputs().phase)
}

fn nominal() -> Trace {
    let (trace, phase) = run(&effects::null(), |_| None);
    assert_eq!(phase, Phase::Locked, "the launch must pass through lock-up to prove anything");
    trace
}

/// A pseudo-random number in 0..1 that depends on `seed` alone (splitmix64).
fn share(seed: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Null amplitudes of `entry`, with shape parameters anywhere within their bounds.
fn shaped(entry: &Entry, seed: u64, p: &mut Parameters) {
    for k in entry.parameters.clone().filter(|k| !entry.effect.amplitudes.contains(k)) {
        let parameter = &PARAMETERS[k];
        p[k] = parameter.min + share(seed * 1000 + k as u64) * (parameter.max - parameter.min);
    }
}

#[test]
fn every_effect_is_bit_identical_at_its_null_value() {
    let nominal = nominal();
    for entry in effects::all() {
        for seed in 0..3 {
            let mut p = effects::null();
            shaped(entry, seed, &mut p);
            assert!(run(&p, |_| None).0 == nominal, "{} with {:?}", entry.id, &p[entry.parameters.clone()]);
        }
    }
}

#[test]
fn all_effects_together_are_bit_identical_at_null_also_when_set_while_running() {
    let all = |seed: u64| {
        let mut p = effects::null();
        effects::all().for_each(|entry| shaped(entry, seed, &mut p));
        p
    };
    let changing = run(&all(7), |k| (k % 13 == 5).then(|| all(k as u64))).0;
    assert!(changing == nominal());
}

#[test]
fn every_start_of_every_effect_changes_the_plant() {
    let nominal = nominal();
    for entry in effects::all() {
        assert!(!entry.effect.starts.is_empty(), "{} has no start", entry.id);
        for (n, start) in entry.effect.starts.iter().enumerate() {
            let mut p = effects::null();
            start.iter().for_each(|&(k, value)| p[k] = value);
            assert!(!entry.is_null(&p), "{}: a start is null", entry.id);
            assert!(!entry.effect.starts[..n].contains(start), "{}: {start:?} is there twice", entry.id);
            assert!(run(&p, |_| None).0 != nominal, "{}: {start:?} changes nothing", entry.id);
        }
    }
}

/// Every negative start value has its positive mirror, because a search that starts only on one side of zero does not find an optimum on the other.
#[test]
fn a_start_below_zero_has_its_mirror_above() {
    let mut mirrored = 0;
    for entry in effects::all() {
        let turns = |k: usize| entry.effect.amplitudes.contains(&k) && PARAMETERS[k].null == 0.0;
        for start in entry.effect.starts.iter().filter(|start| start.iter().any(|&(k, value)| turns(k) && value < 0.0)) {
            let mirror: Vec<(usize, f64)> = start.iter().map(|&(k, value)| (k, if turns(k) { -value } else { value })).collect();
            assert!(entry.effect.starts.contains(&mirror.as_slice()), "{}: {start:?} has no mirror", entry.id);
            mirrored += 1;
        }
    }
    assert!(mirrored >= 8, "{mirrored}");
}

/// Learned laws: each curve changes the plant, and none leaves a trace once it is zero again.
#[test]
fn a_learned_law_is_bit_identical_at_zero_and_each_of_its_curves_changes_the_plant() {
    let nominal = nominal();
    for curve in &CURVES {
        let mut p = effects::null();
        curve.parameters().for_each(|k| p[k] = 0.2 * PARAMETERS[k].max);
        assert!(run(&p, |_| None).0 != nominal, "{} changes nothing", curve.name);
        curve.parameters().for_each(|k| p[k] = -0.0);
        assert!(run(&p, |_| None).0 == nominal, "{}: a negative zero is no law", curve.name);
    }
    let zero = run(&effects::null(), |k| (k % 13 == 5).then(effects::null)).0;
    assert!(zero == nominal);
}

/// However wild a law is, slipping facings only dissipate, the energy balance closes, and no energy is created.
#[test]
fn the_books_of_energy_close_under_any_learned_law() {
    for seed in 0..12 {
        let mut p = effects::null();
        for k in CURVES.iter().flat_map(|c| c.parameters()) {
            p[k] = PARAMETERS[k].min + share(seed * 1000 + k as u64) * (PARAMETERS[k].max - PARAMETERS[k].min);
        }
        let mut plant = Plant::new(&Vehicle::paper(), &p, &START, &inputs(0));
        plant.config().pace.check().unwrap();
        let begin = plant.energy();
        let mut heat = 0.0;
        for k in 0..STEPS {
            plant.step(&inputs(k), STEP);
            let now = plant.energy();
            assert!(now.dissipated >= heat - 1e-9, "seed {seed}: faces gave {} J back in step {k}", heat - now.dissipated);
            heat = now.dissipated;
        }
        let end = plant.energy();
        let turned = end.work_in.abs() + end.dissipated + end.losses.abs() + begin.stored;
        let off = end.work_in - (end.stored - begin.stored + end.dissipated + end.losses);
        assert!(off.abs() < 1e-5 * turned, "seed {seed}: {off} J of {turned} J");
    }
}

#[test]
fn every_number_of_an_effect_is_within_its_bounds() {
    for (k, p) in PARAMETERS.iter().enumerate() {
        assert!(p.min < p.max && (p.min..=p.max).contains(&p.null), "{}: {} in {} to {}", p.variable, p.null, p.min, p.max);
        assert!(p.nominal > 0.0, "{}: a nominal size of {}", p.variable, p.nominal);
        assert_eq!(effects::owner(k).map_or("empirical", |entry| entry.id), p.effect);
        assert_eq!(p.variable, format!("effect.{}.{}", p.effect, p.name));
    }
    for entry in effects::all() {
        assert!(!entry.effect.amplitudes.is_empty(), "{} cannot be switched off", entry.id);
        assert!(entry.effect.amplitudes.iter().all(|k| entry.parameters.contains(k)), "{} switches another effect", entry.id);
        for &(k, value) in entry.effect.starts.iter().copied().flatten() {
            assert!(entry.parameters.contains(&k), "{}: a start sets another effect", entry.id);
            let p = &PARAMETERS[k];
            assert!((p.min..=p.max).contains(&value), "{}: start {value} is outside {} to {}", p.variable, p.min, p.max);
        }
        assert!(!entry.effect.shown_by.is_empty(), "{}: what shows it?", entry.id);
    }
}

#[test]
fn every_subsystem_and_every_kind_of_act_is_used() {
    let subsystems: BTreeSet<Subsystem> = REGISTRY.iter().map(|e| e.effect.subsystem).collect();
    assert_eq!(subsystems.len(), Subsystem::ALL.len());
    let kinds: BTreeSet<&str> = effects::all()
        .map(|e| match e.effect.act {
            Act::Constants(_) => "constants",
            Act::Contact(_) => "contact",
            Act::Force(_) => "force",
            Act::Friction(_) => "friction",
            Act::FrictionAdded(_) => "friction added",
            Act::Pulsation(_) => "pulsation",
            Act::Drag(_) => "drag",
            Act::Load(_) => "load",
            Act::Engine(_) => "engine",
            Act::Pressure(_) => "pressure",
            Act::Shafts(_) => "shafts",
            Act::Worn(_) => "worn",
        })
        .collect();
    assert_eq!(kinds.len(), 12, "{kinds:?}");
}
