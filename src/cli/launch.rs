//! `kisspoint launch`: the coupled start-up compared with Table II, the paper's figures, hot launches, and the Monte Carlo study of drawn cars.

use super::error::CommandError;
use super::files::{read_faults, read_vehicle, write_all};
use super::launch_drawn;
use super::output::{print, print_json};
use crate::control::performance::Performance;
use crate::launch::drive::Meeting;
use crate::launch::temperature::{self, Case};
use crate::launch::{self, Column, Launch, Setup, TABLE_II};
use crate::plots;
use crate::vehicle::Vehicle;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `kisspoint launch`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    kisspoint launch\n  \
    kisspoint launch --plots figures\n  \
    kisspoint launch --monte-carlo 2000 --plots figures\n  \
    kisspoint launch --vehicle vehicle.json --json")]
pub struct Args {
    /// Print the table as JSON
    #[arg(long)]
    json: bool,
    /// Write Figures 1 to 7 of the paper and the hot launches, or those of the Monte Carlo study, as SVG into this directory
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    /// Faults for the plant to play: a JSON list of parameter, time_s, ramp_s and value
    #[arg(long, value_name = "FILE", conflicts_with = "monte_carlo")]
    faults: Option<PathBuf>,
    /// Launch this vehicle instead of the paper's
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Instead, launch N randomly drawn cars under the governed controller, the paper's and a plain PI, and print the share of good launches
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    monte_carlo: Option<u32>,
    /// Seed for drawing the cars
    #[arg(long, value_name = "SEED", default_value_t = 1, requires = "monte_carlo")]
    seed: u64,
}

/// A launch of Table II, and the state at which the slip actually vanished.
struct Found {
    column: Column,
    performance: Option<Performance>,
    meeting: Option<Meeting>,
}

/// Runs the subcommand.
///
/// # Errors
/// A vehicle file or a file of faults that is missing or malformed; a directory that cannot be written.
pub fn run(args: &Args) -> Result<(), CommandError> {
    let vehicle = args.vehicle.as_deref().map_or(Ok(Vehicle::paper()), |path| read_vehicle(path).map(|file| file.vehicle))?;
    if let Some(count) = args.monte_carlo {
        return launch_drawn::run(&vehicle, count as usize, args.seed, args.plots.as_deref(), args.json);
    }
    let faults = args.faults.as_deref().map(read_faults).transpose()?.unwrap_or_default();
    let setups = TABLE_II.map(|column| Setup { faults: faults.clone(), ..column.setup(&vehicle) });
    for (setup, path) in setups.iter().zip(args.faults.iter().cycle()) {
        setup.check_faults().map_err(|e| CommandError::Faults { path: path.clone(), what: e.to_string() })?;
    }
    let launches = setups.each_ref().map(launch::simulate);
    let found: Vec<Found> =
        TABLE_II.iter().zip(&launches).map(|(c, l)| Found { column: *c, performance: l.performance, meeting: l.meeting }).collect();
    let cases = temperature::cases(&vehicle);
    let mut figures = plots::all(&vehicle, &launches);
    figures.push(("hot_launches.svg", plots::hot_launches(&cases)));
    let wrote = write_figures(args.plots.as_deref(), figures)?;
    if args.json {
        return print_json(&json!({"table_ii": table_ii(&found), "hot_launches": hot(&cases)}));
    }
    print(&(as_text(&found) + &hot_as_text(&cases) + &wrote))
}

