"""evidence.ssp: it is valid, and a reader who has nothing else repeats its numbers with FMPy."""

import hashlib
import json
import os
import re
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
SCHEMAS = os.environ.get("KISSPOINT_SCHEMAS")
"""Folder with the repositories ssp-ls-traceability, ssp-standard and fmi-ls-ref of the Modelica Association, checked out; their schemas are in no package registry."""


@pytest.fixture(scope="module")
def evidence(kisspoint, tmp_path_factory):
    out = tmp_path_factory.mktemp("evidence")
    kisspoint("diagnose", EXAMPLE, "--out", out / "answer", "--evidence")
    archive = zipfile.ZipFile(out / "answer" / "evidence.ssp")
    archive.extractall(out / "unpacked")
    return out / "unpacked"


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


def published(path, folder):
    """A published schema (XSD 1.1), whose imports are looked up on this machine instead of on the network."""
    import fmu_manipulation_toolbox

    xlink = folder / "xlink.xsd"
    names = ("type", "href", "role", "arcrole", "title", "show", "actuate", "label", "from", "to")
    attributes = "".join(f'<xs:attribute name="{name}" type="xs:string"/>' for name in names)
    head = '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" targetNamespace="http://www.w3.org/1999/xlink">'
    xlink.write_text(f"{head}{attributes}</xs:schema>")
    text = path.read_text()
    manifest = Path(fmu_manipulation_toolbox.__file__).parent / "resources/fmi-3.0/fmi3LayeredStandardManifest.xsd"
    where = [Path(SCHEMAS) / "ssp-standard/schema/SystemStructureCommon.xsd", xlink, manifest, Path(SCHEMAS) / "ssp-ls-traceability/STC.xsd"]
    for place in where:
        text = re.sub(rf'schemaLocation="[^"]*{re.escape(place.name)}"', f'schemaLocation="{place.as_uri()}"', text)
    local = folder / path.name
    local.write_text(text)
    # STC itself imports the same two.
    common = folder / "STC.xsd"
    if path.name != "STC.xsd" and "STC.xsd" in text:
        published(where[3], folder)
        local.write_text(text.replace(where[3].as_uri(), common.as_uri()))
    return xmlschema.XMLSchema11(str(local), validation="lax")


@pytest.mark.skipif(not SCHEMAS, reason="KISSPOINT_SCHEMAS names no folder with ssp-ls-traceability and fmi-ls-ref")
def test_the_metadata_follow_their_published_schemas(evidence, tmp_path):
    traceability, reference = Path(SCHEMAS) / "ssp-ls-traceability", Path(SCHEMAS) / "fmi-ls-ref"
    published(traceability / "STMD.xsd", tmp_path).validate(str(evidence / STMD))
    srmd = published(traceability / "SRMD.xsd", tmp_path)
    for path in evidence.glob("resources/**/*.srmd"):
        srmd.validate(str(path))
    schema = published(reference / "schema/fmi3LayeredStandardReferenceManifest.xsd", tmp_path)
    manifest = zipfile.ZipFile(evidence / "resources" / "DrivelinePlant.fmu").read(f"{LS_REF}/fmi-ls-manifest.xml")
    schema.validate(manifest.decode())
