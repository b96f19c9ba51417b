"""Timed faults: the plant's FMU and `kisspoint launch` give the same result from the same file, whatever the communication step."""

import json

import pytest
from master import Model, couple

FAULTS = [
    {"parameter": "effect.friction_level.factor", "time_s": 0.5004, "ramp_s": 0.2, "value": 0.8},
    {"parameter": "effect.kiss_point_offset.offset", "time_s": 0.3, "value": 0.05},
    {"parameter": "effect.friction_level.factor", "time_s": 1.0, "value": 0.9},
]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("faults") / "faults.json"
    path.write_text(json.dumps(FAULTS))
    return path


@pytest.fixture(scope="module")
def faulty(kisspoint, file):
    kisspoint("fmu", "--out", file.parent, "--faults", file)
    return Model(file.parent / "DrivelinePlant.fmu")


def drive(instance, h, end=1.3):
    instance.set(x_to=6.0, T_e_ref=45.0)
    for _ in range(round(end / h)):
        instance.step(h)


def test_the_communication_step_does_not_matter(faulty):
    ends = []
    for h in (1e-3, 1e-2, 0.13, 1.3):
        instance = faulty.instance()
        drive(instance, h)
        ends.append(instance.outputs())
        assert instance.get("effect.friction_level.factor") == 0.9
        instance.free()
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], rel=1e-6)


def test_a_fault_is_what_setting_the_parameter_is(faulty, plant):
    played, by_hand = faulty.instance(), plant.instance()
    for instance in (played, by_hand):
        instance.set(x_to=6.0, T_e_ref=45.0)
    for k in range(400):
        if k == 300:
            by_hand.set(effect__kiss_point_offset__offset=0.05)
        played.step(1e-3), by_hand.step(1e-3)
    assert played.outputs() == pytest.approx(by_hand.outputs(), rel=1e-9)
    # To the middle of the ramp, and back to it from a saved state.
    drive(played, 1e-3, 0.2)
    assert 0.89 < played.get("effect.friction_level.factor") < 0.91
    state, time = played.save(), played.time
    drive(played, 1e-3, 0.3)
    once = played.bytes()
    played.restore(state, time)
    drive(played, 1e-3, 0.3)
    assert played.bytes() == once
    played.free(), by_hand.free()


def test_the_launch_plays_the_same_file(kisspoint, file, faulty, controller, launch_sets):
    """Column B of `kisspoint launch --faults` compared with both FMUs, of which the plant applies the faults itself."""
    column = json.loads(kisspoint("launch", "--faults", file, "--json").stdout)["table_ii"][2]
    nominal = json.loads(kisspoint("launch", "--json").stdout)["table_ii"][2]
    p, c = faulty.instance(**launch_sets["plant"]), controller.instance(**launch_sets["clutch_controller"])
    couple(p, c, [1e-3] * 2500, on_step=lambda: c.get("phase") == 3)
    assert p.time == pytest.approx(column["t_f_s"]["found"], rel=1e-9)
    assert p.get("E_d") == pytest.approx(column["e_d_j"]["found"], rel=1e-9)
    assert column["e_d_j"]["found"] != pytest.approx(nominal["e_d_j"]["found"], rel=1e-5)
    p.free(), c.free()


def test_an_unsound_file_is_refused_by_name(kisspoint, tmp_path):
    path = tmp_path / "faults.json"
    path.write_text(json.dumps([{"parameter": "effect.friction_level.factor", "time_s": 0.0, "value": 99.0}]))
    for words in (("launch",), ("fmu", "--out", tmp_path)):
        said = kisspoint(*words, "--faults", path, check=False)
        assert said.returncode == 1 and "faults.json" in said.stderr and "value" in said.stderr
