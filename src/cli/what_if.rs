//! Data of the report's "What if": the plant as a WebAssembly module with the inputs of each recording, or replays made beforehand.

use super::laws::source;
use crate::campaign::Campaign;
use crate::effects::{Entry, PARAMETERS, Parameters, REGISTRY, find};
use crate::fmu;
use crate::gap::diagnosis::Diagnosis;
use crate::gap::measure::Overlay;
use crate::gap::model::replay;
use crate::gap::model::tolerance::Car;
use crate::gap::model::track::{Channel, Track};
use crate::plant::{Start, sensed};
use crate::report::what_if::{Drive, Effect, Plant, Player, Replays, Size, WhatIf};

/// Number of steps of a slider.
const STOPS: f64 = 200.0;
/// Sizes of the replays made beforehand, as shares of the identified size.
const SHARES: [f64; 9] = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0];

/// What the page of a diagnosis can replay. Without a `module`, these are the named effects at [`SHARES`] of their identified sizes.
pub fn of(campaign: &Campaign, found: &Diagnosis, module: Option<Vec<u8>>) -> WhatIf {
    let named: Vec<usize> = found.answer.which.effects.iter().filter_map(|e| find(e.id)).collect();
    let drives: Vec<Option<(Track, Drive)>> = found.overlays.iter().map(|o| drive(campaign, found, o)).collect();
    let Some(module) = module else {
        let effects = named.iter().map(|&e| Effect { id: REGISTRY[e].id, named: true, sizes: vec![share()] }).collect();
        return WhatIf { player: Player::Replays(replays(found, &named, &drives)), effects };
    };
    let others = (0..REGISTRY.len()).filter(|e| !named.contains(e));
    let effects = named.iter().copied().chain(others).map(|e| effect(&REGISTRY[e], named.contains(&e), &found.effects)).collect();
    let model = fmu::MODELS.iter().find(|m| m.description.name == "DrivelinePlant").expect("the plant is one of the models");
    let reference = |name: &str| {
        let variable = model.description.variables.iter().find(|v| v.name == name);
        variable.unwrap_or_else(|| panic!("{name} is a variable of the plant")).value_reference
    };
    let (guid, vehicle) = fmu::start(model, &found.vehicle, &found.effects);
    let outputs = ["omega_f", "omega_c", "x_to_actual", "T_fc", "theta_c"];
    let plant = Plant {
        module,
        guid,
        vehicle,
        start: ["omega_f_start", "omega_c_start", "theta_c_start", "theta_b_start"].map(reference),
        inputs: ["x_to", "T_e_ref", "theta_h"].map(reference),
        outputs: Channel::ALL.iter().zip(outputs).map(|(c, name)| (c.column(), reference(name))).collect(),
        drives: drives.into_iter().map(|d| d.map(|(_, drive)| drive)).collect(),
    };
    WhatIf { player: Player::Plant(plant), effects }
}

/// An effect with all its parameters, the amplitudes (whose null values switch it off) first.
fn effect(entry: &'static Entry, named: bool, found: &Parameters) -> Effect {
    let amplitude = |k: &usize| entry.effect.amplitudes.contains(k);
    let (first, then): (Vec<usize>, Vec<usize>) = entry.parameters.clone().partition(amplitude);
    let size = |k: usize| {
        let p = &PARAMETERS[k];
        let value = found[k];
        let reach = (2.0 * entry.scale(k)).max(1.5 * (value - p.null).abs());
        let range = [(p.null - reach).max(p.min), (p.null + reach).min(p.max)];
        Size {
            reference: p.value_reference,
            name: p.name,
            unit: p.unit,
            null: p.null,
            found: value,
            range,
            step: (range[1] - range[0]) / STOPS,
        }
    };
    Effect { id: entry.id, named, sizes: first.into_iter().chain(then).map(size).collect() }
}

