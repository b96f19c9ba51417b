"""The page of ten thousand cars in a real browser, and the comparison of two answers. Needs Chromium with its driver and selenium for the first."""

import json
import random
import subprocess

import pytest
from conftest import find_command
from test_report_browser import CONTRAST

CARS = 10_000


def rows():
    """Cars in the form in which `kisspoint fleet` passes them to `kisspoint index`."""
    draw = random.Random(1)
    for k in range(CARS):
        bad = k % 10 == 0
        yield {
            "name": f"car_{k}", "report": f"cars/car_{k}/report.html", "error": "vehicle.json is missing" if k == 7 else None, "verdict": "explained" if bad else "no_gap",
            "confidence": 0.9, "where": "friction" if bad else None, "effects": [{"id": "friction_fade", "ambiguous_with": []}] if bad else [], "closed": draw.random(),
            "before": draw.gammavariate(3, 1), "after": 0.1, "mileage_km": draw.uniform(0, 2e5), "date": None, "off": ["driveline.J_f by +12 tolerances"] if k % 500 == 0 else None,
            "values": {f"number_{n}": [draw.gauss(0, 1), 0.1, "mm"] for n in range(12)},
        }  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    lines = folder / "rows.jsonl"
    lines.write_text("\n".join(json.dumps(row) for row in rows()))
    subprocess.run([find_command(), "index", "--rows", lines, "--out", folder / "index.html", "--title", "ten thousand"], check=True, capture_output=True)
    return folder / "index.html"


@pytest.fixture(scope="module")
def shown(page, browser):
    browser.get(page.as_uri())
    yield browser
    assert browser.get_log("browser") == []


def test_ten_thousand_cars_are_a_few_megabytes_and_few_elements(page, shown):
    assert page.stat().st_size < 6_000_000
    assert shown.execute_script("return document.querySelectorAll('*').length") < 1500
    assert shown.execute_script("return document.getElementById('count').textContent") == "10000 cars"


def test_the_list_scrolls_to_the_last_car(shown):
    shown.execute_script("const w = document.getElementById('window'); w.scrollTop = w.scrollHeight;")
    names = shown.execute_async_script("const done = arguments[0]; setTimeout(() => done([...document.querySelectorAll('#rows a')].map((a) => a.textContent)), 300)")
    assert names[-1] == "car_9999" and len(names) < 60


def test_filters_sorting_and_links_work(shown):
    js = shown.execute_script
    js("document.querySelector('[data-effect=friction_fade]').click()")
    assert js("return document.getElementById('count').textContent") == "1000 of 10000 cars"
    js("[...document.querySelectorAll('#head button')].find((b) => b.textContent.startsWith('Gap')).click()")
    gaps = js("return [...document.querySelectorAll('#rows [role=row] > :nth-child(5)')].map((e) => parseFloat(e.textContent))")
    assert gaps == sorted(gaps, reverse=True) and gaps[0] > 5
    assert js("return document.querySelector('#rows a').getAttribute('href')").startswith("cars/car_")
    js("document.getElementById('clear').click(); const o = document.getElementById('outliers'); o.checked = true; o.oninput()")
    assert js("return document.getElementById('count').textContent") == "20 of 10000 cars"
    js("document.getElementById('clear').click(); const f = document.getElementById('find'); f.value = 'missing'; f.oninput()")
    assert js("return document.querySelector('#rows [role=row]').textContent").startswith("car_7not diagnosed")
    js("document.getElementById('clear').click()")


def test_a_point_is_reached_by_keys_and_named(shown):
    js = shown.execute_script
    for over in ("", "mileage_km"):
        js("const o = document.getElementById('over'); o.value = arguments[0]; o.onchange()", over)
        assert js("return document.getElementById('hint').textContent") == "10000 cars have a value"
        js("document.getElementById('plot').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'}))")
        assert js("return document.getElementById('hint').textContent").startswith("car_")
        # The image of an empty canvas is short.
        assert js("return document.getElementById('plot').toDataURL().length") > 20_000


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_contrast(shown, scheme):
    shown.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
    low = [one for one in shown.execute_script(CONTRAST) if one[0] < 4.5]
    assert not low, low[:5]


def test_a_narrow_screen_scrolls_one_way(shown):
    shown.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 360, "height": 740, "deviceScaleFactor": 1, "mobile": True})
    assert shown.execute_script("return document.documentElement.scrollWidth") <= 360
    shown.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def answer(effects, tolerance=0.0):
    joint = {"unknowns": [{"name": "driveline.J_f", "kind": "tolerance", "value": tolerance, "sigma": 0.01, "relative": True, "one_sided": False, "same_as": None}], "precision": [[20.0]]}
    return {
        "verdict": "explained" if effects else "no_gap", "sentence": "", "confidence": 0.9, "where": {"primary": None}, "which": {"effects": effects},
        "how_far": {"before": 5.0, "after": 0.5, "closed_fraction": 0.9}, "plant": {"nominal_parameters": {"driveline.J_f": 0.2}}, "joint": joint,
    }  # fmt: skip


def test_a_repair_is_told(tmp_path, kisspoint):
    fade = {"id": "friction_fade", "ambiguous_with": [], "parameters": {"depth": {"value": 0.3, "low": 0.2, "high": 0.4, "unit": "1"}}}
    for name, content in (("before", answer([fade])), ("after", answer([], 2.0))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "diagnosis.json").write_text(json.dumps(content))
        (tmp_path / name / "report.html").write_text("")
    done = kisspoint("compare", tmp_path / "before", tmp_path / "after", "--out", tmp_path / "compare.html")
    assert done.stdout.startswith("Friction fade when hot is gone; driveline.J_f has changed.")
    page = (tmp_path / "compare.html").read_text()
    assert 'href="before/report.html"' in page and "<em>changed</em>" in page
    found = json.loads(kisspoint("compare", tmp_path / "before", tmp_path / "before", "--json").stdout)
    assert [e["change"] for e in found["effects"]] == ["stays"] and not any(c["significant"] for c in found["changes"])
    refused = kisspoint("compare", tmp_path / "before", tmp_path / "none", check=False)
    assert refused.returncode == 1 and "none/diagnosis.json" in refused.stderr
    kisspoint("index", tmp_path / "before", tmp_path / "after", "--out", tmp_path / "index.html")
    assert '"before/report.html"' in (tmp_path / "index.html").read_text()


def test_several_campaigns_of_one_call_get_an_index(tmp_path, kisspoint):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    done = kisspoint("diagnose", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "out", "--no-fmu", check=False)
    assert done.returncode == 1
    page = (tmp_path / "out/index.html").read_text()
    assert "No car could be diagnosed." in page and "2 campaigns could not be diagnosed" in page
