//! Screening: what every effect could explain beside everything that is already free, alone and together with others, from a few replays per start.
//!
//! At an anchor (a fitted point, or the nominal car), each effect is set to each of its starts and to a share of it, and the recordings are replayed once for each. The changes of
//! the innovations, and the derivatives of everything already free, are columns of one linear model. Nuisances and own unknowns are eliminated from it once, and what is left is a
//! small Gram matrix from which the gain of every set of starts follows.

use super::coordinate::coordinates;
use super::density::{Basis, Point, Problem, Residuals, cost, huber, prior, size};
use super::fit::Fit;
use super::information::{Believed, Information};
use super::limit::Visibility;
use super::linear::{Columns, Frame, Normal, assemble, derivatives, normal, products};
use crate::effects::{Act, Entry, PARAMETERS, REGISTRY};
use crate::gap::model::column::Column;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// A point around which a linear model is made.
pub struct Anchor {
    /// The point.
    pub point: Point,
    /// Effects that are free there.
    pub effects: Vec<usize>,
    basis: Option<Basis>,
    residuals: Vec<Residuals>,
    frame: Frame,
    /// Derivatives at the point.
    pub columns: Arc<Vec<Columns>>,
    equations: Normal,
    cost: f64,
}

impl Anchor {
    /// Differentiates at `point` along nuisances and the parameters of `effects`, unless the fit `known` holds the derivatives at this point.
    pub fn new(problem: &Problem, point: &Point, effects: &[usize], basis: Option<&Basis>, known: Option<&Fit>) -> Option<Self> {
        let residuals = problem.all_residuals(point, basis);
        let (shared, own) = coordinates(problem, effects, point.missing.len());
        let frame = Frame { shared, own };
        let anew = || Arc::new(derivatives(problem, point, basis, &residuals, &frame, None));
        let columns = known.filter(|f| !f.columns.is_empty()).map_or_else(anew, |f| f.columns.clone());
        let equations = normal(point, &frame, &columns, &residuals, 0.0)?;
        let cost = cost(point, &residuals);
        Some(Self { point: point.clone(), effects: effects.to_vec(), basis: basis.cloned(), residuals, frame, columns, equations, cost })
    }
}

/// A start of an effect, or a share of one, as it was replayed at an anchor.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Place in the registry.
    pub effect: usize,
    /// Point of the replay.
    pub point: Point,
    /// Cost at this point.
    pub cost: f64,
    /// Index among the starts of the effect.
    start: usize,
    /// Index of the tolerance that moves the same number, and how many of its standard deviations do the same; only for limits.
    twin: Option<(usize, f64)>,
    /// Share of the start at which it was replayed.
    pub(super) share: f64,
}

#[cfg(test)]
impl Candidate {
    /// An effect at this point, from this share of a start; nothing was replayed.
    pub fn of_share(effect: usize, point: Point, share: f64) -> Self {
        Self { effect, point, cost: 0.0, start: 0, twin: None, share }
    }
}

/// The linear model of the candidates of an anchor.
pub struct Screening {
    /// Candidates.
    pub candidates: Vec<Candidate>,
    /// Information of the recordings about the candidates.
    pub information: Information,
    /// Prior precision of the shared coordinates.
    prior: DMatrix<f64>,
    /// Curvature along the candidates with their prior, all else eliminated.
    gram: DMatrix<f64>,
    /// Gradient along the candidates, all else eliminated.
    slope: DVector<f64>,
    cost: f64,
    /// Worth of each candidate alone.
    believed: Vec<Believed>,
}

/// Largest factor on a start that the linear model may ask for.
pub(super) const LARGEST_FACTOR: f64 = 6.0;

/// Share of a start at which every effect is replayed as well: for an effect that is as small, or that is traded against a tolerance, the linear model holds from this share and
/// not from the whole start.
const SMALL_SHARE: f64 = 0.1;

