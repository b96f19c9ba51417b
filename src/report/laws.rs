//! The laws of the clutch: torque over position, friction over slip and temperature, nominal and identified, with the measured data as a cloud.

use std::fmt::Write as _;

use super::Input;
use super::chart::{Scale, path, range};
use super::json::{real, text, texts};
use super::names;
use super::residuals::{labelled, plain};
use super::text::{capitalised, enumeration, escape, percent};

/// One curve of a law.
#[derive(Clone, Debug)]
pub struct Line {
    /// Whether it belongs to the identified car instead of the nominal one.
    pub identified: bool,
    /// Whether it belongs to the hotter of two temperatures.
    pub hot: bool,
    /// Points of the curve.
    pub points: Vec<(f64, f64)>,
}

/// One law as a figure.
#[derive(Clone, Debug)]
pub struct Law {
    /// Title of the figure.
    pub title: String,
    /// Abscissa with its unit.
    pub over: String,
    /// Unit of the ordinate.
    pub unit: &'static str,
    /// Curves.
    pub lines: Vec<Line>,
    /// Measured points.
    pub cloud: Vec<(f64, f64)>,
    /// Source of the cloud, in words.
    pub note: String,
    /// 95 % band of the identified curve: abscissa, lower bound, upper bound; may be empty.
    pub band: Vec<(f64, f64, f64)>,
    /// Whether it is a learned law, for a gap that no effect of the library explains.
    pub learned: bool,
}

/// Largest number of dots of a cloud.
const DOTS: usize = 1500;

/// The section with all laws; empty if there is none.
pub fn section(input: &Input) -> String {
    let retuned = super::series::retuned(input.diagnosis);
    let figures = |learned: bool| input.laws.iter().filter(|l| l.learned == learned).map(|l| drawn(l, retuned)).collect::<String>();
    clutch(&figures(false), retuned) + &beyond(input, &figures(true))
}

/// The learned laws, for a gap that no effect of the library explains.
fn beyond(input: &Input, figures: &str) -> String {
    let far = &input.diagnosis["how_far"];
    let found = &far["empirical"];
    let Some(reason) = text(found, "reason") else { return String::new() };
    let of: Vec<String> = texts(found, "laws").into_iter().map(names::place).collect();
    let name = escape(&enumeration(&of));
    let [heading, law, says] =
        if of.len() == 1 { ["An empirical law", "a law", "It says"] } else { ["Empirical laws", "laws", "They say"] };
    let what = if input.diagnosis["verdict"] == "explained" { "the named effects leave" } else { "no effect in the library accounts for" };
    if found["taken"] != true {
        return format!(
            "<h3>No empirical law was adopted</h3>\n<p>For what {what}, a law of {name} was learned and tried on recordings that had not taught it: {}.</p>\n",
            escape(reason)
        );
    }
    let reason = escape(&capitalised(reason));
    let closed = real(found, "closed_fraction")
        .map_or_else(String::new, |c| format!(" Not counting what even a perfect model may be off by, {} of the gap is gone.", percent(c)));
    format!(
        "<h3>{heading} of {name}</h3>\n<p>For what {what}, the retuned plant holds {law} learned from these recordings. {says} how the car \
         behaves where it was driven, not why. {reason}.{closed} The curves of a law are added; as tables they are <code>effect.empirical.*</code> of the FMU, held constant outside their breakpoints.</p>\n\
         <p class=\"keys\"><svg class=\"key\" aria-hidden=\"true\"><path class=\"c-before\" d=\"M0 7h26\"/></svg> no law \
         <svg class=\"key\" aria-hidden=\"true\"><path class=\"c-after\" d=\"M0 7h26\"/></svg> learned, with its 95\u{202f}% band; dots: the recordings, less what the other curves account for</p>\n\
         <div class=\"figures\">{figures}</div>\n"
    )
}

fn clutch(figures: &str, retuned: bool) -> String {
    if figures.is_empty() {
        return String::new();
    }
    let (heading, identified) = if retuned {
        (
            "The laws of the clutch, nominal and identified",
            "\n<svg class=\"key\" aria-hidden=\"true\"><path class=\"c-after\" d=\"M0 7h26\"/></svg> identified",
        )
    } else {
        ("The laws of the clutch as the model has them", "")
    };
    format!(
        "<h3>{heading}</h3>\n<p class=\"keys\"><svg class=\"key\" aria-hidden=\"true\"><path class=\"c-before\" d=\"M0 7h26\"/></svg> nominal{identified}; \
         thin lines: cold, thick lines: hot; dots: the recordings while the clutch slips</p>\n<div class=\"figures\">{figures}</div>\n"
    )
}

