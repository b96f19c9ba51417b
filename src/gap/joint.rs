//! The normal posterior of the unknowns that all recordings share, and the prior contained in it. Fleets are pooled from these.
//!
//! With H the precision and m the mode of the posterior, and P and c the precision and the centre of the prior, the information of the recordings alone is, in canonical form,
//! N⁻¹(H m − P c, H − P). Forms of the effects, and a law that is missing beside them, are eliminated from H, as from every fit of the posterior.

use super::answer::{Joint, Real, SameAs, Unknown};
use super::infer::coordinate::Coordinate;
use super::infer::density::Problem;
use super::infer::linear::{Frame, assemble};
use super::verdict::Conclusion;
use crate::effects::PARAMETERS;

/// The joint posterior of the explanation that stands; none if its curvature is not positive definite.
pub fn joint(problem: &Problem, conclusion: &Conclusion) -> Option<Joint> {
    let explanation = &conclusion.explanation;
    let fit = explanation.fit.as_ref()?;
    // The normal equations without any recording are those of the prior.
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
