//! One page for many cars: what is wrong with all of them, what with some, and every car with a link to its report.
//!
//! Each car is a row, a JSON object with `name`, `report` (a link), `error`, `verdict`, `where`, `effects` (`id`, `ambiguous_with`), `closed`, `confidence`, `before`, `after`,
//! and if known `mileage_km`, `date`, `off` (why the car is an outlier, in words) and `values` (by number: departure from the vehicle file and standard deviation). [`row`]
//! makes a row from a diagnosis. `population` is the content of fleet.json, or null.
//!
//! The tables that describe the population need no script. Distributions and the list of cars are drawn by fleet.js, the former on a canvas and the latter row by row as it is
//! scrolled, so that the page stays usable with ten thousand cars.

use super::json::{flag, list, real, text, texts};
use super::names;
use super::page;
use super::text::{capitalised, enumeration, escape, number, signed, unit};
use crate::vehicle::NUMBERS;
use serde_json::{Map, Value, json};

const FLEET_STYLE: &str = include_str!("fleet.css");
const SCRIPT: &str = include_str!("fleet.js");

/// The row of a diagnosed car.
pub fn row(name: &str, report: &str, diagnosis: &Value) -> Value {
    let (place, far) = (&diagnosis["where"], &diagnosis["how_far"]);
    let effects: Vec<Value> =
        list(&diagnosis["which"], "effects").iter().map(|e| json!({"id": e["id"], "ambiguous_with": e["ambiguous_with"]})).collect();
    json!({
        "name": name, "report": report, "error": null, "verdict": diagnosis["verdict"], "confidence": diagnosis["confidence"],
        "where": text(place, "primary").or_else(|| text(place, "unexplained_at")), "effects": effects,
        "closed": far["closed_fraction"], "before": far["before"], "after": far["after"],
    })
}

/// The whole page as one HTML document.
pub fn html(title: &str, rows: &[Value], population: &Value) -> String {
    let mut sections: Vec<page::Section> = Vec::new();
    if !list(population, "numbers").is_empty() {
        sections.push(("all", "What is wrong with all of them", numbers(population)));
    }
    sections.push(("which", "What is wrong, and where", effects(rows, population)));
    sections.push(("spread", "How it is distributed", DISTRIBUTION.to_owned()));
    sections.push(("cars", "The cars", CARS.to_owned()));
    page::html(&page::Page {
        title: if title.is_empty() { "fleet" } else { title },
        style: FLEET_STYLE,
        header: &header(title, rows, population),
        sections: &sections,
        data: &[("fleet", data(rows, population))],
        script: SCRIPT,
    })
}

fn diagnosed(rows: &[Value]) -> usize {
    rows.iter().filter(|r| r["error"].is_null()).count()
}

fn of(count: usize, all: usize) -> String {
    if count == all && all > 1 { format!("all {all}") } else { format!("{count} of {all}") }
}

