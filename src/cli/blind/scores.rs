//! Scores over all outcomes, each with its count and its 95 % interval.
//!
//! A share p̂ = x/n has Wilson's interval (p̂ + z²/2n ± z √(p̂(1 − p̂)/n + z²/4n²)) / (1 + z²/n), z = 1.96; an effect that is named as one of a group of m counts 1/m. The
//! interval of a quantile q is given by the order statistics at n q ± z √(n q (1 − q)).

use super::closed::Closed;
use super::examine::{Named, Outcome};
use realcar::altered::{ALTERATIONS, Alteration};
use serde_json::{Value, json};

/// Two-sided 95 % quantile of the normal distribution.
const Z: f64 = 1.96;

/// One score.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Name of the score.
    pub name: String,
    /// Value; `None` if there is no outcome that it concerns.
    pub value: Option<f64>,
    /// For a share: number of hits, where partial hits count as fractions.
    pub hits: Option<f64>,
    /// 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// Number of outcomes that it concerns.
    pub count: usize,
    /// Whether it is printed in per cent.
    pub is_share: bool,
}

/// Name of the table rows of an alteration.
pub fn row_name(alteration: Alteration) -> &'static str {
    ALTERATIONS.iter().find(|a| a.0 == alteration).map_or("", |a| a.1)
}

/// Wilson's interval of `hits` in `count`.
pub fn wilson(hits: f64, count: usize) -> [f64; 2] {
    let n = count as f64;
    let p = hits / n;
    let middle = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [-1.0, 1.0].map(|side| ((middle + side * half) / (1.0 + Z * Z / n)).clamp(0.0, 1.0))
}

/// Share of the outcomes for which `hit` holds; a partial hit counts as a fraction.
fn share<'a>(name: impl Into<String>, outcomes: impl Iterator<Item = &'a Outcome>, hit: impl Fn(&Outcome) -> f64) -> Score {
    let hits: Vec<f64> = outcomes.map(hit).collect();
    let (count, sum) = (hits.len(), hits.iter().sum::<f64>());
    let some = count > 0;
    let value = some.then(|| sum / count as f64);
    Score { name: name.into(), value, hits: Some(sum), interval: some.then(|| wilson(sum, count)), count, is_share: true }
}

fn quantile(name: impl Into<String>, sorted: &[f64], q: f64) -> Score {
    let n = sorted.len() as f64;
    let at = |place: f64| sorted[(place.round().max(0.0) as usize).min(sorted.len() - 1)];
    let spread = Z * (n * q * (1.0 - q)).sqrt();
    let some = !sorted.is_empty();
    Score {
        name: name.into(),
        value: some.then(|| at((n - 1.0) * q)),
        hits: None,
        interval: some.then(|| [at((n - 1.0) * q - spread), at((n - 1.0) * q + spread)]),
        count: sorted.len(),
        is_share: true,
    }
}

fn yes(condition: bool) -> f64 {
    f64::from(u8::from(condition))
}

/// Whether a named effect refers to this effect, by itself or as a member of its group.
fn means(named: &Named, id: &str) -> bool {
    named.id == id || named.group.iter().any(|g| g == id)
}

/// Share of the true effects that are named; one named within a group counts 1/(size of the group).
fn credit(o: &Outcome) -> f64 {
    let of = |id| o.named.iter().find(|n| means(n, id)).map_or(0.0, |n| 1.0 / (1 + n.group.len()) as f64);
    o.true_ids().map(of).sum::<f64>() / o.truth.effects.len() as f64
}

/// Number of effects named beyond the true ones.
fn extra(o: &Outcome) -> usize {
    o.named.iter().filter(|n| !o.true_ids().any(|id| means(n, id))).count()
}

fn flagged(o: &Outcome) -> f64 {
    yes(!matches!(o.verdict.as_str(), "no_gap" | ""))
}

/// All scores.
pub fn table(outcomes: &[Outcome]) -> Vec<Score> {
    let mut table = if outcomes.iter().any(|o| o.alteration.is_some()) { altered(outcomes) } else { drawn(outcomes) };
    let failed = outcomes.iter().filter(|o| o.error.is_some()).count();
    if failed > 0 {
        table.push(share("not diagnosed at all", outcomes.iter(), |o| yes(o.error.is_some())));
    }
    table
}

/// Up to three rows for each alteration, and two for all together.
fn altered(outcomes: &[Outcome]) -> Vec<Score> {
    let first = |o: &Outcome| yes(o.named.first().is_some_and(|n| o.true_ids().any(|id| id == n.id)));
    let among = |o: &Outcome| yes(o.named.first().is_some_and(|n| o.true_ids().any(|id| means(n, id))));
    let mut table = Vec::new();
    for (alteration, name) in ALTERATIONS {
        let those =
            |healthy: bool| outcomes.iter().filter(move |o| o.alteration == Some(alteration) && o.truth.effects.is_empty() == healthy);
        if alteration == Alteration::SmallEffect {
            table.push(share(format!("{name}: flagged"), those(false), flagged));
        } else {
            table.push(share(format!("{name}: healthy flagged"), those(true), flagged));
        }
        table.push(share(format!("{name}: right effect first"), those(false), first));
        if alteration == Alteration::UnknownTemperatures {
            table.push(share(format!("{name}: right effect in the first group"), those(false), among));
        }
    }
    table.retain(|s| s.count > 0);
    let all = |healthy: bool| {
        outcomes.iter().filter(move |o| o.truth.effects.is_empty() == healthy && o.alteration != Some(Alteration::SmallEffect))
    };
    table.push(share("all but the small: healthy flagged", all(true), flagged));
    table.push(share("all but the small: right effect first", all(false), first));
    table
}

