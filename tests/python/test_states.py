"""Saved states, reset, communication steps and threads of each FMU on its own."""

import random
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException


def drive(instance, first, last, h=0.01):
    """A run with inputs that change every 10 ms: contact, slip, lock-up and break-away for the plant; a launch for the controller."""
    inside = max(1, round(0.01 / h))
    for k in range(first, last):
        t = k * 0.01
        if "x_to" in inputs_of(instance):
            instance.set(x_to=min(8.0, 4.0 + 2.5 * t), T_e_ref=60.0 if k % 50 < 40 else -60.0)
        else:
            instance.set(omega_f=104.7 - 10 * t + 0.01 * (k % 7), omega_c=min(100.0, 60 * t), T_e=40.0)
        for _ in range(inside):
            instance.step(h)


def inputs_of(instance):
    return [v.name for v in instance.model.description.modelVariables if v.causality == "input"]


@pytest.fixture(params=["plant", "controller"])
def model(request):
    return request.getfixturevalue(request.param)


EFFECTS = {
    "effect__actuator_delay__delay": 0.015,
    "effect__actuator_lag__time_constant": 0.03,
    "effect__clutch_speed_delay__delay": 0.02,
    "effect__engine_speed_delay__delay": 0.01,
    "effect__cushion_hysteresis__width": 0.1,
    "effect__actuator_backlash__play": 0.05,
    "effect__driveline_compliance__compliance": 1e-3,
    "effect__judder__cosine": 0.05,
}


@pytest.mark.parametrize("effects", [{}, EFFECTS], ids=["nominal", "effects"])
def test_rolling_back_repeats_the_same_bits(plant, effects):
    instance = plant.instance(**effects)
    drive(instance, 0, 80)
    state, time = instance.save(), instance.time
    drive(instance, 80, 200)
    once = instance.bytes()
    instance.restore(state, time)
    drive(instance, 80, 200)
    assert instance.bytes() == once
    instance.free()


def test_rolling_back_each_step_changes_nothing(model):
    straight, rolled = model.instance(), model.instance()
    drive(straight, 0, 150)
    for k in range(150):
        state, time = rolled.save(), rolled.time
        drive(rolled, k, k + 1)
        rolled.restore(state, time)
        rolled.fmu.freeFMUState(state)
        drive(rolled, k, k + 1)
    assert rolled.bytes() == straight.bytes()
    straight.free(), rolled.free()


def test_another_process_continues_with_the_same_bits(model, tmp_path):
    instance = model.instance(**(EFFECTS if "x_to_actual" in model.variables else {}))
    drive(instance, 0, 90)
    (tmp_path / "state").write_bytes(instance.bytes())
    time = instance.time
    drive(instance, 90, 200)
    script = Path(__file__).with_name("continue_elsewhere.py")
    words = [sys.executable, script, model.path, tmp_path / "state", repr(time), "90", "200", tmp_path / "end"]
    subprocess.run(list(map(str, words)), check=True)
    assert (tmp_path / "end").read_bytes() == instance.bytes()
    instance.free()


def test_reset_equals_fresh(model):
    used, fresh = model.instance(), model.fresh()
    drive(used, 0, 120)
    used.fmu.reset()
    assert used.bytes() == fresh.bytes()
    used.initialize(), fresh.initialize()
    drive(used, 0, 120), drive(fresh, 0, 120)
    assert used.bytes() == fresh.bytes()
    used.free(), fresh.free()


def test_a_state_of_the_other_model_is_refused(plant, controller):
    one, other = plant.instance(), controller.instance()
    with pytest.raises(FMICallException):
        other.fmu.deSerializeFMUstate(one.bytes())
    assert other.fmu.getVersion() == "2.0"
    other.step(0.001)
    one.free(), other.free()


def test_results_do_not_depend_on_the_communication_step(plant):
    """Inputs are held for 10 ms each; within these, steps of 10, 1 and 0.1 ms, and irregular ones."""
    ends = []
    for h in (0.01, 0.001, 0.0001):
        instance = plant.instance()
        drive(instance, 0, 250, h)
        ends.append(instance.outputs())
        instance.free()
    rng = random.Random(4)
    instance = plant.instance()
    for k in range(250):
        instance.set(x_to=min(8.0, 4.0 + 2.5 * k * 0.01), T_e_ref=60.0 if k % 50 < 40 else -60.0)
        cuts = sorted(rng.uniform(0, 0.01) for _ in range(rng.randrange(4)))
        edges = [k * 0.01, *(k * 0.01 + cut for cut in cuts), (k + 1) * 0.01]
        for a, b in zip(edges, edges[1:]):
            instance.time = a
            instance.step(b - a)
    ends.append(instance.outputs())
    instance.free()
    for end in ends[1:]:
        for name, value in end.items():
            assert value == pytest.approx(ends[0][name], rel=1e-6, abs=1e-6), name


def test_threads_do_not_disturb_each_other(model):
    ends = [None] * 8

    def work(k):
        instance = model.instance()
        drive(instance, 0, 100)
        ends[k] = instance.bytes()
        instance.free()

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(end == ends[0] for end in ends)


def test_effects_injected_while_running_make_no_jump(plant):
    """Speeds, temperatures, energy and position continue from their values; the effect shows afterwards."""
    nominal, injected = plant.instance(), plant.instance()
    drive(nominal, 0, 100), drive(injected, 0, 100)
    before = injected.outputs()
    injected.set(**EFFECTS, effect__friction_level__factor=0.8)
    injected.step(1e-6)
    after = injected.outputs()
    for name in ("omega_f", "omega_c", "theta_c", "theta_b", "E_d", "x_to_actual"):
        assert after[name] == pytest.approx(before[name], rel=1e-4, abs=1e-4), name
    nominal.step(1e-6)
    for k in range(100):
        nominal.step(0.01), injected.step(0.01)
    assert abs(nominal.get("x_to_actual") - injected.get("x_to_actual")) < 0.1
    assert nominal.outputs() != injected.outputs()
    nominal.free(), injected.free()


@pytest.mark.parametrize("name, value", [("x_to", float("nan")), ("T_load", float("inf")), ("x_to", 1e6), ("driveline.J_c", 0.6)])
def test_a_refused_value_leaves_the_instance_as_it_was(plant, name, value):
    instance = plant.instance()
    before = instance.bytes()
    with pytest.raises(FMICallException):
        instance.set(**{name.replace(".", "__"): value})
    after = instance.bytes()
    assert before == after
    instance.step(0.01)
    instance.free()
