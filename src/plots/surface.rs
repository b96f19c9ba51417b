//! A family of surfaces over two axes in parallel projection, drawn as nets.

use super::chart::{self, COLOURS, WIDTH};
use std::fmt::Write as _;

/// A horizontal axis.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Label.
    pub label: &'static str,
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
}

impl Axis {
    fn at(&self, share: f64) -> f64 {
        self.low + share * (self.high - self.low)
    }
}

/// One surface of the family.
pub struct Surface<'a> {
    /// Name in the legend.
    pub name: String,
    /// Its height over both axes.
    pub height: Box<dyn Fn(f64, f64) -> f64 + 'a>,
}

/// Meshes along an axis.
const MESHES: usize = 24;

const HEIGHT: f64 = 520.0;

/// Point on the page of shares 0..1 along the first axis, the second axis and upwards.
fn project(a: f64, b: f64, up: f64) -> (f64, f64) {
    (70.0 + 400.0 * a + 230.0 * b, 440.0 + 40.0 * a - 150.0 * b - 230.0 * up)
}

/// The family as an SVG document.
pub fn render(title: &str, first: Axis, second: Axis, up_label: &str, surfaces: &[Surface]) -> String {
    let mut svg = chart::begin(title, HEIGHT);
    let shares = || (0..=MESHES).map(|k| k as f64 / MESHES as f64);
    let corner = |s: &Surface| {
        shares().flat_map(|a| shares().map(move |b| (a, b))).map(|(a, b)| (s.height)(first.at(a), second.at(b))).fold(0.0, f64::max)
    };
    let highest = surfaces.iter().map(corner).fold(1e-9, f64::max);
    draw_axes(&mut svg, first, second, up_label, highest);
    for (k, surface) in surfaces.iter().enumerate() {
        let point = |a: f64, b: f64| project(a, b, (surface.height)(first.at(a), second.at(b)) / highest);
        // Far meshes first, so that near ones cover them.
        for row in (0..MESHES).rev() {
            for column in 0..MESHES {
                let (a, b) = (column as f64 / MESHES as f64, row as f64 / MESHES as f64);
                let d = 1.0 / MESHES as f64;
                let ring = [point(a, b), point(a + d, b), point(a + d, b + d), point(a, b + d)];
                let ring: Vec<String> = ring.iter().map(|p| format!("{:.1},{:.1}", p.0, p.1)).collect();
                let colour = COLOURS[k];
                writeln!(
                    svg,
                    "<polygon points=\"{}\" fill=\"{colour}\" fill-opacity=\"0.10\" stroke=\"{colour}\" stroke-width=\"0.6\"/>",
                    ring.join(" ")
                )
                .unwrap();
            }
        }
        let at = 66.0 + 20.0 * k as f64;
        writeln!(svg, "<rect x=\"84\" y=\"{}\" width=\"26\" height=\"12\" fill=\"{}\" fill-opacity=\"0.5\"/>", at - 10.0, COLOURS[k])
            .unwrap();
        writeln!(svg, "<text x=\"118\" y=\"{at}\">{}</text>", surface.name).unwrap();
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw_axes(svg: &mut String, first: Axis, second: Axis, up_label: &str, highest: f64) {
    let line = |svg: &mut String, from: (f64, f64), to: (f64, f64), colour: &str| {
        writeln!(svg, "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{colour}\" fill=\"none\"/>", from.0, from.1, to.0, to.1).unwrap();
    };
    let text = |svg: &mut String, at: (f64, f64), anchor: &str, what: &str| {
        writeln!(svg, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{what}</text>", at.0, at.1).unwrap();
    };
    let moved = |p: (f64, f64), dx: f64, dy: f64| (p.0 + dx, p.1 + dy);
    let values = chart::ticks(first.low, first.high, 5.0);
    for &v in &values {
        let a = (v - first.low) / (first.high - first.low);
        line(svg, project(a, 0.0, 0.0), project(a, 1.0, 0.0), "#e0e0e0");
        text(svg, moved(project(a, 0.0, 0.0), 0.0, 18.0), "middle", &chart::label(v, &values));
    }
    let values = chart::ticks(second.low, second.high, 5.0);
    for &v in &values {
        let b = (v - second.low) / (second.high - second.low);
        line(svg, project(0.0, b, 0.0), project(1.0, b, 0.0), "#e0e0e0");
        text(svg, moved(project(1.0, b, 0.0), 8.0, 12.0), "start", &chart::label(v, &values));
    }
    let values = chart::ticks(0.0, highest, 5.0);
    for &v in &values {
        line(svg, project(0.0, 0.0, v / highest), project(0.0, 1.0, v / highest), "#e0e0e0");
        text(svg, moved(project(0.0, 0.0, v / highest), -8.0, 4.0), "end", &chart::label(v, &values));
    }
    for (from, to) in [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))] {
        line(svg, project(from.0, from.1, from.2), project(to.0, to.1, to.2), "#404040");
    }
    text(svg, moved(project(0.5, 0.0, 0.0), -10.0, 42.0), "middle", first.label);
    text(svg, moved(project(1.0, 0.5, 0.0), 62.0, 22.0), "middle", second.label);
    let x = WIDTH * 0.02 + 4.0;
    writeln!(svg, "<text transform=\"translate({x:.1} 330) rotate(-90)\" text-anchor=\"middle\">{up_label}</text>").unwrap();
}
