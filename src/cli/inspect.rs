//! `kisspoint inspect`: what a measurement file holds, and a draft of the channel map for it.

use std::path::PathBuf;

use clap::Args;

use super::error::CommandError;
use super::files::write_new;
use super::output::{print, print_json};
use super::progress::Progress;
use crate::campaign::{self, ChannelInfo, Inspection};

/// Show what a measurement file holds (text, MDF4, Parquet), and draft a channel map.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint inspect drive.mf4\n  \
    kisspoint inspect drive.mf4 --draft-map channels.toml\n  \
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
    /// Overwrite the channel map if it exists
    #[arg(long, requires = "draft_map")]
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
    match &args.draft_map {
        Some(target) if target.as_os_str() == "-" => print(&campaign::draft_channel_map(&inspection)),
        Some(target) => {
            write_new(target, &campaign::draft_channel_map(&inspection), args.force)?;
            print(&format!("{}\nChannel map written to {}: check every entry.\n", table(&inspection), target.display()))
        }
        None if args.json => print_json(&inspection.to_json()),
        None => print(&table(&inspection)),
    }
}

/// The channels as a table for people.
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

/// Six digits at most.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e7).contains(&value.abs()) {
        return format!("{value:.4e}");
    }
    let decimals = if value == 0.0 { 0 } else { (5 - value.abs().log10().floor() as i32).clamp(0, 6) as usize };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}
