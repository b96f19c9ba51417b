"""The population of a fleet, tested on cars drawn from a known population."""

import datetime
import json
import os
import sys

import pytest
from conftest import ROOT, find_command

sys.path.insert(0, str(ROOT / "python"))
os.environ.setdefault("KISSPOINT", str(find_command()))
os.environ.setdefault("OMP_NUM_THREADS", "1")

np = pytest.importorskip("numpy")
pytest.importorskip("scipy")
pytest.importorskip("fsspec")
pa = pytest.importorskip("pyarrow")
import pyarrow.parquet as pq  # noqa: E402
from kisspoint import fleet  # noqa: E402
from kisspoint.fleet import _hierarchy, _population, _told  # noqa: E402
from kisspoint.fleet._table import SCHEMA, digest_of_vehicle  # noqa: E402
from scipy.stats import binom  # noqa: E402

VEHICLE = (ROOT / "tests/data/campaigns/example/vehicle.json").read_text()
# Tolerance, whether it is relative, its size, and the effect parameter of the same meaning with its prior centre and size.
NUMBERS = [
    ("actuator.x_cnt", False, 0.015, ("effect.kiss_point_offset.offset", 0.0, 0.2)),
    ("cushion_spring.beta", True, 0.01, ("effect.friction_level.factor", 1.0, 0.15)),
    ("driveline.J_c", True, 0.02, ("effect.vehicle_mass.factor", 1.0, 0.15)),
    ("driveline.J_f", True, 0.01, None),
    ("engine.T_e_bias", False, 0.2, ("effect.engine_torque_bias.torque", 0.0, 5.0)),
    ("friction.mu", True, 0.015, ("effect.friction_level.factor", 1.0, 0.15)),
    ("thermal.C_1", True, 0.05, None),
]
J = len(NUMBERS)


def answer(rng, x, effects=(), mileage=None, k=0):
    """The row that a diagnosis of a car with these departures (in tolerances) would give: a linear car, whose recordings inform all numbers at once."""
    A = rng.normal(size=(J + 4, J)) * np.array([4.0, 2.0, 1.5, 1.0, 2.0, 3.0, 0.3])
    # The torque is the product of force and friction, so only the sum of their logarithms is observed.
    A[:, 1] = A[:, 5] * 0.01 / 0.015
    y = A @ x + rng.normal(size=len(A))
    unknowns = [
        {"name": n, "kind": "tolerance", "centre": 0.0, "sigma": s, "relative": r, "one_sided": False, "unit": None, "same_as": e and e[0], "per_sigma": e and s}
        for n, r, s, e in NUMBERS
    ]
    columns, precision = [A[:, j] for j in range(J)], [1.0] * J
    for name in effects:
        j, (_, relative, sigma, (variable, centre, size)) = next((j, n) for j, n in enumerate(NUMBERS) if n[3] and n[3][0] == name)
        unknowns.append({"name": variable, "kind": "effect", "centre": centre, "sigma": None, "relative": False, "one_sided": False, "unit": "mm", "same_as": None, "per_sigma": None})
        columns.append(A[:, j] / sigma)
        precision.append(size**-2)
    B, P = np.column_stack(columns), np.diag(precision)
    H = B.T @ B + P
    value = np.linalg.solve(H, B.T @ y)
    scale = np.ones(len(value))
    for k_, (one, v) in enumerate(zip(unknowns, value, strict=True)):
        # A factor is shifted in its logarithm, in steps relative to itself; its value is the exponential of the linear quantity.
        factor = one["kind"] == "effect" and one["centre"] == 1.0
        one["value"] = float(np.exp(v)) if factor else float(one["centre"] + v)
        scale[k_] = 1 / one["value"] if factor else 1.0
    H = (B * scale).T @ (B * scale) + P
    named = sorted({name.split(".")[1] for name in effects})
    return {
        "campaign": f"car_{k}", "name": f"car_{k}", "mileage_km": mileage, "date": datetime.date(2026, 1, 1), "verdict": "explained" if named else "no_gap",
        "effects": [{"id": e, "probability": 0.99, "ambiguous_with": []} for e in named], "explanations": [{"effects": named, "missing_law": None, "probability": 1.0}],
        "unknowns": unknowns, "precision": [float(H[i, j]) for i in range(len(H)) for j in range(i + 1)],
        "precision_exact": [float(H[i, j]) for i in range(len(H)) for j in range(i + 1)],
        "prior_precision": [{"row": i, "column": i, "value": p} for i, p in enumerate(precision)],
        "vehicle": digest_of_vehicle(VEHICLE), "vehicle_file": VEHICLE, "cached": False, "attempts": 1, "report": f"cars/car_{k}/report.html",
    }  # fmt: skip


