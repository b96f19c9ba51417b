"""Learned laws in the FMU: tables act like the effects of the same meaning, and a car whose gap only a learned law closes."""

import json

import pytest
from conftest import ROOT
from master import Model
from test_diagnosis import SPEEDS, recording, speed_errors

OUTSIDE = ROOT / "tests/data/cases/5/campaign"
"""A car whose brake drags, which no effect of the library does."""


def drive(plant, **parameters):
    """Outputs during a launch that slips and then drives on."""
    instance = plant.instance(omega_f_start=120.0, theta_c_start=70.0, x_to=5.8, T_e_ref=40.0, **parameters)
    shown = []
    for k in range(40):
        instance.set(x_to=5.8 + 0.02 * k)
        instance.step(0.02)
        shown.append(instance.get("omega_f", "omega_c", "T_fc"))
    instance.free()
    return shown


@pytest.mark.parametrize(
    ("curve", "value", "same"),
    [
        ("friction_slip", 0.1, {"effect.friction_level.factor": 1.1}),
        ("force_position", -0.2, {"effect.friction_level.factor": 0.8}),
        ("engine_speed", 5.0, {"effect.engine_torque_bias.torque": 5.0}),
        ("load_speed", 4.0, {"effect.road_load.rolling_torque": 4.0}),
        ("actuator_time", 0.06, {"effect.actuator_lag.time_constant": 0.06}),
        ("actuator_play", 0.05, {"effect.actuator_backlash.play": 0.1}),
        ("disc_scale", 0.03, {"effect.clutch_speed_gain.gain": 1.03}),
        ("flywheel_filter", 0.02, {"effect.engine_speed_delay.smoothing": 0.02}),
    ],
)
def test_a_flat_table_does_what_the_effect_of_that_size_does(plant, curve, value, same):
    tables = {name: value for name in plant.variables if name.startswith(f"effect.empirical.{curve}_")}
    assert tables
    flat, expected, nominal = drive(plant, **tables), drive(plant, **same), drive(plant)
    for row, other in zip(flat, expected):
        assert row == pytest.approx(other, abs=1e-7)
    assert flat != nominal
    assert drive(plant, **dict.fromkeys(tables, 0.0)) == nominal


def test_the_fmu_closes_the_gap_that_the_answer_says_its_learned_law_closes(kisspoint, tmp_path):
    out = tmp_path / "out"
    kisspoint("diagnose", OUTSIDE, "--out", out)
    answer = json.loads((out / "diagnosis.json").read_text())
    far, law = answer["how_far"], answer["how_far"]["empirical"]
    assert answer["where"]["unexplained_at"] and law["taken"] and law["closed_fraction"] > 0.8 > far["closed_fraction"]
    for curve in law["curves"]:
        for k, value in enumerate(curve["values"], 1):
            assert answer["plant"]["parameters"][f"effect.empirical.{curve['id']}_{k}"] == pytest.approx(value, rel=1e-5)
    index = json.loads((OUTSIDE / "recordings.json").read_text())
    (name,) = far["held_out"]
    found = speed_errors(Model(out / "DrivelinePlant.fmu"), recording(OUTSIDE, name), index[name], answer["plant"]["parameters"], {})
    for row in law["per_recording"]:
        if row["channel"] in SPEEDS:
            assert found[row["channel"]] == pytest.approx(row["after"], rel=0.02), row["channel"]
    page = (out / "report.html").read_text()
    assert "An empirical law of" in page and "Load over speed" in page
