//! From the search to a verdict.
//!
//! The thresholds were set on drawn cars whose effects are known, by the procedure that the docs of the method describe; they are
//! never set on a case at hand.

use super::coordinate::Coordinate;
use super::fit::{Fit, fit_along};
use super::problem::{Point, Problem, prior, weight};
use super::select::{Hypothesis, Search};
use crate::effects::{REGISTRY, Subsystem};

/// Verdict on a campaign, as the answer's schema names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing beyond noise and tolerances.
    NoGap,
    /// The effects leave nothing structured.
    Explained,
    /// The effects help and something structured remains.
    PartlyExplained,
    /// A gap that no library effect accounts for.
    Unexplained,
}

/// Evidence (twice in nats) that a first effect needs: on cars within their tolerances the best of all candidates stays below it.
pub const FIRST_GAIN: f64 = 40.0;
/// Evidence from tolerances set free that a first effect needs if it has little else: what the data say of a healthy car wanders with the
/// sensors' habits, where its tolerances lie does not.
const FIRST_FREED: f64 = 10.0;
/// Cost relative to the noise's up to which residuals are what the noise makes of them: evidence from the data alone then has to be this many times
/// as strong.
const NOISE_ALONE: f64 = 1.05;
const BEYOND_DOUBT: f64 = 3.0;
/// Evidence that a second effect needs, and that of tolerances set free if it sets them free.
pub const SECOND_GAIN: f64 = 30.0;
const SECOND_FREED: f64 = 12.0;
/// Share of the pull of the tolerances that a second effect sets free which has to be gone: it frees them altogether or it is another effect.
const MOST: f64 = 0.7;
/// Share of the first effect's excess that a second effect has to take.
pub const SECOND_SHARE: f64 = 0.6;
/// Share of what the first effect explains below which a second one is a trifle: a difference of form.
pub const TRIFLE: f64 = 0.004;
/// The same for a second effect of the first one's subsystem, which is what a difference of form looks like.
const TRIFLE_ALIKE: f64 = 0.04;
/// Cost per residual above which something structured is there.
pub const STRUCTURED: f64 = 1.3;
/// Share of the base's excess that an explanation may leave.
pub const LEFT: f64 = 0.06;
/// Share of the base's excess above which an effect explains nothing worth naming.
pub const HELPS: f64 = 0.15;

/// Mean square of the tolerances, in standard deviations, above which an explanation that needs them there is not whole, and above which it is none:
/// a car's numbers scatter by one; an effect of another form pulls at them, but hardly beyond the second of these.
pub const STRETCHED: f64 = 6.0;
const TORN: f64 = 40.0;

/// Share of what an unseen recording costs beyond noise that effects have to take away if they are to explain it, and to be named at all.
const EXPLAINS_UNSEEN: f64 = 0.8;
const HELPS_UNSEEN: f64 = 0.5;
/// Iterations on the start temperatures of an unseen recording.
const START_ITERATIONS: usize = 6;
/// How far they may be from what was noted, K: a misfit that asks for more is not theirs.
const FURTHEST_START_K: f64 = 3.0;
/// Cost of an unseen recording, relative to the noise, that is large enough to test them.
const TELLING: f64 = 4.0;

/// Cost of a recording that took no part, as the fit counts it. Only its start temperatures are fitted to it, which belong to the recording and not to
/// the car: an error of 1 K in what was noted costs more than the noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unseen {
    /// With the numbers of the vehicle file.
    pub before: f64,
    /// With tolerances and effects of the hypothesis.
    pub after: f64,
    /// Of noise alone.
    pub noise: f64,
}

impl Unseen {
    /// Judges a hypothesis on a recording.
    pub fn of(recording: &Problem, point: &Point) -> Self {
        let start = [Coordinate::Theta(0, 0), Coordinate::Theta(0, 1)];
        let cost = |p: &Point| {
            let mut fitted = fit_along(recording, start.to_vec(), p, START_ITERATIONS, None).point;
            fitted.theta_shift.iter_mut().flatten().for_each(|shift| *shift = shift.clamp(-FURTHEST_START_K, FURTHEST_START_K));
            recording.cost(&fitted, &recording.all_residuals(&fitted)) - prior(p)
        };
        let nominal = recording.nominal();
        let point = Point { theta_shift: nominal.theta_shift.clone(), ..point.clone() };
        Self { before: cost(&nominal), after: cost(&point), noise: recording.noise_cost() }
    }