def test_the_prior_is_divided_out_with_an_effect_named_or_not():
    """Whether a shift is attributed to a tolerance or named as an effect, the likelihood of it is the same."""
    x = np.array([3.0, 0, 0, 0, 0, 0, 0])
    told = []
    for effects in ((), ("effect.kiss_point_offset.offset",)):
        row = answer(np.random.default_rng(4), x, effects)
        group = _told.Group(VEHICLE)
        one, left = _told.read(row["unknowns"], *_told.matrices(row), group)
        assert not left and one.names[0] == "actuator.x_cnt"
        told.append(one)
    np.testing.assert_allclose(told[0].D, told[1].D, rtol=1e-6, atol=1e-6 * np.abs(told[0].D).max())
    np.testing.assert_allclose(told[0].h, told[1].h, rtol=1e-5, atol=1e-5 * np.abs(told[0].h).max())
    # And it equals the true likelihood.
    rng = np.random.default_rng(4)
    A = rng.normal(size=(J + 4, J)) * np.array([4.0, 2.0, 1.5, 1.0, 2.0, 3.0, 0.3])
    assert told[0].D[0, 0] == pytest.approx(A[:, 0] @ A[:, 0], rel=1e-6)


def test_numbers_that_act_alike_are_one():
    row = answer(np.random.default_rng(1), np.zeros(J))
    group = _told.Group(VEHICLE)
    one, _ = _told.read(row["unknowns"], *_told.matrices(row), group)
    assert "cushion_spring.beta × friction.mu" in one.names and len(one.names) == J - 1
    assert group.sigma["cushion_spring.beta × friction.mu"][0] == pytest.approx(np.hypot(0.01, 0.015))


def members(rng, n=200, j=5, off=0.02):
    """Members of a population with their likelihoods; the means, slopes, spreads, outliers and numbers they were drawn with."""
    mean, spread = rng.normal(0, 1.5, j), np.exp(rng.normal(-0.3, 0.5, j))
    slope = rng.normal(0, 0.4, j)
    c = np.column_stack([np.ones(n), rng.normal(size=n)])
    away = rng.random((n, j)) < off
    x = c @ np.stack([mean, slope]) + spread * rng.normal(size=(n, j)) + away * rng.normal(0, 10, (n, j))
    h, D = [], []
    for i in range(n):
        A = rng.normal(size=(j + 3, j)) * rng.choice([0.1, 0.5, 2, 4], j)
        D.append(A.T @ A)
        h.append(A.T @ (A @ x[i] + rng.normal(size=j + 3)))
    return _hierarchy.Members(np.array(h), np.array(D), c), mean, slope, spread, away, x


def rare(hits, tries, chance=0.95):
    """Probability that intervals with this coverage contain the truth in so few or fewer cases."""
    return binom.cdf(hits, tries, chance)


