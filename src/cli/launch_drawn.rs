//! `kisspoint launch --monte-carlo N`: randomly drawn cars under several controllers.

use super::error::CommandError;
use super::launch::write_figures;
use super::output::{print, print_json};
use crate::control::Settings;
use crate::launch::monte_carlo::{self, CRITERIA, Column, Outcome};
use crate::plots;
use crate::vehicle::Vehicle;
use serde_json::{Value, json};
use std::path::Path;

/// A quantity whose quantiles are printed: name, JSON name, decimals, and accessor.
type Spread = (&'static str, &'static str, usize, fn(&Outcome) -> f64);

const SPREADS: [Spread; 5] = [
    ("time until the slip is gone [s]", "time_s", 2, |o| o.figures.time),
    ("slip acceleration at 0 [rad/s²]", "slip_acceleration_rad_s2", 0, |o| o.figures.slip_acceleration),
    ("peak torque over plan", "peak_over_plan", 2, |o| o.figures.peak_torque / o.planned),
    ("least engine speed [rad/s]", "least_engine_speed_rad_s", 0, |o| o.figures.least_engine_speed),
    ("energy dissipated [J]", "energy_j", 0, |o| o.figures.energy),
];

const QUANTILES: [f64; 3] = [0.05, 0.5, 0.95];

/// Draws the cars, simulates the launches, prints the results and writes the figure.
pub fn run(vehicle: &Vehicle, count: usize, seed: u64, plots: Option<&Path>, as_json: bool) -> Result<(), CommandError> {
    let (columns, left_out) = monte_carlo::run(vehicle, count, seed);
    let spread = monte_carlo::learning(vehicle, Settings::robust().learning_rate);
    let wrote = write_figures(plots, vec![("monte_carlo.svg", plots::monte_carlo(&columns))])?;
    if as_json {
        return print_json(&json!({
            "cars": count, "seed": seed, "cannot_lock": left_out, "controllers": columns.iter().map(column_json).collect::<Vec<_>>(),
            "learning": {"spread_of_time_s": spread},
        }));
    }
    let mut text = format!("{count} cars drawn with seed {seed}; {left_out} cannot lock whatever the controller does and are left out\n");
    text += &line("share of the launches [%]", columns.iter().map(|c| c.name.to_owned()));
    for (k, name) in CRITERIA.iter().enumerate() {
        text += &line(name, columns.iter().map(|c| format!("{:.1}", 100.0 * c.shares()[k])));
    }
    text += "5, 50, 95 % of\n";
    for (name, _, digits, of) in SPREADS {
        let cell = |c: &Column| QUANTILES.map(|q| format!("{:.digits$}", c.quantile(q, of))).join(" ");
        text += &line(name, columns.iter().map(cell));
    }
    let spread: Vec<String> = spread.iter().map(|s| format!("{s:.3}")).collect();
    text += &format!(
        "Learning: range of the time over friction x 0.8 to 1.2 and kiss point +- 0.4 mm, launch 1 to {}: {} s\n",
        monte_carlo::LAUNCHES,
        spread.join(", ")
    );
    print(&(text + &wrote))
}

fn line(name: &str, cells: impl Iterator<Item = String>) -> String {
    let cells: String = cells.map(|cell| format!("{cell:>20}")).collect();
    format!("{name:<34}{cells}\n")
}

fn column_json(column: &Column) -> Value {
    let shares: serde_json::Map<String, Value> = CRITERIA.iter().zip(column.shares()).map(|(n, s)| ((*n).to_owned(), json!(s))).collect();
    let spreads: serde_json::Map<String, Value> =
        SPREADS.iter().map(|(_, name, _, of)| ((*name).to_owned(), json!(QUANTILES.map(|q| column.quantile(q, of))))).collect();
    json!({"name": column.name, "launches": column.outcomes.len(), "shares": shares, "quantiles_5_50_95": spreads})
}