/// Writes the figures if a folder is given. Returns the lines that report them.
pub fn write_figures(folder: Option<&Path>, figures: Vec<(&'static str, String)>) -> Result<String, CommandError> {
    let Some(folder) = folder else { return Ok(String::new()) };
    let figures: Vec<_> = figures.into_iter().map(|(name, svg)| (name, svg.into_bytes())).collect();
    write_all(folder, &figures)?;
    Ok(figures.iter().map(|(name, _)| format!("wrote {}\n", folder.join(name).display())).collect())
}

/// The three figures of merit under their JSON names, with the number of decimals for the table.
fn figures(p: &Performance) -> [(&'static str, f64, usize); 3] {
    [("t_f_s", p.time, 3), ("e_d_j", p.energy, 0), ("slip_acceleration_rad_s2", p.slip_acceleration, 3)]
}

fn percent(found: f64, paper: f64) -> f64 {
    100.0 * (found / paper - 1.0)
}

fn table_ii(found: &[Found]) -> Value {
    let columns = found.iter().map(|f| {
        let mut entry = json!({"column": f.column.name, "meaning": f.column.meaning, "locked": f.performance.is_some()});
        for (k, (name, paper, _)) in figures(&f.column.paper).into_iter().enumerate() {
            let value = f.performance.map(|p| figures(&p)[k].1);
            entry[name] = json!({"found": value, "paper": paper, "deviation_percent": value.map(|v| percent(v, paper))});
        }
        entry["slip_acceleration_at_zero_rad_s2"] = json!(f.meeting.map(|m| m.slip_acceleration));
        entry["torque_at_zero_n_m"] = json!(f.meeting.map(|m| m.torque));
        entry
    });
    Value::Array(columns.collect())
}

fn as_text(found: &[Found]) -> String {
    let mut text = String::from("Table II of the paper            t_f [s]             E_d [J]    slip acceleration [rad/s²]\n");
    for f in found {
        let paper = figures(&f.column.paper);
        let row = |what: &str, cells: [String; 3]| format!("{what:<28}{:>12}{:>20}{:>30}\n", cells[0], cells[1], cells[2]);
        text += &format!("{}: {}\n", f.column.name, f.column.meaning);
        let Some(p) = &f.performance else {
            text += "   the clutch has not locked\n";
            continue;
        };
        let here = figures(p);
        text += &row("   this run", here.map(|(_, v, digits)| format!("{v:.digits$}")));
        text += &row("   paper", paper.map(|(_, v, digits)| format!("{v:.digits$}")));
        text += &row("   deviation", std::array::from_fn(|k| format!("{:+.2} %", percent(here[k].1, paper[k].1))));
        if let Some(m) = &f.meeting {
            let torque = format!("peak {:.0} N·m", m.torque);
            text += &row("   where the slip is 0", [String::new(), torque, format!("{:.1}", m.slip_acceleration)]);
        }
    }
    text
}

/// Rows of the hot launches: temperature case, torque feedback (no, yes) and launch.
fn rows(cases: &[Case; 3]) -> impl Iterator<Item = (&'static str, &'static str, &Launch)> {
    cases.iter().flat_map(|c| [(c.name, "no", &c.open_loop), (c.name, "yes", &c.closed_loop)])
}

fn hot(cases: &[Case; 3]) -> Value {
    let entries = rows(cases).map(|(name, feedback, launch)| {
        json!({
            "temperature": name,
            "torque_feedback": feedback == "yes",
            "t_f_s": launch.performance.map(|p| p.time),
            "e_d_j": launch.performance.map(|p| p.energy),
            "slip_acceleration_rad_s2": launch.performance.map(|p| p.slip_acceleration),
        })
    });
    Value::Array(entries.collect())
}

fn hot_as_text(cases: &[Case; 3]) -> String {
    let mut text = format!(
        "\nA hot launch ({:.0} °C) of a car whose kiss point moves by {} mm/K\n\
         temperature   torque feedback     t_f [s]     E_d [J]    slip acceleration [rad/s²]\n",
        temperature::HOT,
        temperature::TOUCH_POINT
    );
    for (name, feedback, launch) in rows(cases) {
        text += &match launch.performance {
            Some(p) => format!("{name:<14}{feedback:<16}{:>11.3}{:>12.0}{:>30.1}\n", p.time, p.energy, p.slip_acceleration),
            None => format!("{name:<14}{feedback:<16}  does not lock\n"),
        };
    }
    text
}
