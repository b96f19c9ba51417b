//! What if an effect were larger or smaller: the reader drags its size, and the recording is replayed with it.
//!
//! The plant itself computes the replay. It is compiled to WebAssembly and driven as an importer drives the FMU: same GUID, same vehicle.json, same calls. Without a module the
//! page contains replays made beforehand, of the named effects at a few sizes, and the slider stops only at these. Drives and replays are included as long as there is room for
//! them, held-out ones first.

use super::series::{base64, channel, viewer_limit};
use super::text::{escape, unit, words};
use super::{Input, Overlay, names};
use flate2::{Compression, write::GzEncoder};
use serde_json::{Value, json};
use std::io::Write;

/// Bytes of the page that recordings may take here, not counting the module.
const ROOM: usize = 500_000;

/// Data of the section.
#[derive(Clone, Debug)]
pub struct WhatIf {
    /// Source of the replays.
    pub player: Player,
    /// Effects that can be changed, the named ones first.
    pub effects: Vec<Effect>,
}

/// Source of replays.
#[derive(Clone, Debug)]
pub enum Player {
    /// The plant, run in the page.
    Plant(Plant),
    /// Replays made beforehand of each overlay with each of the effects, at the sizes from the least to the greatest stop of [`Effect`]'s slider.
    Replays(Vec<Replays>),
}

/// The plant as a WebAssembly module, and the data with which an instance is started.
#[derive(Clone, Debug)]
pub struct Plant {
    /// The module.
    pub module: Vec<u8>,
    /// GUID of the FMU with the retuned numbers.
    pub guid: String,
    /// Its `resources/vehicle.json`.
    pub vehicle: String,
    /// Value references of the start values: speeds of flywheel and disc, temperatures of disc and body.
    pub start: [u32; 4],
    /// Value references of commanded position, torque and temperature of the housing air.
    pub inputs: [u32; 3],
    /// Columns and value references of the outputs that sensors show.
    pub outputs: Vec<(&'static str, u32)>,
    /// Inputs of each overlay, in the order of the overlays; `None` if they are not known.
    pub drives: Vec<Option<Drive>>,
}

/// Inputs of a replay.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Start speeds and temperatures of the plant.
    pub start: [f64; 4],
    /// Times at which the inputs change, s.
    pub time: Vec<f64>,
    /// Position, torque and temperature of the housing air from each of these times on.
    pub inputs: [Vec<f64>; 3],
    /// For each sample of the curves, the index of the time that belongs to it.
    pub samples: Vec<usize>,
}

/// Replays of one overlay with one effect, one for each of the sizes.
#[derive(Clone, Debug)]
pub struct Replays {
    /// Index of the overlay.
    pub overlay: usize,
    /// Id of the effect.
    pub effect: &'static str,
    /// For each size, a copy of the overlay whose `after` holds the replay.
    pub curves: Vec<Overlay>,
}

/// An effect whose size can be changed.
#[derive(Clone, Debug)]
pub struct Effect {
    /// Id of the effect.
    pub id: &'static str,
    /// Whether the verdict names it.
    pub named: bool,
    /// Parameters that can be changed.
    pub sizes: Vec<Size>,
}

/// A parameter with a slider.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Value reference; 0 for replays made beforehand.
    pub reference: u32,
    /// Name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Value without the effect.
    pub null: f64,
    /// Value of the retuned plant.
    pub found: f64,
    /// Least and greatest value that the slider reaches.
    pub range: [f64; 2],
    /// Distance between neighbouring stops of the slider.
    pub step: f64,
}