    /// Share of the cost beyond noise that is gone; none where there was little to begin with.
    pub fn fraction(&self) -> Option<f64> {
        (self.before >= TELLING * self.noise).then(|| ((self.before - self.after) / (self.before - self.noise)).min(1.0))
    }
}

/// What was decided.
#[derive(Clone, Debug)]
pub struct Decision {
    /// Verdict.
    pub verdict: Verdict,
    /// The hypothesis that stands, with the effects of the verdict.
    pub chosen: Hypothesis,
    /// Cost that the chosen hypothesis leaves above the noise, relative to what the tolerances alone leave.
    pub left: f64,
    /// Mean square of the tolerances that the best explanation needs, in standard deviations.
    pub stretch: f64,
}

/// Numbers of residuals that are summed for the dispersion: up to twice the memory of the replay.
const BLOCKS: [usize; 3] = [10, 25, 50];

/// Variance of residuals over blocks, relative to white noise of the estimated size, at least 1.
///
/// Quantised torque reports and forms that differ leave residuals that hang together; they weigh less than their number says.
pub fn dispersion(fit: &Fit) -> f64 {
    let of = |length: usize| {
        let sums = fit.residuals.iter().flat_map(|r| r.chunks_exact(length)).map(|b| b.iter().map(|r| r * weight(*r)).sum::<f64>());
        let squares: Vec<f64> = sums.map(|s| s * s / length as f64).collect();
        squares.iter().sum::<f64>() / squares.len().max(1) as f64
    };
    BLOCKS.into_iter().map(of).fold(1.0, f64::max)
}

/// Cost of the nuisances, and cost of the data.
fn split(h: &Hypothesis) -> (f64, f64) {
    let pulled = prior(&h.fit.point);
    (pulled, h.fit.cost - pulled)
}

/// Evidence for the second of two hypotheses, twice in nats: tolerances that it sets free, and data that it explains beyond what hangs
/// together anyway, less what its parameters have to earn.
pub fn evidence(small: &Hypothesis, large: &Hypothesis) -> f64 {
    let (data_0, data_1) = (split(small).1, split(large).1);
    freed(small, large) + (data_0 - data_1) / dispersion(&large.fit)
}

/// The part of the evidence that is tolerances set free, less what the parameters have to earn.
fn freed(small: &Hypothesis, large: &Hypothesis) -> f64 {
    let earned = (large.score() - large.fit.cost) - (small.score() - small.fit.cost);
    split(small).0 - split(large).0 - earned
}

/// Evidence that the data alone have to give, where this much is asked for and `small` is the hypothesis to beat.
fn beyond_noise(search: &Search, small: &Hypothesis, needed: f64) -> f64 {
    if small.fit.cost < NOISE_ALONE * search.noise_cost { BEYOND_DOUBT * needed } else { needed }
}

/// Whether an effect is more than a healthy car would offer.
fn first_is_needed(search: &Search, effects: &Hypothesis) -> bool {
    let (evidence, freed) = (evidence(&search.base, effects), freed(&search.base, effects));
    evidence > beyond_noise(search, &search.base, FIRST_GAIN) || evidence > FIRST_FREED && freed > FIRST_FREED
}

/// Squares of the tolerances in standard deviations, summed.
fn pull(h: &Hypothesis) -> f64 {
    h.fit.point.z.iter().map(|z| z * z).sum()
}

/// Tolerances that the second of two hypotheses sets free: their pull (squares in standard deviations) that is gone, and what it was.
fn set_free(small: &Hypothesis, large: &Hypothesis) -> [f64; 2] {
    let squares = small.fit.point.z.iter().zip(&large.fit.point.z).map(|(a, b)| [a * a - b * b, a * a]);
    squares.filter(|[gone, _]| *gone > 1.0).fold([0.0; 2], |sum, [gone, was]| [sum[0] + gone, sum[1] + was])
}