fn drawn(outcomes: &[Outcome]) -> Vec<Score> {
    let of_size = |n: usize| outcomes.iter().filter(|o| o.known()).filter(move |o| o.truth.effects.len() == n);
    let faulty = || outcomes.iter().filter(|o| !o.truth.effects.is_empty());
    let outside = |new: bool| outcomes.iter().filter(move |o| !o.known() && o.truth.effects.iter().any(|e| e.is_new) == new);
    let placed = |o: &Outcome| o.is_at(o.unexplained_at.as_deref()) || o.is_at(o.primary.as_deref());
    let left_open = |o: &Outcome| o.doubted.iter().any(|s| o.is_at(Some(s)));
    let unknown = |o: &Outcome| yes(matches!(o.verdict.as_str(), "unexplained" | "partly_explained"));
    let fraction = |o: &Outcome| o.closed.and_then(|c| c.fraction());
    let mut table = vec![
        share("healthy cars flagged", of_size(0), flagged),
        share("gaps detected", faulty(), flagged),
        share("located", faulty(), |o| yes(o.is_at(o.primary.as_deref()))),
        share("single effects attributed", of_size(1), credit),
        share("pairs attributed", of_size(2), credit),
        share("pairs complete, nothing extra", of_size(2), |o| yes(credit(o) > 0.999 && extra(o) == 0)),
        share("triples attributed", of_size(3), credit),
        share("triples complete, nothing extra", of_size(3), |o| yes(credit(o) > 0.999 && extra(o) == 0)),
    ];
    for (new, mark) in [(false, "outside"), (true, "outside (new)")] {
        table.push(share(format!("{mark}: flagged"), outside(new), unknown));
        table.push(share(format!("{mark}: located"), outside(new), |o| yes(placed(o))));
        table.push(share(format!("{mark}: located or left open"), outside(new), |o| yes(placed(o) || left_open(o))));
        let measurable = || outside(new).filter(|o| fraction(o).is_some());
        table.push(share(format!("{mark}: 80 % of the gap closed"), measurable(), |o| yes(fraction(o) >= Some(0.8))));
        table.push(share(format!("{mark}: made worse"), measurable(), |o| yes(fraction(o) < Some(0.0))));
    }
    table.retain(|s| s.count > 0);
    let count = outcomes.len();
    let mean = outcomes.iter().map(extra).sum::<usize>() as f64 / count as f64;
    let variance = outcomes.iter().map(|o| (extra(o) as f64 - mean).powi(2)).sum::<f64>() / count as f64;
    let half = Z * (variance / count as f64).sqrt();
    table.push(Score {
        name: "extra effects per car".into(),
        value: Some(mean),
        hits: None,
        interval: Some([(mean - half).max(0.0), mean + half]),
        count,
        is_share: false,
    });
    let counts: [(&str, fn(&Closed) -> Option<f64>); 2] =
        [("gap closed on unseen recordings", Closed::fraction), ("gap closed above what the true car leaves", Closed::of_true_car)];
    for (name, fraction) in counts {
        let mut closed: Vec<f64> = faulty().filter(|o| o.known()).filter_map(|o| fraction(o.closed.as_ref()?)).collect();
        closed.sort_by(f64::total_cmp);
        table.push(quantile(format!("{name}, median"), &closed, 0.5));
        table.push(quantile(format!("{name}, tenth percentile"), &closed, 0.1));
    }
    table
}

/// The scores by name.
pub fn as_json(table: &[Score]) -> Value {
    let row = |s: &Score| (s.name.clone(), json!({"value": s.value, "interval": s.interval, "count": s.count}));
    Value::Object(table.iter().map(row).collect())
}

/// The scores as text.
pub fn as_text(table: &[Score]) -> String {
    let number = |s: &Score, v: f64| if s.is_share { format!("{:.1} %", 100.0 * v) } else { format!("{v:.2}") };
    let row = |s: &Score| {
        let value = s.value.map_or("-".into(), |v| number(s, v));
        let interval = s.interval.map_or(String::new(), |[low, high]| format!("{} to {}", number(s, low), number(s, high)));
        // Rounded to two decimals, since an effect named in a group counts as a fraction; whole counts are printed without decimals.
        let of = match s.hits {
            Some(hits) => format!("{} of {}", (100.0 * hits).round() / 100.0, s.count),
            None => format!("{} car{}", s.count, if s.count == 1 { "" } else { "s" }),
        };
        format!("  {:<50} {of:>13}  {value:>8}  {interval}\n", s.name)
    };
    let head = format!("  {:<50} {:>13}  {:>8}  {}\n", "", "count", "value", "95 % interval");
    head + &table.iter().map(row).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wilson's intervals of 0, 7 and 10 in 10, from published tables.
    #[test]
    fn intervals_are_wilson_s() {
        for (hits, low, high) in [(0.0, 0.0, 0.2775), (7.0, 0.3968, 0.8922), (10.0, 0.7225, 1.0)] {
            let got = wilson(hits, 10);
            assert!((got[0] - low).abs() < 2e-4 && (got[1] - high).abs() < 2e-4, "{hits}: {got:?}");
        }
    }

    #[test]
    fn a_quantile_lies_within_its_interval() {
        let sorted: Vec<f64> = (0..=100).map(f64::from).collect();
        let s = quantile("", &sorted, 0.1);
        let [low, high] = s.interval.unwrap();
        assert_eq!(s.value, Some(10.0));
        assert!(low < 10.0 && high > 10.0 && low > 0.0 && high < 20.0);
        assert_eq!(quantile("", &[], 0.5).value, None);
    }
}