fn plural(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

fn header(title: &str, rows: &[Value], population: &Value) -> String {
    let all = diagnosed(rows);
    let gaps = rows.iter().filter(|r| r["error"].is_null() && text(r, "verdict") != Some("no_gap")).count();
    let off: Vec<String> = list(population, "numbers")
        .iter()
        .filter(|n| flag(n, "off") && text(n, "kind") == Some("tolerance"))
        .filter_map(|n| text(n, "number"))
        .map(String::from)
        .collect();
    let the_car = if rows.len() == 1 { "the car" } else { "the one car that was diagnosed" };
    let mut sentence = match (all, gaps) {
        (0, _) => "No car could be diagnosed.".to_owned(),
        (1, 0) => format!("The model follows {the_car} within its tolerances."),
        (1, _) => format!("{} has a gap.", capitalised(the_car)),
        (_, 0) => format!("{}: the model follows every one of them within its tolerances.", plural(all, "car")),
        _ => format!("{} cars {} a gap.", capitalised(&of(gaps, all)), if gaps == 1 { "has" } else { "have" }),
    };
    if !off.is_empty() {
        let (verb, noun) = if off.len() == 1 { ("is", "number") } else { ("are", "numbers") };
        sentence += &format!(" {} {noun} of the vehicle file {verb} off for all of them.", capitalised(&count_word(off.len())));
    }
    let failed = rows.len() - all;
    let outliers = list(population, "outliers").len();
    let mut tiles = vec![
        (
            "Cars",
            plural(rows.len(), "campaign"),
            if failed > 0 {
                format!("{} could not be diagnosed; their rows say why", plural(failed, "campaign"))
            } else {
                "all were diagnosed".to_owned()
            },
        ),
        ("Where most often", most(&places(rows), names::subsystem, "nowhere").0, most(&places(rows), names::subsystem, "nowhere").1),
        ("Which most often", most(&counted(rows), names::effect, "no effect").0, most(&counted(rows), names::effect, "no effect").1),
    ];
    if !list(population, "numbers").is_empty() {
        tiles.push((
            "Vehicle file",
            if off.is_empty() { "holds".to_owned() } else { enumeration(&off) },
            if off.is_empty() { "no number is off for all" } else { "off for all cars" }.to_owned(),
        ));
        tiles.push(("Outliers", plural(outliers, "car"), "stand out, by a number or an effect".to_owned()));
    }
    let tiles: String = tiles
        .iter()
        .map(|(what, value, more)| {
            format!("<div><dt>{what}</dt><dd><strong>{}</strong><span>{}</span></dd></div>", escape(value), escape(more))
        })
        .collect();
    format!(
        "<header><p class=\"eyebrow\">Kisspoint fleet{}</p>\n<h1>{}</h1>\n<dl class=\"tiles\">{tiles}</dl></header>\n",
        if title.is_empty() { String::new() } else { format!(": {}", escape(title)) },
        escape(&sentence)
    )
}

/// The most frequent keys, and their frequency; keys that share the first place are named together, so that none seems to lead.
fn most(counted: &[(String, usize)], name: fn(&str) -> String, none: &str) -> (String, String) {
    let top = counted.first().map_or(0, |c| c.1);
    let first: Vec<String> = counted.iter().take_while(|c| c.1 == top).map(|c| name(&c.0)).collect();
    match first.len() {
        0 => (capitalised(none), String::new()),
        1 => (capitalised(&first[0]), plural(top, "car")),
        2 => (capitalised(&enumeration(&first)), format!("{} each", plural(top, "car"))),
        n => ("None stands out".to_owned(), format!("{} with {} each", count_word(n), plural(top, "car"))),
    }
}

fn count_word(n: usize) -> String {
    ["no", "one", "two", "three", "four", "five", "six"].get(n).map_or_else(|| n.to_string(), |w| (*w).to_owned())
}

/// Keys with their frequency, most frequent first.
fn tally(keys: impl Iterator<Item = String>) -> Vec<(String, usize)> {
    let mut counts: std::collections::BTreeMap<String, usize> = std::collections::BTreeMap::new();
    keys.for_each(|k| *counts.entry(k).or_default() += 1);
    let mut all: Vec<(String, usize)> = counts.into_iter().collect();
    all.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    all
}

fn counted(rows: &[Value]) -> Vec<(String, usize)> {
    tally(rows.iter().flat_map(|r| list(r, "effects")).filter_map(|e| text(e, "id")).map(String::from))
}

fn places(rows: &[Value]) -> Vec<(String, usize)> {
    tally(rows.iter().filter_map(|r| text(r, "where")).map(String::from))
}

/// Half width of the plot of the numbers, in standard deviations of their tolerances.
const REACH: f64 = 4.0;

fn numbers(population: &Value) -> String {
    let body: String = list(population, "numbers").iter().map(one_number).collect();
    let populations = list(population, "populations");
    let others = if populations.len() > 1 {
        format!(
            "<p class=\"absent\">There are {} vehicle files; this one covers the most cars ({}). fleet.json holds the others.</p>",
            populations.len(),
            real(&populations[0], "cars").unwrap_or(0.0)
        )
    } else {
        String::new()
    };
    format!(
        "<p>Each number of the vehicle file over all cars, in standard deviations of its declared tolerance, or of the default where the file declares none: where its mean lies (point, 95 % interval) and how much cars differ (band, ± one spread). \
         The tolerance assumed in each car's own fit is divided out.</p>{others}\n<div class=\"scroll\"><table class=\"plain numbers\"><thead><tr><th scope=\"col\">Number</th><th scope=\"col\" class=\"num\">Off by</th>\
         <th scope=\"col\">−{REACH} to {REACH} σ</th><th scope=\"col\" class=\"num\">Spread / tolerance</th><th scope=\"col\">Says</th></tr></thead><tbody>{body}</tbody></table></div>\n"
    )
}

/// Unit of a number of the vehicle file; empty if it has none or is not known.
fn unit_of(name: &str) -> String {
    let flat = NUMBERS.iter().find(|n| n.name == name || n.name.strip_suffix("_0") == Some(name));
    match flat {
        Some(n) => unit(n.unit),
        None if name == "engine.T_e_bias" => unit("N.m"),
        None if name.ends_with("latency") || name.ends_with("timing") => "s".to_owned(),
        None => String::new(),
    }
}

fn one_number(n: &Value) -> String {
    let get = |key: &str| real(n, key).unwrap_or(f64::NAN);
    let name = text(n, "number").unwrap_or_default();
    let (mean, low, high, sigma) = (get("mean"), get("low"), get("high"), get("sigma"));
    let spread = |key: &str| real(&n["spread"], key).unwrap_or(f64::NAN);
    let by = |z: f64| {
        if flag(n, "relative") {
            format!("{} %", signed_number(100.0 * sigma * z))
        } else {
            format!("{} {}", signed_number(sigma * z), unit_of(name))
        }
    };
    let mut says = Vec::new();
    let informed = get("informed") > 0.5;
    if flag(n, "off") {
        says.push("<span class=\"pill warn\">off for all</span>".to_owned());
    }
    let declared = if text(n, "kind") == Some("logger") { "default" } else { "tolerance" };
    match text(n, "tolerance") {
        Some("too_wide") => says.push(format!("<span class=\"pill\">{declared} too wide</span>")),
        Some("too_narrow") => says.push(format!("<span class=\"pill warn\">{declared} too narrow</span>")),
        _ => {}
    }
    for d in list(n, "drift").iter().filter(|d| flag(d, "significant")) {
        let slope = real(d, "slope").unwrap_or(f64::NAN);
        says.push(format!("<span class=\"pill warn\">moves {} per {}</span>", by(slope), text(d, "per").unwrap_or_default()));
    }
    if !informed && says.is_empty() {
        says.push("<span class=\"note\">most cars' recordings say little of it</span>".to_owned());
    }
    let place = |z: f64| 100.0 + 100.0 * (z / REACH).clamp(-1.0, 1.0);
    let figure = format!(
        "<svg viewBox=\"0 0 200 22\" role=\"img\" aria-label=\"{}\"><path class=\"null\" d=\"M100 0V22\"/><path class=\"tolerance\" d=\"M75 20H125\"/><rect class=\"noise\" x=\"{:.1}\" y=\"4\" width=\"{:.1}\" height=\"12\"/>\
         <path class=\"whisker\" d=\"M{:.1} 10H{:.1}\"/><circle class=\"dot\" cx=\"{:.1}\" cy=\"10\" r=\"4\"/></svg>",
        escape(&format!("{name}: {mean:.2} σ, 95 % from {low:.2} to {high:.2}")),
        place(mean - spread("value")),
        place(mean + spread("value")) - place(mean - spread("value")),
        place(low),
        place(high),
        place(mean)
    );
    format!(
        "<tr><th scope=\"row\"><code>{}</code></th><td class=\"num\">{}<small>{} to {} σ</small></td><td class=\"drawn\">{figure}</td><td class=\"num\">{}<small>{} to {}</small></td><td>{}</td></tr>\n",
        escape(name).replace(" × ", " ×<br>"),
        escape(&by(mean)),
        signed(low, 2),
        signed(high, 2),
        number(spread("value"), 2),
        number(spread("low"), 2),
        number(spread("high"), 2),
        says.join(" ")
    )
}

fn signed_number(value: f64) -> String {
    format!("{}{}", if value < 0.0 { "−" } else { "+" }, number(value.abs(), 2))
}

fn effects(rows: &[Value], population: &Value) -> String {
    let all = diagnosed(rows).max(1);
    let bar = |count: usize| format!("<span class=\"bar\"><i style=\"width:{:.1}%\"></i></span>", 100.0 * count as f64 / all as f64);
    let places = places(rows);
    let mut out = String::new();
    if places.is_empty() {
        out += "<p class=\"absent\">No car has a gap that lies anywhere.</p>\n";
    } else {
        let lines: String = places
            .iter()
            .map(|(id, count)| format!("<tr><th scope=\"row\"><button type=\"button\" class=\"pick\" data-where=\"{0}\">{1}</button></th><td class=\"wide\">{2}</td><td class=\"num\">{count}</td></tr>", escape(id), escape(&names::subsystem_title(id)), bar(*count)))
            .collect();
        out += &format!(
            "<h3>Where</h3><table class=\"bars\"><caption class=\"unseen\">Cars by subsystem</caption><tbody>{lines}</tbody></table>\n"
        );
    }
    let counted = counted(rows);
    if counted.is_empty() {
        return out;
    }
    let known = list(population, "effects");
    let lines: String = counted
        .iter()
        .map(|(id, count)| {
            let share = known.iter().find(|e| text(e, "effect") == Some(id));
            let told = share.map_or(String::new(), |s| {
                let get = |key: &str| 100.0 * real(s, key).unwrap_or(f64::NAN);
                format!("{} %<small>{} to {} %</small>", number(get("share"), 2), number(get("low"), 2), number(get("high"), 2))
            });
            let sizes: Vec<String> = share.map_or(&[][..], |s| list(s, "parameters")).iter().map(size).collect();
            format!(
                "<tr><th scope=\"row\"><button type=\"button\" class=\"pick\" data-effect=\"{0}\">{1}</button><br><code>{4}</code></th><td class=\"wide\">{2}</td><td class=\"num\">{count}</td>{3}</tr>",
                escape(id),
                escape(&names::effect_title(id)),
                bar(*count),
                if known.is_empty() { String::new() } else { format!("<td class=\"num\">{told}</td><td>{}</td>", sizes.join("<br>")) },
                escape(id).replace('_', "_<wbr>")
            )
        })
        .collect();
    let heads = if known.is_empty() {
        ""
    } else {
        "<th scope=\"col\" class=\"num\">Share of such cars (95 %)</th><th scope=\"col\">Size among them</th>"
    };
    out + &format!(
        "<h3>Which</h3><div class=\"scroll\"><table class=\"bars which\"><thead><tr><th scope=\"col\">Effect</th><th scope=\"col\"><span class=\"unseen\">Bar</span></th><th scope=\"col\" class=\"num\">Cars</th>{heads}</tr></thead><tbody>{lines}</tbody></table></div>\n\
         <p class=\"hint live\">Click a name to list its cars below.</p>\n"
    )
}

/// Mean, spread and drift of an effect's parameter.
fn size(p: &Value) -> String {
    let get = |key: &str| real(p, key).unwrap_or(f64::NAN);
    let unit = unit(text(p, "unit").unwrap_or_default());
    let mut told = format!(
        "<small><code>{}</code> {} {unit} ({} to {}), spread {}</small>",
        escape(text(p, "parameter").unwrap_or_default().rsplit('.').next().unwrap_or_default()),
        number(get("mean"), 3),
        number(get("low"), 3),
        number(get("high"), 3),
        number(real(&p["spread"], "value").unwrap_or(f64::NAN), 2)
    );
    for d in list(p, "drift").iter().filter(|d| flag(d, "significant")) {
        told += &format!(
            " <span class=\"pill warn\">moves {} {unit} per {}</span>",
            signed_number(real(d, "slope").unwrap_or(f64::NAN)),
            text(d, "per").unwrap_or_default()
        );
    }
    told
}

const DISTRIBUTION: &str = "<noscript><p class=\"absent\">The distributions are drawn by a script, which this browser does not run; cars.parquet holds the numbers.</p></noscript>\n\
<div class=\"live tools\"><label>Number <select id=\"number\"></select></label><label>Over <select id=\"over\"></select></label></div>\n\
<div class=\"live\"><p class=\"shown\" id=\"hint\" role=\"status\"></p><canvas id=\"plot\" tabindex=\"0\" role=\"img\" aria-label=\"Cars as points; the list below holds the same\"></canvas>\n\
<p class=\"hint\">Each point is a car in the list below, filters applied; click it for its report, or move with the arrow keys. Orange: outliers.</p></div>\n";

const CARS: &str = "<noscript><p class=\"absent\">The list is drawn by a script, which this browser does not run; fleet.parquet holds the rows.</p></noscript>\n\
<div class=\"live tools\"><label>Find <input type=\"search\" id=\"find\" placeholder=\"name or message\"></label><label>Verdict <select id=\"verdict\"></select></label>\
<label>Where <select id=\"where-is\"></select></label><label>Effect <select id=\"effect\"></select></label><label class=\"check\"><input type=\"checkbox\" id=\"outliers\"> outliers only</label>\
<button type=\"button\" id=\"clear\">All cars</button></div>\n\
<p class=\"live shown\" id=\"count\" role=\"status\"></p>\n<div class=\"live\" id=\"list\" role=\"table\" aria-label=\"Cars\"><div role=\"row\" class=\"head\" id=\"head\"></div><div id=\"window\" tabindex=\"0\"><div id=\"rows\"></div></div></div>\n";

/// Data of the script, stored by columns so that ten thousand cars take a few megabytes.
fn data(rows: &[Value], population: &Value) -> String {
    let column = |get: &dyn Fn(&Value) -> Value| -> Value { rows.iter().map(get).collect::<Vec<_>>().into() };
    let key = |name: &'static str| column(&move |r: &Value| r[name].clone());
    let rounded = |v: Option<f64>| v.and_then(|v| format!("{v:.3e}").parse::<f64>().ok()).map_or(Value::Null, Value::from);
    let real_column = |name: &'static str| column(&move |r: &Value| rounded(real(r, name)));
    let mut numbers: Vec<String> = Vec::new();
    for r in rows {
        for name in r["values"].as_object().into_iter().flat_map(Map::keys) {
            if !numbers.contains(name) {
                numbers.push(name.clone());
            }
        }
    }
    let value = |name: &str, k: usize| column(&|r: &Value| rounded(r["values"][name][k].as_f64()));
    let values: Map<String, Value> = numbers
        .iter()
        .map(|n| {
            (n.clone(), json!({"value": value(n, 0), "sd": value(n, 1), "unit": rows.iter().find_map(|r| r["values"][n][2].as_str())}))
        })
        .collect();
    let plain: Map<String, Value> = names::EFFECTS.iter().map(|(id, name)| ((*id).to_owned(), capitalised(name).into())).collect();
    let within: Map<String, Value> = names::SUBSYSTEMS.iter().map(|(id, _)| ((*id).to_owned(), names::place(id).into())).collect();
    let places: Map<String, Value> = names::SUBSYSTEMS.iter().map(|(id, name)| ((*id).to_owned(), capitalised(name).into())).collect();
    let effects = column(&|r: &Value| list(r, "effects").iter().filter_map(|e| text(e, "id")).collect::<Vec<_>>().into());
    let rivals = column(&|r: &Value| list(r, "effects").iter().map(|e| Value::from(texts(e, "ambiguous_with"))).collect::<Vec<_>>().into());
    let all = json!({
        "name": key("name"), "report": key("report"), "error": key("error"), "verdict": key("verdict"), "where": key("where"), "date": key("date"), "off": key("off"),
        "effects": effects, "rivals": rivals, "closed": real_column("closed"), "before": real_column("before"), "after": real_column("after"),
        "confidence": real_column("confidence"), "mileage_km": real_column("mileage_km"), "values": values, "units": numbers.iter().map(|n| (n.clone(), unit_of(n).into())).collect::<Map<_, _>>(),
        "names": plain, "places": places, "in": within, "outliers": list(population, "outliers").len(),
    });
    // A script element must not contain "<".
    all.to_string().replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_of_a_name_reaches_neither_page_nor_script() {
        let rows = [
            json!({"name": "</script><b>", "report": "cars/a/report.html", "error": null, "verdict": "explained", "where": "friction", "effects": [{"id": "judder", "ambiguous_with": []}]}),
        ];
        let page = html("</title><i>", &rows, &Value::Null);
        assert!(!page.contains("</script><b>") && !page.contains("</title><i>"));
        assert!(
            page.contains("<h1>The car has a gap.</h1>")
                && page.contains("Kisspoint fleet: &lt;/title")
                && page.contains("data-effect=\"judder\"")
        );
    }

    #[test]
    fn what_occurs_equally_often_does_not_lead() {
        let row = |place: &str| json!({"name": place, "verdict": "unexplained", "error": null, "where": place, "effects": []});
        let tiles = |places: &[&str]| html("fleet", &places.iter().map(|p| row(p)).collect::<Vec<_>>(), &Value::Null);
        assert!(tiles(&["friction", "engine", "driveline"]).contains("<strong>None stands out</strong><span>three with 1 car each"));
        assert!(tiles(&["friction", "engine"]).contains("<strong>Engine torque and friction</strong><span>1 car each"));
        assert!(tiles(&["friction", "engine", "friction"]).contains("<strong>Friction</strong><span>2 cars"));
    }

    #[test]
    fn what_could_not_be_diagnosed_is_counted() {
        let rows = [json!({"name": "a", "error": "vehicle.json is missing", "effects": []})];
        let page = html("", &rows, &Value::Null);
        assert!(page.contains("<title>Kisspoint: fleet</title>") && page.contains("Kisspoint fleet</p>"));
        assert!(page.contains("No car could be diagnosed.") && page.contains("1 campaign could not be diagnosed"));
    }
}
