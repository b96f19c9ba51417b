"""Both FMUs as `kisspoint fmu` writes them, and the command itself."""

import fcntl
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from lxml import etree

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "tests/data/campaigns/example"
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")


def chromium():
    """Headless Chromium, controlled by its driver, which records console and network."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1280,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))


@pytest.fixture(scope="module")
def browser():
    """A browser that all tests of a module share."""
    if not (BROWSER and DRIVER):
        pytest.skip("no Chromium with chromedriver on the path: apt-get install chromium chromium-driver")
    driver = chromium()
    yield driver
    driver.quit()


def find_command() -> Path:
    """Path of the command: $KISSPOINT, or the newest of the builds."""
    if "KISSPOINT" in os.environ:
        return Path(os.environ["KISSPOINT"])
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    built = [p for p in (target / profile / "kisspoint" for profile in ("release", "quick", "debug")) if p.is_file()]
    if not built:
        pytest.exit("no kisspoint command was found: run `cargo build --release`, or set KISSPOINT", returncode=2)
    return max(built, key=lambda p: p.stat().st_mtime)


@pytest.fixture(scope="session")
def kisspoint():
    command = find_command()
    # `kisspoint fleet` runs this checkout's Python package.
    python = {"PYTHONPATH": str(ROOT / "python"), "KISSPOINT_PYTHON": sys.executable}

    def run(*arguments, check=True):
        words = [str(command), *map(str, arguments)]
        return subprocess.run(words, check=check, capture_output=True, text=True, env={**os.environ, **python})

    return run


@pytest.fixture(scope="session")
def example_answer(kisspoint, tmp_path_factory):
    """Folder with the answer to the bundled campaign, including its evidence. All workers share it; the first one that asks computes it."""
    shared = tmp_path_factory.getbasetemp()
    shared = (shared.parent if "PYTEST_XDIST_WORKER" in os.environ else shared) / "example_answer"
    with open(f"{shared}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (shared / "diagnosis.json").is_file():
            kisspoint("diagnose", EXAMPLE, "--out", shared, "--evidence")
    return shared


@pytest.fixture(scope="session")
def written(kisspoint, tmp_path_factory):
    """The directory that `kisspoint fmu` fills."""
    out = tmp_path_factory.mktemp("fmus")
    kisspoint("fmu", "--out", out)
    return out


@pytest.fixture(scope="session")
def fmus(written):
    """Paths of the FMUs by model name."""
    return {path.stem: path for path in written.glob("*.fmu")}


@pytest.fixture(scope="session")
def launch_sets(written):
    """Parameter sets in launch.ssp, by component, with dots written as two underscores."""
    archive = zipfile.ZipFile(written / "launch.ssp")

    def read(component):
        root = etree.fromstring(archive.read(f"resources/{component}.ssv"))
        return {p.get("name").replace(".", "__"): float(p[0].get("value")) for p in root.iter("{*}Parameter")}

    return {component: read(component) for component in ("plant", "clutch_controller")}


@pytest.fixture(scope="session")
def plant(fmus):
    from master import Model

    return Model(fmus["DrivelinePlant"])


@pytest.fixture(scope="session")
def controller(fmus):
    from master import Model

    return Model(fmus["ClutchController"])
