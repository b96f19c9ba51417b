//! The paper's figures as SVG.
//!
//! - [`chart`]: line charts with panels one below the other
//! - [`diagram`]: the block diagram of the controller
//!
//! | figure | content | from |
//! |---|---|---|
//! | 1 | T_fc over x_to and ω_fc for several θ_c, as cuts | torque map |
//! | 2 | T_fc over x_to and θ_c for several ω_fc, as cuts | torque map |
//! | 3 | control scheme | [`crate::control::figure_3`] |
//! | 4 | speeds and their references | column I |
//! | 5 | x_to with and without feedback, x_to,fb | columns A and B |
//! | 6 | T_e, T_fc and its estimate | column B |
//! | 7 | θ_c and θ_b | column B |
//! | hot launches | the paper's point, see [`crate::launch::temperature`] | Table II's set |

pub mod chart;
pub mod diagram;

use crate::control::Settings;
use crate::control::reference;
use crate::launch::monte_carlo::{Column, Outcome};
use crate::launch::temperature::Case;
use crate::launch::{IDLE, Launch, Row};
use crate::physics::phase::Phase;
use crate::physics::{cushion, map};
use crate::vehicle::Vehicle;
use chart::{Panel, Series};

/// File name and text of every figure; `launches` are the columns of Table II.
pub fn all(vehicle: &Vehicle, launches: &[Launch; 3]) -> Vec<(&'static str, String)> {
    let [ideal, open_loop, closed_loop] = launches;
    vec![
        ("figure_1.svg", torque_over_slip(vehicle)),
        ("figure_2.svg", torque_over_temperature(vehicle)),
        ("figure_3.svg", diagram::figure_3()),
        ("figure_4.svg", speeds(ideal)),
        ("figure_5.svg", positions(open_loop, closed_loop)),
        ("figure_6.svg", torques(closed_loop)),
        ("figure_7.svg", temperatures(closed_loop)),
    ]
}

/// Torque in N·m at position `x` mm.
fn torque(v: &Vehicle, x: f64, slip: f64, theta: f64) -> f64 {
    let xi = map::normalised_position(map::contact(&v.actuator, theta), x);
    let force = cushion::force(&v.cushion_spring, cushion::contact_point(&v.cushion_spring), xi);
    map::torque_capacity(&v.friction, force, slip, theta)
}

/// Torque over position, one line for each (name, slip, temperature).
fn torque_lines(v: &Vehicle, lines: &[(String, f64, f64)]) -> Panel {
    let (low, high) = (v.actuator.x_cnt_0, v.actuator.x_cls_0);
    let series = lines.iter().map(|(name, slip, theta)| {
        let points = (0..=100).map(|k| low + (high - low) * f64::from(k) / 100.0).map(|x| (x, torque(v, x, *slip, *theta)));
        Series { name: name.clone(), points: points.collect(), dashed: false }
    });
    Panel { x_label: "x_to [mm]".to_owned(), y_label: "T_fc [N·m]".to_owned(), series: series.collect() }
}

/// Figure 1 as cuts, because a surface is hard to read: over position at two slip speeds, and over slip at one position.
fn torque_over_slip(v: &Vehicle) -> String {
    let lines = |slip: f64| [25.0, 75.0, 150.0].map(|theta| (format!("{slip:.0} rad/s, {theta:.0} °C"), slip, theta));
    let x = 0.5 * (v.actuator.x_cnt_0 + v.actuator.x_cls_0) + 0.25 * (v.actuator.x_cls_0 - v.actuator.x_cnt_0);
    let over = [25.0, 75.0, 150.0].map(|theta| Series {
        name: format!("{x:.2} mm, {theta:.0} °C"),
        points: (0..=200).map(|k| 0.2 * f64::from(k)).map(|slip| (slip, torque(v, x, slip, theta))).collect(),
        dashed: false,
    });
    let over = Panel { x_label: "ω_fc [rad/s]".to_owned(), y_label: "T_fc [N·m]".to_owned(), series: over.into() };
    let panels = [torque_lines(v, &lines(1.0)), torque_lines(v, &lines(40.0)), over];
    chart::render("Figure 1: torque map over position and slip speed, for several temperatures", &panels)
}

/// Figure 2 as cuts: over position at two temperatures, and over temperature at one position.
fn torque_over_temperature(v: &Vehicle) -> String {
    let lines = |theta: f64| [0.0, 3.0, 40.0].map(|slip| (format!("{theta:.0} °C, {slip:.0} rad/s"), slip, theta));
    let x = 0.5 * (v.actuator.x_cnt_0 + v.actuator.x_cls_0) + 0.25 * (v.actuator.x_cls_0 - v.actuator.x_cnt_0);
    let over = [0.0, 3.0, 40.0].map(|slip| Series {
        name: format!("{x:.2} mm, {slip:.0} rad/s"),
        points: (0..=200).map(|k| 25.0 + 1.125 * f64::from(k)).map(|theta| (theta, torque(v, x, slip, theta))).collect(),
        dashed: false,
    });
    let over = Panel { x_label: "θ_c [°C]".to_owned(), y_label: "T_fc [N·m]".to_owned(), series: over.into() };
    let panels = [torque_lines(v, &lines(25.0)), torque_lines(v, &lines(200.0)), over];
    chart::render("Figure 2: torque map over position and temperature, for several slip speeds", &panels)
}

