"""evidence.ssp is valid, and a reader who has nothing else can reproduce its numbers with FMPy."""

import hashlib
import json
import zipfile
from pathlib import Path

import fmpy
import pytest
import xmlschema
from lxml import etree
from master import Model
from test_diagnosis import EXAMPLE, SPEEDS, recording, speed_errors

STMD = "extra/org.ssp-standard.ssp-traceability.stmd/SimulationTask.stmd"
LS_REF = "extra/org.fmi-standard.fmi-ls-ref"
SCHEMAS = Path(__file__).resolve().parents[1] / "data" / "schemas"
"""As published by the Modelica Association; LICENSE.txt there says where."""


@pytest.fixture(scope="module")
def evidence(example_answer, tmp_path_factory):
    out = tmp_path_factory.mktemp("evidence")
    zipfile.ZipFile(example_answer / "evidence.ssp").extractall(out)
    return out


def test_a_reader_with_the_archive_alone_repeats_its_numbers(evidence):
    resources = evidence / "resources"
    answer = json.loads((resources / "diagnosis.json").read_text())
    noted = json.loads((resources / "experiments" / "recordings.json").read_text())
    model = Model(resources / "DrivelinePlant.fmu")
    assert set(noted) == set(answer["how_far"]["held_out"])
    compared = 0
    for figure in ("before", "after"):
        values = answer["plant"]["nominal_parameters" if figure == "before" else "parameters"]
        for name in noted:
            found = speed_errors(model, recording(resources / "experiments", name), noted[name], values, values if figure == "before" else {})
            for row in answer["how_far"]["per_recording"]:
                if row["recording"] == name and row["channel"] in SPEEDS:
                    assert found[row["channel"]] == pytest.approx(row[figure], rel=0.01), (figure, name, row["channel"])
                    compared += 1
    assert compared == 4 * len(noted)


def test_of_a_drive_it_is_the_engagement_that_judged(kisspoint, tmp_path):
    """For a drive, the experiment is the held-out engagement. Its start temperatures are those of the retuned plant, so that the gap is reproduced."""
    drawn = ("--road", "--cars", 1, "--seed", 4, "--drives", 1, "--drive-length", 60, "--draw-only", "--keep", tmp_path / "drawn")
    kisspoint("blind", *drawn)
    kisspoint("diagnose", tmp_path / "drawn" / "case_001", "--out", tmp_path / "out", "--evidence", "--threads", 1)
    zipfile.ZipFile(tmp_path / "out" / "evidence.ssp").extractall(tmp_path / "evidence")
    resources = tmp_path / "evidence" / "resources"
    answer = json.loads((resources / "diagnosis.json").read_text())
    ((name, noted),) = json.loads((resources / "experiments" / "recordings.json").read_text()).items()
    of, at = name.split("_at_")
    assert answer["how_far"]["held_out"] == [f"the engagement at {at.replace('_', ' ')} of {of}"]
    found = speed_errors(Model(resources / "DrivelinePlant.fmu"), recording(resources / "experiments", name), noted, answer["plant"]["parameters"], {})
    after = {row["channel"]: row["after"] for row in answer["how_far"]["per_recording"]}
    assert found == pytest.approx(after, rel=0.01)


def test_every_checksum_is_right(evidence):
    described = list(evidence.glob("resources/**/*.srmd"))
    assert len(described) == len([p for p in evidence.glob("resources/**/*") if p.is_file()]) / 2
    for path in described:
        root = etree.parse(path).getroot()
        data = path.parent / root.get("data")
        assert root.get("checksumType") == "SHA3-256"
        assert hashlib.sha3_256(data.read_bytes()).hexdigest() == root.get("checksum"), data.name


def test_the_task_names_resources_that_are_there(evidence):
    task = etree.parse(evidence / STMD).getroot()
    sources = [r.get("source") for r in task.iter("{*}Resource") if r.get("source")]
    assert {"model", "parameter", "testcase", "result", "report"} <= {r.get("kind") for r in task.iter("{*}Resource")}
    for source in sources:
        assert ((evidence / STMD).parent / source).is_file(), source


def test_the_fmu_holds_what_its_manifest_names(evidence):
    archive = zipfile.ZipFile(evidence / "resources" / "DrivelinePlant.fmu")
    manifest = etree.fromstring(archive.read(f"{LS_REF}/fmi-ls-manifest.xml"))
    roles = set()
    for related in manifest.iter("Related"):
        assert f"{LS_REF}/{related.get('source')}" in archive.namelist()
        roles.add(related.get("role"))
    assert {"parameter", "experiment/validation", "result", "report", "meta-data"} <= roles


def test_the_structure_follows_the_schema_of_ssp_1_0(evidence):
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureDescription.xsd"
    etree.XMLSchema(etree.parse(str(schema))).assertValid(etree.parse(evidence / "SystemStructure.ssd"))


XLINK = """<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" targetNamespace="http://www.w3.org/1999/xlink">
  %s</xs:schema>""" % "".join(f'<xs:attribute name="{name}" type="xs:string"/>' for name in "type href role arcrole title show actuate label from to".split())


def published(name, folder):
    """A published schema (XSD 1.1), whose imports are resolved on this machine instead of over the network."""
    (folder / "xlink.xsd").write_text(XLINK)
    places = [*SCHEMAS.glob("*.xsd"), folder / "xlink.xsd", *(Path(fmpy.__file__).parent / "schema/fmi3").glob("*.xsd")]
    here = {place.name: place.as_uri() for place in places}
    return xmlschema.XMLSchema11(str(SCHEMAS / name), uri_mapper=lambda uri: here.get(uri.rsplit("/", 1)[-1], uri), allow="local")


def test_the_metadata_follow_their_published_schemas(evidence, tmp_path):
    task, resource = published("STMD.xsd", tmp_path), published("SRMD.xsd", tmp_path)
    reference = published("fmi3LayeredStandardReferenceManifest.xsd", tmp_path)
    task.validate(str(evidence / STMD))
    for path in evidence.glob("resources/**/*.srmd"):
        resource.validate(str(path))
    archive = zipfile.ZipFile(evidence / "resources" / "DrivelinePlant.fmu")
    for name in archive.namelist():
        if name.startswith(LS_REF) and name.endswith(".srmd"):
            resource.validate(archive.read(name).decode())
    manifest = archive.read(f"{LS_REF}/fmi-ls-manifest.xml").decode()
    reference.validate(manifest)
    # The schemas can refuse: a missing attribute that is required, or an unknown kind.
    assert not reference.is_valid(manifest.replace("role=", "use=", 1))
    assert not task.is_valid((evidence / STMD).read_text().replace('kind="testcase"', 'kind="anything"'))
    assert not resource.is_valid(next(evidence.glob("resources/*.srmd")).read_text().replace(" name=", " named=", 1))
