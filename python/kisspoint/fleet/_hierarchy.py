"""A normal population whose members are each known by a normal likelihood, and some of whose members are outliers.

Member i has J numbers x_i, in standard deviations of the prior knowledge about them. Its recordings give the likelihood

    L_i(x) ∝ exp(h_iᵀ x − ½ xᵀ D_i x),                                                                   (1)

which may be flat in some directions. The population model is

    x_ij ~ N(b_jᵀ c_i, τ_j²), or N(b_jᵀ c_i, τ_j² + ω²) with probability π,                              (2)

where c_i consists of 1 and the covariates of the member's mean (mileage, date). With m = B c and V the variances of one choice of outliers, the evidence of the member is

    ln Z = hᵀm − ½ mᵀDm + ½ rᵀV^½ K⁻¹ V^½ r − ½ ln det K,    r = h − Dm,    K = 1 + V^½ D V^½,           (3)

and its numbers are N(m + V^½ K⁻¹ V^½ r, V^½ K⁻¹ V^½). B, τ, π and ω maximise their posterior (empirical Bayes), and their intervals are Laplace's: the curvature of the
log posterior at the maximum, by finite differences of its exact gradient. Weak priors keep parameters within reason about which the members say nothing.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy.special import expit, log_expit, logsumexp

Array = NDArray[np.float64]

MEAN_SD = 30.0
"""Prior standard deviation of means and slopes: effects of the library reach some tens of tolerances."""
LOG_SPREAD_SD = 1.5
"""Prior standard deviation of ln τ around 0, the value that the tolerances state: 95 % of spreads lie between 1/20 and 20 times the tolerances."""
OFF_PRIOR = 0.01
OFF_SD = 1.5
"""Prior of π: in ln (odds), centred on the diagnosis's own prior of an effect, with a standard deviation of a factor of 4.5."""
LOG_WIDTH = np.log(10.0)
LOG_WIDTH_SD = 0.7
"""Prior of ln ω: outlying numbers are off by about ten tolerances."""
CANDIDATE = 3.0
"""Nats by which "off" may trail "not off" for a number to be weighed again at every step; the others keep the ratio that they had at the start."""
MOST = 3
"""Largest number of outlying numbers of one member: as many as a diagnosis names effects."""

BLOCK = 1000
"""Number of choices that are processed at a time; their matrices take some tens of megabytes."""


@dataclass
class Members:
    """Likelihoods of N members, J numbers, and C covariates, of which the first is 1."""

    information: Array
    """h, N × J."""
    precision: Array
    """D, N × J × J, positive semidefinite."""
    covariates: Array
    """N × C."""


@dataclass
class Population:
    """The inferred population, in the members' units."""

    means: Array
    """B, J × C."""
    means_sd: Array
    spreads: Array
    """τ, J."""
    spreads_interval: Array
    """95 % interval of τ, J × 2."""
    off: float
    """π."""
    width: float
    """ω."""
    covariance: Array
    """Covariance of (B row by row, ln τ, logit π, ln ω)."""
    values: Array
    """Shrunk numbers of every member, N × J."""
    values_sd: Array
    offs: Array
    """Probability that a number of a member is an outlier, N × J."""


class _Evaluated(NamedTuple):
    log: Array
    """ln Z of (3) for each choice."""
    values: Array
    variances: Array
    """Posterior mean and variances of the member's numbers."""
    slope: Array
    by_variance: Array
    """Derivatives of (3) with respect to the population's mean and variances."""


