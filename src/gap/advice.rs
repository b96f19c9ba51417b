//! Texts of the answer on what to measure: the manoeuvre that distinguishes rival explanations, the one that shows an effect, and all manoeuvres by their worth.

use super::answer::{MeasureNext, Planned, Real, RivalSet};
use super::map::HOT_DEGC;
use super::plan::manoeuvre::Manoeuvre;
use super::plan::reach::{Reach, TOO_LARGE};
use super::plan::split::Rival;
use super::plan::{Outlook, Worth};
use super::prose::chance;
use super::verdict::NAMED_BESIDE;
use crate::effects::{PARAMETERS, REGISTRY};
use crate::vehicle::written;

/// A manoeuvre in words: what is driven, its name, whether the clutch is hot, and its length.
fn said(m: &Manoeuvre) -> String {
    let warm = if m.theta_c > HOT_DEGC { ", hot" } else { "" };
    format!("{} ({}{warm}, {:.0} s)", m.kind.words(), m.name, m.seconds)
}

/// Nats, rounded to the precision that planning needs.
fn nats(x: f64) -> String {
    if x >= 9.95 { format!("{x:.0}") } else { format!("{x:.1}") }
}

/// Text on the manoeuvre that best distinguishes an effect from those that may be present instead.
pub fn separated_by(outlook: &Outlook, effect: usize) -> String {
    let ranked = outlook.ranked(&outlook.in_place_of(effect));
    let Some(best) = ranked.first() else {
        return "no manoeuvre was rehearsed, for what stands in its place has no formula".to_owned();
    };
    told_apart(best, &outlook.manoeuvres[best.manoeuvre])
}

/// Text on how well a manoeuvre distinguishes rivals. The best one may still be unlikely to.
fn told_apart(best: &Worth, m: &Manoeuvre) -> String {
    let (what, nats, minutes, per_minute) = (said(m), nats(best.nats), m.minutes(), nats(best.nats_per_minute));
    let expected = format!("{nats} nats expected in {minutes:.1} minutes, preparation included ({per_minute} per minute)");
    if best.splits < NAMED_BESIDE {
        return format!(
            "none of the manoeuvres that were rehearsed is likely to, driven once; the most per minute comes from {what}: {expected}"
        );
    }
    format!("{what}: {expected}; it tells them apart with a probability of {}", chance(best.splits))
}

/// Text on the manoeuvre that best shows an effect which the recordings cannot show.
pub fn shown_by(outlook: &Outlook, effect: usize) -> String {
    let entry = &REGISTRY[effect];
    let best = outlook.reach.as_ref().and_then(|r| Some((r, r.best_for(effect, &outlook.manoeuvres)?)));
    let Some((reach, k)) = best else { return entry.effect.shown_by.to_owned() };
    let Some(limit) = Reach::of(&reach.with[k], effect) else { return entry.effect.shown_by.to_owned() };
    let p = &PARAMETERS[limit.parameter];
    let from =
        format!("{:.2} of a usual one on ({} by {:.2e} {})", limit.in_sizes(), p.name, limit.size, written(p.unit)).replace(" )", ")");
    let what = said(&outlook.manoeuvres[k]);
    if limit.in_sizes() <= TOO_LARGE {
        format!("{what}: shows it from {from}")
    } else {
        format!("{}; of what can be driven, {what} shows most, but only from {from}", entry.effect.shown_by)
    }
}

/// The `measure_next` of the answer: the rival explanations and the ranked manoeuvres; none if nothing is open.
pub fn measure_next(outlook: &Outlook) -> Option<MeasureNext> {
    let ranked = outlook.ranked_for_all();
    let planned = |w: &Worth| {
        let m = &outlook.manoeuvres[w.manoeuvre];
        Planned {
            name: m.name.clone(),
            drive: m.kind.words(),
            torque_nm: Real(m.torque_nm),
            theta_c: Real(m.theta_c),
            seconds: Real(m.seconds),
            prepare_s: Real(m.prepare_s),
            nats: Real(w.nats),
            nats_per_minute: Real(w.nats_per_minute),
            splits: Real(w.splits),
        }
    };
    let rival = |r: &Rival| RivalSet { effects: r.effects.iter().map(|&e| REGISTRY[e].id).collect(), probability: Real(r.probability) };
    (!ranked.is_empty())
        .then(|| MeasureNext { rivals: outlook.rivals.iter().map(rival).collect(), manoeuvres: ranked.iter().map(planned).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::plan::manoeuvre::built_in;
    use crate::vehicle::Vehicle;

    #[test]
    fn a_manoeuvre_with_a_hot_clutch_is_said_to_be_hot() {
        let all = built_in(&Vehicle::paper());
        let words = |name: &str| said(all.iter().find(|m| m.name == name).unwrap());
        let [cold, hot] = ["launch", "launch_hot"].map(words);
        assert!(cold.ends_with(" (launch, 4 s)") && hot.ends_with(" (launch_hot, hot, 4 s)"), "{cold}, {hot}");
    }

    #[test]
    fn a_manoeuvre_that_hardly_distinguishes_is_not_recommended_as_if_it_did() {
        let all = built_in(&Vehicle::paper());
        let launch = all.iter().find(|m| m.name == "launch").unwrap();
        let worth = |splits: f64| Worth { manoeuvre: 0, nats: 0.5, nats_per_minute: 0.9, splits };
        let [unlikely, likely] = [0.04, 0.6].map(|splits| told_apart(&worth(splits), launch));
        assert!(unlikely.starts_with("none of the manoeuvres") && unlikely.contains("0.5 nats expected"), "{unlikely}");
        assert!(likely.starts_with("a launch") && likely.ends_with("it tells them apart with a probability of 60 %"), "{likely}");
    }

    #[test]
    fn nats_are_said_as_one_reads_them() {
        assert_eq!([nats(9.94), nats(9.96), nats(0.0)], ["9.9", "10", "0.0"]);
    }
}
