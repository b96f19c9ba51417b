//! The normal posterior of what all recordings share, and the prior that is in it: what a fleet is pooled from.
//!
//! With H the posterior's precision, m its mode, P and c those of the prior, the recordings alone say N⁻¹(H m − P c, H − P). Forms of the
//! effects, and a law that is missing beside them, are eliminated from H, as from every fit that the posterior holds.

use super::answer::{Joint, Real, SameAs, Unknown};
use super::infer::coordinate::Coordinate;
use super::infer::density::Problem;
use super::infer::linear::{Frame, assemble};
use super::verdict::Conclusion;
use crate::effects::PARAMETERS;

/// That of the explanation that stands; none if its curvature is not positive.
pub fn joint(problem: &Problem, conclusion: &Conclusion) -> Option<Joint> {
    let explanation = &conclusion.explanation;
    let fit = explanation.fit.as_ref()?;
    // A prior is what is assembled of no recordings.
    let prior = assemble(&fit.point, &Frame { shared: fit.shared.clone(), own: Vec::new() }, &[], 0.0)?.curvature;
    let covariance = fit.covariance()?;
    let car = problem.car(&fit.point, None);
    let unknown = |&c: &Coordinate| {
        let (value, centre) = (Real(c.get(&fit.point, 0)), Real(c.centre()));
        match c {
            Coordinate::Shared(n) => {
                let n = &problem.shared[n];
                Unknown {
                    name: n.name.clone(),
                    kind: if n.declared { "tolerance" } else { "logger" },
                    value,
                    centre,
                    unit: None,
                    sigma: Some(Real(n.sigma)),
                    relative: n.relative,
                    one_sided: n.one_sided,
                    same_as: n.same_as(&car).map(|(p, rate)| SameAs { parameter: PARAMETERS[p].variable, per_sigma: Real(rate) }),
                }
            }
            Coordinate::Effect(p) => Unknown {
                name: PARAMETERS[p].variable.to_owned(),
                kind: "effect",
                value,
                centre,
                unit: Some(PARAMETERS[p].unit),
                sigma: None,
                relative: false,
                one_sided: false,
                same_as: None,
            },
            Coordinate::Missing(_) | Coordinate::Own(_) => unreachable!("functions are eliminated, and own unknowns are not shared"),
        }
    };
    let lower = |i: usize| (0..=i).map(move |j| (i, j));
    Some(Joint {
        unknowns: fit.shared.iter().map(unknown).collect(),
        precision: (0..fit.shared.len()).map(|i| lower(i).map(|at| Real(fit.curvature[at])).collect()).collect(),
        precision_exact: (0..fit.shared.len()).map(|i| lower(i).map(|at| Real(fit.exact[at])).collect()).collect(),
        covariance: (0..fit.shared.len()).map(|i| lower(i).map(|at| Real(covariance[at])).collect()).collect(),
        prior_precision: (0..fit.shared.len())
            .flat_map(lower)
            .map(|(i, j)| (i, j, prior[(i, j)]))
            .filter(|entry| entry.2 != 0.0)
            .map(|(i, j, value)| (i, j, Real(value)))
            .collect(),
    })
}