/// Shares of a start at which limits of detection are computed. A limit is taken from the share that is nearest to it, because an effect that resembles a tolerance at its limit
/// may not do so at the size of a usual fault, and a play that shows when it is large may not show when it is small.
const LIMIT_SHARES: [f64; 3] = [1.0, MIDDLE_SHARE, 0.01];
const MIDDLE_SHARE: f64 = 0.1;

/// Replays every start of every effect that is not free at the anchor. `further` are starts that a scan found.
pub fn screen(problem: &Problem, anchor: &Anchor, further: &[(usize, Point)]) -> Screening {
    screen_at(problem, anchor, further, For::Promises)
}

/// As [`screen`], with shares of each start from a hundredth to the whole, for [`Screening::limits`].
pub fn screen_for_limits(problem: &Problem, anchor: &Anchor, further: &[(usize, Point)]) -> Screening {
    screen_at(problem, anchor, further, For::Limits(&|_, _| LIMIT_SHARES.to_vec()))
}

/// Information of the recordings about tolerances, in their standard deviations, followed by that about the starts of effects, in units of these; own unknowns are eliminated, and
/// the priors of tolerances and effects are left out.
pub fn information_of_starts(problem: &Problem, anchor: &Anchor) -> DMatrix<f64> {
    let screening = screen_at(problem, anchor, &[], For::Limits(&|_, _| vec![MIDDLE_SHARE]));
    let Information { curvature, cross, gram } = screening.information;
    let (s, m) = (curvature.nrows(), gram.nrows());
    let mut all = DMatrix::zeros(s + m, s + m);
    all.view_mut((0, 0), (s, s)).copy_from(&curvature);
    all.view_mut((0, s), (s, m)).copy_from(&(&cross / MIDDLE_SHARE));
    all.view_mut((s, 0), (m, s)).copy_from(&(cross.transpose() / MIDDLE_SHARE));
    all.view_mut((s, s), (m, m)).copy_from(&(gram / MIDDLE_SHARE.powi(2)));
    all
}

/// The detection limit of each effect that is not free at the anchor. Each start is replayed at the middle share, and also at another one if its limit is nearer to that.
pub fn limits(problem: &Problem, anchor: &Anchor, further: &[(usize, Point)]) -> Vec<Limit> {
    let of_starts = |s: Screening| s.limits_of_starts(&s.information);
    let mut all = of_starts(screen_at(problem, anchor, further, For::Limits(&|_, _| vec![MIDDLE_SHARE])));
    let nearer = |effect: usize, start: usize| -> Vec<f64> {
        let there = all.iter().find(|l| (l.limit.effect, l.start) == (effect, start));
        there.map(OfStart::nearest_share).into_iter().filter(|share| *share != MIDDLE_SHARE).collect()
    };
    all.extend(of_starts(screen_at(problem, anchor, &[], For::Limits(&nearer))));
    first_to_show(&all)
}

/// What a screening is made for.
#[derive(Clone, Copy)]
enum For<'a> {
    /// What each start promises, for the search.
    Promises,
    /// Limits, from these shares of each start; the arguments are the effect and the start.
    Limits(&'a dyn Fn(usize, usize) -> Vec<f64>),
}

