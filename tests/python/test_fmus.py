"""Content of the FMUs: schema, semantics, units, files, reproducible bytes."""

import json
import math
import struct
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

MODELS = ["DrivelinePlant", "ClutchController"]
FUNCTIONS_OF_FMI_2 = 44


@pytest.mark.parametrize("model", MODELS)
def test_fmpy_finds_no_problem(fmus, model):
    assert validate_fmu(str(fmus[model])) == []


@pytest.mark.parametrize("model", MODELS)
def test_description_follows_the_schema(fmus, model):
    schema = etree.XMLSchema(etree.parse(str(Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd")))
    text = zipfile.ZipFile(fmus[model]).read("modelDescription.xml")
    schema.assertValid(etree.fromstring(text))


@pytest.mark.parametrize("model", MODELS)
def test_units_are_defined_and_right(fmus, model):
    root = etree.fromstring(zipfile.ZipFile(fmus[model]).read("modelDescription.xml"))
    bases = {unit.get("name"): dict(unit.find("BaseUnit").attrib) for unit in root.iter("Unit")}
    used = {real.get("unit") for real in root.iter("Real")} - {None}
    assert used <= set(bases)
    display = {(u.get("name"), d.get("name")): float(d.get("factor", 1)) for u in root.iter("Unit") for d in u.iter("DisplayUnit")}
    assert math.isclose(display["rad/s", "rpm"], 30 / math.pi, rel_tol=1e-15)
    assert bases["degC"] == {"K": "1", "offset": "273.15"}
    assert bases["mm"] == {"m": "1", "factor": "0.001"}
    assert bases["N.m"] == {"kg": "1", "m": "2", "s": "-2"}
    every_real = [v for v in root.iter("ScalarVariable") if v.find("Real") is not None]
    types = {t.get("name"): t.find("Real") for t in root.iter("SimpleType")}
    for variable in every_real:
        real = variable.find("Real")
        unit = real.get("unit") or types[real.get("declaredType")].get("unit")
        assert unit in bases, variable.get("name")
        assert float(real.get("nominal")) > 0, variable.get("name")
        shown = real.get("displayUnit") or (types[real.get("declaredType")].get("displayUnit") if real.get("declaredType") else None)
        assert shown is None or (unit, shown) in display, variable.get("name")


def test_connected_variables_have_the_same_unit(plant, controller):
    from master import CONTROLLER_TO_PLANT, PLANT_TO_CONTROLLER

    def unit(model, name):
        variable = model.variables[name]
        return variable.unit or variable.declaredType.unit

    for source, target in PLANT_TO_CONTROLLER.items():
        assert unit(plant, source) == unit(controller, target)
    for source, target in CONTROLLER_TO_PLANT.items():
        assert unit(controller, source) == unit(plant, target)


@pytest.mark.parametrize("model", MODELS)
def test_archive_holds_what_it_should(fmus, model):
    archive = zipfile.ZipFile(fmus[model])
    names = archive.namelist()
    for name in ["modelDescription.xml", "model.png", "documentation/index.html", "resources/vehicle.json", "licenses/MIT.txt"]:
        assert name in names
    assert any(name.startswith("binaries/") for name in names)
    assert not any(name.startswith(("./", "/")) or "\\" in name for name in names)
    assert archive.read("model.png")[:8] == b"\x89PNG\r\n\x1a\n"
    page = archive.read("documentation/index.html").decode()
    root = etree.fromstring(archive.read("modelDescription.xml"))
    assert all(f"<code>{v.get('name')}</code>" in page for v in root.iter("ScalarVariable"))


def test_an_fmu_says_nothing_of_the_machine_that_built_it(written):
    """It names no folder of the build, and contains no debug information, which would be forty times the size."""
    places = [str(Path(__file__).resolve().parents[2]), str(Path.home() / ".cargo")]
    for path in written.glob("*.fmu"):
        archive = zipfile.ZipFile(path)
        for name in archive.namelist():
            content = archive.read(name)
            assert not any(place.encode() in content for place in places), name
        assert path.stat().st_size < 2_000_000
    assert (written / "launch.ssp").stat().st_size < 4_000_000


def test_guids_differ_and_have_no_braces(plant, controller):
    guids = {plant.description.guid, controller.description.guid}
    assert len(guids) == 2 and all(len(guid) == 36 and "{" not in guid for guid in guids)


def test_bytes_are_reproducible(kisspoint, written, tmp_path):
    kisspoint("fmu", "--out", tmp_path)
    for path in written.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


def test_every_function_is_exported(plant):
    import ctypes

    binary = next(Path(plant.folder).glob("binaries/linux64/*.so"))
    library = ctypes.CDLL(str(binary))
    names = """GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment EnterInitializationMode
        ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean SetString
        GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate
        GetDirectionalDerivative EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime
        SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates
        SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus GetIntegerStatus
        GetBooleanStatus GetStringStatus""".split()
    assert len(names) == FUNCTIONS_OF_FMI_2
    for name in names:
        assert getattr(library, "fmi2" + name)


def test_a_vehicle_gives_its_numbers_as_start_values(kisspoint, fmus, tmp_path):
    from master import Model

    vehicle = json.loads(zipfile.ZipFile(fmus["DrivelinePlant"]).read("resources/vehicle.json"))
    vehicle["driveline"]["J_c"] = 0.75
    vehicle["friction"]["mu_d"][0] = 0.2
    file = tmp_path / "vehicle.json"
    file.write_text(json.dumps(vehicle))
    kisspoint("fmu", "--out", tmp_path, "--vehicle", file)
    model = Model(tmp_path / "DrivelinePlant.fmu")
    assert float(model.variables["driveline.J_c"].start) == 0.75
    # An importer that caches FMUs by their GUID must not confuse the cars.
    paper = Model(fmus["DrivelinePlant"])
    assert model.description.guid != paper.description.guid and model.description.guid[:24] == paper.description.guid[:24]
    instance = model.instance()
    assert instance.get("driveline.J_c", "friction.m_0") == [0.75, 0.2]
    instance.free()
    # A start value that the importer sets takes precedence over resources/vehicle.json.
    instance = model.instance(driveline__J_c=0.6)
    assert instance.get("driveline.J_c", "friction.m_0") == [0.6, 0.2]
    instance.free()


def test_platforms_that_are_missing_are_named(kisspoint, tmp_path):
    said = kisspoint("fmu", "--out", tmp_path).stdout
    assert "binaries: linux64" in said and "win64" in said and "packaging/cross.sh" in said


def test_a_wrong_library_is_refused_with_the_command_that_builds_it(kisspoint, tmp_path):
    stale = tmp_path / "old.so"
    stale.write_bytes(b"\x7fELF\x02\x01" + bytes(12) + struct.pack("<H", 62) + bytes(64))
    said = kisspoint("fmu", "--out", tmp_path, "--library", stale, check=False)
    assert said.returncode != 0 and "cargo build --release --lib --no-default-features" in said.stderr
    text = tmp_path / "text.so"
    text.write_text("no library")
    said = kisspoint("fmu", "--out", tmp_path, "--library", text, check=False)
    assert said.returncode != 0 and "not a shared library" in said.stderr


OFFSET = {"effect.empirical.actuator_offset_5": 0.1, "effect.empirical.actuator_offset_6": 0.3}
START = {"plant": {"omega_c_start": 30.0, "omega_f_start": 120.0, "x_to": 6.0, "T_e_ref": 20.0, **OFFSET}, "controller": {}}
"""Values at which every dependency shows: at standstill the gain of a speed sensor does nothing, nor does a position in a table of zeros."""


@pytest.mark.parametrize("name", ["plant", "controller"])
def test_declared_dependencies_hold(request, name):
    """During initialization an output depends on exactly those values that ModelStructure lists; afterwards on none."""
    model = request.getfixturevalue(name)
    instance = model.fresh(**START[name])
    instance.fmu.setupExperiment(startTime=0.0)
    instance.fmu.enterInitializationMode()
    before = instance.outputs()
    listed = {
        u.variable.name: None if u.dependencies is None else {v.name for v in u.dependencies} for u in model.description.initialUnknowns
    }
    assert set(listed) == set(before)
    found = {output: set() for output in before}
    for known in model.description.modelVariables:
        if known.causality not in ("input", "parameter") or known.type != "Real":
            continue
        old, least, most = instance.get(known.name), float(known.min or -1e9), float(known.max or 1e9)
        new = old + 0.07 * min(abs(old) or 1.0, most - old, old - least or 1.0)
        if new == old:
            new = old + 0.01 * (most - least) * (1 if old < most else -1)
        instance.set(**{known.name: new})
        for output, value in instance.outputs().items():
            if value != before[output]:
                found[output].add(known.name)
        instance.set(**{known.name: old})
    for output, names in listed.items():
        # In a table, only the values next to the operating point matter, so one start value does not exercise all of them.
        tables = {n for n in names or () if n.startswith("effect.empirical.")}
        assert names is None or found[output] <= names and names - tables == found[output] - tables, output
    assert any(found.values())
    instance.fmu.exitInitializationMode()
    running = instance.outputs()
    for known in model.description.modelVariables:
        if known.causality == "input" and known.type == "Real":
            instance.set(**{known.name: instance.get(known.name) + 1.0})
    assert instance.outputs() == running
    instance.free()