def test_means_slopes_and_spreads_lie_in_their_intervals_and_outliers_are_found():
    """Four populations of 200 members and five numbers: 20 means, 20 slopes, 20 spreads, about 80 outlying numbers, and the numbers of every member."""
    held = {"means": [], "slopes": [], "spreads": [], "values": []}
    probability, true, clear = [], [], []
    for seed in range(4):
        drawn, mean, slope, spread, away, x = members(np.random.default_rng(100 + seed))
        found = _hierarchy.fit(drawn)
        for what, at, truth in (("means", 0, mean), ("slopes", 1, slope)):
            held[what] += list(np.abs(found.means[:, at] - truth) < 1.96 * found.means_sd[:, at])
        held["spreads"] += list((found.spreads_interval[:, 0] < spread) & (spread < found.spreads_interval[:, 1]))
        held["values"] += list((np.abs(found.values - x) < 1.96 * found.values_sd).ravel())
        probability.append(found.offs.ravel())
        true.append(away.ravel())
        # Visibility of an outlier: its departure relative to the uncertainty from its own recordings and the spread of the others together.
        own = np.sqrt(np.einsum("njj->nj", np.linalg.inv(drawn.precision + 1e-6 * np.eye(5))))
        clear.append((away & (np.abs(x - drawn.covariates @ np.stack([mean, slope])) > 6 * np.hypot(own, spread))).ravel())
    for what, hits in held.items():
        assert rare(sum(hits), len(hits)) > 1e-3, f"{what}: {sum(hits)} of {len(hits)}"
    p, t = np.concatenate(probability), np.concatenate(true)
    # Claimed probabilities are calibrated: the Brier score is within its scatter for true probabilities.
    assert abs(((p - t) ** 2).sum() - (p * (1 - p)).sum()) < 4 * np.sqrt(((1 - 2 * p) ** 2 * p * (1 - p)).sum())
    stands_out = np.concatenate(clear)
    assert t[p > 0.9].mean() > 0.9 and stands_out.sum() > 15 and p[stands_out].min() > 0.5


def test_the_gradient_is_that_of_the_objective():
    drawn, *_ = members(np.random.default_rng(0), n=20, j=3, off=0.2)
    model = _hierarchy._Model(drawn, True)
    theta = model.start() + 0.1
    model.choose(theta)
    _, gradient = model.objective(theta)
    for k, step in enumerate(np.eye(len(theta)) * 1e-5):
        assert (model.objective(theta + step)[0] - model.objective(theta - step)[0]) / 2e-5 == pytest.approx(gradient[k], abs=1e-4)


def test_a_number_that_nobody_informs_keeps_its_prior():
    drawn, *_ = members(np.random.default_rng(3), n=40, j=3, off=0.0)
    drawn.precision[:, 1, :] = drawn.precision[:, :, 1] = 0.0
    drawn.information[:, 1] = 0.0
    found = _hierarchy.fit(drawn)
    low, high = found.spreads_interval[1]
    assert low < 0.06 and high > 15 and found.means_sd[1, 0] > 20 and found.offs[:, 1].max() < 0.2