class _Model:
    def __init__(self, members: Members, robust: bool) -> None:
        self.h, self.D, self.c = members.information, members.precision, members.covariates
        self.N, self.J = self.h.shape
        self.C = self.c.shape[1]
        self.robust = robust
        # Choices of outlying numbers: the member and the numbers that are off; at first one choice per member, with no outlier.
        self.member = np.arange(self.N)
        self.choice = np.zeros((self.N, self.J), bool)
        self.candidate = np.zeros((self.N, self.J), bool)
        self.ratio = np.full((self.N, self.J), -np.inf)

    def start(self) -> Array:
        """Initial means and spreads, estimated from the members that are known best."""
        diagonal = np.einsum("njj->nj", self.D)
        mean = np.zeros((self.J, self.C))
        log_spread = np.zeros(self.J)
        precise = np.linalg.solve(self.D + np.eye(self.J) * 0.01, self.h[..., None])[..., 0]
        for j in range(self.J):
            known = precise[diagonal[:, j] > 0.1, j]
            if len(known) >= 3:
                mean[j, 0] = np.median(known)
                log_spread[j] = np.log(max(1.4826 * np.median(np.abs(known - mean[j, 0])), 0.1))
        return np.concatenate([mean.ravel(), np.clip(log_spread, -2, 2), [np.log(OFF_PRIOR / (1 - OFF_PRIOR)), LOG_WIDTH]])

    def split(self, theta: Array) -> tuple[Array, Array, float, float]:
        k = self.J * self.C
        return theta[:k].reshape(self.J, self.C), np.exp(theta[k : k + self.J]), float(theta[-2]), float(np.exp(theta[-1]))

    def evaluate(self, theta: Array, member: NDArray[np.int_], choice: NDArray[np.bool_]) -> "_Evaluated":
        """Evaluates (3) for each choice, in blocks, because the matrices of several thousand members would take gigabytes."""
        blocks = [self.block(theta, member[k : k + BLOCK], choice[k : k + BLOCK]) for k in range(0, len(member), BLOCK)]
        return _Evaluated(*(np.concatenate(one) for one in zip(*blocks, strict=True)))

    def block(self, theta: Array, member: NDArray[np.int_], choice: NDArray[np.bool_]) -> tuple[Array, ...]:
        B, spread, _, width = self.split(theta)
        h, D = self.h[member], self.D[member]
        m = self.c[member] @ B.T
        root = np.sqrt(spread**2 + choice * width**2)
        r = h - np.einsum("nij,nj->ni", D, m)
        K = np.eye(self.J) + root[:, :, None] * D * root[:, None, :]
        L = np.linalg.cholesky(K)
        inverse = np.linalg.inv(K)
        y = np.einsum("nij,nj->ni", inverse, root * r)
        log = (
            np.einsum("nj,nj->n", h, m)
            - 0.5 * np.einsum("nj,nj->n", m, h - r)
            + 0.5 * np.einsum("nj,nj->n", root * r, y)
            - np.log(np.einsum("njj->nj", L)).sum(axis=1)
        )
        x, cov = m + root * y, root[:, :, None] * inverse * root[:, None, :]
        slope = h - np.einsum("nij,nj->ni", D, x)
        # Derivative of (3) with respect to a variance: half of (squared slope − precision of the observed quantity).
        gram = np.einsum("njj->nj", D) - np.einsum("nji,nij->nj", D @ cov, D)
        return log, x, np.einsum("njj->nj", cov), slope, 0.5 * (slope**2 - gram)

    def choose(self, theta: Array) -> None:
        """Lists the choices of outliers that are worth weighing at these parameters."""
        everybody = np.arange(self.N)
        none = np.zeros((self.N, self.J), bool)
        log = self.evaluate(theta, everybody, none).log
        for j in range(self.J):
            single = none.copy()
            single[:, j] = True
            self.ratio[:, j] = self.evaluate(theta, everybody, single).log - log
        self.candidate = self.ratio > theta[-2] * -1 - CANDIDATE
        # From these, the most likely ones are added one after the other: the best, the best in addition to it, and so on.
        chosen, here = [none], none.copy()
        log_here = log
        for _ in range(MOST):
            best, gain = np.full(self.N, -1), np.full(self.N, -np.inf)
            for j in range(self.J):
                who = np.flatnonzero(self.candidate[:, j] & ~here[:, j])
                if len(who) == 0:
                    continue
                tried = here[who].copy()
                tried[:, j] = True
                value = self.evaluate(theta, who, tried).log - log_here[who]
                better = value > gain[who]
                best[who[better]], gain[who[better]] = j, value[better]
            found = best >= 0
            if not found.any():
                break
            here = here.copy()
            here[np.flatnonzero(found), best[found]] = True
            log_here = np.where(found, log_here + np.where(found, gain, 0.0), log_here)
            chosen.append(here)
        members, choices = [everybody], [none]
        for j in range(self.J):
            who = np.flatnonzero(self.candidate[:, j])
            single = np.zeros((len(who), self.J), bool)
            single[:, j] = True
            members.append(who)
            choices.append(single)
        for many in chosen[2:]:
            who = np.flatnonzero(many.sum(axis=1) >= 2)
            members.append(who)
            choices.append(many[who])
        pairs = np.unique(np.column_stack([np.concatenate(members), np.concatenate(choices).astype(int)]), axis=0)
        self.member, self.choice = pairs[:, 0], pairs[:, 1:].astype(bool)

    def weights(self, theta: Array, log: Array) -> tuple[Array, Array]:
        """Log evidence of each member, and the share of each choice in it."""
        logit = theta[-2]
        candidates = self.candidate[self.member].sum(axis=1)
        picked = self.choice.sum(axis=1)
        prior = picked * log_expit(logit) + (candidates - picked) * log_expit(-logit)
        total = log + prior
        most = np.full(self.N, -np.inf)
        np.maximum.at(most, self.member, total)
        share = np.exp(total - most[self.member])
        whole = np.bincount(self.member, share, self.N)
        # A number that is not a candidate is off or not with the odds that it had at the start.
        rest = np.where(self.candidate, 0.0, np.logaddexp(log_expit(-logit), log_expit(logit) + self.ratio)) if self.robust else np.zeros((self.N, self.J))
        return most + np.log(whole) + rest.sum(axis=1), share / whole[self.member]

    def objective(self, theta: Array) -> tuple[float, Array]:
        """Negative log posterior of the parameters, and its gradient."""
        _, spread, logit, width = self.split(theta)
        found = self.evaluate(theta, self.member, self.choice)
        evidence, weight = self.weights(theta, found.log)
        by_variance = found.by_variance * weight[:, None]
        by_mean = np.einsum("nj,nc->jc", found.slope * weight[:, None], self.c[self.member])
        by_spread = by_variance.sum(axis=0) * 2 * spread**2
        by_width = (by_variance * self.choice).sum() * 2 * width**2
        p = expit(logit)
        picked, candidates = self.choice.sum(axis=1), self.candidate[self.member].sum(axis=1)
        by_logit = (weight * (picked - candidates * p)).sum()
        if self.robust:
            ratio = np.exp(np.clip(self.ratio, -700, 700))
            by_logit += np.where(self.candidate, 0.0, p * (1 - p) * (ratio - 1) / (1 - p + p * ratio)).sum()
        k = self.J * self.C
        prior_value, prior = self.prior(theta)
        gradient = np.concatenate([by_mean.ravel(), by_spread, [by_logit, by_width]])
        assert len(gradient) == k + self.J + 2
        return -(evidence.sum() + prior_value), -(gradient + prior)

    def prior(self, theta: Array) -> tuple[float, Array]:
        k = self.J * self.C
        centre = np.zeros_like(theta)
        sd = np.concatenate([np.full(k, MEAN_SD), np.full(self.J, LOG_SPREAD_SD), [OFF_SD, LOG_WIDTH_SD]])
        centre[-2], centre[-1] = np.log(OFF_PRIOR / (1 - OFF_PRIOR)), LOG_WIDTH
        z = (theta - centre) / sd
        return -0.5 * float(z @ z), -z / sd


