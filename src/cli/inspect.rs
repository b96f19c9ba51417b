//! `kisspoint inspect`: lists the content of a measurement file, and drafts a channel map and a list of recordings for it.

use std::path::PathBuf;

use clap::Args;

use super::error::{CommandError, at};
use super::files::write_new;
use super::output::{print, print_json};
use super::progress::Progress;
use crate::campaign::{self, ChannelInfo, Inspection};

/// Show what a measurement file holds (text, MDF4, Parquet), and draft a channel map and a recordings.json.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint inspect drive.mf4\n  \
    kisspoint inspect car_17/r01.mf4 --draft-map car_17/channels.toml \\\n      --draft-recordings car_17/recordings.json\n  \
    kisspoint inspect drive.csv --json")]
pub struct InspectArgs {
    /// The file to look into
    pub file: PathBuf,
    /// Database (DBC) of the CAN bus whose frames an MDF4 file holds
    #[arg(long, value_name = "FILE")]
    pub dbc: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
    /// Write a channel map to start from; `-` prints it instead of the table
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    pub draft_map: Option<PathBuf>,
    /// Write a recordings.json to start from, with an entry for each file of this format in the folder of FILE; `-` prints it
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    pub draft_recordings: Option<PathBuf>,
    /// Overwrite drafts that exist
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
pub fn run(args: &InspectArgs) -> Result<(), CommandError> {
    let inspection = {
        let bar = Progress::new();
        let found = campaign::inspect(&args.file, args.dbc.as_deref(), &|share| bar.tell("reading", share));
        bar.finish();
        found?
    };
    if args.json {
        return print_json(&inspection.to_json());
    }
    let mut drafts: Vec<(&PathBuf, String, &str)> = Vec::new();
    if let Some(target) = &args.draft_map {
        drafts.push((target, campaign::draft_channel_map(&inspection), "Channel map written to {}: check every entry."));
    }
    if let Some(target) = &args.draft_recordings {
        let said = "Recordings written to {}: name each manoeuvre, and give the temperatures at the start if you know them.";
        drafts.push((target, campaign::draft_recordings(&args.file).map_err(at(&args.file))?, said));
    }
    let printed: String = drafts.iter().filter(|(target, ..)| target.as_os_str() == "-").map(|(_, text, _)| text.as_str()).collect();
    let mut said = if printed.is_empty() { table(&inspection) } else { printed };
    for (target, text, what) in drafts.iter().filter(|(target, ..)| target.as_os_str() != "-") {
        write_new(target, text, args.force)?;
        said.push_str(&format!("\n{}\n", what.replace("{}", &target.display().to_string())));
    }
    print(&said)
}

/// The channels as a text table.
fn table(inspection: &Inspection) -> String {
    let head = ["channel", "unit", "group", "rate/Hz", "samples", "invalid", "min", "max", "seems to be"];
    let mut rows: Vec<[String; 9]> = vec![head.map(str::to_string)];
    rows.extend(inspection.channels.iter().map(row));
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let mut out = format!("{} ({})\n\n", inspection.file, inspection.format);
    for row in &rows {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, width))| match i {
            3..=7 => format!("{cell:>width$}"),
            _ => format!("{cell:<width$}"),
        });
        out.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        out.push('\n');
    }
    for note in &inspection.notes {
        out.push_str(&format!("\nnote: {note}\n"));
    }
    out
}

fn row(channel: &ChannelInfo) -> [String; 9] {
    let value = |v: Option<f64>| v.map_or_else(|| "-".to_string(), short);
    let group = match channel.group.1.as_str() {
        "" => channel.group.0.to_string(),
        name => format!("{} {name}", channel.group.0),
    };
    let seems = channel.guess.map_or("", |g| g.spec().column);
    [
        channel.name.clone(),
        channel.unit.clone().unwrap_or_default(),
        group,
        value(channel.rate_hz),
        channel.count.to_string(),
        channel.invalid.to_string(),
        value(channel.min),
        value(channel.max),
        if channel.text { "(text)".to_string() } else { seems.to_string() },
    ]
}

/// A number with at most six significant digits.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e7).contains(&value.abs()) {
        return format!("{value:.4e}");
    }
    let decimals = if value == 0.0 { 0 } else { (5 - value.abs().log10().floor() as i32).clamp(0, 6) as usize };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}