/// The controls above the plots of the viewer, which the script fills.
pub fn control(input: &Input) -> String {
    let Some(what_if) = input.what_if.filter(|w| !w.effects.is_empty()) else { return String::new() };
    let option = |e: &Effect| format!("<option value=\"{}\">{}</option>", escape(e.id), escape(&names::effect(e.id)));
    let group = |named: bool, label: &str| {
        let options: String = what_if.effects.iter().filter(|e| e.named == named).map(option).collect();
        if options.is_empty() { options } else { format!("<optgroup label=\"{label}\">{options}</optgroup>") }
    };
    let how = match what_if.player {
        Player::Plant(_) => {
            "The plant itself runs in this page, exactly as the FMU does, and replays the recording shown below with the sizes you choose."
        }
        Player::Replays(_) => {
            "The replays were computed with the plant when this page was written, at the sizes at which the slider stops; nothing is interpolated."
        }
    };
    format!(
        "<details class=\"what-if\" id=\"what-if\"><summary>What if an effect were larger or smaller?</summary>\n<p class=\"hint\">{how} It starts at the speeds and temperatures at which \
         the retuned model does.</p>\n<div class=\"tools\"><label>Effect <select id=\"what-if-effect\">{}{}</select></label> \
         <button type=\"button\" data-size=\"found\">As found</button><button type=\"button\" data-size=\"null\">Without it</button></div>\n\
         <div id=\"what-if-sizes\"></div>\n<p id=\"what-if-said\" class=\"hint\" aria-live=\"polite\"></p></details>\n",
        group(true, "found in this campaign"),
        group(false, "not found")
    )
}

/// Data of the script, as JSON that is safe inside a script element.
pub fn embedded(input: &Input) -> String {
    let Some(what_if) = input.what_if else { return "null".to_owned() };
    let effects: Vec<Value> = what_if.effects.iter().map(effect).collect();
    let order = held_out_first(input.overlays);
    let data = match &what_if.player {
        Player::Plant(plant) => {
            let mut left = ROOM;
            let mut drives = vec![Value::Null; input.overlays.len()];
            for k in order {
                let Some(drive) = plant.drives.get(k).and_then(Option::as_ref) else { continue };
                let packed = base64(&gzip(drive_json(drive).to_string().as_bytes()));
                if packed.len() <= left {
                    left -= packed.len();
                    drives[k] = packed.into();
                }
            }
            let outputs: Vec<Value> = plant.outputs.iter().map(|(column, reference)| json!([column, reference])).collect();
            json!({
                "effects": effects, "drives": drives, "module": base64(&gzip(&plant.module)), "guid": plant.guid, "vehicle": plant.vehicle,
                "start": plant.start, "inputs": plant.inputs, "outputs": outputs,
            })
        }
        Player::Replays(all) => {
            let limit = viewer_limit(input.overlays);
            let mut left = ROOM;
            let mut replays: Vec<Value> = vec![json!({}); input.overlays.len()];
            for k in order {
                let of: serde_json::Map<String, Value> = all
                    .iter()
                    .filter(|r| r.overlay == k)
                    .map(|r| (r.effect.to_owned(), r.curves.iter().map(|o| curves(o, limit)).collect()))
                    .collect();
                let of = Value::Object(of);
                let size = of.to_string().len();
                if size <= left {
                    left -= size;
                    replays[k] = of;
                }
            }
            json!({ "effects": effects, "replays": replays })
        }
    };
    data.to_string().replace('<', "\\u003c")
}

fn held_out_first(overlays: &[Overlay]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..overlays.len()).collect();
    order.sort_by_key(|&k| !overlays[k].held_out);
    order
}

fn effect(e: &Effect) -> Value {
    let sizes: Vec<Value> = e
        .sizes
        .iter()
        .map(|s| {
            json!({ "reference": s.reference, "label": words(s.name), "unit": unit(s.unit), "null": s.null, "found": s.found, "low": s.range[0],
                    "high": s.range[1], "step": s.step })
        })
        .collect();
    json!({ "id": e.id, "name": names::effect(e.id), "sizes": sizes })
}

fn drive_json(d: &Drive) -> Value {
    // Usually the inputs change exactly once per sample, and the list is left out.
    let samples = d.samples.iter().enumerate().any(|(k, &s)| k != s).then_some(&d.samples);
    json!({ "start": d.start, "time": d.time, "inputs": d.inputs, "samples": samples })
}

/// Gaps of a replay by column, packed in the same way as the report's curves.
fn curves(o: &Overlay, limit: usize) -> Value {
    o.channels.iter().map(|c| (c.column.to_owned(), channel(c, None, limit)["after"].take())).collect::<serde_json::Map<_, _>>().into()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("memory can be written to")
}
