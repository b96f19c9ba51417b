//! The report as a file: content, size, reproducibility, and robustness against bad and missing input.

mod campaign;

use kisspoint::report::laws::{Law, Line};
use kisspoint::report::{Input, Overlay, OverlayChannel, html};
use serde_json::{Value, json};

fn render(diagnosis: &Value, overlays: &[Overlay]) -> String {
    html(&Input { overlays, ..Input::empty(diagnosis) })
}

fn page_of(made: &campaign::Campaign, provenance: &[(String, String)]) -> String {
    html(&Input { name: "car 17", overlays: &made.overlays, provenance, regions: "cold is below 70 °C", ..Input::empty(&made.diagnosis) })
}

/// The body without the scripts.
fn body(html: &str) -> &str {
    &html[html.find("<body>").expect("a body")..html.find("<script").expect("a script")]
}

/// The text between tags, with entities left as they are.
fn visible(html: &str) -> String {
    body(html).split('<').map(|part| part.split_once('>').map_or("", |(_, text)| text)).collect::<Vec<_>>().join(" ")
}

#[test]
fn the_name_of_a_campaign_is_text_wherever_it_stands() {
    let made = campaign::campaign();
    let name = "</title><script>alert('x')</script> & \"co\"";
    let page = html(&Input {
        name,
        overlays: &made.overlays,
        provenance: &[(name.into(), name.into())],
        regions: name,
        ..Input::empty(&made.diagnosis)
    });
    assert!(!page.contains("<script>alert") && !page.contains("</title><script>"), "markup in a name is text");
    let head = &page[page.find("<title>").unwrap()..page.find("</title>").unwrap()];
    assert!(head.contains("&lt;/title&gt;&lt;script&gt;") && head.contains("&amp; &quot;co&quot;"), "{head}");
}

#[test]
fn what_is_irregular_stands_where_the_gap_lies() {
    let mut diagnosis = campaign::campaign().diagnosis;
    let said = |diagnosis: &Value| visible(&render(diagnosis, &[])).contains("What is irregular: ");
    assert!(!said(&diagnosis));
    diagnosis["where"]["irregular"] = json!(["the disc speed repeats <what> it showed", "10 N·m on the car's side"]);
    let text = visible(&render(&diagnosis, &[]));
    assert!(text.contains("What is irregular: the disc speed repeats &lt;what&gt; it showed; 10 N·m on the car&#39;s side."), "{text}");
}

#[test]
fn the_answers_of_a_campaign_are_all_there() {
    let made = campaign::campaign();
    let page = page_of(&made, &made.provenance);
    let text = visible(&page);
    for expected in [
        "Friction fade when hot",
        "explains the gap.",
        "Not settled. Next best: thermal change of the cushion stiffness, 0.52 nats behind",
        "≈",
        "which took no part in the fit, the model is off by",
        "car 17",
        "Cold is below 70 °C.",
        "may just as well lie in",
        "cannot tell",
        "Does what is left look like noise?",
        "Unexplained torque over slip",
        "Slip of car and model, after",
        "0.281 to 0.327",
        "Share of the friction that is lost when hot",
        "thermal change of the cushion stiffness",
        "slip at constant clutch torque on a hot disc",
        "held out",
        "Even a perfect model",
        "Dissipated energy, kJ",
        "a creep at 5 to 30 rad/s of slip, recorded at 1 kHz",
        "r11",
        "5a2c7e0d6b8f",
        "friction_fade. depth",
    ] {
        assert!(text.contains(expected), "{expected:?} is missing");
    }
    let order =
        ["where", "curves", "which", "how-far", "open", "computed"].map(|id| page.find(&format!("<section id=\"{id}\"")).expect(id));
    assert!(order.is_sorted(), "sections stand in the order of the questions");
    assert_eq!(page.matches("<th scope=\"row\"><code>").count(), 5, "five parameters differ from the vehicle file, friction.m_0 does not");
}

