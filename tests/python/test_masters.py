"""The launch in independent co-simulation masters, each compared with the tests' own Jacobi master, and a third check of the FMUs."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from lxml import etree
from master import couple

PLANT = [("omega_f", 11), ("omega_c", 12), ("T_fc", 14), ("theta_c", 15), ("E_d", 18)]
END = 1.3
"""Past lock-up, s."""


@pytest.fixture(scope="module")
def reference(plant, controller, launch_sets):
    """Outputs of plant and controller at END, coupled by a Jacobi master with a step of 1 ms."""
    p, c = plant.instance(**launch_sets["plant"]), controller.instance(**launch_sets["clutch_controller"])
    couple(p, c, [1e-3] * round(END * 1000), "jacobi")
    assert p.get("phase") == 3
    found = p.get(*(name for name, _ in PLANT))
    p.free(), c.free()
    return found


@pytest.mark.parametrize("structure", ["ssp", "osp"])
def test_libcosim_runs_the_launch(written, tmp_path, reference, structure):
    """libcosim's fixed-step algorithm is a Jacobi master, so only the last bits may differ."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    if structure == "ssp":
        zipfile.ZipFile(written / "launch.ssp").extractall(tmp_path)
        execution = CosimExecution.from_ssp_file(str(tmp_path), step_size=1_000_000)
    else:
        execution = CosimExecution.from_osp_config_file(str(written / "OspSystemStructure.xml"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    assert execution.simulate_until(round(END * 1e9))
    index = execution.slave_index_from_instance_name("plant")
    found = observer.last_real_values(index, [reference for _, reference in PLANT])
    assert found == pytest.approx(reference, rel=1e-9)


def test_a_container_of_both_runs_the_launch(written, plant, controller, tmp_path):
    """fmucontainer couples the FMUs inside one FMU, in C, as a Jacobi master; it omits the parameter sets."""
    for name in ("launch.ssp", "DrivelinePlant.fmu", "ClutchController.fmu"):
        shutil.copy(written / name, tmp_path)
    words = [tool("fmucontainer"), "-fmu-directory", str(tmp_path), "-container", "launch.ssp:0.001"]
    said = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr
    result = fmpy.simulate_fmu(str(tmp_path / "launch.fmu"), validate=False, stop_time=END, output_interval=1e-3)
    p, c = plant.instance(), controller.instance()
    couple(p, c, [1e-3] * round(END * 1000), "jacobi")
    found = [result[f"drivelineplant.{name}"][-1] for name in ("omega_f", "omega_c", "T_e")]
    assert found == pytest.approx(p.get("omega_f", "omega_c", "T_e"), rel=1e-9)
    p.free(), c.free()


def tool(name):
    return shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)


@pytest.mark.parametrize("model", ["DrivelinePlant", "ClutchController"])
def test_fmu_manipulation_toolbox_finds_no_error(fmus, model):
    said = subprocess.run([tool("fmutool"), "-input", str(fmus[model]), "-check"], capture_output=True, text=True)
    text = said.stdout + said.stderr
    assert said.returncode == 0 and "compliant with FMI-2.0" in text and "No semantic error" in text, text


def test_fmpy_runs_launch_ssp(written, plant, controller, launch_sets):
    """FMPy's SSP master makes its first step with all inputs at 0, and takes parameters as one set; otherwise it is a Jacobi master."""
    from types import SimpleNamespace

    from fmpy.ssp.simulation import simulate_ssp

    every = [(f"{who}.{name.replace('__', '.')}", value) for who, values in launch_sets.items() for name, value in values.items()]
    parameters = SimpleNamespace(parameters=[SimpleNamespace(name=name, value=value) for name, value in every])
    steps = round(END * 1000)
    result = simulate_ssp(str(written / "launch.ssp"), stop_time=END - 5e-4, step_size=1e-3, parameter_set=parameters)
    assert len(result) == steps
    p, c = plant.instance(**launch_sets["plant"]), controller.instance(**launch_sets["clutch_controller"])
    p.set(x_to=0.0, T_e_ref=0.0), c.set(omega_f=0.0, omega_c=0.0, T_e=0.0)
    p.step(1e-3), c.step(1e-3)
    couple(p, c, [1e-3] * (steps - 1), "jacobi")
    found = [result[f"plant.{name}"][-1] for name in ("omega_f", "omega_c", "T_e")]
    assert found == pytest.approx(p.get("omega_f", "omega_c", "T_e"), rel=1e-9)
    p.free(), c.free()


SCHEMAS = {
    "SystemStructure.ssd": "SystemStructureDescription",
    "resources/plant.ssv": "SystemStructureParameterValues",
    "resources/clutch_controller.ssv": "SystemStructureParameterValues",
}


@pytest.mark.parametrize("name", SCHEMAS)
def test_launch_ssp_follows_the_schema_of_ssp_1_0(written, name):
    """By the XSD that comes with FMPy."""
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / f"{SCHEMAS[name]}.xsd"
    document = etree.fromstring(zipfile.ZipFile(written / "launch.ssp").read(name))
    etree.XMLSchema(etree.parse(str(schema))).assertValid(document)


def test_launch_ssp_suits_omsimulator(written):
    """Requirements of OMSimulator: a master in its annotation, and components whose names are not prefixes of their variables' names.

    OMSimulator itself is not available as a binary from the package registry; docs/importers.md has the recipe.
    """
    archive = zipfile.ZipFile(written / "launch.ssp")
    structure = etree.fromstring(archive.read("SystemStructure.ssd"))
    masters = structure.findall("{*}System/{*}Annotations/{*}Annotation[@type='org.openmodelica']//{*}FixedStepMaster")
    assert [float(master.get("stepSize")) for master in masters] == [1e-3]
    for component in structure.iter("{*}Component"):
        with archive.open(component.get("source")) as fmu, zipfile.ZipFile(fmu) as inner:
            description = etree.fromstring(inner.read("modelDescription.xml"))
        names = [variable.get("name") for variable in description.iter("ScalarVariable")]
        assert not any(name.split(".")[0] == component.get("name") for name in names), component.get("name")
