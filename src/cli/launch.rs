//! `kisspoint launch`: the coupled start-up beside Table II, and the paper's figures.

use super::error::CommandError;
use super::files::{read_faults, read_vehicle, write_all};
use super::output::{print, print_json};
use crate::control::performance::Performance;
use crate::launch::{self, Column, Setup, TABLE_II};
use crate::plots;
use crate::vehicle::Vehicle;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Options of `kisspoint launch`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint launch\n  \
    kisspoint launch --plots figures\n  \
    kisspoint launch --vehicle vehicle.json --json")]
pub struct Args {
    /// Print the table as JSON
    #[arg(long)]
    json: bool,
    /// Write Figures 1, 2, 4, 5, 6 and 7 of the paper as SVG into this directory
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    /// Faults of the plant: a JSON list of parameter, time_s, ramp_s and value
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Launch another vehicle than the paper's
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
}

/// Figures of a column that this run has found; none if the clutch has not locked.
type Found = (Column, Option<Performance>);

/// Runs the subcommand.
///
/// # Errors
/// A vehicle file that is missing or not sound; a directory that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let vehicle = args.vehicle.as_deref().map_or(Ok(Vehicle::paper()), |path| read_vehicle(path).map(|file| file.vehicle))?;
    let faults = args.faults.as_deref().map(read_faults).transpose()?.unwrap_or_default();
    let setups = TABLE_II.map(|column| Setup { faults: faults.clone(), ..column.setup(&vehicle) });
    for (setup, path) in setups.iter().zip(args.faults.iter().cycle()) {
        setup.check_faults().map_err(|e| CommandError::Faults { path: path.clone(), what: e.to_string() })?;
    }
    let launches = setups.each_ref().map(launch::simulate);
    let found: Vec<Found> = TABLE_II.iter().zip(&launches).map(|(column, launch)| (*column, launch.performance)).collect();
    let mut wrote = Vec::new();
    if let Some(folder) = &args.plots {
        let figures = plots::all(&vehicle, &launches).into_iter().map(|(name, svg)| (name, svg.into_bytes())).collect::<Vec<_>>();
        write_all(folder, &figures)?;
        wrote.extend(figures.iter().map(|(name, _)| folder.join(name)));
    }
    if args.json {
        return print_json(&as_json(&found));
    }
    let wrote: String = wrote.iter().map(|path| format!("wrote {}\n", path.display())).collect();
    print(&(as_text(&found) + &wrote))
}

/// The three figures under their JSON names, with decimals for the table.
fn figures(p: &Performance) -> [(&'static str, f64, usize); 3] {
    [("t_f_s", p.time, 3), ("e_d_j", p.energy, 0), ("slip_acceleration_rad_s2", p.slip_acceleration, 3)]
}

fn percent(found: f64, paper: f64) -> f64 {
    100.0 * (found / paper - 1.0)
}

fn as_json(found: &[Found]) -> Value {
    let columns = found.iter().map(|(column, figures_found)| {
        let mut entry = json!({"column": column.name, "meaning": column.meaning, "locked": figures_found.is_some()});
        for (k, (name, paper, _)) in figures(&column.paper).into_iter().enumerate() {
            let value = figures_found.map(|p| figures(&p)[k].1);
            entry[name] = json!({"found": value, "paper": paper, "deviation_percent": value.map(|v| percent(v, paper))});
        }
        entry
    });
    json!({"table_ii": columns.collect::<Vec<_>>()})
}

fn as_text(found: &[Found]) -> String {
    let mut text = String::from("Table II of the paper            t_f [s]             E_d [J]    slip acceleration [rad/s2]\n");
    for (column, figures_found) in found {
        let paper = figures(&column.paper);
        let row = |what: &str, cells: [String; 3]| format!("{what:<28}{:>12}{:>20}{:>30}\n", cells[0], cells[1], cells[2]);
        text += &format!("{}: {}\n", column.name, column.meaning);
        let Some(p) = figures_found else {
            text += "   the clutch has not locked\n";
            continue;
        };
        let here = figures(p);
        text += &row("   this run", here.map(|(_, v, digits)| format!("{v:.digits$}")));
        text += &row("   paper", paper.map(|(_, v, digits)| format!("{v:.digits$}")));
        text += &row("   deviation", std::array::from_fn(|k| format!("{:+.2} %", percent(here[k].1, paper[k].1))));
    }
    text
}
