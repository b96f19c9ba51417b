//! The paper's Figure 3: the control scheme as a block diagram.

use super::chart;
use std::fmt::Write as _;

const HEIGHT: f64 = 470.0;

/// A block: left, top, width, lines of text.
const BLOCKS: [(f64, f64, f64, [&str; 2]); 9] = [
    (30.0, 90.0, 110.0, ["references", "ω_f,ref, ω_c,ref"]),
    (200.0, 70.0, 110.0, ["PI", "engine speed"]),
    (200.0, 170.0, 110.0, ["PI", "clutch speed"]),
    (390.0, 170.0, 130.0, ["inverse torque map", "x(T_c,ref, ω_fc, θ̂_c)"]),
    (390.0, 270.0, 130.0, ["PI", "torque feedback"]),
    (610.0, 70.0, 110.0, ["engine", ""]),
    (610.0, 170.0, 110.0, ["clutch", "T_fc(x_to, ω_fc, θ_c)"]),
    (740.0, 120.0, 100.0, ["driveline", "(7)"]),
    (200.0, 380.0, 320.0, ["torque observer (9), thermal model (6)", "T̂_fc, θ̂_c"]),
];

/// A signal: its path, and its name with the position of the name.
const SIGNALS: [(&str, &str, f64, f64); 14] = [
    ("M140 105H200", "", 0.0, 0.0),
    ("M140 115H165V185H200", "", 0.0, 0.0),
    ("M310 95H548", "", 0.0, 0.0),
    ("M562 95H610", "T_e,ref", 566.0, 88.0),
    ("M310 195H390", "T_c,ref", 322.0, 188.0),
    ("M350 195V130H555V102", "decoupling", 400.0, 146.0),
    ("M520 195H548", "", 0.0, 0.0),
    ("M562 195H610", "x_to", 570.0, 188.0),
    ("M370 195V290H390", "", 0.0, 0.0),
    ("M520 295H555V202", "x_to,fb", 560.0, 260.0),
    ("M720 95H755V120", "T_e", 726.0, 88.0),
    ("M720 195H755V170", "T_fc", 726.0, 212.0),
    ("M790 170V405H520", "ω_f, ω_c, T_e", 690.0, 398.0),
    ("M300 380V345H345V315H390", "T̂_fc", 305.0, 338.0),
];

/// Feedback signals, routed along the margin.
const BACK: [(&str, &str, f64, f64); 2] =
    [("M450 380V345H460V320", "θ̂_c to the map", 466.0, 350.0), ("M200 405H175V215H200", "ω_f, ω_c", 112.0, 330.0)];

/// The figure as an SVG document.
pub fn figure_3() -> String {
    let mut svg = chart::begin("Figure 3: the paper's control scheme", HEIGHT);
    svg.push_str(
        "<defs><marker id=\"tip\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"8\" markerHeight=\"8\" orient=\"auto\">\
         <path d=\"M0 0L8 4L0 8z\" fill=\"#404040\"/></marker></defs>\n",
    );
    for (way, name, x, y) in SIGNALS.iter().chain(&BACK) {
        writeln!(svg, "<path d=\"{way}\" fill=\"none\" stroke=\"#404040\" marker-end=\"url(#tip)\"/>").expect("a String takes all text");
        if !name.is_empty() {
            writeln!(svg, "<text x=\"{x}\" y=\"{y}\" font-size=\"12\">{name}</text>").expect("a String takes all text");
        }
    }
    for (x, y) in [(555.0, 95.0), (555.0, 195.0)] {
        writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"7\" fill=\"white\" stroke=\"#404040\"/>").expect("a String takes all text");
        writeln!(svg, "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">+</text>", y + 4.5).expect("a String takes all text");
    }
    for (x, y, width, lines) in BLOCKS {
        writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"50\" fill=\"#eef4fa\" stroke=\"#404040\"/>")
            .expect("a String takes all text");
        for (k, line) in lines.iter().enumerate() {
            let (at, down) = (x + 0.5 * width, y + 21.0 + 18.0 * k as f64);
            writeln!(svg, "<text x=\"{at}\" y=\"{down}\" text-anchor=\"middle\" font-size=\"12\">{line}</text>")
                .expect("a String takes all text");
        }
    }
    svg.push_str("</svg>\n");
    svg
}
