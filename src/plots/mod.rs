//! The paper's figures as SVG.
//!
//! - [`chart`]: line charts, panels under each other
//! - [`surface`]: a family of surfaces as the paper's Figures 1 and 2 draw the torque map
//!
//! | figure | content | from |
//! |---|---|---|
//! | 1 | T_fc over x_to and ω_fc for several θ_c | torque map |
//! | 2 | T_fc over x_to and θ_c for several ω_fc | torque map |
//! | 4 | speeds and their references | column I |
//! | 5 | x_to with and without feedback, x_to,fb | columns A and B |
//! | 6 | T_e, T_fc and its estimate | column B |
//! | 7 | θ_c and θ_b | column B |

pub mod chart;
pub mod surface;

use crate::control::Settings;
use crate::control::reference;
use crate::launch::{IDLE, Launch, Row};
use crate::physics::{cushion, map};
use crate::vehicle::Vehicle;
use chart::{Panel, Series};
use surface::{Axis, Surface};

/// File name and text of every figure; `launches` are the columns of Table II.
pub fn all(vehicle: &Vehicle, launches: &[Launch; 3]) -> Vec<(&'static str, String)> {
    let [ideal, open_loop, closed_loop] = launches;
    vec![
        ("figure_1.svg", torque_over_slip(vehicle)),
        ("figure_2.svg", torque_over_temperature(vehicle)),
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

fn travel(v: &Vehicle) -> Axis {
    Axis { label: "x_to [mm]", low: v.actuator.x_cnt_0, high: v.actuator.x_cls_0 }
}

fn torque_over_slip(v: &Vehicle) -> String {
    let surfaces = [25.0, 75.0, 150.0]
        .map(|theta| Surface { name: format!("θ_c = {theta:.0} °C"), height: Box::new(move |x, slip| torque(v, x, slip, theta)) });
    let slip = Axis { label: "ω_fc [rad/s]", low: 0.0, high: 40.0 };
    surface::render("Figure 1: torque map over position and slip speed", travel(v), slip, "T_fc [N·m]", &surfaces)
}

fn torque_over_temperature(v: &Vehicle) -> String {
    let surfaces = [0.0, 3.0, 40.0]
        .map(|slip| Surface { name: format!("ω_fc = {slip:.0} rad/s"), height: Box::new(move |x, theta| torque(v, x, slip, theta)) });
    let theta = Axis { label: "θ_c [°C]", low: 25.0, high: 250.0 };
    surface::render("Figure 2: torque map over position and temperature", travel(v), theta, "T_fc [N·m]", &surfaces)
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
    let lines = vec![
        series("engine T_e", launch, false, |r| r.plant.t_e),
        series("clutch T_fc", launch, false, |r| r.plant.t_fc),
        series("estimate of T_fc", launch, true, |r| r.controller.t_fc_hat),
    ];
    chart::render("Figure 6: engine torque, clutch torque and its estimate (column B)", &[panel("torque [N·m]", lines)])
}

fn temperatures(launch: &Launch) -> String {
    let disc =
        vec![series("clutch θ_c", launch, false, |r| r.plant.theta_c), series("estimate of θ_c", launch, true, |r| r.controller.theta_c)];
    let body =
        vec![series("body θ_b", launch, false, |r| r.plant.theta_b), series("estimate of θ_b", launch, true, |r| r.controller.theta_b)];
    let panels = [panel("clutch [°C]", disc), panel("body [°C]", body)];
    chart::render("Figure 7: temperatures of clutch and body (column B)", &panels)
}
