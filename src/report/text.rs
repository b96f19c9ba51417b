//! Text for readers: escaping, numbers, names.

use crate::gap::prose::listed;

/// `text` escaped for HTML content and quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            _ => out.push(c),
        }
    }
    out
}

/// A number with `digits` significant digits, a true minus sign and grouped thousands; a dash if it is not finite.
pub fn number(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..9).contains(&magnitude) {
        return format!("{value:.*e}", digits.max(1) as usize - 1).replace('-', "−");
    }
    fixed(value, (digits - 1 - magnitude).clamp(0, 9) as usize)
}

/// A number with up to `digits` significant digits and no trailing zeros.
pub fn plain(value: f64, digits: i32) -> String {
    let text = number(value, digits);
    let (digits, power) = text.split_once('e').map_or((text.as_str(), String::new()), |(digits, power)| (digits, format!("e{power}")));
    let bare = if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits };
    format!("{bare}{power}")
}

/// A number with `decimals` decimals, otherwise formatted as [`number`].
pub fn fixed(value: f64, decimals: usize) -> String {
    let plain = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = plain.split_once('.').map_or((plain.as_str(), ""), |(w, f)| (w, f));
    let mut out = String::new();
    if value < 0.0 && plain.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
        out.push('−');
    }
    for (k, digit) in whole.chars().enumerate() {
        if k > 0 && whole.len() > 4 && (whole.len() - k) % 3 == 0 {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    if !fraction.is_empty() {
        out.push('.');
        out.push_str(fraction);
    }
    out
}

/// Like [`fixed`], with an explicit plus sign.
pub fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if text.starts_with('−') || !text.bytes().any(|b| (b'1'..=b'9').contains(&b)) { text } else { format!("+{text}") }
}

/// A share in per cent, never rounded up to certainty.
pub fn percent(share: f64) -> String {
    let p = 100.0 * share;
    match p {
        _ if !p.is_finite() => "–".to_owned(),
        _ if p > 99.0 && p < 99.95 => format!("{}\u{202f}%", fixed((10.0 * p).floor() / 10.0, 1)),
        _ if (99.95..100.0).contains(&p) => "over\u{2009}99.9\u{202f}%".to_owned(),
        _ => format!("{}\u{202f}%", fixed(p, 0)),
    }
}

/// The probability of an explanation among those compared, in per cent; never 100 %.
pub fn probability(p: f64) -> String {
    percent(p.min(0.9999))
}

/// An id as a title: `kiss_point_offset` becomes "Kiss point offset".
pub fn title(id: &str) -> String {
    capitalised(&words(id))
}

/// Capitalises a text unless it begins with the name of a channel or a recording, which must not be changed.
pub fn capitalised(text: &str) -> String {
    let first = text.split_whitespace().next().unwrap_or("");
    if first.contains('_') || first.contains(|c: char| c.is_ascii_digit()) {
        return text.to_owned();
    }
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + chars.as_str())
}

/// An id as words within a sentence.
pub fn words(id: &str) -> String {
    id.replace('_', " ")
}

/// Items as a list joined by commas and "and".
pub fn enumeration(items: &[String]) -> String {
    listed(items, " and ")
}

/// Items as a list joined by commas and "or".
pub fn alternatives(items: &[String]) -> String {
    listed(items, " or ")
}

pub use crate::vehicle::written as unit;

/// A meaning from the model description, which is in ASCII, with symbols restored.
pub fn meaning(raw: &str) -> String {
    raw.replace("degC", "°C").replace("2 pi", "2π")
}

/// Estimate and interval with as many decimals as the interval justifies, and with a power of ten if they are tiny.
pub fn estimate([value, low, high]: [f64; 3]) -> (String, String) {
    let largest = value.abs().max(low.abs()).max(high.abs());
    let power = if largest < 1e-3 { largest.log10().floor() as i32 } else { 0 };
    let scale = 10f64.powi(-power);
    // The estimate has two digits of the interval's width.
    let places = (1 - ((high - low) * scale).log10().floor() as i32).clamp(0, 9) as usize;
    let [value, low, high] = [value, low, high].map(|v| fixed(v * scale, places));
    if power == 0 {
        return (value, format!("{low} to {high}"));
    }
    let tail = format!("·10{}", superscript(power));
    // An estimate of zero gets no power of ten.
    let is_nothing = value.chars().all(|c| matches!(c, '0' | '.'));
    (if is_nothing { value } else { format!("{value}{tail}") }, format!("({low} to {high}){tail}"))
}

fn superscript(power: i32) -> String {
    let digit = |c: char| c.to_digit(10).map_or('⁻', |d| ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][d as usize]);
    power.to_string().chars().map(digit).collect()
}

/// Plain name of a recording's column.
pub fn channel(column: &str) -> String {
    match column {
        "omega_f_rad_s" => "Flywheel speed",
        "omega_c_rad_s" => "Disc speed",
        "T_e_Nm" => "Engine torque reported",
        "x_to_cmd_mm" => "Bearing position commanded",
        "x_to_mm" => "Bearing position",
        "T_fc_Nm" => "Clutch torque",
        "theta_c_degC" => "Disc temperature",
        "theta_h_degC" => "Housing air",
        other => return title(other),
    }
    .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_is_escaped() {
        assert_eq!(escape("<b a='1' c=\"2\">&</b>"), "&lt;b a=&#39;1&#39; c=&quot;2&quot;&gt;&amp;&lt;/b&gt;");
    }

    #[test]
    fn names_of_channels_and_recordings_stay_as_they_are() {
        let of = ["the driver", "x_to_cmd_mm is not recorded", "r01 from 60 s", "10 of 12", ""].map(capitalised);
        assert_eq!(of, ["The driver", "x_to_cmd_mm is not recorded", "r01 from 60 s", "10 of 12", ""]);
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(number(0.031_416, 3), "0.0314");
        assert_eq!(number(-12.345, 3), "−12.3");
        assert_eq!(number(123_456.7, 4), "123\u{202f}457");
        assert_eq!(number(1.5e-6, 2), "1.5e−6");
        assert_eq!(number(f64::NAN, 3), "–");
        assert_eq!([-7.06e-6, 28.5, 120.0].map(|v| plain(v, 4)), ["−7.06e−6", "28.5", "120"]);
        assert_eq!(fixed(-0.001, 2), "0.00", "no negative zero");
        assert_eq!(signed(0.5, 1), "+0.5");
        assert_eq!(signed(0.0, 1), "0.0");
    }

    #[test]
    fn an_estimate_is_no_more_precise_than_its_interval() {
        let read = |all| {
            let (value, interval) = estimate(all);
            format!("{value}, {interval}")
        };
        assert_eq!(read([0.002_085_6, 0.002_062, 0.002_109]), "0.002086, 0.002062 to 0.002109");
        assert_eq!(read([7.85e-8, -7.2e-8, 2.29e-7]), "0.8·10⁻⁷, (−0.7 to 2.3)·10⁻⁷");
        assert_eq!(read([1e-9, -5.2e-6, 5.2e-6]), "0, (−5 to 5)·10⁻⁶");
        assert_eq!(read([119.2, 114.0, 124.0]), "119, 114 to 124");
    }

    #[test]
    fn percent_never_rounds_up_to_certainty() {
        assert_eq!(percent(0.9994), "99.9\u{202f}%");
        assert_eq!(percent(0.99999), "over\u{2009}99.9\u{202f}%");
        assert_eq!(percent(1.0), "100\u{202f}%");
        assert_eq!(percent(0.874), "87\u{202f}%");
    }
}
