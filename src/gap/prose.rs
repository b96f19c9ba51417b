//! Lists and figures in sentences.

/// Joins items with commas, and the last two with `last`, e.g. " and ".
pub fn listed(items: &[impl AsRef<str>], last: &str) -> String {
    let items: Vec<&str> = items.iter().map(AsRef::as_ref).collect();
    match &items[..] {
        [head @ .., end] if !head.is_empty() => format!("{}{last}{end}", head.join(", ")),
        _ => items.concat(),
    }
}

/// A value with three significant digits, as in the headline of the report.
pub fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let rounded: f64 = format!("{value:.2e}").parse().expect("a number that was just written");
    let magnitude = rounded.abs().max(1e-6).log10().floor() as i32;
    format!("{value:.*}", (2 - magnitude).clamp(0, 9) as usize)
}

/// A share in percent, rounded down, so that "100 %" is printed only for a gap that is closed, and not for one that nearly is.
pub fn percent(share: f64) -> String {
    if share >= 1.0 { "100 %".to_owned() } else { format!("{:.1} %", (1000.0 * share).floor() / 10.0).replace('-', "−") }
}

/// A probability in percent, which is never printed as 100 %.
pub fn chance(p: f64) -> String {
    match 100.0 * p {
        p if p >= 99.95 => "over 99.9 %".to_owned(),
        p if p > 99.0 => format!("{:.1} %", (10.0 * p).floor() / 10.0),
        p => format!("{p:.0} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_two_are_joined_by_a_word() {
        let none: [&str; 0] = [];
        assert_eq!([listed(&none, " and "), listed(&["a"], " and ")], ["", "a"]);
        assert_eq!([listed(&["a", "b"], " or "), listed(&["a", "b", "c"], ", and ")], ["a or b", "a, b, and c"]);
    }

    #[test]
    fn figures_are_said_as_one_reads_them() {
        assert_eq!([chance(1.0), chance(0.9994), chance(0.98), chance(0.5)], ["over 99.9 %", "99.9 %", "98 %", "50 %"]);
        assert_eq!(
            [percent(1.0), percent(1.2), percent(0.9999), percent(0.123_49), percent(-0.05)],
            ["100 %", "100 %", "99.9 %", "12.3 %", "−5.0 %"]
        );
        assert_eq!(
            [
                three_digits(12.345),
                three_digits(0.012_345),
                three_digits(1234.5),
                three_digits(9.999),
                three_digits(-99.96),
                three_digits(0.0)
            ],
            ["12.3", "0.0123", "1234", "10.0", "-100", "0"]
        );
    }
}