def fit(members: Members, robust: bool = True, taught_by: NDArray[np.bool_] | None = None) -> Population:
    """Fits the population to these members, or only to those in `taught_by`; estimates are returned for all. Without `robust`, no member is an outlier."""
    teach = members if taught_by is None or taught_by.all() else _of(members, taught_by)
    model = _Model(teach, robust)
    theta = model.start()
    bounds = [(None, None)] * (model.J * model.C) + [(-6.0, 5.0)] * model.J + [(-9.0, 0.0), (0.7, 4.5)]
    for _ in range(3 if robust else 1):
        if robust:
            model.choose(theta)
        found = optimize.minimize(model.objective, theta, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 300, "ftol": 1e-11, "gtol": 1e-6})
        theta = found.x
    if robust:
        model.choose(theta)
    covariance = np.asarray(np.linalg.inv(_positive(_hessian(model, theta))), np.float64)
    sd = np.sqrt(np.diag(covariance))
    k = model.J * model.C
    B, spread, logit, width = model.split(theta)
    log_spread = theta[k : k + model.J]
    interval = np.exp(log_spread[:, None] + np.array([-1.96, 1.96]) * sd[k : k + model.J, None])
    if teach is not members:
        model = _Model(members, robust)
        if robust:
            model.choose(theta)
    values, values_sd, offs = _members(model, theta)
    return Population(B, sd[:k].reshape(B.shape), spread, np.asarray(interval, np.float64), float(expit(logit)), width, covariance, values, values_sd, offs)


def given(members: Members, population: Population, spreads: Array) -> tuple[Array, Array]:
    """Numbers of every member and their standard deviations, if the population had these spreads."""
    off = np.clip(population.off, 1e-9, 1 - 1e-9)
    theta = np.concatenate([population.means.ravel(), np.log(spreads), [np.log(off / (1 - off)), np.log(population.width)]])
    model = _Model(members, True)
    model.choose(theta)
    values, sd, _ = _members(model, theta)
    return values, sd


def _of(members: Members, which: NDArray[np.bool_]) -> Members:
    return Members(members.information[which], members.precision[which], members.covariates[which])


def _hessian(model: _Model, theta: Array) -> Array:
    step = 1e-4
    rows = []
    for k in range(len(theta)):
        move = np.zeros_like(theta)
        move[k] = step
        rows.append((model.objective(theta + move)[1] - model.objective(theta - move)[1]) / (2 * step))
    hessian = np.array(rows)
    return 0.5 * (hessian + hessian.T)


