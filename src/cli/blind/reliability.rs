//! What claimed probabilities and intervals are worth.
//!
//! Every effect that an answer names with a probability is a claim that it is there. Claims in bins of probability against the share that
//! is true; calibration error Σ n_b/n · abs(mean claim − share true) over the bins; Brier score: mean of (claim − truth)².
//!
//! Every parameter that has a true value in the library's terms is a claim that its 95 % interval holds that value.

use super::examine::Outcome;
use super::scores::wilson;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Edges of the bins.
const EDGES: [f64; 8] = [0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0];

/// One bin of claims.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// How many claims.
    pub count: usize,
    /// Sum of their probabilities.
    pub claimed: f64,
    /// How many of them are true.
    pub hits: usize,
}

/// Claims and what became of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reliability {
    /// By probability.
    pub bins: [Bin; 7],
    /// Sum of squared errors of the claims.
    pub squares: f64,
    /// Intervals that hold the true value, of how many; by parameter.
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
        let k = EDGES[1..].iter().position(|edge| p < *edge).unwrap_or(EDGES.len() - 2);
        let bin = &mut self.bins[k];
        bin.count += 1;
        bin.claimed += p;
        bin.hits += usize::from(is_true);
        self.squares += (p - f64::from(u8::from(is_true))).powi(2);
    }

    fn claims(&self) -> usize {
        self.bins.iter().map(|b| b.count).sum()
    }

    /// Calibration error; none without claims.
    pub fn calibration_error(&self) -> Option<f64> {
        let n = self.claims();
        (n > 0).then(|| self.bins.iter().map(|b| (b.claimed - b.hits as f64).abs()).sum::<f64>() / n as f64)
    }

    /// Brier score; none without claims.
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
            "bins": bins.map(bin).collect::<Vec<_>>(), "calibration_error": self.calibration_error(), "brier": self.brier(),
            "coverage": {"covered": hits, "count": count, "interval": (count > 0).then(|| wilson(hits as f64, count)), "parameters": parameters},
        })
    }

    /// The tables for people.
    pub fn as_text(&self) -> String {
        let mut text = String::new();
        if let (Some(error), Some(brier)) = (self.calibration_error(), self.brier()) {
            text += &format!(
                "probability claimed for a named effect: {} claims, calibration error {error:.3}, Brier score {brier:.3}\n",
                self.claims()
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
        assert_eq!(Reliability::default().calibration_error(), None);
    }
}
