"""Properties that the cars of a fleet share: the numbers of their vehicle file, the effects, and how both drift with mileage and date.

Each car's answer contains a normal posterior of the numbers and of the parameters of the named effects, and the prior. The prior is divided out (`_told`), and the
resulting likelihoods, which state what each car's recordings say, are pooled by `_hierarchy`. Numbers and effect parameters that act alike on a car are added up first,
because a kiss point that is off in every car may be named as an effect in some of them and attributed to a tolerance in others.
"""

import datetime
import json
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.stats import norm

from .. import _command
from . import _hierarchy
from ._store import Place
from ._table import Row
from ._told import Array, Group, matrices, read

POOLED = 20_000
"""Number of cars of one vehicle file that are pooled. Of a larger number only every n-th car is taken, and the others get no shrunk estimates."""
LEAST = 3
"""Smallest number of cars for which a population is inferred."""
PRIOR_ODDS = 0.01 / 0.99
"""Prior odds of an effect in each car's answer (docs/diagnosis.md)."""
FAMILY_WISE = 0.05
"""Family-wise error rate (Holm) of the numbers reported as off, and likewise of the reported drifts."""
OFF = 0.5
"""Probability from which a car counts as an outlier."""
SLOPE_LEAST = 8
"""Smallest number of cars with a mileage or date for which a drift is inferred."""

_COLUMNS = ["campaign", "name", "mileage_km", "date", "error", "explanations", "unknowns", "precision", "precision_exact", "prior_precision", "vehicle", "vehicle_file", "report"]


