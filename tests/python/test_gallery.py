"""The gallery (`packaging/gallery.py`): every report of it opens in a browser without a word on the console, fits a narrow screen, and says its doubts.

$KISSPOINT_GALLERY names a gallery that is built already; else one is built without the drive, which takes minutes.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT, find_command
from test_report_browser import BROWSER, DRIVER, NO_BROWSER

pytestmark = pytest.mark.skipif(not (BROWSER and DRIVER), reason=NO_BROWSER)


@pytest.fixture(scope="module")
def gallery(tmp_path_factory):
    if "KISSPOINT_GALLERY" in os.environ:
        return Path(os.environ["KISSPOINT_GALLERY"]).resolve()
    out = tmp_path_factory.mktemp("gallery")
    environment = {**os.environ, "KISSPOINT": str(find_command())}
    subprocess.run([sys.executable, ROOT / "packaging/gallery.py", out, "--without", "drive"], check=True, env=environment, capture_output=True)
    return out


@pytest.fixture(scope="module")
def driver():
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def reports(gallery):
    return sorted(gallery.rglob("report.html"))


def test_there_is_a_report_of_every_kind_and_the_index_leads_to_each(gallery, driver):
    found = {report.relative_to(gallery).parts[0] for report in reports(gallery)}
    assert found >= {"healthy", "single", "pair", "three", "unknown", "thin", "fleet"}
    driver.get((gallery / "index.html").as_uri())
    links = {link.get_attribute("href") for link in driver.find_elements("css selector", "a")}
    assert links == {report.as_uri() for report in reports(gallery)}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_report_opens_quietly_and_fits_a_narrow_screen(gallery, driver, scheme):
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": False})
    for report in reports(gallery):
        driver.get(report.as_uri())
        assert driver.get_log("browser") == [], report
        assert driver.execute_script("return document.documentElement.scrollWidth") <= 390, report
        assert driver.find_elements("css selector", "#stage figure svg"), report
        drawn = driver.execute_script("return [...document.querySelectorAll('#stage path')].map((p) => p.getAttribute('d')).join('')")
        assert "NaN" not in drawn and "Infinity" not in drawn, report


def test_thin_data_take_the_tick_away(gallery, driver):
    driver.get((gallery / "thin/report.html").as_uri())
    assert any("Thin data: 2 recordings" in doubt.text for doubt in driver.find_elements("css selector", ".doubts .grave"))
    assert "✓" not in driver.find_element("css selector", "header > .pill").text