def _positive(matrix: Array) -> Array:
    """Replaces the curvature of flat directions by that of a prior, so that an inverse exists."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.maximum(values, MEAN_SD**-2)) @ vectors.T)


def _members(model: _Model, theta: Array) -> tuple[Array, Array, Array]:
    found = model.evaluate(theta, model.member, model.choice)
    x = found.values
    _, weight = model.weights(theta, found.log)
    values, second, offs = (np.zeros((model.N, model.J)) for _ in range(3))
    np.add.at(values, model.member, weight[:, None] * x)
    np.add.at(second, model.member, weight[:, None] * (x**2 + found.variances))
    np.add.at(offs, model.member, weight[:, None] * model.choice)
    if model.robust:
        logit = theta[-2]
        offs = np.where(model.candidate, offs, expit(logit + model.ratio))
    return values, np.sqrt(np.maximum(second - values**2, 0.0)), offs


def shares(evidence: list[dict[tuple[str, ...], float]], prior_odds: float) -> tuple[dict[str, tuple[float, float, float]], list[dict[str, float]]]:
    """Shares of members that have a property (mean, 2.5 %, 97.5 %), and each member's probability of having it, given all members.

    The members' probabilities of sets of properties were computed with prior odds of `prior_odds` for each property; these odds are replaced by those of the population.
    The prior of a share is a Beta distribution with mean `prior_odds` / (1 + `prior_odds`) and the weight of `PRIOR_MEMBERS` members. The interval of a share keeps the
    other shares at their estimates.
    """
    names = sorted({name for one in evidence for chosen in one for name in chosen})
    place = {name: k for k, name in enumerate(names)}
    if not names:
        return {}, [{} for _ in evidence]
    member = np.concatenate([np.full(len(one), i) for i, one in enumerate(evidence)]).astype(int)
    sets = [chosen for one in evidence for chosen in one]
    log = np.log(np.maximum([p for one in evidence for p in one.values()], 1e-300))
    holds = np.zeros((len(sets), len(names)))
    for s, chosen in enumerate(sets):
        holds[s, [place[name] for name in chosen]] = 1.0
    n = len(evidence)
    mean = prior_odds / (1 + prior_odds)
    a, b = PRIOR_MEMBERS * mean, PRIOR_MEMBERS * (1 - mean)
    share = np.full(len(names), mean)

    def weigh(share: Array) -> Array:
        total = log + holds @ (np.log(share / (1 - share)) - np.log(prior_odds))
        most = np.full(n, -np.inf)
        np.maximum.at(most, member, total)
        part = np.exp(total - most[member])
        return np.asarray(part / np.bincount(member, part, n)[member])

    for _ in range(500):
        counts = weigh(share) @ holds
        new = (counts + a) / (n + PRIOR_MEMBERS)
        moved = np.abs(np.log(new / share)).max()
        share = new
        if moved < 1e-6:
            break
    weight = weigh(share)
    probabilities = np.zeros((n, len(names)))
    np.add.at(probabilities, member, weight[:, None] * holds)
    result = {}
    for name, k in place.items():
        p = np.clip(probabilities[:, k], 1e-300, 1 - 1e-16)
        odds = np.log(p) - np.log1p(-p) - np.log(share[k] / (1 - share[k]))
        # On a grid of ln (share), which also resolves the posterior of a share near zero.
        grid = np.linspace(np.log(1e-8), np.log(1 - 1e-6), 2000)
        pi = np.exp(grid)
        posterior = np.logaddexp(np.log1p(-pi)[:, None], grid[:, None] + odds[None, :]).sum(axis=1) if n <= 2000 else _in_parts(grid, pi, odds)
        posterior = posterior + a * grid + (b - 1) * np.log1p(-pi)
        mass = np.exp(posterior - logsumexp(posterior))
        below = np.cumsum(mass)
        low, high = (float(pi[min(int(np.searchsorted(below, q)), len(pi) - 1)]) for q in (0.025, 0.975))
        result[name] = (float(mass @ pi), low, high)
    return result, [{name: float(probabilities[i, k]) for name, k in place.items() if probabilities[i, k] > 1e-3} for i in range(n)]


PRIOR_MEMBERS = 10.0
"""Weight of the prior of a share, in members."""


def _in_parts(grid: Array, pi: Array, odds: Array) -> Array:
    total = np.zeros(len(grid))
    for part in np.array_split(odds, max(1, len(odds) // 2000)):
        total += np.logaddexp(np.log1p(-pi)[:, None], grid[:, None] + part[None, :]).sum(axis=1)
    return total
