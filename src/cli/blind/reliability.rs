//! Calibration of claimed probabilities and intervals.
//!
//! Every effect that an answer names with a probability is a claim that the effect is there. Claims are binned by probability, and each bin is compared with the share of its
//! claims that are true. The calibration error is Σ n_b/n · abs(mean claim − share true) over the bins; the Brier score is the mean of (claim − truth)². With few claims, the
//! calibration error is above zero by chance as well. Beside it stands the error to be expected of calibrated claims, each true independently with the probability that it
//! claims.
//!
//! Every parameter that has a true value in the library's terms is a claim that its 95 % interval contains that value.

use super::examine::Outcome;
use super::scores::wilson;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Edges of the bins.
const EDGES: [f64; 8] = [0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0];

/// Steps per claim in the discretised distribution of the calibration error.
const STEPS: f64 = 100.0;

fn bin_of(p: f64) -> usize {
    EDGES[1..].iter().position(|edge| p < *edge).unwrap_or(EDGES.len() - 2)
}

/// Distribution of the sum of two independent non-negative integers, from their distributions.
fn sum_of(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate().filter(|(_, x)| **x > 0.0) {
        b.iter().enumerate().for_each(|(j, y)| sum[i + j] += x * y);
    }
    sum
}

/// One bin of claims.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Number of claims.
    pub count: usize,
    /// Sum of their probabilities.
    pub claimed: f64,
    /// Number of true claims.
    pub hits: usize,
}

/// Claims and their outcomes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reliability {
    /// Claims by probability.
    pub bins: [Bin; 7],
    /// Probability of every claim.
    pub claimed: Vec<f64>,
    /// Sum of squared errors of the claims.
    pub squares: f64,
    /// Number of intervals that contain the true value, and number of intervals, by parameter.
    pub coverage: BTreeMap<String, (usize, usize)>,
}

/// The claims of all outcomes.
pub fn of(outcomes: &[Outcome]) -> Reliability {
    let mut r = Reliability::default();
    for o in outcomes {
        for named in &o.named {
            let truth = o.truth.effects.iter().find(|e| e.id == named.id);
            if let Some(p) = named.probability {
                r.claim(p, truth.is_some());
            }
        }
        for interval in o.intervals() {
            let holds = interval.holds();
            let (hits, count) = r.coverage.entry(interval.parameter).or_default();
            *count += 1;
            *hits += usize::from(holds);
        }
    }
    r
}

impl Reliability {
    fn claim(&mut self, p: f64, is_true: bool) {
        self.claimed.push(p);
        let bin = &mut self.bins[bin_of(p)];
        bin.count += 1;
        bin.claimed += p;
        bin.hits += usize::from(is_true);
        self.squares += (p - f64::from(u8::from(is_true))).powi(2);
    }

    fn claims(&self) -> usize {
        self.claimed.len()
    }

    /// Calibration error; `None` without claims.
    pub fn calibration_error(&self) -> Option<f64> {
        let n = self.claims();
        (n > 0).then(|| self.bins.iter().map(|b| (b.claimed - b.hits as f64).abs()).sum::<f64>() / n as f64)
    }

    /// Calibration error that the same claims would show by chance if they were calibrated: its mean and its 95th percentile; `None` without claims.
    pub fn error_by_chance(&self) -> Option<[f64; 2]> {
        let n = self.claims();
        if n == 0 {
            return None;
        }
        // Distribution of Σ abs(claimed − true) over the bins, in steps of 1/STEPS.
        let mut error = vec![1.0];
        for k in 0..self.bins.len() {
            let mut hits = vec![1.0];
            for p in self.claimed.iter().filter(|p| bin_of(**p) == k) {
                hits = sum_of(&hits, &[1.0 - p, *p]);
            }
            let off = |true_ones: usize| ((self.bins[k].claimed - true_ones as f64).abs() * STEPS).round() as usize;
            let mut of_bin = vec![0.0; (0..hits.len()).map(off).max().unwrap_or(0) + 1];
            hits.iter().enumerate().for_each(|(true_ones, chance)| of_bin[off(true_ones)] += chance);
            error = sum_of(&error, &of_bin);
        }
        let unit = 1.0 / (STEPS * n as f64);
        let mean: f64 = error.iter().enumerate().map(|(k, chance)| k as f64 * chance).sum();
        let mut below = 0.0;
        let most = error.iter().take_while(|chance| {
            below += **chance;
            below < 0.95
        });
        Some([mean * unit, most.count() as f64 * unit])
    }

