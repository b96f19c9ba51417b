"""What if: the plant in the report replays a recording as the FMU does; without it, the page contains replays made beforehand."""

import base64
import gzip
import json
import shutil
import subprocess
from pathlib import Path
from urllib.parse import unquote

import pytest
from conftest import ROOT, find_command
from master import Model
from test_diagnosis import EXAMPLE, recording, starts, subset

COLUMNS = ("omega_f", "omega_c")
EFFECT = "kiss_point_thermal"


def module():
    """Path of the plant's WebAssembly module, where the command looks for it."""
    beside = find_command().resolve().parent
    places = (beside / "libraries/wasm32/kisspoint.wasm", beside / "../fmu-sources/kisspoint.wasm")
    return next((place for place in places if place.is_file()), None)


class Page:
    """A report with its "what if" section open."""

    def __init__(self, driver, report, shown):
        self.driver = driver
        driver.get("about:blank")
        driver.get(f"{report.as_uri()}#recording={shown}")
        driver.execute_script("document.getElementById('what-if').open = true")
        self.said()

    def said(self):
        """The message of a replay, once it is finished."""
        from selenium.webdriver.support.wait import WebDriverWait

        text = lambda _: self.driver.execute_script("return document.getElementById('what-if-said').textContent")
        return WebDriverWait(self.driver, 20).until(text)

    def drag(self, share):
        """Moves the first slider to a share of its range. Returns its value."""
        value = self.driver.execute_script(
            """document.getElementById("what-if-said").textContent = "";
            const s = document.querySelector("#what-if-sizes input");
            s.value = Number(s.min) + arguments[0] * (Number(s.max) - Number(s.min));
            s.dispatchEvent(new Event("input"));
            return Number(s.value);""",
            share,
        )
        said = self.said()
        assert said.startswith("Car minus model (rms): Flywheel speed before "), said
        return value

    def press(self, size):
        self.driver.execute_script(
            "document.getElementById('what-if-said').textContent = ''; document.querySelector(`#what-if button[data-size=${arguments[0]}]`).click()", size
        )
        return self.said()

    def curves(self):
        """Columns of the tables of both speeds, as they are saved."""
        tables = self.driver.execute_script(
            """const saved = [], click = HTMLAnchorElement.prototype.click;
            HTMLAnchorElement.prototype.click = function () { saved.push(this.href); };
            for (const b of [...document.querySelectorAll("#stage .save button[aria-label$=CSV]")].slice(0, 2)) b.click();
            HTMLAnchorElement.prototype.click = click;
            return saved;"""
        )
        for table in tables:
            head, *rows = unquote(table.split(",", 1)[1]).splitlines()
            yield dict(zip((name.split(" [")[0] for name in head.split(",")), zip(*([float(cell) for cell in row.split(",")] for row in rows))))


@pytest.fixture(scope="module")
def answer(example_answer):
    if module() is None:
        pytest.skip("packaging/sources.sh has not made the plant for browsers")
    return example_answer


def by_the_fmu(fmu, name, parameters):
    """Both speeds at each row, from the FMU driven by a master."""
    noted = json.loads((EXAMPLE / "recordings.json").read_text())[name]
    values = json.loads((fmu.parent / "diagnosis.json").read_text())["plant"]["parameters"]
    measured = recording(EXAMPLE, name)
    held = [dict(zip(("x_to", "T_e_ref", "theta_h"), row)) for row in zip(*(measured[c] for c in ("x_to_cmd_mm", "T_e_Nm", "theta_h_degC")))]
    plant = Model(fmu).instance(**parameters, **starts(measured, noted, values), **held[0])
    found = {column: [] for column in COLUMNS}
    for k, inputs in enumerate(held):
        for column in COLUMNS:
            found[column].append(plant.get(column))
        plant.set(**inputs)
        if k + 1 < len(held):
            plant.step(measured["time_s"][k + 1] - measured["time_s"][k])
    plant.free()
    return found


