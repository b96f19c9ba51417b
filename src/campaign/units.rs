//! Unit strings and how they convert to the units of a recording.
//!
//! value in our unit = factor · value + offset
//!
//! | quantity | our unit | also read |
//! |---|---|---|
//! | time | s | min, ms, µs, ns |
//! | speed | rad/s | rpm, Hz, rev/s, deg/s |
//! | torque | N·m | kN·m, mN·m, daN·m, N·mm, lbf·ft |
//! | length | mm | m, cm, µm, in |
//! | temperature | °C | K, °F |
//! | flag | 1 | bool |
//! | road speed | m/s | km/h, mph |
//! | acceleration | m/s² | g_n |
//! | percentage | % | |
//!
//! A bare `1/s` is refused on purpose: some tools mean rad/s by it and some mean revolutions.

use std::f64::consts::PI;

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// s
    Time,
    /// rad/s
    Speed,
    /// N·m
    Torque,
    /// mm
    Length,
    /// °C
    Temperature,
    /// 0 or 1
    Flag,
    /// m/s
    Velocity,
    /// m/s²
    Acceleration,
    /// %
    Share,
}

impl Quantity {
    /// Our unit for the quantity.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Speed => "rad/s",
            Self::Torque => "N·m",
            Self::Length => "mm",
            Self::Temperature => "°C",
            Self::Flag => "1",
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s²",
            Self::Share => "%",
        }
    }
}

/// A unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// What it measures.
    pub quantity: Quantity,
    /// Factor to our unit.
    pub factor: f64,
    /// Offset to our unit, added after the factor.
    pub offset: f64,
}

/// Reads a unit string; `None` if it is not one that a recording's channel can have.
pub fn parse(text: &str) -> Option<Unit> {
    let key = normalise(text);
    let unit = |quantity, factor, offset| Some(Unit { quantity, factor, offset });
    match key.as_str() {
        "s" | "sec" | "second" | "seconds" => unit(Quantity::Time, 1.0, 0.0),
        "min" | "minute" | "minutes" => unit(Quantity::Time, 60.0, 0.0),
        "ms" | "msec" | "millisecond" | "milliseconds" => unit(Quantity::Time, 1e-3, 0.0),
        "us" | "usec" | "microsecond" | "microseconds" => unit(Quantity::Time, 1e-6, 0.0),
        "ns" | "nsec" | "nanosecond" | "nanoseconds" => unit(Quantity::Time, 1e-9, 0.0),
        "rad/s" | "rad/sec" | "rads^-1" | "rads-1" | "radps" | "rad_s" => unit(Quantity::Speed, 1.0, 0.0),
        "rpm" | "1/min" | "u/min" | "rev/min" | "r/min" | "tr/min" | "min^-1" | "min-1" | "/min" => unit(Quantity::Speed, PI / 30.0, 0.0),
        "hz" | "rev/s" | "rps" | "u/s" => unit(Quantity::Speed, 2.0 * PI, 0.0),
        "deg/s" | "°/s" | "degree/s" => unit(Quantity::Speed, PI / 180.0, 0.0),
        "nm" | "newtonmeter" | "newton-meter" => unit(Quantity::Torque, 1.0, 0.0),
        "knm" => unit(Quantity::Torque, 1e3, 0.0),
        "danm" => unit(Quantity::Torque, 10.0, 0.0),
        "mnm" | "nmm" => unit(Quantity::Torque, 1e-3, 0.0),
        "lbft" | "lbfft" | "ftlb" | "ftlbf" | "lb-ft" | "lbf-ft" | "ft-lb" | "ft-lbs" | "ftlbs" | "lbsft" => {
            unit(Quantity::Torque, 1.355_817_948_331_4, 0.0)
        }
        "mm" | "millimeter" | "millimetre" => unit(Quantity::Length, 1.0, 0.0),
        "m" | "meter" | "metre" => unit(Quantity::Length, 1e3, 0.0),
        "cm" => unit(Quantity::Length, 10.0, 0.0),
        "um" | "micron" | "micrometer" => unit(Quantity::Length, 1e-3, 0.0),
        "in" | "inch" => unit(Quantity::Length, 25.4, 0.0),
        "°c" | "degc" | "c" | "celsius" | "deg_c" | "grdc" => unit(Quantity::Temperature, 1.0, 0.0),
        "k" | "kelvin" | "degk" => unit(Quantity::Temperature, 1.0, -273.15),
        "°f" | "degf" | "f" | "fahrenheit" | "deg_f" => unit(Quantity::Temperature, 5.0 / 9.0, -160.0 / 9.0),
        "m/s" | "mps" | "ms^-1" | "meters/second" | "metres/second" => unit(Quantity::Velocity, 1.0, 0.0),
        "km/h" | "kmh" | "kph" | "kmph" | "km/hr" => unit(Quantity::Velocity, 1.0 / 3.6, 0.0),
        "mph" | "mi/h" | "miles/h" | "miles/hour" => unit(Quantity::Velocity, 0.447_04, 0.0),
        "m/s²" | "m/s^2" | "m/s2" | "mps2" => unit(Quantity::Acceleration, 1.0, 0.0),
        "g_n" => unit(Quantity::Acceleration, 9.806_65, 0.0),
        "%" | "pct" | "percent" => unit(Quantity::Share, 1.0, 0.0),
        "1" | "-" | "bool" | "boolean" => unit(Quantity::Flag, 1.0, 0.0),
        _ => None,
    }
}

