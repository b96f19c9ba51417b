"""What one car's answer says about the numbers of its vehicle file and the effects: the likelihood, which is its posterior with the prior divided out."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ._table import Row

Array = NDArray[np.float64]


@dataclass
class Told:
    """The likelihood of one car, as input of the hierarchy."""

    names: list[str]
    """Names of the numbers: the name of a tolerance, or of several tolerances that act alike, joined by " × "."""
    h: Array
    D: Array
    exact: tuple[Array, Array]
    """h and D for exact laws, whose only uncertainty is noise."""
    inexact: Array
    """Variance of each number due to the inaccuracy of the laws."""


@dataclass
class Group:
    """Cars of one vehicle file."""

    file: str
    members: list[Row] = field(default_factory=list)
    """campaign, name, mileage_km, date, report."""
    told: list[Told] = field(default_factory=list)
    sigma: dict[str, tuple[float, bool, str]] = field(default_factory=dict)
    """For each number: its standard deviation, whether that of the logarithm, and its kind."""
    parts: dict[str, dict[str, float]] = field(default_factory=dict)
    """For each number: its tolerances, and the share of a shift that each takes."""
    stood_for: set[str] = field(default_factory=set)
    """Effects that act like a number, and are reported as that number."""
    effects: dict[str, list[tuple[int, Array, Array]]] = field(default_factory=dict)
    """By effect: index of the member, and its likelihood of the parameters that are not numbers of the vehicle file, in their sizes."""
    parameters: dict[str, list[tuple[str, str, float, float]]] = field(default_factory=dict)
    """By effect: variable, unit, prior centre and size of each of these parameters."""
    evidence: list[dict[tuple[str, ...], float]] = field(default_factory=list)


def matrices(row: Row) -> tuple[Array, Array, Array, Array]:
    """Mode, posterior precision, posterior precision for exact laws, and prior precision of a row's unknowns."""
    unknowns = row["unknowns"]
    n = len(unknowns)
    H, E, P = np.zeros((3, n, n))
    H[np.tril_indices(n)] = row["precision"]
    E[np.tril_indices(n)] = row["precision_exact"]
    for entry in row["prior_precision"]:
        P[entry["row"], entry["column"]] = entry["value"]
    H, E, P = (m + np.tril(m, -1).T for m in (H, E, P))
    return np.array([u["value"] for u in unknowns]), H, E, P