def test_shares_of_effects_are_learned_and_rivals_share():
    rng = np.random.default_rng(7)
    truth = {"friction_fade": 0.4, "judder": 0.03}
    evidence, has = [], []
    for _ in range(200):
        holds = {e: rng.random() < share for e, share in truth.items()}
        has.append(holds)
        # Log evidence of each effect with a noise of 5 nats around ±12.5. A normal distribution with mean ±s²/2 is consistent with calibrated evidence.
        nats = {e: rng.normal(12.5 if h else -12.5, 5.0) for e, h in holds.items()}
        sets = {}
        for chosen in [(), ("friction_fade",), ("judder",), ("friction_fade", "judder")]:
            sets[chosen] = sum(nats[e] for e in chosen) + len(chosen) * np.log(0.01 / 0.99)
        most = max(sets.values())
        whole = sum(np.exp(v - most) for v in sets.values())
        evidence.append({chosen: float(np.exp(v - most) / whole) for chosen, v in sets.items()})
    found, each = _hierarchy.shares(evidence, _population.PRIOR_ODDS)
    for effect, share in truth.items():
        mean, low, high = found[effect]
        assert low < share < high and high - low < 0.2 and low < sum(h[effect] for h in has) / 200 < high
    p = np.array([one.get("friction_fade", 0.0) for one in each])
    t = np.array([h["friction_fade"] for h in has])
    assert abs(((p - t) ** 2).sum() - (p * (1 - p)).sum()) < 4 * np.sqrt(((1 - 2 * p) ** 2 * p * (1 - p)).sum()) + 0.5
    # Two effects that no recording can tell apart: if one of them is seen without its rival in other cars, it is the more probable one.
    evidence = [{("a",): 0.5, ("b",): 0.5}] * 10 + [{("a",): 1.0}] * 30 + [{(): 1.0}] * 60
    _, each = _hierarchy.shares(evidence, _population.PRIOR_ODDS)
    assert each[0]["a"] > 0.9 and each[0]["b"] < 0.1


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """200 cars of one vehicle file: a kiss point that is off in all and drifts with mileage, a tolerance that is too wide, one that is too narrow, three outliers."""
    rng = np.random.default_rng(11)
    mean, spread = np.array([1.5, 0, 0, 0.0, 0, 0, 0]), np.array([1.0, 0.6, 0.3, 2.5, 1.0, 0.9, 1.0])
    outliers = {5: ("engine.T_e_bias", 15.0), 50: ("driveline.J_c", 12.0), 120: ("engine.T_e_bias", -12.0)}
    rows = []
    for k in range(200):
        mileage = float(rng.uniform(0, 2e5))
        x = mean + spread * rng.normal(size=J)
        x[0] += 2.0 * (mileage - 1e5) / 1e5
        if k in outliers:
            x[[n[0] for n in NUMBERS].index(outliers[k][0])] += outliers[k][1]
        # As in a diagnosis, a large shift is named as an effect, and a small one is not.
        named = tuple(sorted({n[3][0] for n, value in zip(NUMBERS, x, strict=True) if n[3] and abs(value) > 5}))
        rows.append(answer(rng, x, named, mileage, k))
    out = tmp_path_factory.mktemp("fleet")
    pq.write_table(pa.Table.from_pylist(rows, SCHEMA), out / "fleet.parquet")
    return fleet.pool(out / "fleet.parquet"), out, mean, spread, outliers


def number(found, name):
    (one,) = [n for n in found["numbers"] if n["number"] == name]
    return one


def test_the_fleet_says_what_is_off_for_all(drawn):
    found, out, mean, spread, _ = drawn
    assert [n["number"] for n in found["numbers"] if n["off"]] == ["actuator.x_cnt"]
    kiss = number(found, "actuator.x_cnt")
    assert kiss["low"] < 1.5 < kiss["high"] and kiss["spread"]["low"] < 1.0 < kiss["spread"]["high"]
    (drift,) = kiss["drift"]
    assert drift["significant"] and drift["low"] < 0.02 < drift["high"] and drift["per"] == "1000 km"
    assert number(found, "driveline.J_c")["tolerance"] == "too_wide" and number(found, "driveline.J_f")["tolerance"] == "too_narrow"
    assert json.loads((out / "fleet.json").read_text())["numbers"] == found["numbers"]


def test_outliers_are_named_with_their_number(drawn):
    found, _, _, _, outliers = drawn
    told = {one["campaign"]: {n["number"] for n in one["numbers"]} for one in found["outliers"]}
    for k, (name, _) in outliers.items():
        assert name in told[f"car_{k}"]
    assert len(told) <= len(outliers) + 2


def test_the_corrected_vehicle_file_is_one(drawn, kisspoint):
    found, out, *_ = drawn
    corrected = json.loads((out / "vehicle.corrected.json").read_text())
    kiss = number(found, "actuator.x_cnt")
    assert corrected["actuator"]["x_cnt"][0] == pytest.approx(4.02 + 0.015 * kiss["mean"], rel=1e-5)
    narrow, wide = corrected["tolerance"]["driveline.J_f"]["rel"], corrected["tolerance"]["driveline.J_c"]["rel"]
    assert narrow == pytest.approx(0.01 * 2.5, rel=0.25) and wide == pytest.approx(0.02 * 0.3, rel=0.5)
    assert corrected["thermal"] == json.loads(VEHICLE)["thermal"]
    assert kisspoint("vehicle", "check", out / "vehicle.corrected.json").returncode == 0