/// Whether a second effect is there, and not only the first one's form that differs.
///
/// Two signs count: the first effect alone pulls tolerances far beyond their size and the second sets them free, or the second takes
/// most of the structure that the first left, and not a trifle beside what the first explains. One of the first one's own subsystem has to do
/// the latter, and more of it; so has a thermal one, but no more of it.
fn second_is_needed(search: &Search, single: &Hypothesis, pair: &Hypothesis) -> bool {
    let (data_1, data_2) = (split(single).1, split(pair).1);
    let (gained, earned) = (data_1 - data_2, pair.score() - pair.fit.cost - (single.score() - single.fit.cost));
    let structure = data_1 - data_2.min(search.noise_cost);
    let explained = search.base.fit.cost - single.fit.cost;
    let subsystem = |k: usize| REGISTRY[pair.effects[k]].effect.subsystem;
    let alike = subsystem(0) == subsystem(1);
    let evidence = evidence(single, pair);
    let trifle = if alike { TRIFLE_ALIKE } else { TRIFLE };
    let takes_the_rest =
        evidence > beyond_noise(search, single, SECOND_GAIN) && gained > SECOND_SHARE * structure && gained > trifle * explained;
    let freed = pull(single) - pull(pair) - earned;
    let [gone, was] = set_free(single, pair);
    // Where heat goes shows in the speeds through friction alone: a friction of another form pulls at the same tolerances.
    let thermal = (0..2).any(|k| subsystem(k) == Subsystem::Thermal);
    let sets_free = !alike && !thermal && evidence.min(freed) > SECOND_FREED && gone > MOST * was;
    sets_free || takes_the_rest
}

/// The single effect that a second one has to beat: the best one that is needed, for a pliable effect may fit noise a little better than the
/// true one sets tolerances free.
fn first_choice(search: &Search) -> Option<&Hypothesis> {
    search.singles.iter().find(|single| first_is_needed(search, single)).or(search.singles.first())
}

/// Pairs that the data ask for.
pub fn needed_pairs(search: &Search) -> impl Iterator<Item = &Hypothesis> {
    let first = first_choice(search);
    search.pairs.iter().filter(move |pair| first.is_some_and(|single| second_is_needed(search, single, pair)))
}

/// Decides.
pub fn decide(search: &Search) -> Decision {
    let n = search.noise_cost;
    let base = &search.base;
    let excess = |h: &Hypothesis| (h.fit.cost - n).max(0.0);
    let mut chosen = base.clone();
    if let Some(single) = first_choice(search) {
        // Not the pair that fits best: a second effect that polishes the first one's form may fit better than the true one.
        let pair = needed_pairs(search).max_by(|a, b| evidence(single, a).total_cmp(&evidence(single, b)));
        // Two effects may need each other: alone, either leaves most of the gap.
        if first_is_needed(search, single) || pair.is_some_and(|pair| first_is_needed(search, pair)) {
            chosen = pair.unwrap_or(single).clone();
        }
    }
    let structured = chosen.fit.cost > STRUCTURED * n;
    let left = if excess(base) > 0.0 { excess(&chosen) / excess(base) } else { 0.0 };
    let stretch = pull(&chosen) / chosen.fit.point.z.len().max(1) as f64;
    let verdict = if chosen.effects.is_empty() {
        if structured { Verdict::Unexplained } else { Verdict::NoGap }
    } else if structured && left > HELPS || stretch > TORN {
        chosen = base.clone();
        Verdict::Unexplained
    } else if structured && left > LEFT || stretch > STRETCHED {
        Verdict::PartlyExplained
    } else {
        Verdict::Explained
    };
    Decision { verdict, chosen, left, stretch }
}

impl Decision {
    /// Lowers the verdict on effects that do not keep their word on a recording that took no part: it may refute them, never choose them.
    pub fn tested(mut self, search: &Search, unseen: &Unseen) -> Self {
        let Some(fraction) = unseen.fraction().filter(|_| !self.chosen.effects.is_empty()) else { return self };
        if fraction < HELPS_UNSEEN {
            (self.verdict, self.chosen) = (Verdict::Unexplained, search.base.clone());
        } else if fraction < EXPLAINS_UNSEEN {
            self.verdict = Verdict::PartlyExplained;
        }
        self
    }
}