#[test]
fn a_usual_campaign_stays_below_two_and_a_half_megabytes() {
    let columns = ["omega_f_rad_s", "omega_c_rad_s", "T_fc_Nm", "x_to_mm", "theta_c_degC"];
    let noisy = |k: usize, j: usize| 150.0 * (0.01 * k as f64).sin() + ((k * 7919 + j * 104_729) % 1000) as f64 / 200.0;
    let channel = |j: usize, n: usize| OverlayChannel {
        column: columns[j],
        unit: "rad/s",
        real: (0..n).map(|k| noisy(k, j)).collect(),
        before: (0..n).map(|k| noisy(k + 3, j + 1)).collect(),
        after: (0..n).map(|k| noisy(k + 1, j + 2)).collect(),
    };
    let overlay = |r: usize, n: usize| Overlay {
        recording: format!("r{r:02}"),
        manoeuvre: "launch".to_owned(),
        held_out: false,
        dt: 0.01,
        theta: [25.0; 2],
        slip_angle: 0.0,
        channels: (0..5).map(|j| channel(j, n)).collect(),
    };
    let usual: Vec<Overlay> = (0..10).map(|r| overlay(r, 450)).collect();
    let long: Vec<Overlay> = (0..10).map(|r| overlay(r, 60_000)).collect();
    for (name, overlays) in [("10 × 450", usual), ("10 × 60000", long)] {
        let size = render(&json!({}), &overlays).len();
        assert!(size < 2_500_000, "{name} samples with five channels: {size} bytes");
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let pages = [0, 1].map(|_| {
        let made = campaign::campaign();
        page_of(&made, &made.provenance)
    });
    assert!(pages[0] == pages[1]);
}

/// Every text that a user can bring in is shown as text; none of it becomes markup, neither in the page nor in the script.
#[test]
fn no_text_becomes_markup() {
    const EVIL: &str = "</script><img src=x onerror=alert(1)>'\"&";
    fn poison(value: &mut Value) {
        match value {
            Value::String(text) => *text = EVIL.to_owned(),
            Value::Array(items) => items.iter_mut().for_each(poison),
            Value::Object(map) => {
                let poisoned: Vec<(String, Value)> = std::mem::take(map).into_iter().collect();
                for (key, mut item) in poisoned {
                    poison(&mut item);
                    map.insert(key, item);
                }
            }
            _ => {}
        }
    }
    let mut made = campaign::campaign();
    poison(&mut made.diagnosis);
    let depth = made.diagnosis["which"]["effects"][0]["parameters"]["depth"].clone();
    made.diagnosis["which"]["effects"][0]["parameters"][EVIL] = depth;
    made.diagnosis["plant"]["parameters"][EVIL] = json!(1.0);
    let kpi = made.diagnosis["how_far"]["kpi"]["r01"].clone();
    made.diagnosis["how_far"]["kpi"][EVIL] = kpi;
    made.overlays[0].recording = EVIL.to_owned();
    made.overlays[0].manoeuvre = EVIL.to_owned();
    let provenance = [(EVIL.to_owned(), EVIL.to_owned())];
    let page = page_of(&made, &provenance);
    assert!(page.contains("&lt;/script&gt;&lt;img"), "the text is shown");
    assert!(!page.contains("<img"), "the text is never markup");
    assert_eq!(page.matches("</script>").count(), 3, "both data and the script end where they should");
}

/// A section without data says so, and nothing panics, whatever is missing or of another type.
#[test]
fn what_is_missing_is_said() {
    let page = visible(&render(&json!({}), &[]));
    for said in [
        "The diagnosis holds no verdict",
        "Confidence: not stated",
        "The curves are missing",
        "The gap per equation, phase and region is missing",
        "The ranking of all candidates is missing",
        "The gap before and after is missing",
        "Which effects the data cannot show is not stated",
        "Versions, settings and the fingerprint of the data are missing",
    ] {
        assert!(page.contains(said), "{said:?} is missing");
    }
}

#[test]
fn any_part_may_be_missing_or_of_another_type() {
    fn paths(value: &Value, at: String, out: &mut Vec<String>) {
        let children: Vec<(String, &Value)> = match value {
            Value::Object(map) => map.iter().map(|(k, v)| (k.replace('~', "~0").replace('/', "~1"), v)).collect(),
            Value::Array(items) => items.iter().enumerate().take(1).map(|(k, v)| (k.to_string(), v)).collect(),
            _ => Vec::new(),
        };
        for (key, child) in children {
            let path = format!("{at}/{key}");
            paths(child, path.clone(), out);
            out.push(path);
        }
    }
    let made = campaign::campaign();
    let mut all = Vec::new();
    paths(&made.diagnosis, String::new(), &mut all);
    assert!(all.len() > 80, "the fixture reaches every part: {}", all.len());
    for path in all {
        for wrong in [Value::Null, json!("text"), json!(-1e300), json!([])] {
            let mut diagnosis = made.diagnosis.clone();
            *diagnosis.pointer_mut(&path).expect("a path of the fixture") = wrong;
            let page = render(&diagnosis, &[]);
            assert!(page.ends_with("</html>\n"), "{path}");
            let broken = ["NaN", "\"inf", ":inf", ":-", " inf"].into_iter().find(|bad| body(&page).contains(bad));
            assert_eq!(broken, None, "{path}");
        }
    }
}

#[test]
fn curves_may_be_empty_constant_or_broken() {
    let channel =
        |real: Vec<f64>| OverlayChannel { column: "T_fc_Nm", unit: "N·m", before: real.clone(), after: vec![0.0; real.len()], real };
    let bodies = [vec![], vec![1.0], vec![5.0; 40], vec![f64::NAN; 40], vec![1.0, f64::NAN, f64::INFINITY, 2.0], vec![-1e300, 1e300]];
    let overlays: Vec<Overlay> = bodies
        .into_iter()
        .map(|real| Overlay {
            recording: "r".to_owned(),
            manoeuvre: String::new(),
            held_out: true,
            dt: 0.01,
            theta: [25.0; 2],
            slip_angle: 0.0,
            channels: vec![channel(real)],
        })
        .chain([Overlay {
            recording: "none".to_owned(),
            manoeuvre: String::new(),
            held_out: true,
            dt: 0.01,
            theta: [25.0; 2],
            slip_angle: 0.0,
            channels: vec![],
        }])
        .collect();
    let page = render(&json!({}), &overlays);
    let page = body(&page);
    assert!(!page.contains("NaN") && !page.contains("inf "), "no coordinate is other than a number");
}

/// If nothing was retuned, there is one model, and no column, bar or curve repeats it.
#[test]
fn an_unexplained_gap_is_shown_once() {
    let mut made = campaign::campaign();
    made.diagnosis["verdict"] = json!("unexplained");
    made.diagnosis["where"]["unexplained_at"] = json!("friction");
    let points = vec![(0.0, 1.0), (1.0, 2.0)];
    let line = |identified| Line { identified, hot: false, points: points.clone() };
    let law = Law {
        title: "Friction".to_owned(),
        over: "slip, rad/s".to_owned(),
        unit: "",
        lines: vec![line(false), line(true)],
        cloud: points.clone(),
        note: String::new(),
        band: Vec::new(),
        learned: false,
    };
    let laws = [law];
    let page = |diagnosis: &Value| html(&Input { overlays: &made.overlays, laws: &laws, ..Input::empty(diagnosis) });
    let section = |page: &str, id: &str| {
        let from = page.find(&format!("<section id=\"{id}\"")).expect(id);
        page[from..from + page[from..].find("</section>").expect("an end")].to_owned()
    };
    let (once, mut retuned) = (page(&made.diagnosis), made.diagnosis.clone());
    retuned["verdict"] = json!("explained");
    for id in ["curves", "which", "how-far"] {
        for word in ["c-after", "d-after", ">After<", "identified"] {
            assert!(!section(&once, id).contains(word), "{id}: {word}");
        }
    }
    let twice = page(&retuned);
    assert!(section(&twice, "how-far").contains(">After<") && section(&twice, "which").contains("c-after"), "else the test proves nothing");
    assert!(visible(&once).contains("How large the gap is") && !visible(&once).contains("is gone"));
}

/// If a gap is explained in part, the ambiguity of the remainder's place does not cast doubt on the named effects.
#[test]
fn the_place_of_the_rest_is_told_apart_from_the_place_of_the_gap() {
    let mut made = campaign::campaign();
    made.diagnosis["verdict"] = json!("partly_explained");
    let place = &mut made.diagnosis["where"];
    place["primary"] = json!("actuator");
    place["unexplained_at"] = json!("engine");
    place["ambiguous_with"] = json!(["driveline"]);
    let page = render(&made.diagnosis, &made.overlays);
    assert!(page.contains("<dt>Where</dt><dd><strong>Actuator</strong>"), "the named effect lies in the actuator and nowhere else");
    assert!(visible(&page).contains("the rest: engine torque or driveline"));
    assert!(visible(&page).contains("The rest may just as well lie in"));
}

/// Withdrawn effects are mentioned with the verdict, which is then not settled, and numbers of the withdrawn fit are not shown as valid.
#[test]
fn effects_that_were_taken_back_stand_with_the_verdict() {
    let mut made = campaign::campaign();
    made.diagnosis["verdict"] = json!("unexplained");
    made.diagnosis["which"]["effects"] = json!([]);
    made.diagnosis["which"]["tolerances"] = json!({"b": -19.2});
    let before = visible(&render(&made.diagnosis, &made.overlays));
    assert!(before.contains("by 19 standard deviations") && !before.contains("Withdrawn"));
    made.diagnosis["which"]["taken_back"] = json!({"effects": ["vehicle_mass", "judder"], "before": 27.46, "after": 68.45});
    let page = visible(&render(&made.diagnosis, &made.overlays));
    assert!(page.contains("Withdrawn: ") && page.contains("vehicle mass") && page.contains("judder"));
    assert!(page.contains("68.5 rad/s with it, and by 27.5 rad/s as"));
    assert!(page.contains("Not settled.") && !page.contains("Next best") && !page.contains("by 19 standard deviations"));
}

/// A road load that counts as part of the law missing in the driveline is not named; the same law without it is not a different explanation.
#[test]
fn the_next_best_explanation_says_something_else() {
    let mut made = campaign::campaign();
    made.diagnosis["verdict"] = json!("unexplained");
    made.diagnosis["which"]["effects"] = json!([]);
    let explanation =
        |effects: Value, law: Value, behind: f64| json!({"effects": effects, "missing_law": law, "probability": 0.0, "behind": behind});
    let mut said = |effects: Value| {
        made.diagnosis["which"]["explanations"] = json!([
            explanation(effects, json!("driveline"), 0.0),
            explanation(json!([]), json!("driveline"), 51.6),
            explanation(json!(["road_load"]), Value::Null, 174.0),
        ]);
        visible(&render(&made.diagnosis, &made.overlays))
    };
    assert!(said(json!(["road_load"])).contains("Next best: road load, 174 nats behind"));
    assert!(said(json!(["road_load", "vehicle_mass"])).contains("Next best: road load, 174 nats behind"));
}

/// If an effect closes nothing of the held-out data, the headline says so when it names the effect.
#[test]
fn a_headline_tells_effects_that_close_nothing_of_what_was_held_out() {
    let mut made = campaign::campaign();
    let headline = |d: &serde_json::Value| kisspoint::report::verdict::headline(d);
    let only = "in the recordings used in the fit, but closes none of it on held-out data";
    made.diagnosis["which"]["effects"] = json!([{"id": "judder", "parameters": {}, "ambiguous_with": []}]);
    for (closed, said) in [(0.4, false), (0.0, true), (-0.6, true)] {
        made.diagnosis["how_far"]["closed_fraction"] = json!(closed);
        for (verdict, rest) in [("explained", "the gap"), ("partly_explained", "; the rest lies in")] {
            made.diagnosis["verdict"] = json!(verdict);
            let found = headline(&made.diagnosis);
            assert!(found.contains(only) == said && found.contains(" explains ") && found.contains(rest), "{closed}: {found}");
        }
    }
    made.diagnosis["how_far"]["held_out"] = json!([]);
    assert!(!headline(&made.diagnosis).contains(only), "nothing was held out");
}

/// An effect that is more likely absent is not said to explain the gap; one of two effects that share their probability is.
#[test]
fn a_headline_tells_an_explanation_that_is_likelier_not_to_hold() {
    let mut made = campaign::campaign();
    let explanation = |effects: Value, probability: f64| json!({"effects": effects, "missing_law": null, "probability": probability});
    made.diagnosis["verdict"] = json!("explained");
    made.diagnosis["confidence"] = json!(0.42);
    made.diagnosis["which"]["explanations"] =
        json!([explanation(json!(["judder", "road_load"]), 0.42), explanation(json!(["clutch_drag", "road_load"]), 0.38)]);
    let effect = |id: &str, probability: f64, rivals: Value| json!({"id": id, "probability": probability, "parameters": {}, "ambiguous_with": rivals});
    let mut headline = |rivals: Value| {
        made.diagnosis["which"]["effects"] = json!([effect("judder", 0.42, rivals), effect("road_load", 0.8, json!([]))]);
        kisspoint::report::verdict::headline(&made.diagnosis)
    };
    let tentative = headline(json!([]));
    assert!(
        tentative.starts_with("The most probable explanation of the gap, at 42\u{202f}%, is ") && !tentative.contains(" explain "),
        "{tentative}"
    );
    let shared = headline(json!(["clutch_drag"]));
    assert!(shared.contains(" or ") && shared.contains(" explain the gap"), "{shared}");
}

/// Numbers that the fit moved beyond the scale of the drawing are marked differently from those at its edge.
#[test]
fn a_number_beyond_the_scale_is_drawn_as_an_arrow() {
    let mut made = campaign::campaign();
    made.diagnosis["which"]["tolerances"] = json!({"a": -3.9, "b": -19.2, "c": 5.0});
    let page = render(&made.diagnosis, &made.overlays);
    let row = |name: &str| {
        page[page.find(&format!("<code>{name}</code></th><td class=\"num\">")).expect(name)..].split("</tr>").next().unwrap().to_owned()
    };
    assert!(row("a").contains("<circle") && row("b").contains("beyond") && row("c").contains("beyond"));
    assert!(visible(&page).contains("by 19, "), "the doubts name it");
}