fn screen_at(problem: &Problem, anchor: &Anchor, further: &[(usize, Point)], what_for: For) -> Screening {
    let mut candidates: Vec<Candidate> = Vec::new();
    for (e, entry) in REGISTRY.iter().enumerate().filter(|(e, _)| !anchor.effects.contains(e)) {
        if !matches!(entry.effect.act, Act::Pulsation(_)) {
            candidates.extend(starts(problem, anchor, e, entry, what_for));
        }
    }
    let found = further.iter().filter(|(e, _)| !anchor.effects.contains(e));
    candidates.extend(found.map(|(e, p)| Candidate { effect: *e, point: p.clone(), cost: 0.0, start: 0, twin: None, share: 1.0 }));
    let parts: Vec<Part> = (0..problem.tracks.len()).into_par_iter().map(|r| part(problem, anchor, &candidates, r)).collect();
    let m = candidates.len();
    candidates.iter_mut().for_each(|c| c.cost = prior(&c.point));
    let (mut gram, mut slope, mut cross) = (DMatrix::zeros(m, m), DVector::zeros(m), DMatrix::zeros(anchor.frame.shared.len(), m));
    for p in parts {
        gram += p.gram;
        slope += p.slope;
        cross += p.cross;
        candidates.iter_mut().zip(p.misfit).for_each(|(c, m)| c.cost += m);
    }
    // Without recordings, the prior is assembled alone.
    let shared_alone = Frame { shared: anchor.frame.shared.clone(), own: Vec::new() };
    let unlearned = assemble(&anchor.point, &shared_alone, &[], 0.0).expect("priors are positive");
    let information =
        Information { curvature: &anchor.equations.curvature - &unlearned.curvature, cross: cross.clone(), gram: gram.clone() };
    let of_recordings = &anchor.equations.gradient - &unlearned.gradient;
    let believed = information.believed(problem.power(), &unlearned, &of_recordings, &slope, &candidates);
    let prior = unlearned.curvature;
    let root = anchor.equations.curvature.clone().cholesky().expect("the anchor's curvature is positive");
    let solved = root.solve(&cross);
    gram -= cross.transpose() * &solved;
    slope -= solved.tr_mul(&anchor.equations.gradient);
    for (k, c) in candidates.iter().enumerate() {
        gram[(k, k)] += c.share * c.share;
    }
    let settled = root.solve(&anchor.equations.gradient).dot(&anchor.equations.gradient)
        + anchor.equations.eliminated.iter().map(|e| e.gain()).sum::<f64>();
    Screening { candidates, information, prior, gram, slope, cost: anchor.cost - settled, believed }
}

/// Starts of an effect, each at the shares that are required.
fn starts(problem: &Problem, anchor: &Anchor, effect: usize, entry: &'static Entry, what_for: For) -> Vec<Candidate> {
    let car = problem.car(&anchor.point, None);
    let same: Vec<Option<(usize, f64)>> = problem.shared.iter().map(|n| n.same_as(&car)).collect();
    let mut all = Vec::new();
    for (which, start) in entry.effect.starts.iter().enumerate() {
        // An effect that does exactly what a tolerance does is distinguished from it by its prior alone, and not by how far two finite steps are from one line.
        let does_the_same = match (what_for, start) {
            (For::Limits(_), [(k, value)]) => {
                let place = same.iter().position(|s| s.is_some_and(|(p, _)| p == *k));
                place.zip(place.and_then(|n| same[n])).map(|(n, (_, rate))| (n, (value - PARAMETERS[*k].null) / rate))
            }
            _ => None,
        };
        let shares = match what_for {
            For::Promises => vec![1.0, SMALL_SHARE],
            For::Limits(shares) => shares(effect, which),
        };
        for share in shares {
            let mut point = anchor.point.clone();
            for &(k, value) in *start {
                let null = PARAMETERS[k].null;
                let amplitude = entry.effect.amplitudes.contains(&k);
                point.effects[k] = if amplitude { null + share * (value - null) } else { value };
            }
            let twin = does_the_same.map(|(n, sigmas)| (n, share * sigmas));
            all.push(Candidate { effect, point, cost: 0.0, start: which, twin, share });
        }
    }
    all.retain(|c| problem.can_follow(&c.point));
    all
}

/// One recording's part of a screening.
struct Part {
    gram: DMatrix<f64>,
    slope: DVector<f64>,
    cross: DMatrix<f64>,
    /// Misfit of each candidate at the point of its replay.
    misfit: Vec<f64>,
}