fn series(name: &str, launch: &Launch, dashed: bool, value: impl Fn(&Row) -> f64) -> Series {
    Series { name: name.to_owned(), points: launch.rows.iter().map(|r| (r.time_s, value(r))).collect(), dashed }
}

fn panel(y_label: &str, series: Vec<Series>) -> Panel {
    Panel { x_label: "time [s]".to_owned(), y_label: y_label.to_owned(), series }
}

fn speeds(launch: &Launch) -> String {
    let plan = reference::plan(&Settings::paper(), IDLE, 0.0);
    let lines = vec![
        series("engine ω_f", launch, false, |r| r.plant.omega_f),
        series("clutch ω_c", launch, false, |r| r.plant.omega_c),
        series("slip ω_fc", launch, false, |r| r.plant.omega_f - r.plant.omega_c),
        series("reference ω_f", launch, true, |r| reference::references(&plan, r.time_s).omega_f),
        series("reference ω_c", launch, true, |r| reference::references(&plan, r.time_s).omega_c),
    ];
    chart::render("Figure 4: clutch, engine and slip speeds (column I)", &[panel("speed [rad/s]", lines)])
}

fn positions(open_loop: &Launch, closed_loop: &Launch) -> String {
    let position = vec![
        series("x_to with feedback (B)", closed_loop, false, |r| r.controller.x_to),
        series("x_to without feedback (A)", open_loop, true, |r| r.controller.x_to),
    ];
    let share = vec![series("x_to,fb (B)", closed_loop, false, |r| r.controller.x_to_fb)];
    let panels = [panel("position [mm]", position), panel("feedback [mm]", share)];
    chart::render("Figure 5: throwout position and its feedback component", &panels)
}

fn torques(launch: &Launch) -> String {
    // From lock-up on, the paper shows the torque that the clutch can transmit at rest, and so does its estimate.
    let locked = launch.rows.iter().find(|r| r.controller.phase == Phase::Locked).map_or(f64::INFINITY, |r| r.time_s);
    let lines = vec![
        series("engine T_e", launch, false, |r| r.plant.t_e),
        series("clutch T_fc, static once locked", launch, false, |r| r.transmissible),
        series("estimate of T_fc until then", launch, true, |r| if r.time_s < locked { r.controller.t_fc_hat } else { r.transmissible }),
    ];
    chart::render("Figure 6: engine torque, clutch torque and its estimate (column B)", &[panel("torque [N·m]", lines)])
}

fn temperatures(launch: &Launch) -> String {
    let lines = vec![
        series("clutch θ_c", launch, false, |r| r.plant.theta_c),
        series("estimate of θ_c", launch, true, |r| r.controller.theta_c),
        series("body θ_b", launch, false, |r| r.plant.theta_b),
        series("estimate of θ_b", launch, true, |r| r.controller.theta_b),
    ];
    chart::render("Figure 7: temperatures of clutch and body (column B)", &[panel("temperature [°C]", lines)])
}

/// Three launches of a hot car whose touch point moves with temperature.
pub fn hot_launches(cases: &[Case; 3]) -> String {
    let lines = |of: fn(&Case) -> &Launch, value: fn(&Row) -> f64| {
        cases.iter().map(|case| series(&format!("temperature {}", case.name), of(case), false, value)).collect::<Vec<_>>()
    };
    let slip = |r: &Row| r.plant.omega_f - r.plant.omega_c;
    let panels = [
        panel("slip, no feedback [rad/s]", lines(|c| &c.open_loop, slip)),
        panel("T_fc, no feedback [N·m]", lines(|c| &c.open_loop, |r| r.plant.t_fc)),
        panel("slip, with feedback [rad/s]", lines(|c| &c.closed_loop, slip)),
        panel("T_fc, with feedback [N·m]", lines(|c| &c.closed_loop, |r| r.plant.t_fc)),
    ];
    chart::render("A hot launch: kiss point moves with temperature", &panels)
}

/// Distributions of the launches of many drawn cars, for each controller.
pub fn monte_carlo(columns: &[Column]) -> String {
    let shown = |x_label: &str, most: f64, of: fn(&Outcome) -> f64| {
        let series = columns.iter().map(|column| {
            let mut all: Vec<f64> = column.outcomes.iter().map(of).collect();
            all.sort_by(f64::total_cmp);
            let count = all.len().max(1) as f64;
            let points = all.iter().enumerate().map(|(k, x)| (x.min(most), 100.0 * (k + 1) as f64 / count)).collect();
            Series { name: column.name.to_owned(), points, dashed: false }
        });
        Panel { x_label: x_label.to_owned(), y_label: "share of cars [%]".to_owned(), series: series.collect() }
    };
    let panels = [
        shown("time until the slip is gone [s]", 8.0, |o| o.figures.time),
        shown("slip acceleration at ω_fc = 0 [rad/s²], cut at 400", 400.0, |o| o.figures.slip_acceleration.abs()),
        shown("peak torque over the planned one, cut at 2.5", 2.5, |o| o.figures.peak_torque / o.planned),
        shown("energy dissipated [kJ], cut at 30", 30.0, |o| 1e-3 * o.figures.energy),
    ];
    chart::render("Launches of drawn cars", &panels)
}