fn share() -> Size {
    let range = [100.0 * SHARES[0], 100.0 * SHARES[SHARES.len() - 1]];
    Size { reference: 0, name: "size", unit: "% of what was found", null: 0.0, found: 100.0, range, step: 100.0 * (SHARES[1] - SHARES[0]) }
}

/// Inputs of an overlay, starting at the sample at which the overlay's replay starts.
fn drive(campaign: &Campaign, found: &Diagnosis, o: &Overlay) -> Option<(Track, Drive)> {
    // The plant in the page is driven by a position command.
    let (recording, begin) = source(campaign, o).filter(|(r, _)| !r.x_to_cmd.is_empty())?;
    let track = Track::new(recording);
    let first = |channel: Channel| o.channels.iter().find(|c| c.column == channel.column()).and_then(|c| c.after.first()).copied();
    let speeds = [first(Channel::OmegaF)?, first(Channel::OmegaC)?];
    let speeds: [f64; 2] = std::array::from_fn(|k| sensed::meant(&found.effects, k, speeds[k]));
    let end = begin + o.channels.first()?.real.len();
    let ticks = &track.ticks[track.tick_of_row[begin]..track.tick_of_row[end]];
    let from = track.tick_of_row[begin];
    let drive = Drive {
        start: [speeds[0], speeds[1], o.theta[0], o.theta[1]],
        time: ticks.iter().map(|t| t.time).collect(),
        inputs: [ticks.iter().map(|t| t.x_to).collect(), ticks.iter().map(|t| t.t_e).collect(), ticks.iter().map(|t| t.theta_h).collect()],
        samples: track.tick_of_row[begin..end].iter().map(|k| k - from).collect(),
    };
    Some((track, drive))
}

fn car(found: &Diagnosis, effects: &Parameters) -> Car {
    Car { effects: *effects, ..Car::nominal(&found.vehicle) }
}

/// Replays of each overlay with each named effect at each of [`SHARES`].
fn replays(found: &Diagnosis, named: &[usize], drives: &[Option<(Track, Drive)>]) -> Vec<Replays> {
    let mut all = Vec::new();
    for (overlay, (o, known)) in found.overlays.iter().zip(drives).enumerate() {
        let Some((track, drive)) = known else { continue };
        // Ticks and rows of a track share one time base, so the time of the first tick gives the row.
        let begin = track.time.iter().position(|t| *t >= drive.time[0]).unwrap_or(0);
        for &e in named {
            let curves = SHARES.map(|share| replayed(found, o, track, drive, begin, &scaled(&REGISTRY[e], &found.effects, share))).to_vec();
            all.push(Replays { overlay, effect: REGISTRY[e].id, curves });
        }
    }
    all
}

/// The identified parameters, with the amplitudes of one effect at a share of their departure from null.
fn scaled(entry: &Entry, found: &Parameters, share: f64) -> Parameters {
    let mut changed = *found;
    for &k in entry.effect.amplitudes {
        let p = &PARAMETERS[k];
        changed[k] = (p.null + share * (found[k] - p.null)).clamp(p.min, p.max);
    }
    changed
}

fn replayed(found: &Diagnosis, o: &Overlay, track: &Track, drive: &Drive, begin: usize, effects: &Parameters) -> Overlay {
    let [omega_f, omega_c, theta_c, theta_b] = drive.start;
    let start = Start { omega_f, omega_c, theta_c, theta_b };
    let mut changed = o.clone();
    changed.channels.iter_mut().for_each(|c| c.after.clear());
    replay::replay(track, &car(found, effects), (&start, o.slip_angle), begin..begin + drive.samples.len(), None, |_, now, _, _| {
        for (channel, value) in Channel::ALL.iter().zip([now.omega_f, now.omega_c, now.x_to_actual, now.t_fc, now.theta_c]) {
            changed.channels.iter_mut().filter(|c| c.column == channel.column()).for_each(|c| c.after.push(value));
        }
    });
    changed
}