    /// Brier score; `None` without claims.
    pub fn brier(&self) -> Option<f64> {
        let n = self.claims();
        (n > 0).then(|| self.squares / n as f64)
    }

    fn covered(&self) -> (usize, usize) {
        self.coverage.values().fold((0, 0), |(h, n), (hits, count)| (h + hits, n + count))
    }

    /// The tables as JSON.
    pub fn as_json(&self) -> Value {
        let bins = self.bins.iter().zip(EDGES.windows(2)).filter(|(b, _)| b.count > 0);
        let bin = |(b, edges): (&Bin, &[f64])| json!({"from": edges[0], "to": edges[1], "count": b.count, "claimed": b.claimed / b.count as f64, "true": b.hits as f64 / b.count as f64, "interval": wilson(b.hits as f64, b.count)});
        let (hits, count) = self.covered();
        let parameters: serde_json::Map<String, Value> =
            self.coverage.iter().map(|(name, (hits, count))| (name.clone(), json!({"covered": hits, "count": count}))).collect();
        json!({
            "bins": bins.map(bin).collect::<Vec<_>>(), "calibration_error": self.calibration_error(), "calibration_error_by_chance": self.error_by_chance(), "brier": self.brier(),
            "coverage": {"covered": hits, "count": count, "interval": (count > 0).then(|| wilson(hits as f64, count)), "parameters": parameters},
        })
    }

    /// The tables as text.
    pub fn as_text(&self) -> String {
        let mut text = String::new();
        if let (Some(error), Some([mean, most]), Some(brier)) = (self.calibration_error(), self.error_by_chance(), self.brier()) {
            text += &format!(
                "probability claimed for a named effect: {} claim{}, calibration error {error:.3} (calibrated claims as few as these: {mean:.3} in the mean, at most {most:.3} in 95 % of cases), Brier score {brier:.3}\n",
                self.claims(),
                if self.claims() == 1 { "" } else { "s" }
            );
            for (b, edges) in self.bins.iter().zip(EDGES.windows(2)).filter(|(b, _)| b.count > 0) {
                let [low, high] = wilson(b.hits as f64, b.count);
                let (claimed, hit) = (b.claimed / b.count as f64, b.hits as f64 / b.count as f64);
                text += &format!(
                    "  {:.2} to {:.2}: claimed {claimed:.3}, true {hit:.3} ({} of {}, {low:.3} to {high:.3})\n",
                    edges[0], edges[1], b.hits, b.count
                );
            }
        }
        let (hits, count) = self.covered();
        if count > 0 {
            let [low, high] = wilson(hits as f64, count);
            let part = 100.0 * hits as f64 / count as f64;
            text += &format!(
                "95 % intervals that hold the true value: {part:.1} % ({hits} of {count}, {:.1} % to {:.1} %)\n",
                100.0 * low,
                100.0 * high
            );
            text.extend(self.coverage.iter().map(|(name, (hits, count))| format!("  {name:<44} {hits} of {count}\n")));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibrated_teller_has_no_error_and_a_sure_liar_has_it_all() {
        let mut fair = Reliability::default();
        (0..4).for_each(|k| fair.claim(0.75, k < 3));
        assert_eq!((fair.calibration_error(), fair.brier()), (Some(0.0), Some((3.0 * 0.0625 + 0.5625) / 4.0)));
        let mut liar = Reliability::default();
        (0..4).for_each(|_| liar.claim(1.0, false));
        assert_eq!((liar.calibration_error(), liar.brier()), (Some(1.0), Some(1.0)));
        assert_eq!(liar.bins[6].count, 4);
        assert_eq!((Reliability::default().calibration_error(), Reliability::default().error_by_chance()), (None, None));
    }

    /// Of two claims of 75 %, two are true with probability 9/16, one with 6/16 and none with 1/16; the error per claim is 0.25, 0.25 or 0.75. A further claim of 40 % is off
    /// by 0.6 or 0.4.
    #[test]
    fn few_claims_are_off_by_chance() {
        let mut few = Reliability::default();
        (0..2).for_each(|_| few.claim(0.75, true));
        let [mean, most] = few.error_by_chance().unwrap();
        assert!((mean - (15.0 * 0.25 + 0.75) / 16.0).abs() < 1e-9 && (most - 0.75).abs() < 1e-9, "{mean} {most}");
        few.claim(0.4, true);
        let [mean, _] = few.error_by_chance().unwrap();
        let expected = (2.0 * (15.0 * 0.25 + 0.75) / 16.0 + 0.4 * 0.6 + 0.6 * 0.4) / 3.0;
        assert!((mean - expected).abs() < 1e-9, "{mean} {expected}");
    }
}
