//! Limits of detection of effects: of a campaign, of planned manoeuvres, and of both together.

use super::Planner;
use super::manoeuvre::Manoeuvre;
use crate::effects::{Act, REGISTRY};
use crate::gap::infer::density::{Point, Problem};
use crate::gap::infer::information::Information;
use crate::gap::infer::screen::{self, Anchor, Limit, Screening, screen_for_limits};
use rayon::prelude::*;

/// Limits of detection of a campaign now, and with further manoeuvres.
#[derive(Clone, Debug)]
pub struct Reach {
    /// Limits of what was recorded; infinite if nothing was.
    pub now: Vec<Limit>,
    /// Limits with each manoeuvre added, in the planner's order.
    pub with: Vec<Vec<Limit>>,
    /// Limits with all manoeuvres added, each once.
    pub with_all: Vec<Limit>,
}

/// Limit in units of an effect's usual size above which recordings cannot show the effect.
pub const TOO_LARGE: f64 = 3.0;

impl Reach {
    /// The limit of an effect in a list.
    pub fn of(limits: &[Limit], effect: usize) -> Option<&Limit> {
        limits.iter().find(|l| l.effect == effect)
    }

    /// Whether recordings with these limits cannot show an effect.
    pub fn hides(limits: &[Limit], effect: usize) -> bool {
        Self::of(limits, effect).is_some_and(|l| l.in_sizes() > TOO_LARGE)
    }

    /// Index of the manoeuvre that adds the most information on an effect per minute, among those that make it visible, or among all if none does. `None` if none adds any.
    pub fn best_for(&self, effect: usize, manoeuvres: &[Manoeuvre]) -> Option<usize> {
        let now = Self::of(&self.now, effect).map_or(0.0, Self::precision);
        let gain = |k: usize| {
            let l = Self::of(&self.with[k], effect)?;
            let gain = (Self::precision(l) - now) / manoeuvres[k].minutes();
            (gain > 1e-3 * now && gain.is_finite()).then_some((l.in_sizes() <= TOO_LARGE, gain))
        };
        (0..self.with.len())
            .filter_map(|k| Some((k, gain(k)?)))
            .max_by(|a, b| (a.1.0.cmp(&b.1.0)).then(a.1.1.total_cmp(&b.1.1)))
            .map(|b| b.0)
    }

    /// Information on the size of an effect in units of a noticeable effect.
    fn precision(l: &Limit) -> f64 {
        l.visibility.information / l.visibility.relative.powi(2)
    }
}

/// Every ripple with its first start values, at a point. Where nothing was measured, no scan can determine its order.
fn ripples(point: &Point) -> Vec<(usize, Point)> {
    let ripples = REGISTRY.iter().enumerate().filter(|(_, e)| matches!(e.effect.act, Act::Pulsation(_)));
    let started = |(e, entry): (usize, &crate::effects::Entry)| {
        let mut there = point.clone();
        entry.effect.starts[0].iter().for_each(|&(k, v)| there.effects[k] = v);
        (e, there)
    };
    ripples.map(started).collect()
}

/// The screening of recordings at a point without effects, with ripples among its candidates.
fn screened(problem: &Problem, point: &Point) -> Option<Screening> {
    let anchor = Anchor::new(problem, point, &[], None, None)?;
    Some(screen_for_limits(problem, &anchor, &ripples(point)))
}

/// Limits of recordings alone, at a point without effects.
pub fn limits(problem: &Problem, point: &Point) -> Vec<Limit> {
    let anchor = Anchor::new(problem, point, &[], None, None);
    anchor.map_or_else(Vec::new, |anchor| screen::limits(problem, &anchor, &ripples(point)))
}

/// Limits of what was recorded, if anything was, and with each manoeuvre of the planner added. `point` has no effects.
pub fn reach(planner: &Planner, recorded: Option<&Problem>, point: &Point) -> Option<Reach> {
    let present = match recorded {
        Some(problem) => Some(screened(problem, point)?),
        None => None,
    };
    let there = planner.at(point);
    let planned: Vec<Screening> = planner
        .manoeuvres
        .par_iter()
        .map(|m| {
            let problem = planner.problem(m, &planner.car(&there));
            screened(&problem, &there)
        })
        .collect::<Option<_>>()?;
    let any = present.as_ref().or(planned.first())?;
    let now: Information = present.as_ref().map_or_else(|| any.information.none(), |p| p.information.clone());
    let mut all = now.clone();
    let mut with = Vec::with_capacity(planned.len());
    for p in &planned {
        let mut more = now.clone();
        more.add(&p.information, 1.0);
        all.add(&p.information, 1.0);
        with.push(any.limits(&more));
    }
    Some(Reach { now: any.limits(&now), with, with_all: any.limits(&all) })
}

#[cfg(test)]
mod tests {
    use super::super::Sensors;
    use super::super::manoeuvre::built_in;
    use super::super::rehearse::Logger;
    use super::*;
    use crate::effects::find;
    use crate::vehicle::Vehicle;
    use serde_json::json;

    fn found(tolerance: &serde_json::Value, names: &[&str]) -> Reach {
        let vehicle = Vehicle::paper();
        let mut document = vehicle.to_value();
        document["tolerance"] = tolerance.clone();
        let manoeuvres = built_in(&vehicle).into_iter().filter(|m| names.contains(&m.name.as_str())).collect();
        let logger = Logger { rate_hz: 100.0, bench: [false; 3], theta_0_sigma: [1.0; 2] };
        let planner = Planner::before(&vehicle, &document, Sensors::default(), logger, manoeuvres).unwrap();
        reach(&planner, None, &planner.nominal()).unwrap()
    }

