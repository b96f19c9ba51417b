"""The output of `kisspoint diagnose`: the answer is checked against its schema, and the retuned FMU against the numbers of the answer."""

import csv
import json
import shutil
import zipfile
from math import sqrt
from pathlib import Path

import pytest
from conftest import EXAMPLE
from jsonschema import Draft202012Validator
from lxml import etree
from master import Model

DATA = Path(__file__).resolve().parents[1] / "data"

SPEEDS = {"omega_f_rad_s": "omega_f", "omega_c_rad_s": "omega_c"}
LOCKED_SLIP_RAD_S = 0.6
"""Slip below which a recording that starts with a closed clutch counts as starting locked, as the docs of the method say."""


class Diagnosed:
    """A campaign and the folder with its answer."""

    def __init__(self, campaign, out):
        self.campaign, self.out = campaign, out
        self.answer = json.loads((out / "diagnosis.json").read_text())


def subset(names, folder):
    """A copy of the example with only these recordings."""
    folder.mkdir()
    shutil.copy(EXAMPLE / "vehicle.json", folder)
    index = json.loads((EXAMPLE / "recordings.json").read_text())
    (folder / "recordings.json").write_text(json.dumps({name: index[name] for name in names}))
    for name in names:
        shutil.copy(EXAMPLE / f"{name}.csv", folder)
    return folder


@pytest.fixture(scope="session", params=["example", "a launch and a locked drive"])
def diagnosed(request, kisspoint, tmp_path_factory, example_answer):
    """Two campaigns: the whole example, whose held-out recording is a launch, and two of its recordings, of which the locked drive is held out."""
    if request.param == "example":
        return Diagnosed(EXAMPLE, example_answer)
    folder = tmp_path_factory.mktemp("diagnosis")
    campaign = subset(["r01", "r09"], folder / "campaign")
    kisspoint("diagnose", campaign, "--out", folder / "out")
    return Diagnosed(campaign, folder / "out")


@pytest.fixture(scope="session")
def retuned(diagnosed):
    return Model(diagnosed.out / "DrivelinePlant.fmu")