def groups(file: Place) -> tuple[dict[str, Group], dict[str, int]]:
    """Rows of a fleet by vehicle file, and the numbers of campaigns, errors and answers without a posterior."""
    parquet = pq.ParquetFile(file.path, filesystem=file.fs)
    counts = {"campaigns": 0, "errors": 0, "without_posterior": 0}
    each = max(1, -(-parquet.metadata.num_rows // POOLED))
    found: dict[str, Group] = {}
    for batch in parquet.iter_batches(batch_size=512, columns=_COLUMNS):
        for row in batch.to_pylist():
            counts["campaigns"] += 1
            if row["error"] is not None:
                counts["errors"] += 1
                continue
            if not row["unknowns"]:
                counts["without_posterior"] += 1
                continue
            if counts["campaigns"] % each:
                continue
            group = found.setdefault(row["vehicle"], Group(row["vehicle_file"]))
            _add(group, row)
    return found, counts


def _add(group: Group, row: Row) -> None:
    told, effects = read(row["unknowns"], *matrices(row), group)
    k = len(group.members)
    group.members.append({key: row[key] for key in ("campaign", "name", "mileage_km", "date", "report")})
    group.told.append(told)
    for effect, (h, D) in effects.items():
        group.effects.setdefault(effect, []).append((k, h, D))
    sets: dict[tuple[str, ...], float] = {}
    for one in row["explanations"]:
        law = [f"a law missing in {one['missing_law']}"] if one["missing_law"] else []
        chosen = tuple(sorted(one["effects"]) + law)
        sets[chosen] = sets.get(chosen, 0.0) + (one["probability"] or 0.0)
    group.evidence.append(sets)


@dataclass
class Covariate:
    """A covariate of the means."""

    name: str
    unit: str
    centre: float
    scale: float
    values: Array
    """Standardised values; 0 where a car's value is unknown."""
    known: Array
    """Whether each car's value is known."""


def covariates(members: list[Row]) -> list[Covariate]:
    """Mileage and date, each if enough cars state it."""
    found = []
    days = [None if m["date"] is None else float(m["date"].toordinal()) for m in members]
    for name, unit, raw in (("mileage_km", "1000 km", [m["mileage_km"] for m in members]), ("date", "year", days)):
        known = np.array([v is not None for v in raw])
        values = np.array([np.nan if v is None else float(v) for v in raw])
        if known.sum() < SLOPE_LEAST or np.std(values[known]) == 0:
            continue
        centre, scale = float(values[known].mean()), float(values[known].std())
        found.append(Covariate(name, unit, centre, scale, np.where(known, (values - centre) / scale, 0.0), known))
    # If both are strongly correlated, their influences cannot be separated.
    if len(found) == 2 and abs(np.corrcoef(found[0].values, found[1].values)[0, 1]) > 0.95:
        found.pop()
    return found


def infer(file: Place) -> tuple[dict[str, Any], pa.Table, dict[str, tuple[dict[str, Any], dict[str, Any] | None]]]:
    """fleet.json; shrunk estimates of every car and number; and for each vehicle file its corrections and the corrected document."""
    found, counts = groups(file)
    populations: list[dict[str, Any]] = []
    estimates, vehicles = [], {}
    for digest, group in sorted(found.items(), key=lambda item: -len(item[1].members)):
        if len(group.members) < LEAST:
            populations.append({"vehicle": digest, "cars": len(group.members), "note": f"fewer than {LEAST} cars are no population"})
            continue
        population, rows = _one(digest, group)
        populations.append(population)
        estimates.append(pa.Table.from_pylist(rows, ESTIMATES))
        corrections = _corrections(population, group)
        vehicles[digest] = (corrections, _corrected(group.file, corrections))
    first: dict[str, Any] = next((p for p in populations if "numbers" in p), {"numbers": [], "effects": [], "outliers": []})
    summary = {
        "schema": "kisspoint-fleet/1",
        **counts,
        "pooled": sum(p["cars"] for p in populations),
        **{key: first[key] for key in ("numbers", "effects", "outliers")},
        "populations": populations,
    }
    return summary, pa.concat_tables(estimates) if estimates else ESTIMATES.empty_table(), vehicles


ESTIMATES = pa.schema(
    {
        "campaign": pa.string(),
        "name": pa.string(),
        "vehicle": pa.string(),
        "number": pa.string(),  # or an effect's parameter
        "value": pa.float64(),  # departure from the vehicle file, in `unit`
        "sd": pa.float64(),
        "alone": pa.float64(),  # estimate from the car's own recordings alone; null if they say next to nothing
        "unit": pa.string(),
        "off": pa.float64(),  # probability that it is an outlier
    }
)
"""Columns of cars.parquet."""


def _unit(name: str, group: Group) -> tuple[float, str]:
    """Factor to a unit for display, and that unit."""
    sigma, relative, _ = group.sigma[name]
    return (100.0 * sigma, "%") if relative else (sigma, "")


def _one(digest: str, group: Group) -> tuple[dict[str, Any], list[Row]]:
    names = list(dict.fromkeys(name for told in group.told for name in told.names))
    n, J = len(group.members), len(names)
    h, D, inexact = np.zeros((2, n, J)), np.zeros((2, n, J, J)), np.full((n, J), np.nan)
    for i, told in enumerate(group.told):
        at = [names.index(name) for name in told.names]
        for which, (own_h, own_D) in enumerate(((told.h, told.D), told.exact)):
            h[which, i, at] = own_h
            D[which][np.ix_([i], at, at)] = own_D
        inexact[i, at] = told.inexact
    drift = covariates(group.members)
    c = np.column_stack([np.ones(n), *(one.values for one in drift)])
    teach = _teach(group)
    members = [_hierarchy.Members(h[which], D[which], c) for which in (0, 1)]
    fitted, exact = (_hierarchy.fit(one, taught_by=teach) for one in members)
    _allow_for_inexact_laws(fitted, exact, np.nanmedian(inexact, axis=0))
    # Estimates of the cars use the upper bound of each spread, because a spread that is underestimated by chance would make every car seem known too well.
    fitted.values, fitted.values_sd = _hierarchy.given(members[0], fitted, fitted.spreads_interval[:, 1])
    h, D = h[0], D[0]
    numbers = [_number(j, name, group, fitted, D[:, j, j], drift) for j, name in enumerate(names)]
    _mark(numbers)
    shares, likely = _hierarchy.shares(group.evidence, PRIOR_ODDS)
    rows = list(_estimates(digest, names, group, fitted, h, D))
    effects: list[dict[str, Any]] = []
    for effect, (share, low, high) in sorted(shares.items(), key=lambda item: -item[1][0]):
        who = [i for i, one in enumerate(likely) if one.get(effect, 0.0) > OFF]
        entry: dict[str, Any] = {"effect": effect, "share": share, "low": low, "high": high, "cars": len(who), "parameters": []}
        if len(group.effects.get(effect, [])) >= LEAST:
            entry["parameters"], more = _sizes(digest, effect, group, drift)
            rows += more
        effects.append(entry)
    _holm([drift for one in effects for parameter in one["parameters"] for drift in parameter["drift"]], "slope", "significant")
    population = {
        "vehicle": digest,
        "cars": n,
        "covariates": [{"name": one.name, "unit": one.unit, "centre": _shown(one), "cars": int(one.known.sum())} for one in drift],
        "numbers": sorted(numbers, key=lambda one: -abs(one["mean"] / one["mean_sd"])),
        "effects": [one for one in effects if one["high"] > 0.02 or one["cars"]],
        "off": {"probability": fitted.off, "width": fitted.width},
        "outliers": _outliers(names, group, fitted, likely, shares),
    }
    return population, rows


def _teach(group: Group) -> NDArray[np.bool_]:
    """Cars whose numbers the population is fitted to: those in which no effect was named that does not stand for a number. The other cars only receive estimates,
    because an effect whose form differs from the library's biases the numbers beside it."""
    beyond = [sum(p for chosen, p in one.items() if not group.stood_for.issuperset(chosen)) for one in group.evidence]
    teach = np.array(beyond) <= OFF
    return teach if teach.sum() >= LEAST else np.ones(len(teach), bool)


def _allow_for_inexact_laws(fitted: _hierarchy.Population, exact: _hierarchy.Population, inexact: Array) -> None:
    """Allows for inexact laws. The variance that a car's answer includes for them is partly common to all cars, to an unknown degree. As far as it is common, many cars do not
    determine a mean better, and the observed scatter is a real difference between cars; as far as it is not, it is part of the scatter. Intervals cover both cases."""
    fitted.means_sd[:, 0] = np.hypot(fitted.means_sd[:, 0], np.sqrt(inexact))
    both = np.stack([fitted.spreads_interval, exact.spreads_interval])
    fitted.spreads_interval = np.column_stack([both[:, :, 0].min(axis=0), both[:, :, 1].max(axis=0)])
    fitted.spreads = np.sqrt(fitted.spreads * exact.spreads)


def _shown(one: Covariate) -> float | str:
    return datetime.date.fromordinal(round(one.centre)).isoformat() if one.name == "date" else one.centre


def _interval(mean: float, sd: float) -> dict[str, float]:
    return {"mean": mean, "mean_sd": sd, "low": mean - 1.96 * sd, "high": mean + 1.96 * sd}


def _slopes(j: int, fitted: _hierarchy.Population, factor: float, drift: list[Covariate]) -> list[dict[str, Any]]:
    out = []
    for k, one in enumerate(drift, start=1):
        per = {"mileage_km": 1000.0, "date": 365.25}[one.name] / one.scale
        slope, sd = fitted.means[j, k] * per * factor, fitted.means_sd[j, k] * per * factor
        out.append({"with": one.name, "per": one.unit, "slope": float(slope), "slope_sd": float(sd), "low": float(slope - 1.96 * sd), "high": float(slope + 1.96 * sd)})
    return out


def _number(j: int, name: str, group: Group, fitted: _hierarchy.Population, known: Array, drift: list[Covariate]) -> dict[str, Any]:
    sigma, relative, kind = group.sigma[name]
    return {
        "number": name,
        "kind": kind,
        "sigma": sigma,
        "relative": relative,
        "unit": "standard deviations of the tolerance",
        **_interval(float(fitted.means[j, 0]), float(fitted.means_sd[j, 0])),
        "spread": {"value": float(fitted.spreads[j]), "low": float(fitted.spreads_interval[j, 0]), "high": float(fitted.spreads_interval[j, 1])},
        "informed": float((known > 1.0).mean()),
        "drift": _slopes(j, fitted, 1.0, drift),
        "parts": group.parts[name],
    }


def _holm(rows: list[dict[str, Any]], what: str, mark: str) -> None:
    """Marks the rows whose value differs significantly from zero, by Holm's procedure over all of them."""
    rows = sorted(rows, key=lambda one: -abs(one[what] / one[f"{what}_sd"]))
    on = True
    for rank, one in enumerate(rows):
        on = on and 2 * norm.sf(abs(one[what] / one[f"{what}_sd"])) < FAMILY_WISE / (len(rows) - rank)
        one[mark] = bool(on)


def _mark(numbers: list[dict[str, Any]]) -> None:
    """Marks the numbers that are off in all cars, those that drift, and whether their tolerances match the spread of the cars."""
    _holm(numbers, "mean", "off")
    _holm([drift for one in numbers for drift in one["drift"]], "slope", "significant")
    for one in numbers:
        spread = one["spread"]
        one["tolerance"] = "too_wide" if spread["high"] < 1 else "too_narrow" if spread["low"] > 1 else "as_declared"


def _sizes(digest: str, effect: str, group: Group, drift: list[Covariate]) -> tuple[list[dict[str, Any]], list[Row]]:
    """Distribution of the size of an effect among the cars that have it."""
    which = [i for i, *_ in group.effects[effect]]
    J = len(group.parameters[effect])
    same = [(h, D) for _, h, D in group.effects[effect] if len(h) == J]
    h, D = np.array([one[0] for one in same]), np.array([one[1] for one in same])
    known = [one for one in drift if one.known[which].sum() >= SLOPE_LEAST]
    c = np.column_stack([np.ones(len(which)), *(one.values[which] for one in known)])
    fitted = _hierarchy.fit(_hierarchy.Members(h, D, c))
    out, rows = [], []
    for j, (variable, unit, centre, size) in enumerate(group.parameters[effect]):
        mean = _interval(centre + size * float(fitted.means[j, 0]), size * float(fitted.means_sd[j, 0]))
        low, high = size * fitted.spreads_interval[j]
        spread = {"value": size * float(fitted.spreads[j]), "low": float(low), "high": float(high)}
        out.append({"parameter": variable, "unit": unit, **mean, "spread": spread, "drift": _slopes(j, fitted, size, known)})
        for at, i in enumerate(which):
            own = float(h[at, j] / D[at, j, j]) * size + centre if D[at, j, j] > 0 and J == 1 else None
            rows.append(
                {
                    **_member(group.members[i], digest),
                    "number": variable,
                    "value": centre + size * float(fitted.values[at, j]),
                    "sd": size * float(fitted.values_sd[at, j]),
                    "alone": own,
                    "unit": unit,
                    "off": float(fitted.offs[at, j]),
                }
            )
    return out, rows


def _member(member: Row, digest: str) -> Row:
    return {"campaign": member["campaign"], "name": member["name"], "vehicle": digest}


def _estimates(digest: str, names: list[str], group: Group, fitted: _hierarchy.Population, h: Array, D: Array) -> Iterator[Row]:
    # Estimate of a single car, if its recordings determine a number independently of the others.
    weak = np.eye(len(names)) * 1e-3
    alone = np.linalg.solve(D + weak, h[..., None])[..., 0]
    alone_sd = np.sqrt(np.einsum("njj->nj", np.linalg.inv(D + weak)))
    for i, member in enumerate(group.members):
        for j, name in enumerate(names):
            factor, unit = _unit(name, group)
            yield {
                **_member(member, digest),
                "number": name,
                "value": factor * float(fitted.values[i, j]),
                "sd": factor * float(fitted.values_sd[i, j]),
                "alone": factor * float(alone[i, j]) if alone_sd[i, j] < 10 else None,
                "unit": unit,
                "off": float(fitted.offs[i, j]),
            }


def _outliers(
    names: list[str], group: Group, fitted: _hierarchy.Population, likely: list[dict[str, float]], shares: dict[str, tuple[float, float, float]]
) -> list[dict[str, Any]]:
    """Cars with an outlying number, or with an effect that most others lack."""
    out = []
    for i, member in enumerate(group.members):
        numbers = [
            {"number": name, "probability": float(fitted.offs[i, j]), "by": float(fitted.values[i, j] - fitted.means[j, 0])}
            for j, name in enumerate(names)
            if fitted.offs[i, j] > OFF
        ]
        effects = [{"effect": effect, "probability": p} for effect, p in likely[i].items() if p > OFF and shares[effect][0] < OFF and effect not in group.stood_for]
        if numbers or effects:
            out.append({"campaign": member["campaign"], "name": member["name"], "report": member["report"], "numbers": numbers, "effects": effects})
    return out


def _corrections(population: dict[str, Any], group: Group) -> dict[str, Any]:
    """Shifts and factors in the format of `kisspoint vehicle correct`: for numbers that are off in all cars, and for tolerances that the fleet contradicts."""
    out: dict[str, Any] = {}
    for one in population["numbers"]:
        if one["kind"] != "tolerance":
            continue
        entry = {}
        if one["off"]:
            entry["sigmas"] = one["mean"]
        if one["tolerance"] != "as_declared":
            # Expected departure of a further car of this population: the spread, and the uncertainty of the mean.
            entry["tolerance_factor"] = float(np.hypot(one["spread"]["value"], one["mean_sd"]))
        for part, share in one["parts"].items():
            if entry:
                out[part] = {key: value * share if key == "sigmas" else value for key, value in entry.items()}
    return out


def _corrected(file: str, corrections: dict[str, Any]) -> dict[str, Any] | None:
    """The corrected vehicle file, made by the command, which knows what each tolerance changes."""
    if not corrections:
        return None
    with tempfile.TemporaryDirectory(prefix="kisspoint-fleet-") as work:
        vehicle, by = Path(work) / "vehicle.json", Path(work) / "corrections.json"
        vehicle.write_text(file, encoding="utf-8")
        by.write_text(json.dumps(corrections), encoding="utf-8")
        words = [str(_command.path()), "vehicle", "correct", str(vehicle), "--by", str(by), "--json"]
        done = subprocess.run(words, capture_output=True, encoding="utf-8")
        if done.returncode != 0:
            return {"error": done.stderr.strip().replace(str(vehicle), "vehicle.json").splitlines()[0]}
        found: dict[str, Any] = json.loads(done.stdout)
        return found
