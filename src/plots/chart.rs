//! Line charts as SVG: panels one below the other, each with its own axes.

use std::fmt::Write as _;

/// One line.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points of the line; the line is broken where an ordinate is not a number.
    pub points: Vec<(f64, f64)>,
    /// Whether the line is dashed.
    pub dashed: bool,
}

/// One pair of axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Label of the abscissa.
    pub x_label: String,
    /// Label of the ordinate.
    pub y_label: String,
    /// Lines.
    pub series: Vec<Series>,
}

/// Colours that colour-blind readers can tell apart, also in print.
pub const COLOURS: [&str; 5] = ["#0072b2", "#d55e00", "#009e73", "#56b4e9", "#e69f00"];

pub(super) const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 70.0;
/// Room for the legend, to the right of the lines.
const RIGHT: f64 = 216.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 48.0;

/// The panels as one SVG document.
pub fn render(title: &str, panels: &[Panel]) -> String {
    let height = TOP + panels.len() as f64 * HEIGHT;
    let mut svg = begin(title, height);
    for (k, panel) in panels.iter().enumerate() {
        draw_panel(&mut svg, panel, TOP + k as f64 * HEIGHT);
    }
    svg.push_str("</svg>\n");
    svg
}

/// Beginning of an SVG document, with its title.
pub(super) fn begin(title: &str, height: f64) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<title>{title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"26\" font-size=\"16\" text-anchor=\"middle\">{title}</text>\n",
        0.5 * WIDTH
    )
}

/// Round values that divide `low..high` into about `count` parts.
pub(super) fn ticks(low: f64, high: f64, count: f64) -> Vec<f64> {
    let raw = (high - low) / count;
    let power = 10.0_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|f| f * power).find(|s| *s >= raw * (1.0 - 1e-9)).unwrap_or(10.0 * power);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Label of a tick, with as many decimals as the distance between ticks requires.
pub(super) fn label(value: f64, ticks: &[f64]) -> String {
    let step = ticks.get(1).map_or(1.0, |next| next - ticks[0]);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let margin = 0.04 * (high - low).max(1e-9);
    (low - margin, high + margin)
}

fn draw_panel(svg: &mut String, panel: &Panel, top: f64) {
    let points = || panel.series.iter().flat_map(|s| &s.points);
    let (x_low, x_high) = points().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.0), h.max(p.0)));
    let (y_low, y_high) = bounds(points().map(|p| p.1));
    let (width, height) = (WIDTH - LEFT - RIGHT, HEIGHT - BOTTOM - 10.0);
    let x = |v: f64| LEFT + (v - x_low) / (x_high - x_low) * width;
    let y = |v: f64| top + (y_high - v) / (y_high - y_low) * height;
    let bottom = top + height;
    let x_ticks = ticks(x_low, x_high, 8.0);
    for &t in &x_ticks {
        let at = x(t);
        let text = label(t, &x_ticks);
        writeln!(svg, "<path d=\"M{at:.1} {top:.1}V{bottom:.1}\" stroke=\"#e0e0e0\"/>").unwrap();
        writeln!(svg, "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>", bottom + 17.0).unwrap();
    }
    let y_ticks = ticks(y_low, y_high, 6.0);
    for &t in &y_ticks {
        let at = y(t);
        writeln!(svg, "<path d=\"M{LEFT} {at:.1}H{:.1}\" stroke=\"#e0e0e0\"/>", LEFT + width).unwrap();
        let text = label(t, &y_ticks);
        writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>", LEFT - 6.0, at + 4.5).unwrap();
    }
    writeln!(svg, "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#404040\"/>").unwrap();
    writeln!(svg, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>", LEFT + 0.5 * width, bottom + 36.0, panel.x_label)
        .unwrap();
    let middle = top + 0.5 * height;
    writeln!(svg, "<text transform=\"translate(18 {middle:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>", panel.y_label).unwrap();
    for (k, series) in panel.series.iter().enumerate() {
        draw_line(svg, series, COLOURS[k % COLOURS.len()], &x, &y);
    }
    draw_legend(svg, panel, top);
}

fn dashes(dashed: bool) -> &'static str {
    if dashed { " stroke-dasharray=\"7 4\"" } else { "" }
}

fn draw_line(svg: &mut String, series: &Series, colour: &str, x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) {
    let dash = dashes(series.dashed);
    for part in series.points.split(|p| p.1.is_nan()).filter(|part| !part.is_empty()) {
        let points: Vec<String> = part.iter().map(|p| format!("{:.2},{:.2}", x(p.0), y(p.1))).collect();
        writeln!(svg, "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"{dash}/>", points.join(" ")).unwrap();
    }
}

fn draw_legend(svg: &mut String, panel: &Panel, top: f64) {
    let left = WIDTH - RIGHT + 12.0;
    for (k, series) in panel.series.iter().enumerate() {
        let (at, colour, dash) = (top + 20.0 + 19.0 * k as f64, COLOURS[k % COLOURS.len()], dashes(series.dashed));
        writeln!(svg, "<path d=\"M{left} {at}h30\" stroke=\"{colour}\" stroke-width=\"2\"{dash}/>").unwrap();
        writeln!(svg, "<text x=\"{}\" y=\"{}\">{}</text>", left + 36.0, at + 4.5, series.name).unwrap();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let found = ticks(-4.3, 108.0, 6.0);
        assert_eq!(found, vec![0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        assert_eq!(label(0.25, &ticks(0.0, 0.5, 5.0)), "0.2");
    }

    #[test]
    fn a_line_is_broken_where_it_has_no_value() {
        let points = vec![(0.0, 0.0), (0.0, 2.0), (0.0, f64::NAN), (1.0, 0.0), (1.0, 2.0)];
        let panel =
            Panel { x_label: String::new(), y_label: String::new(), series: vec![Series { name: String::new(), points, dashed: true }] };
        let svg = render("", &[panel]);
        assert!(svg.matches("<polyline").count() == 2 && !svg.contains("NaN"));
    }
}