def recording(campaign, name):
    with (campaign / f"{name}.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {channel: [float(row[channel]) for row in rows] for channel in rows[0]}


def starts(measured, noted, values):
    """Speeds of the first sample, and the noted temperatures; if the clutch is closed, nearly equal speeds start at their mean."""
    omega_f = measured["omega_f_rad_s"][0]
    omega_c = measured["omega_c_rad_s"][0] / values["effect.clutch_speed_gain.gain"]
    closed = measured["x_to_cmd_mm"][0] > 0.5 * (values["actuator.x_cnt_0"] + values["actuator.x_cls_0"])
    if closed and abs(omega_f - omega_c) < LOCKED_SLIP_RAD_S:
        omega_f = omega_c = 0.5 * (omega_f + omega_c)
    return {
        "omega_f_start": omega_f,
        "omega_c_start": omega_c,
        "theta_c_start": noted["theta_c0_degC"],
        "theta_b_start": noted["theta_b0_degC"],
    }


def speed_errors(model, measured, noted, values, parameters):
    """Root mean square of real minus simulated speed, per channel; each input is held from its sample to the next."""
    inputs = [
        {"x_to": x, "T_e_ref": t, "theta_h": theta}
        for x, t, theta in zip(measured["x_to_cmd_mm"], measured["T_e_Nm"], measured["theta_h_degC"])
    ]
    plant = model.instance(**parameters, **starts(measured, noted, values), **inputs[0])
    squares = dict.fromkeys(SPEEDS, 0.0)
    times = measured["time_s"]
    for k, held in enumerate(inputs):
        for channel, name in SPEEDS.items():
            squares[channel] += (measured[channel][k] - plant.get(name)) ** 2
        plant.set(**held)
        if k + 1 < len(times):
            plant.step(times[k + 1] - times[k])
    plant.free()
    return {channel: sqrt(s / len(times)) for channel, s in squares.items()}


def test_the_answer_is_valid_against_its_schema(diagnosed):
    schema = json.loads((DATA / "diagnosis.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    errors = [e.message for e in Draft202012Validator(schema).iter_errors(diagnosed.answer)]
    assert not errors


def test_the_example_is_explained(diagnosed):
    if diagnosed.campaign != EXAMPLE:
        pytest.skip("two recordings do not tell the effects apart")
    answer = diagnosed.answer
    assert answer["verdict"] == "explained" and answer["where"]["primary"] == "clutch_force"
    assert [e["id"] for e in answer["which"]["effects"]] == ["kiss_point_thermal"]
    assert answer["how_far"]["closed_fraction"] > 0.95


@pytest.mark.parametrize("figure", ["before", "after"])
def test_the_fmu_driven_by_the_held_out_recording_gives_the_numbers_of_the_answer(diagnosed, retuned, figure):
    """'after' is the retuned FMU unchanged; 'before' is the same FMU with the nominal parameters set before initialization."""
    plant = diagnosed.answer["plant"]
    values = plant["nominal_parameters" if figure == "before" else "parameters"]
    parameters = values if figure == "before" else {}
    index = json.loads((diagnosed.campaign / "recordings.json").read_text())
    compared = 0
    for name in diagnosed.answer["how_far"]["held_out"]:
        found = speed_errors(retuned, recording(diagnosed.campaign, name), index[name], values, parameters)
        for row in diagnosed.answer["how_far"]["per_recording"]:
            if row["recording"] == name and row["channel"] in SPEEDS:
                assert found[row["channel"]] == pytest.approx(row[figure], rel=0.01), f"{name}, {row['channel']}"
                compared += 1
    assert compared == 2 * len(diagnosed.answer["how_far"]["held_out"])


def test_what_a_campaign_has_found_is_handed_on_with_the_vehicle(diagnosed, kisspoint, tmp_path):
    """An FMU that is written from the retuned one's vehicle.json has the same validated places and deviations, and therefore the same GUID."""

    def resources(fmu):
        with zipfile.ZipFile(fmu) as archive:
            guid = etree.fromstring(archive.read("modelDescription.xml")).get("guid")
            return archive.read("resources/vehicle.json"), guid

    document, guid = resources(diagnosed.out / "DrivelinePlant.fmu")
    (tmp_path / "vehicle.json").write_bytes(document)
    kisspoint("fmu", "--vehicle", tmp_path / "vehicle.json", "--out", tmp_path / "fmus")
    handed_on, guid_then = resources(tmp_path / "fmus" / "DrivelinePlant.fmu")
    found = json.loads(document)["validated"]
    assert found["places"] == diagnosed.answer["domain"]["places"] != []
    assert (json.loads(handed_on)["validated"], guid_then) == (found, guid)


def test_the_fmu_starts_as_the_retuned_car(diagnosed, retuned):
    plant = retuned.instance()
    for name, value in diagnosed.answer["plant"]["parameters"].items():
        assert plant.get(name) == pytest.approx(value, rel=1e-15, abs=0.0), name
    plant.free()


def test_the_parameter_set_holds_the_same_values(diagnosed):
    root = etree.parse(diagnosed.out / "plant.ssv").getroot()
    assert etree.QName(root).localname == "ParameterSet" and root.get("version") == "1.0"
    found = {p.get("name"): float(p[0].get("value")) for p in root.iter("{*}Parameter")}
    assert found == diagnosed.answer["plant"]["parameters"]


@pytest.mark.parametrize("diagnosed", ["a launch and a locked drive"], indirect=True)
def test_json_on_standard_output_is_the_file(diagnosed, kisspoint):
    printed = kisspoint("diagnose", diagnosed.campaign, "--json", "--threads", 1).stdout
    (line,) = printed.splitlines()
    assert json.loads(line) == {"campaign": str(diagnosed.campaign), "diagnosis": json.loads((diagnosed.out / "diagnosis.json").read_text())}


def test_nothing_else_is_left_in_the_folder(diagnosed):
    names = {path.name for path in diagnosed.out.iterdir()}
    asked = {"evidence.ssp"} if diagnosed.campaign == EXAMPLE else set()
    assert names == {"diagnosis.json", "report.html", "plant.ssv", "DrivelinePlant.fmu"} | asked