def test_estimates_of_each_car_are_shrunk_and_better(drawn):
    """Shrunk towards the population, the estimates of J_c scatter less than those of each car alone."""
    _, out, *_ = drawn
    rows = pq.read_table(out / "cars.parquet").to_pylist()
    assert len(rows) == 200 * (J - 1)
    alone = [row for row in rows if row["number"] == "driveline.J_c" and row["alone"] is not None]
    assert np.std([row["value"] for row in alone]) < np.std([row["alone"] for row in alone])
    assert all(row["unit"] == "%" for row in alone)


def test_laws_that_are_not_exact_leave_what_many_cars_cannot_average_out(drawn, tmp_path):
    """The same cars, but half of the likelihood precision is lost to inexact laws. A mean is then no better known than this allows for one car, and a spread lies
    between two readings."""
    found, out, *_ = drawn
    rows = pq.read_table(out / "fleet.parquet").to_pylist()
    for row in rows:
        _, H, _, P = _told.matrices(row)
        # A likelihood of half the precision, because of less confidence in the laws.
        H = P + (H - P) / 2
        row["precision"] = [float(H[i, j]) for i in range(len(H)) for j in range(i + 1)]
    pq.write_table(pa.Table.from_pylist(rows, SCHEMA), tmp_path / "fleet.parquet")
    unsure = fleet.pool(tmp_path / "fleet.parquet")
    for before in found["numbers"]:
        after = number(unsure, before["number"])
        spread, wider = before["spread"], after["spread"]
        assert wider["high"] == pytest.approx(spread["high"], rel=0.02) and wider["low"] < spread["low"] * 1.001
        assert abs(after["mean"] - before["mean"]) < before["mean_sd"] < after["mean_sd"]
    kiss, alone = number(unsure, "actuator.x_cnt"), number(found, "actuator.x_cnt")
    one = [np.linalg.inv(m)[0, 0] for m in _told.matrices(rows[0])[1:3]]
    assert 0.3 < (kiss["mean_sd"] ** 2 - alone["mean_sd"] ** 2) / (one[0] - one[1]) < 3


def test_cars_with_an_effect_that_no_number_stands_for_teach_no_number(drawn, tmp_path):
    """Thirty cars with oil on their facings, whose kiss points are biased by it, leave the fleet's numbers as they were, and still receive estimates."""
    found, out, *_ = drawn
    rows = pq.read_table(out / "fleet.parquet").to_pylist()
    for k in range(30):
        row = answer(np.random.default_rng(500 + k), np.array([-4.0, 0, 0, 0, 0, 0, 0]), k=200 + k)
        row["explanations"] = [{"effects": ["friction_fade"], "missing_law": None, "probability": 0.9}, {"effects": [], "missing_law": None, "probability": 0.1}]
        rows.append(row)
    pq.write_table(pa.Table.from_pylist(rows, SCHEMA), tmp_path / "fleet.parquet")
    with_them = fleet.pool(tmp_path / "fleet.parquet")
    for before in found["numbers"]:
        after = number(with_them, before["number"])
        assert (after["mean"], after["spread"]) == (pytest.approx(before["mean"], abs=1e-6), pytest.approx(before["spread"], rel=1e-6))
    told = {row["campaign"]: row["value"] for row in pq.read_table(tmp_path / "cars.parquet").to_pylist() if row["number"] == "actuator.x_cnt"}
    assert len(told) == 230 and np.mean([told[f"car_{k}"] for k in range(200, 230)]) < np.mean([told[f"car_{k}"] for k in range(200)]) - 0.03


def test_few_cars_and_none_are_said_to_be_few(tmp_path):
    rows = [answer(np.random.default_rng(k), np.zeros(J), k=k) for k in range(2)]
    rows.append({"campaign": "x", "name": "x", "error": "no such folder", "cached": False, "attempts": 1, "seconds": 0.1})
    pq.write_table(pa.Table.from_pylist(rows, SCHEMA), tmp_path / "fleet.parquet")
    found = fleet.pool(tmp_path / "fleet.parquet")
    assert found["numbers"] == [] and found["errors"] == 1 and "fewer than 3" in found["populations"][0]["note"]
