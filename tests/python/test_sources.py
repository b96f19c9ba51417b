"""FMUs compiled from their C sources as C99 by gcc, here and for ARM, give the same results as the binaries, step by step."""

import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from master import Model, couple

ROOT = Path(__file__).resolve().parents[2]
SOURCES = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "fmu-sources"
# Little optimisation, because the compiler takes most of the time of this test.
FLAGS = ["-std=c99", "-Og", "-w"]

pytestmark = pytest.mark.skipif(not (SOURCES / "kisspoint.c").is_file(), reason="packaging/sources.sh has not been run")


@pytest.fixture(scope="module")
def with_sources(kisspoint, tmp_path_factory):
    out = tmp_path_factory.mktemp("sources")
    kisspoint("fmu", "--out", out, "--sources", SOURCES)
    return out


def compiled(fmu, folder, compiler, *flags):
    """Compiles the FMU's own sources as its description says: the file that it names."""
    zipfile.ZipFile(fmu).extractall(folder)
    library = folder / f"{fmu.stem}.so"
    words = [compiler, *FLAGS, *flags, "-shared", "-fPIC", "-fvisibility=hidden", "-o", library, folder / "sources/all.c", "-lm"]
    subprocess.run(list(map(str, words)), check=True)
    return library


def from_sources(fmu, folder):
    model = Model(fmu)
    shutil.copy(compiled(fmu, folder, "gcc"), Path(model.folder) / "binaries/linux64" / f"{fmu.stem}.so")
    return model


def test_every_step_of_the_launch_is_that_of_the_binaries(with_sources, plant, controller, launch_sets, tmp_path):
    pairs = []
    for p, c in (
        (plant, controller),
        (from_sources(with_sources / "DrivelinePlant.fmu", tmp_path / "p"), from_sources(with_sources / "ClutchController.fmu", tmp_path / "c")),
    ):
        effects = {"effect__driveline_compliance__compliance": 1e-3, "effect__clutch_speed_delay__delay": 0.01, **launch_sets["plant"]}
        pairs.append((p.instance(**effects), c.instance(**launch_sets["clutch_controller"])))
    worst = 0.0
    for _ in range(2000):
        found = []
        for p, c in pairs:
            couple(p, c, [1e-3])
            found.append([*p.outputs().values(), *c.outputs().values()])
        worst = max(worst, *(abs(a - b) / max(abs(a), 1.0) for a, b in zip(*found)))
    print(f"worst difference of an output in 2000 steps: {worst:.1e}")
    assert worst < 1e-9 and pairs[0][0].get("phase") == 3
    # Roll-back and refusals work there, too.
    p = pairs[1][0]
    state, time = p.save(), p.time
    before = p.outputs()
    p.step(0.1)
    p.restore(state, time)
    p.step(0.1)
    assert p.outputs() != before and p.bytes() != b""
    with pytest.raises(Exception):
        p.set(x_to=float("nan"))


def test_what_others_wrote_is_named_with_its_licence(with_sources):
    archive = zipfile.ZipFile(with_sources / "DrivelinePlant.fmu")
    stated = archive.read("licenses/third-party.txt").decode()
    texts = [archive.read(name).decode() for name in archive.namelist() if name.startswith("sources/")]
    holders = {holder for text in texts for holder in re.findall(r"Copyright (?:\(c\) )?\d+ (.+)", text)}
    assert holders and all(holder in stated for holder in holders), holders


@pytest.mark.skipif(not shutil.which("arm-linux-gnueabihf-gcc") or not shutil.which("qemu-arm"), reason="no ARM compiler, or no qemu-arm")
def test_sources_compile_and_run_on_arm(with_sources, kisspoint, tmp_path):
    """A 32-bit target: the coupled launch of tests/cross/launch.c, with both models from the plant's sources, which contain both as the binary does; the GUID selects one."""
    compiler = "arm-linux-gnueabihf-gcc"
    fmus = [with_sources / f"{name}.fmu" for name in ("DrivelinePlant", "ClutchController")]
    library = compiled(fmus[0], tmp_path / "arm", compiler)
    guids = [Model(fmu).description.guid for fmu in fmus]
    launch = ROOT / "tests/cross/launch.c"
    native, arm = tmp_path / "launch", tmp_path / "launch_arm"
    subprocess.run(["gcc", "-O2", launch, "-o", native, "-ldl"], check=True)
    subprocess.run([compiler, "-O2", launch, "-o", arm, "-ldl"], check=True)
    binary = Path(Model(fmus[0]).folder) / "binaries/linux64/DrivelinePlant.so"
    expected = subprocess.run([native, binary, *guids], check=True, capture_output=True, text=True).stdout.split()
    words = ["qemu-arm", "-L", "/usr/arm-linux-gnueabihf", arm, library, *guids]
    found = subprocess.run(list(map(str, words)), check=True, capture_output=True, text=True).stdout.split()
    assert len(found) == len(expected) == 48
    assert [float(x) for x in found[2::3]] == pytest.approx([float(x) for x in expected[2::3]], rel=1e-9)