fn drawn(law: &Law, retuned: bool) -> String {
    // If nothing was retuned, both cars are the same and one curve would hide the other.
    let shown: Vec<&Line> = law.lines.iter().filter(|l| retuned || !l.identified).collect();
    let step = law.cloud.len().div_ceil(DOTS).max(1);
    let cloud: Vec<(f64, f64)> = law.cloud.iter().copied().step_by(step).collect();
    let lines = shown.iter().flat_map(|l| &l.points);
    let (low, high) = range(lines.clone().map(|p| &p.0));
    // The ordinate covers the lines, the band, and all dots except the outermost 2 % on either side.
    let mut heights: Vec<f64> = cloud.iter().map(|p| p.1).collect();
    heights.sort_by(f64::total_cmp);
    let inner = heights.get(heights.len() / 50..heights.len() - heights.len() / 50).unwrap_or_default();
    let (bottom, top) = range(lines.map(|p| &p.1).chain(inner).chain(law.band.iter().flat_map(|b| [&b.1, &b.2])));
    let x = Scale { low, high, a: LEFT, b: 512.0 };
    let y = Scale { low: bottom, high: top, a: 188.0, b: 8.0 };
    let mut drawing = frame(&x, &y, &law.over);
    let dots = cloud.iter().filter(|p| (low..=high).contains(&p.0) && (bottom..=top).contains(&p.1)).fold(String::new(), |mut out, p| {
        write!(out, "M{:.0} {:.0}h0", x.at(p.0), y.at(p.1)).expect("a String takes any text");
        out
    });
    if !law.band.is_empty() {
        let there = law.band.iter().map(|b| (x.at(b.0), y.at(b.2)));
        let back = law.band.iter().rev().map(|b| (x.at(b.0), y.at(b.1)));
        write!(drawing, "<path class=\"noise\" d=\"{}z\"/>", path(there.chain(back))).expect("a String takes any text");
    }
    write!(drawing, "<path class=\"dots d-real\" d=\"{dots}\"/>").expect("a String takes any text");
    let mut csv = format!("curve,{},{} {}\n", law.over.replace(',', ""), law.title, law.unit);
    for line in shown {
        let class = format!("{}{}", if line.identified { "c-after" } else { "c-before" }, if line.hot { " hot" } else { "" });
        let points = line.points.iter().map(|p| (x.at(p.0), y.at(p.1)));
        write!(drawing, "<path class=\"{class}\" d=\"{}\"/>", path(points)).expect("a String takes any text");
        let name = format!("{} {}", if line.identified { "identified" } else { "nominal" }, if line.hot { "hot" } else { "cold" });
        line.points.iter().for_each(|p| writeln!(csv, "{name},{},{}", plain(p.0), plain(p.1)).expect("a String takes any text"));
    }
    for (x, low, high) in &law.band {
        writeln!(csv, "95 % low,{0},{1}\n95 % high,{0},{2}", plain(*x), plain(*low), plain(*high)).expect("a String takes any text");
    }
    cloud.iter().for_each(|p| writeln!(csv, "car,{},{}", plain(p.0), plain(p.1)).expect("a String takes any text"));
    figure(&law.title, law.unit, &drawing, &csv, &law.note)
}

/// Width of a figure, and abscissa beyond which a label is aligned with the figure's right edge, in user units.
const WIDTH: f64 = 520.0;
const LAST: f64 = 500.0;

/// Left edge of a still figure's plot, in user units; leaves room for the labels of the ordinate, also on a narrow screen.
pub const LEFT: f64 = 60.0;

/// Grid, ticks and abscissa label of a figure of 520 by 232 user units.
pub fn frame(x: &Scale, y: &Scale, over: &str) -> String {
    let mut out = String::new();
    for (t, text) in labelled(y, 4) {
        let p = y.at(t);
        write!(
            out,
            "<path class=\"grid\" d=\"M{LEFT} {p:.1}H512\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
            LEFT - 5.0,
            p + 4.0
        )
        .expect("a String takes any text");
    }
    for (t, text) in labelled(x, 6) {
        let p = x.at(t);
        // A label centred on the last tick would extend beyond the drawing.
        let (at, anchor) = if p > LAST { (WIDTH, "end") } else { (p, "middle") };
        write!(
            out,
            "<path class=\"grid\" d=\"M{p:.1} 8v180\"/><text class=\"tick\" x=\"{at:.1}\" y=\"205\" text-anchor=\"{anchor}\">{text}</text>"
        )
        .expect("a String takes any text");
    }
    write!(out, "<text class=\"tick\" x=\"286\" y=\"225\" text-anchor=\"middle\">{}</text>", escape(over))
        .expect("a String takes any text");
    out
}

/// A still figure with its data table; the script offers them as SVG, PNG and CSV.
pub fn figure(title: &str, unit: &str, drawing: &str, csv: &str, note: &str) -> String {
    let label = if unit.is_empty() {
        format!("<b>{}</b>", escape(title))
    } else {
        format!("<span><b>{}</b>, {}</span>", escape(title), escape(unit))
    };
    let note = if note.is_empty() { String::new() } else { format!(" <span class=\"note\">{}</span>", escape(note)) };
    format!(
        "<figure data-csv=\"{}\"><figcaption>{label}{note}</figcaption><svg viewBox=\"0 0 520 232\" role=\"img\" aria-label=\"{}\">{drawing}</svg></figure>",
        escape(csv),
        escape(title)
    )
}