/// One recording's part: products among the candidates' columns, with the residuals, and with the shared coordinates, own unknowns eliminated.
fn part(problem: &Problem, anchor: &Anchor, candidates: &[Candidate], r: usize) -> Part {
    let here = &anchor.residuals[r];
    let from = problem.baseline(r, &anchor.point, anchor.basis.as_ref(), Some(here));
    let (changes, misfit): (Columns, Vec<f64>) = candidates
        .par_iter()
        .map(|c| {
            if let Some((tolerance, sigmas)) = c.twin {
                return (anchor.columns[r][tolerance].times(sigmas), f64::NAN);
            }
            let change = problem.change(r, &from, &c.point);
            let misfit = change.iter().zip(here).map(|(change, here)| huber(here + change)).sum::<f64>();
            (Column::new(&change), misfit)
        })
        .unzip();
    let (s, o, m) = (anchor.frame.shared.len(), anchor.frame.own.len(), candidates.len());
    let all: Columns = anchor.columns[r].iter().cloned().chain(changes).collect();
    let (p, g) = products(&all, here);
    let (shared, own) = (p.view((0, s + o), (s, m)), p.view((s, s + o), (o, m)).into_owned());
    let e = &anchor.equations.eliminated[r];
    let gram = p.view((s + o, s + o), (m, m)) - own.tr_mul(&e.solve(&own));
    let slope = g.rows(s + o, m) - own.tr_mul(e.offset());
    let cross = shared - e.coupling().tr_mul(&own);
    Part { gram, slope, cross, misfit }
}

/// A set of candidates of an anchor, and the cost that the linear model promises for them.
#[derive(Clone, Debug)]
pub struct Promise {
    /// Places in [`Screening::candidates`].
    pub members: Vec<usize>,
    /// Factors on their starts.
    pub factors: Vec<f64>,
    /// Promised cost.
    pub cost: f64,
}

impl Screening {
    /// Cost that the linear model promises without any candidate.
    pub fn settled(&self) -> f64 {
        self.cost
    }

    /// Gain of the only candidate of a promise, in the cost with the likelihood raised to its power.
    pub fn gain(&self, single: &Promise) -> f64 {
        self.believed[single.members[0]].gain
    }

    /// The effect of each candidate, and the gain in log evidence, nats, that the linear model predicts for the candidate alone, without the prior odds of the effect.
    pub fn evidence(&self) -> impl Iterator<Item = (usize, f64)> {
        self.candidates.iter().zip(&self.believed).map(|(c, b)| (c.effect, b.evidence))
    }

    /// Promise of these candidates together; none if one of them would have to go in the opposite direction.
    pub fn promise(&self, members: &[usize]) -> Option<Promise> {
        let m = members.len();
        let h = DMatrix::from_fn(m, m, |i, j| self.gram[(members[i], members[j])]);
        let g = DVector::from_fn(m, |i, _| self.slope[members[i]]);
        let step = h.clone().cholesky()?.solve(&-&g);
        if step.iter().any(|f| *f <= 0.0) {
            return None;
        }
        let most = |i: usize| LARGEST_FACTOR / self.candidates[members[i]].share;
        let step = DVector::from_fn(m, |i, _| step[i].min(most(i)));
        let gain = -2.0 * g.dot(&step) - (&h * &step).dot(&step);
        // A replayed cost is certain, a promised one is not.
        if let [k] = members
            && self.candidates[*k].cost < self.cost - gain
        {
            return Some(Promise { members: vec![*k], factors: vec![1.0], cost: self.candidates[*k].cost });
        }
        Some(Promise { members: members.to_vec(), factors: step.iter().copied().collect(), cost: self.cost - gain })
    }

    /// The detection limit of each effect that was screened, from the information of these recordings or of others at the same anchor.
    pub fn limits(&self, information: &Information) -> Vec<Limit> {
        first_to_show(&self.limits_of_starts(information))
    }

    /// Detection limits of each start at each share of it.
    fn limits_of_starts(&self, information: &Information) -> Vec<OfStart> {
        let one = |(c, information): (&Candidate, f64)| {
            let amplitudes = REGISTRY[c.effect].effect.amplitudes.iter();
            let &parameter = amplitudes.max_by(|a, b| off(c, **a).total_cmp(&off(c, **b)))?;
            let start = (c.point.effects[parameter] - PARAMETERS[parameter].null) / c.share;
            let visibility = Visibility { information: information / (c.share * c.share), relative: start.abs() / size(parameter) };
            let in_starts = visibility.limit();
            let limit = Limit { effect: c.effect, parameter, size: in_starts * start.abs(), start, visibility };
            Some(OfStart { start: c.start, share: c.share, in_starts, limit })
        };
        self.candidates.iter().zip(information.beside(&self.prior)).filter_map(one).collect()
    }