@pytest.mark.parametrize("share", [0.1, 0.95])
@pytest.mark.parametrize("shown", ["r01", "held out"])
def test_the_plant_in_the_page_is_the_fmu(answer, browser, shown, share):
    if shown == "held out":
        shown = json.loads((answer / "diagnosis.json").read_text())["how_far"]["held_out"][0]
    page = Page(browser, answer / "report.html", shown)
    value = page.drag(share)
    expected = by_the_fmu(answer / "DrivelinePlant.fmu", shown, {f"effect.{EFFECT}.slope": value})
    for column, table in zip(COLUMNS, page.curves(), strict=True):
        assert len(table["what if"]) == len(expected[column])
        assert table["what if"] == pytest.approx(expected[column], rel=1e-9, abs=1e-9)
        # It differs from the plant of the verdict, otherwise the slider would have no effect.
        assert max(abs(a - b) for a, b in zip(table["what if"], table["after"])) > 0.5
    assert browser.get_log("browser") == []


def test_as_found_it_is_what_the_report_shows(answer, browser):
    shown = json.loads((answer / "diagnosis.json").read_text())["how_far"]["held_out"][0]
    page = Page(browser, answer / "report.html", shown)
    page.drag(0.9)
    page.press("found")
    for table in page.curves():
        assert table["what if"] == pytest.approx(table["after"], abs=0.05)
    browser.execute_script("document.getElementById('what-if').open = false")
    browser.implicitly_wait(0)
    assert browser.execute_async_script("setTimeout(() => arguments[0](document.querySelectorAll('#stage .c-whatif').length), 200)") == 0


def test_as_found_it_is_what_the_report_shows_also_where_the_start_temperature_was_fitted(browser, kisspoint, tmp_path):
    if module() is None:
        pytest.skip("packaging/sources.sh has not made the plant for browsers")
    campaign = subset(["r01", "r02", "r04", "r05"], tmp_path / "campaign")
    noted = json.loads((campaign / "recordings.json").read_text())
    noted["r05"].update(theta_c0_degC=noted["r05"]["theta_c0_degC"] + 30.0, theta_c0_sigma_K=30.0)
    (campaign / "recordings.json").write_text(json.dumps(noted))
    kisspoint("diagnose", campaign, "--out", tmp_path / "out")
    assert "r05" not in json.loads((tmp_path / "out/diagnosis.json").read_text())["how_far"]["held_out"]
    page = Page(browser, tmp_path / "out/report.html", "r05")
    drives = json.loads(browser.execute_script("return document.getElementById('what-if-data').textContent"))["drives"]
    start = json.loads(gzip.decompress(base64.b64decode(drives[list(noted).index("r05")])))["start"]
    assert abs(start[2] - noted["r05"]["theta_c0_degC"]) > 10.0, "the fit has found that the temperature noted is wrong"
    page.drag(0.9)
    page.press("found")
    for table in page.curves():
        assert table["what if"] == pytest.approx(table["after"], abs=0.1)


def test_every_effect_can_be_tried_on_every_recording(answer, browser):
    page = Page(browser, answer / "report.html", "r01")
    effects = browser.execute_script("return [...document.querySelectorAll('#what-if-effect option')].map((o) => o.value)")
    assert len(effects) == 24 and effects[0] == EFFECT
    for effect in effects:
        browser.execute_script(
            "const s = document.getElementById('what-if-effect'); s.value = arguments[0]; s.dispatchEvent(new Event('change'))", effect
        )
        page.drag(0.6)
    for k in range(len(browser.find_elements("css selector", ".card"))):
        browser.execute_script("document.getElementById('what-if-said').textContent = ''; document.querySelectorAll('.card')[arguments[0]].click()", k)
        assert page.said().startswith("Car minus model")


def test_without_the_plant_there_are_replays_made_beforehand(browser, tmp_path):
    command = find_command().resolve()
    for file in (command, command.with_name("libkisspoint.so")):
        shutil.copy(file, tmp_path)
    out = tmp_path / "out"
    subprocess.run([tmp_path / command.name, "diagnose", EXAMPLE, "--out", out], check=True, capture_output=True)
    page = Page(browser, out / "report.html", json.loads((out / "diagnosis.json").read_text())["how_far"]["held_out"][0])
    assert "nothing is interpolated" in browser.find_element("id", "what-if").text
    assert page.drag(0.5) == 100
    for table in page.curves():
        assert table["what if"] == pytest.approx(table["after"], abs=0.05)
    assert page.drag(0.0) == 0
    for table in page.curves():
        assert max(abs(a - b) for a, b in zip(table["what if"], table["after"])) > 0.5
    assert (out / "report.html").stat().st_size < 2_500_000
