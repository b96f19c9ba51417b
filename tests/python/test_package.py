"""The Python package: a campaign from its folder and from memory, and the retuned plant."""

import csv
import json
import math
import os
import sys

import pytest
from conftest import ROOT, find_command

sys.path.insert(0, str(ROOT / "python"))
os.environ.setdefault("KISSPOINT", str(find_command()))

import kisspoint  # noqa: E402

EXAMPLE = ROOT / "tests/data/campaigns/example"


@pytest.fixture(scope="module")
def found():
    return kisspoint.diagnose(EXAMPLE)


def rms(a, b):
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True)) / len(a))


def test_the_answer_reads_like_a_mapping_and_by_name(found):
    assert found["verdict"] == found.verdict == "explained"
    assert found.effects == ["kiss_point_thermal"]
    assert 0 < found.confidence <= 1 and found.sentence in repr(found)
    assert found.report.stat().st_size < 1_500_000


def test_the_retuned_plant_follows_the_car_where_the_nominal_one_does_not(found):
    runs = found.replay("r05")
    for channel in ("omega_f_rad_s", "omega_c_rad_s"):
        before, after = (rms(runs["real"][channel], runs[name][channel]) for name in ("before", "after"))
        assert after < 1.0 < 5.0 < before, (channel, before, after)


def test_tables_in_memory_give_the_same_answer(found):
    tables = {}
    for path in sorted(EXAMPLE.glob("*.csv")):
        rows = list(csv.reader(path.open()))
        tables[path.stem] = {name: [float(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}
    about = json.loads((EXAMPLE / "recordings.json").read_text())
    again = kisspoint.diagnose(tables, about=about, vehicle=EXAMPLE / "vehicle.json")
    assert again["plant"] == found["plant"] and again["which"] == found["which"]


def test_a_plant_is_stepped_and_named_variables_are_checked(found):
    with found.load_plant(theta_c_start=120.0) as plant:
        plant.step(1e-3, x_to=6.5, T_e_ref=40.0)
        assert plant.get("theta_c") == pytest.approx(120.0, abs=1.0) and plant.get("phase") == 2
        with pytest.raises(KeyError, match="no_such"):
            plant.get("no_such")


def test_refusals_say_what_is_wrong(tmp_path):
    with pytest.raises(kisspoint.KisspointError, match="vehicle.json"):
        kisspoint.diagnose(tmp_path)
    with pytest.raises(ValueError, match="about"):
        kisspoint.diagnose({"r01": {"time_s": [0.0]}})
    with pytest.raises(ValueError, match="r02"):
        kisspoint.diagnose({"r01": {"time_s": [0.0]}}, about={"r02": {}}, vehicle={})