def read(unknowns: list[Row], mode: Array, H: Array, E: Array, P: Array, group: Group) -> tuple[Told, dict[str, tuple[Array, Array]]]:
    """The likelihood of the numbers, and of the remaining parameters of each effect.

    Posterior and prior are transformed to the sums u of unknowns that act alike, and the likelihood is their quotient. This is valid for any sums, whatever else is free,
    because the posterior of u is its prior times the probability of the recordings given u.
    """
    by_parameter: dict[str, list[int]] = {}
    rows: list[tuple[str, dict[int, float], float]] = []
    effect_of = {u["name"]: k for k, u in enumerate(unknowns) if u["kind"] == "effect"}
    for k, u in enumerate(unknowns):
        if u["kind"] == "effect" or u["one_sided"]:
            continue
        by_parameter.setdefault(u["same_as"] or u["name"], []).append(k)
        if u["same_as"]:
            group.stood_for.add(u["same_as"].split(".")[1])
    taken = set()
    for parameter, members in by_parameter.items():
        name = " × ".join(unknowns[k]["name"] for k in members)
        sigmas = np.array([unknowns[k]["sigma"] for k in members])
        relative = all(unknowns[k]["relative"] for k in members)
        # If only one number is shifted, the unit is its own standard deviation.
        rates = sigmas if relative or unknowns[members[0]]["per_sigma"] is None else np.array([unknowns[k]["per_sigma"] for k in members])
        whole = float(np.linalg.norm(rates))
        weights = {k: float(rate / whole) for k, rate in zip(members, rates, strict=True)}
        value = sum(weight * mode[k] for k, weight in weights.items())
        e = effect_of.get(parameter)
        if e is not None:
            taken.add(e)
            factor = relative and unknowns[e]["centre"] == 1.0
            if factor:
                # A factor is shifted in its logarithm, as the tolerance is.
                value += np.log(mode[e]) / whole
                weights[e] = 1.0 / (mode[e] * whole)
            else:
                per = float(np.linalg.norm([unknowns[k]["per_sigma"] for k in members]))
                value += (mode[e] - unknowns[e]["centre"]) / per
                weights[e] = 1.0 / per
        rows.append((name, weights, value))
        kind = "tolerance" if any(unknowns[k]["kind"] == "tolerance" for k in members) else "logger"
        unit = float(np.linalg.norm(sigmas))
        group.sigma.setdefault(name, (unit, relative, kind))
        group.parts.setdefault(name, {unknowns[k]["name"]: float(s / unit) for k, s in zip(members, sigmas, strict=True)})
    sums, values, centres = [row[1] for row in rows], np.array([row[2] for row in rows]), np.zeros(len(rows))
    told, exact = _likelihood(sums, values, centres, H, E, P)
    T = _matrix(sums, len(H))
    inexact = np.maximum(np.einsum("ij,ji->i", T, np.linalg.solve(H, T.T) - np.linalg.solve(E, T.T)), 0.0)
    effects: dict[str, list[int]] = {}
    for name, k in effect_of.items():
        if k not in taken:
            effects.setdefault(name.split(".")[1], []).append(k)
    left = {}
    for effect, places in effects.items():
        sizes = [float(P[k, k] ** -0.5) for k in places]
        group.parameters.setdefault(effect, [(unknowns[k]["name"], unknowns[k]["unit"] or "", unknowns[k]["centre"], s) for k, s in zip(places, sizes, strict=True)])
        centres = np.array([unknowns[k]["centre"] for k in places])
        left[effect] = _likelihood([{k: 1 / s} for k, s in zip(places, sizes, strict=True)], (mode[places] - centres) / sizes, np.zeros(len(places)), H, E, P)[0]
    return Told([row[0] for row in rows], *told, exact, inexact), left


def _matrix(weights: list[dict[int, float]], n: int) -> Array:
    """Matrix whose rows are sums of n unknowns."""
    T = np.zeros((len(weights), n))
    for i, one in enumerate(weights):
        T[i, list(one)] = list(one.values())
    return T


def _likelihood(weights: list[dict[int, float]], value: Array, centre: Array, H: Array, E: Array, P: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """h and D for sums of unknowns, and the same for exact laws. The mode is that for exact laws; less confidence in the laws widens the likelihood around the same mode."""
    h, D = _quotient(weights, value, centre, E, P)
    wider = _quotient(weights, value, centre, H, P)[1]
    return (np.asarray(wider @ np.linalg.pinv(D, rcond=1e-9, hermitian=True) @ h), wider), (h, D)


def _quotient(weights: list[dict[int, float]], value: Array, centre: Array, H: Array, P: Array) -> tuple[Array, Array]:
    """h and D of the quotient posterior / prior for sums of unknowns."""
    T = _matrix(weights, len(H))
    posterior = np.linalg.inv(T @ np.linalg.solve(H, T.T))
    prior = np.linalg.inv(T @ np.linalg.solve(P, T.T))
    D = posterior - prior
    values, vectors = np.linalg.eigh(0.5 * (D + D.T))
    # Eigenvalues below rounding errors carry no information.
    kept = np.maximum(values, 0.0) * (values > 1e-6 * np.abs(values).max(initial=0.0))
    h = posterior @ value - prior @ centre
    basis = vectors[:, kept > 0]
    return basis @ (basis.T @ h), np.asarray((vectors * kept) @ vectors.T)