    /// The best start of each effect, or all starts of a ripple, best first.
    pub fn singles(&self) -> Vec<Promise> {
        let mut best: Vec<Promise> = Vec::new();
        for k in 0..self.candidates.len() {
            let Some(p) = self.promise(&[k]) else { continue };
            let pulsates = matches!(REGISTRY[self.candidates[k].effect].effect.act, Act::Pulsation(_));
            match best.iter_mut().find(|b| !pulsates && self.candidates[b.members[0]].effect == self.candidates[k].effect) {
                Some(b) if p.cost < b.cost => *b = p,
                Some(_) => {}
                None => best.push(p),
            }
        }
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        best
    }

    /// The best starts of each pair of effects, best first.
    pub fn pairs(&self) -> Vec<Promise> {
        let mut best: Vec<Promise> = Vec::new();
        let effect = |k: usize| self.candidates[k].effect;
        for i in 0..self.candidates.len() {
            for j in (0..i).filter(|&j| effect(j) != effect(i)) {
                let Some(p) = self.promise(&[j, i]) else { continue };
                let same = |b: &&mut Promise| {
                    let (a, c) = (effect(b.members[0]), effect(b.members[1]));
                    (a, c) == (effect(i), effect(j)) || (c, a) == (effect(i), effect(j))
                };
                match best.iter_mut().find(same) {
                    Some(b) if p.cost < b.cost => *b = p,
                    Some(_) => {}
                    None => best.push(p),
                }
            }
        }
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        best
    }

    /// Start point for a fit of a promise.
    pub fn start(&self, anchor: &Anchor, promise: &Promise) -> Point {
        let mut point = anchor.point.clone();
        for (&k, factor) in promise.members.iter().zip(&promise.factors) {
            let c = &self.candidates[k];
            let entry = &REGISTRY[c.effect];
            for p in entry.parameters.clone() {
                let null = PARAMETERS[p].null;
                let set = c.point.effects[p];
                let amplitude = entry.effect.amplitudes.contains(&p);
                // Only half of the part that is promised beyond the start is taken, because the linear model is most reliable near the point of the replay.
                let factor = if *factor > 1.0 && c.share == 1.0 { 1.0 + 0.5 * (factor - 1.0) } else { *factor };
                let moved = if amplitude { null + factor * (set - null) } else { set };
                point.effects[p] = moved.clamp(PARAMETERS[p].min, PARAMETERS[p].max).clamp(null - 8.0 * size(p), null + 8.0 * size(p));
            }
        }
        point
    }
}

/// The detection limit of an effect along one of its starts, as it follows from one share of the start.
struct OfStart {
    start: usize,
    share: f64,
    /// The limit in units of the start.
    in_starts: f64,
    limit: Limit,
}

/// Limit in units of a start that stands for an infinite one.
const MOST_STARTS: f64 = 1e9;

impl OfStart {
    /// Distance of the limit from a share of the start: the absolute logarithm of their ratio.
    fn away(&self, share: f64) -> f64 {
        (self.in_starts.min(MOST_STARTS) / share).ln().abs()
    }

    /// The share that is nearest to the limit.
    fn nearest_share(&self) -> f64 {
        LIMIT_SHARES.into_iter().min_by(|a, b| self.away(*a).total_cmp(&self.away(*b))).expect("there are shares")
    }
}