    fn limit(r: &Reach, id: &str) -> f64 {
        Reach::of(&r.with_all, find(id).unwrap()).unwrap().size
    }

    /// A further manoeuvre never makes a limit worse, and without any recording all limits are infinite.
    #[test]
    fn more_recordings_show_smaller_effects() {
        let tolerance = json!({"friction.mu": {"rel": 0.015}});
        let (few, more) = (found(&tolerance, &["launch"]), found(&tolerance, &["launch", "creep"]));
        for l in &few.with_all {
            let with = Reach::of(&more.with_all, l.effect).unwrap();
            // The share of the start value at which a limit is computed may change by one step with the limit.
            assert!(with.size < 1.3 * l.size, "{}: {} {}", REGISTRY[l.effect].id, with.size, l.size);
            assert!(more.now.iter().all(|n| n.size.is_infinite()));
        }
    }

    /// A changed friction level hides behind a loose tolerance of friction, whatever is driven, and shows with a tight one.
    #[test]
    fn an_effect_within_its_tolerance_does_not_show() {
        let loose = limit(&found(&json!({"friction.mu": {"rel": 0.05}}), &["launch", "creep"]), "friction_level");
        let tight = limit(&found(&json!({"friction.mu": {"rel": 0.005}}), &["launch", "creep"]), "friction_level");
        assert!(loose > 4.0 * 0.05 && loose < 12.0 * 0.05, "{loose}");
        assert!(tight < 0.4 * loose, "{tight} {loose}");
    }

    #[test]
    fn a_coast_down_says_most_of_the_road() {
        let r = found(&json!({}), &["coast_down", "open_rev"]);
        let driven: Vec<Manoeuvre> =
            built_in(&Vehicle::paper()).into_iter().filter(|m| ["coast_down", "open_rev"].contains(&m.name.as_str())).collect();
        let best = r.best_for(find("road_load").unwrap(), &driven).unwrap();
        assert_eq!(driven[best].name, "coast_down");
        assert!(Reach::of(&r.with_all, find("kiss_point_offset").unwrap()).unwrap().in_sizes() > TOO_LARGE);
    }

    #[test]
    fn an_effect_hides_that_shows_from_three_usual_ones_on() {
        use crate::effects::param::vehicle_mass::factor;
        use crate::gap::infer::density::size;
        use crate::gap::infer::limit::Visibility;
        let visibility = Visibility { information: 1.0, relative: 1.0 };
        let limits = |sizes: f64| [Limit { effect: 7, parameter: factor, size: sizes * size(factor), start: 1.0, visibility }];
        assert!(!Reach::hides(&limits(2.9), 7) && Reach::hides(&limits(3.1), 7) && Reach::hides(&limits(f64::INFINITY), 7));
        assert!(!Reach::hides(&limits(9.0), 6), "of what was not asked for nothing is known");
    }

    #[test]
    fn the_best_manoeuvre_brings_most_per_minute_of_those_that_show_it() {
        use crate::effects::param::vehicle_mass::factor;
        use crate::gap::infer::density::size;
        use crate::gap::infer::limit::Visibility;
        let limit = |sizes: f64, information: f64| {
            vec![Limit {
                effect: 7,
                parameter: factor,
                size: sizes * size(factor),
                start: 1.0,
                visibility: Visibility { information, relative: 2.0 },
            }]
        };
        let mut manoeuvres: Vec<Manoeuvre> = built_in(&Vehicle::paper()).into_iter().take(3).collect();
        manoeuvres.iter_mut().zip([60.0, 120.0, 60.0]).for_each(|(m, seconds)| (m.seconds, m.prepare_s) = (seconds, 0.0));
        let after =
            |now: Vec<Limit>, with: [Vec<Limit>; 3]| Reach { now, with: with.to_vec(), with_all: Vec::new() }.best_for(7, &manoeuvres);
        let best = |with: [Vec<Limit>; 3]| after(limit(9.0, 4.0), with);
        // 16 more in one minute against 24 more in two; then as much as 40 more in two.
        assert_eq!(best([limit(2.0, 20.0), limit(2.0, 28.0), limit(2.0, 4.0)]), Some(0));
        assert_eq!(best([limit(2.0, 20.0), limit(2.0, 44.0), limit(2.0, 4.0)]), Some(1));
        // A manoeuvre that makes the effect visible comes before one that only adds more information.
        assert_eq!(best([limit(4.0, 90.0), limit(4.0, 99.0), limit(2.9, 5.0)]), Some(2));
        assert_eq!(best([limit(4.0, 90.0), limit(4.0, 99.0), limit(3.1, 5.0)]), Some(0));
        assert_eq!(best([limit(9.0, 4.0), limit(9.0, 4.0), limit(9.0, 4.0)]), None);
        // Before anything was measured, there is no best manoeuvre either for an effect about which no manoeuvre says anything.
        let nothing = || limit(f64::INFINITY, 0.0);
        assert_eq!(after(nothing(), [nothing(), nothing(), nothing()]), None);
        assert_eq!(after(nothing(), [nothing(), limit(9.0, 0.1), nothing()]), Some(1));
    }
}