/// Examples of unit strings for one quantity, for messages.
pub fn examples(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "s, ms, us, min",
        Quantity::Speed => "rad/s, rpm, Hz, deg/s",
        Quantity::Torque => "N·m, kN·m, N·mm, lbf·ft",
        Quantity::Length => "mm, m, cm, um, in",
        Quantity::Temperature => "°C, K, °F",
        Quantity::Flag => "1, bool",
        Quantity::Velocity => "m/s, km/h, mph",
        Quantity::Acceleration => "m/s²",
        Quantity::Share => "%",
    }
}

/// Name of the quantity in messages.
pub fn quantity_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "a time",
        Quantity::Speed => "a rotational speed",
        Quantity::Torque => "a torque",
        Quantity::Length => "a length",
        Quantity::Temperature => "a temperature",
        Quantity::Flag => "a flag",
        Quantity::Velocity => "a road speed",
        Quantity::Acceleration => "an acceleration",
        Quantity::Share => "a percentage",
    }
}

/// Splits a header such as `omega_f [rpm]` or `n_eng (1/min)` into name and unit.
///
/// Round brackets count only if they hold a unit, because a name may contain others.
pub fn split_header(header: &str) -> (String, Option<String>) {
    let text = header.trim();
    let inside = |open: char, close: char| {
        let body = text.strip_suffix(close)?;
        let at = body.rfind(open)?;
        Some((body[..at].trim().to_string(), body[at + open.len_utf8()..].trim().to_string()))
    };
    if let Some((name, unit)) = inside('[', ']').filter(|(name, _)| !name.is_empty()) {
        return (name, (!unit.is_empty() && unit != "-").then_some(unit));
    }
    if let Some((name, unit)) = inside('(', ')').filter(|(name, unit)| !name.is_empty() && parse(unit).is_some()) {
        return (name, Some(unit));
    }
    (text.to_string(), None)
}

/// Lower case without blanks and multiplication dots; both micro signs become `u`, all degree signs `°`.
fn normalise(text: &str) -> String {
    text.trim()
        .trim_matches(|c| c == '[' || c == ']')
        .chars()
        .filter(|c| !c.is_whitespace() && !matches!(c, '·' | '*' | '.' | '⋅'))
        .map(|c| match c {
            'µ' | 'μ' => 'u',
            'º' | '˚' => '°',
            other => other,
        })
        .flat_map(char::to_lowercase)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_pairs_convert() {
        let cases = [
            ("rpm", 3000.0, 314.159_265_358_979),
            ("1/min", 60.0, 2.0 * PI),
            ("Hz", 10.0, 62.831_853_071_795_86),
            ("kN·m", 0.16, 160.0),
            ("N*mm", 160_000.0, 160.0),
            ("m", 0.005, 5.0),
            ("µm", 5000.0, 5.0),
            ("K", 300.0, 26.85),
            ("°F", 212.0, 100.0),
            ("ms", 1500.0, 1.5),
        ];
        for (text, value, ours) in cases {
            let unit = parse(text).unwrap_or_else(|| panic!("{text} is not read"));
            let got = value * unit.factor + unit.offset;
            assert!((got - ours).abs() < 1e-9 * ours.abs().max(1.0), "{value} {text} gave {got}, not {ours}");
        }
    }

    #[test]
    fn a_bare_per_second_is_no_unit() {
        assert_eq!(parse("1/s"), None);
        assert_eq!(parse("V"), None);
    }

    #[test]
    fn headers_split() {
        assert_eq!(split_header("omega_f [rpm]"), ("omega_f".into(), Some("rpm".into())));
        assert_eq!(split_header(" n_eng (1/min) "), ("n_eng".into(), Some("1/min".into())));
        assert_eq!(split_header("speed (front)"), ("speed (front)".into(), None));
        assert_eq!(split_header("T_e_Nm"), ("T_e_Nm".into(), None));
        assert_eq!(split_header("gear [-]"), ("gear".into(), None));
        assert_eq!(split_header("[rpm]"), ("[rpm]".into(), None));
    }
}
