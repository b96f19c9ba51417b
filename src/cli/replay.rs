//! `kisspoint replay`: drives the plant with a car's recordings and prints the gap.

use super::error::CommandError;
use super::files::read_vehicle;
use super::output::{print, print_json};
use super::progress::Progress;
use crate::campaign::{self, Campaign, ChannelMap, LeftOut, Note, ReadOptions, Recording};
use crate::gap::measure::{HeldOut, evaluate};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Options of `kisspoint replay`.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Each recording is replayed freely from its first sample, driven by the reported torque and the commanded position.\n\nExamples:\n  kisspoint replay measurements/car_17\n  kisspoint replay measurements/car_17 --vehicle retuned.json --json"
)]
pub struct Args {
    /// Folder with vehicle.json, recordings.json and the recordings
    #[arg(value_name = "CAMPAIGN")]
    campaign: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Vehicle file to use instead of the campaign's, effects included
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Names and units of the channels, TOML or JSON
    #[arg(long, value_name = "FILE")]
    channel_map: Option<PathBuf>,
}

/// Runs the subcommand.
///
/// # Errors
/// A campaign or vehicle file that cannot be read.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let channel_map = args.channel_map.as_deref().map(ChannelMap::from_file).transpose()?;
    let campaign = {
        let bar = Progress::new();
        let read = campaign::read_telling(&args.campaign, &ReadOptions { channel_map, strict: false }, &|file, share| {
            bar.tell(&format!("reading {file}"), share);
        });
        bar.finish();
        read?
    };
    let file = read_vehicle(args.vehicle.as_deref().unwrap_or(&campaign.vehicle_path))?;
    let car = (&file.vehicle, &file.effects);
    let gaps: Vec<(&Recording, HeldOut)> =
        campaign.recordings.iter().flat_map(|r| evaluate(r, car, car).into_iter().map(move |gap| (r, gap))).collect();
    if args.json {
        return print_json(&as_json(&gaps, &campaign));
    }
    let mut text = format!("{:<12} {:<14} {:<15} {:>10} {:>10}  unit\n", "recording", "manoeuvre", "channel", "rms gap", "noise");
    for (r, gap) in &gaps {
        let (channel, unit) = (gap.channel.column(), gap.channel.unit());
        text += &format!("{:<12} {:<14} {channel:<15} {:>10.4} {:>10.4}  {unit}\n", r.name, r.manoeuvre, gap.before, gap.noise);
    }
    print(&(text + &campaign.remarks()))
}

fn as_json(gaps: &[(&Recording, HeldOut)], campaign: &Campaign) -> Value {
    let row = |(r, gap): &(&Recording, HeldOut)| json!({"recording": r.name, "manoeuvre": r.manoeuvre, "channel": gap.channel.column(), "unit": gap.channel.unit(), "rms": gap.before, "noise": gap.noise});
    let left_out = |left: &LeftOut| json!({"recording": left.recording, "reason": left.reason});
    let note = |note: &Note| json!({"recording": note.recording, "text": note.text});
    json!({
        "gaps": gaps.iter().map(row).collect::<Vec<_>>(),
        "left_out": campaign.left_out.iter().map(left_out).collect::<Vec<_>>(),
        "notes": campaign.notes.iter().map(note).collect::<Vec<_>>(),
    })
}