/// Detection limits by effect. Of each start there are the limit at the middle share and the one at the share nearest to that limit; the one that is nearer to its own share
/// counts. Of each effect the start with the smallest limit counts.
fn first_to_show(all: &[OfStart]) -> Vec<Limit> {
    let away = |l: &OfStart| l.away(l.share);
    let is_asked = |l: &&OfStart| {
        let middle = all.iter().find(|m| (m.limit.effect, m.start, m.share) == (l.limit.effect, l.start, MIDDLE_SHARE));
        middle.is_none_or(|middle| l.share == MIDDLE_SHARE || l.share == middle.nearest_share())
    };
    let mut of_starts: Vec<&OfStart> = Vec::new();
    for one in all.iter().filter(is_asked) {
        match of_starts.iter_mut().find(|o| (o.limit.effect, o.start) == (one.limit.effect, one.start)) {
            Some(o) if away(one) < away(o) => *o = one,
            Some(_) => {}
            None => of_starts.push(one),
        }
    }
    let mut all: Vec<Limit> = Vec::new();
    for one in of_starts.into_iter().map(|o| o.limit) {
        match all.iter_mut().find(|a| a.effect == one.effect) {
            Some(a) if one.in_sizes() < a.in_sizes() => *a = one,
            Some(_) => {}
            None => all.push(one),
        }
    }
    all
}

/// The limit of detection: the smallest size of an effect that recordings show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Place in the registry.
    pub effect: usize,
    /// Parameter to which the size refers.
    pub parameter: usize,
    /// Departure of the parameter from its null value that is found with a probability of [`super::limit::POWER`].
    pub size: f64,
    /// Departure at the start that shows best; its sign is that of the effect.
    pub start: f64,
    /// Information of the recordings along this start.
    pub visibility: Visibility,
}

impl Limit {
    /// The limit in units of a noticeable effect.
    pub fn in_sizes(&self) -> f64 {
        self.size / size(self.parameter)
    }

    /// Probability that a departure of this size is found.
    pub fn power(&self, departure: f64) -> f64 {
        self.visibility.power(departure / self.start.abs())
    }
}

/// How far a candidate's parameter is from its null value, in units of its size.
pub(super) fn off(c: &Candidate, p: usize) -> f64 {
    (c.point.effects[p] - PARAMETERS[p].null).abs() / size(p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{self, param::vehicle_mass::factor};

    /// A limit of 0.034 starts that follows from a tenth of the start is nearest to that share. If all three shares were replayed, it is therefore the limit that follows from this
    /// share alone. A limit of 0.02 starts is nearer to a hundredth.
    #[test]
    fn a_limit_is_the_same_whichever_shares_were_replayed() {
        let of = |share: f64, in_starts: f64| OfStart {
            start: 0,
            share,
            in_starts,
            limit: Limit {
                effect: 7,
                parameter: factor,
                size: in_starts,
                start: 1.0,
                visibility: Visibility { information: 1.0, relative: 1.0 },
            },
        };
        let size = |all: Vec<OfStart>| first_to_show(&all)[0].size;
        assert_eq!([size(vec![of(0.1, 0.034)]), size(vec![of(1.0, 0.5), of(0.1, 0.034), of(0.01, 0.0166)])], [0.034; 2]);
        let found = [size(vec![of(0.1, 0.02), of(0.01, 0.012)]), size(vec![of(1.0, 1.0), of(0.1, 0.02), of(0.01, 0.012)])];
        assert_eq!(found, [0.012; 2]);
        // Without the middle share, the limit at the available share counts.
        assert_eq!(size(vec![of(1.0, 0.03)]), 0.03);
    }

    /// A start departs in those amplitudes of its effect that it moves and in no others, whatever their null values are.
    #[test]
    fn a_departure_is_counted_from_where_there_is_no_effect() {
        for (effect, entry) in REGISTRY.iter().enumerate() {
            for start in entry.effect.starts {
                let mut point = Point { shared: Vec::new(), own: Vec::new(), effects: effects::null(), missing: Vec::new() };
                start.iter().for_each(|&(k, value)| point.effects[k] = value);
                let c = Candidate::of_share(effect, point, 1.0);
                for &k in entry.effect.amplitudes {
                    let moved = start.iter().any(|(moved, _)| *moved == k);
                    assert_eq!(off(&c, k) > 0.0, moved, "{}", PARAMETERS[k].variable);
                }
            }
        }
    }
}
