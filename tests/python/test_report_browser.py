"""The report in a real browser: console, cursor, zoom, keys, contrast, narrow screens, paper.

Two reports are tested: that of the bundled campaign, as `kisspoint diagnose` writes it, and one that contains everything a report can contain
(`examples/report.rs`: bench channels, ambiguity groups, a recording left out). `KISSPOINT_REPORT` names another one to test instead.
Needs Chromium with its driver and selenium.
"""

import base64
import json
import os
import re
import subprocess
import unittest
from pathlib import Path
from urllib.parse import quote

import pytest
from conftest import ROOT
from test_quoted import words

# Contrast of every text and of the curves with their background, by the formula of WCAG 2.
CONTRAST = r"""
const channels = (c) => (c.match(/[\d.]+/g) || []).map(Number);
const light = (c) => { const [r, g, b] = c.slice(0, 3).map((v) => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; }); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
const opaque = (c) => c.length > 2 && (c.length === 3 || c[3] === 1);
const behind = (e) => { for (; e; e = e.parentElement) { const c = channels(getComputedStyle(e).backgroundColor); if (opaque(c)) return c; } return [255, 255, 255]; };
const out = [];
for (const e of document.querySelectorAll("#stage .c-real, #stage .c-before, #stage .c-after")) {
  const grounds = e.closest("figure").querySelectorAll(".floor, .s0, .s1, .s2");
  for (const ground of [behind(e), ...[...grounds].map((g) => channels(getComputedStyle(g).fill))]) {
    const [a, b] = [light(channels(getComputedStyle(e).stroke)), light(ground)].sort((x, y) => y - x);
    out.push([(a + 0.05) / (b + 0.05), "curve", e.getAttribute("class")]);
  }
}
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const e = walker.currentNode.parentElement, text = walker.currentNode.textContent.trim();
  if (!text || ["SCRIPT", "STYLE"].includes(e.tagName) || !e.getClientRects().length) continue;
  const style = getComputedStyle(e), svg = e.namespaceURI.includes("svg");
  const ink = channels(svg ? style.fill : style.color);
  const strip = svg && e.ownerSVGElement.querySelector(".floor");
  for (const ground of [behind(e), ...(strip ? [channels(getComputedStyle(strip).fill)] : [])]) {
    const [a, b] = [light(ink), light(ground)].sort((x, y) => y - x);
    out.push([(a + 0.05) / (b + 0.05), text.slice(0, 40), e.tagName + "." + (e.getAttribute("class") || "")]);
  }
}
return out;
"""


def bundled(request):
    """The report of the bundled campaign."""
    return request.getfixturevalue("example_answer") / "report.html"


def made_up(request):
    """The report that contains everything."""
    target = request.getfixturevalue("tmp_path_factory").mktemp("report") / "report.html"
    profile = os.environ.get("KISSPOINT_PROFILE", "dev")
    subprocess.run(["cargo", "run", "--quiet", "--profile", profile, "--example", "report", "--", str(target)], cwd=ROOT, check=True)
    return target


def unpack(text):
    """Decodes integers as the page packs them: differences in groups of seven bits, doubled with the sign in the last bit, one added; None for zero."""
    out, level, value, weight = [], 0, 0, 1
    for byte in base64.b64decode(text):
        value += (byte & 127) * weight
        weight *= 128
        if byte & 128:
            continue
        if value:
            level += -value // 2 if (value - 1) % 2 else (value - 1) // 2
        out.append(level if value else None)
        value, weight = 0, 1
    return out


class Browser:
    """Tests that apply to every report."""

    make = None

    @pytest.fixture(scope="class", autouse=True)
    @classmethod
    def opened(cls, browser, request):
        """Opens the report in the browser."""
        named = os.environ.get("KISSPOINT_REPORT")
        cls.path = Path(named).resolve() if named else cls.make(request)
        cls.url, cls.driver = cls.path.as_uri(), browser

    def setUp(self):
        self.screen(1280, 900)
        self.media("light")
        self.driver.get(self.url)
        self.data = json.loads(self.js("return document.getElementById('series').textContent"))["recordings"]
        self.shown = self.data[int(self.find(".card[aria-pressed=true]")[0].get_attribute("data-recording"))]

    def screen(self, width, height):
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        )

    def media(self, scheme, kind=""):
        # Without animations, because the pointer would miss its target on a page that is still scrolling.
        features = [{"name": "prefers-color-scheme", "value": scheme}, {"name": "prefers-reduced-motion", "value": "reduce"}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": kind, "features": features})

    def js(self, code, *arguments):
        return self.driver.execute_script(code, *arguments)

    def find(self, selector):
        return self.driver.find_elements("css selector", selector)

    def actions(self):
        from selenium.webdriver import ActionChains

        return ActionChains(self.driver, duration=20)

    def texts(self, selector):
        """All texts at one moment, because the page redraws its plots at any time."""
        return self.js("return [...document.querySelectorAll(arguments[0])].map(e => e.innerText ?? e.textContent)", selector)

    def reads(self):
        return self.texts("#stage .read")

    def ticks(self):
        return self.texts("#stage figure:first-child .tick.x")

    def to_stage(self):
        """Scrolls to the first plot and focuses it. Returns the plot."""
        self.js("document.getElementById('stage').focus(); document.getElementById('stage').scrollIntoView()")
        return self.find("#stage figure > svg")[0]

    def press(self, *keys):
        self.actions().send_keys(*keys).perform()

    def test_it_fits_into_a_mail(self):
        self.assertLess(self.path.stat().st_size, 2_500_000)

    def test_console_is_silent_and_nothing_is_fetched(self):
        self.driver.get_log("performance")
        self.driver.get(self.url)
        self.assertEqual(self.driver.get_log("browser"), [])
        fetched = [
            url
            for entry in self.driver.get_log("performance")
            if '"Network.requestWillBeSent"' in entry["message"]
            for url in re.findall(r'"request":\{.*?"url":"(.*?)"', entry["message"])
        ]
        self.assertTrue(all(url == self.url or url.startswith("data:") for url in fetched), fetched)

    def test_hover_reads_all_curves_of_all_channels(self):
        plot = self.to_stage()
        before = self.reads()
        self.assertTrue(all(text.startswith("car minus model (rms) in view") for text in before if text), before)
        self.assertGreaterEqual(sum(bool(text) for text in before), 2)
        self.actions().move_to_element_with_offset(plot, 60, -30).perform()
        reads = self.reads()
        self.assertGreaterEqual(len(reads), 2)
        for text in reads[:2]:
            self.assertRegex(text, r"car −?[\d.]+\s+before −?[\d.]+ \(car minus model [+−]?[\d.]+\)\s+after −?[\d.]+ \(car minus model [+−]?[\d.]+\)")
        self.assertRegex(self.find("#shown")[0].text, r"t = \d\.\d\d+ s")
        places = self.js("return [...document.querySelectorAll('#stage .cursor')].map((c) => c.getAttribute('d').split('V')[0])")
        self.assertEqual(len(set(places)), 1, "the cursor stands at one instant in all channels")

    def test_values_read_are_those_of_the_data(self):
        """Decodes the integers in Python and compares them with the values shown."""
        channel = self.shown["channels"][0]
        self.to_stage()
        self.press("\ue011", "\ue014")  # home, right
        real = unpack(channel["real"])[1] * channel["q"]
        before = real - unpack(channel["before"])[1] * channel["q"]
        shown = [float(v.replace("−", "-")) for v in re.findall(r"(?:car|before) (−?[\d.]+)", self.reads()[0])]
        self.assertAlmostEqual(shown[0], real, delta=0.06)
        self.assertAlmostEqual(shown[1], before, delta=0.06)

    def test_drag_zooms_and_double_click_resets(self):
        plot = self.to_stage()
        whole = self.ticks()
        self.actions().move_to_element_with_offset(plot, -200, 0).click_and_hold().move_by_offset(90, 5).release().perform()
        zoomed = self.ticks()
        self.assertNotEqual(zoomed, whole)
        width = self.js("return document.querySelector('#stage figure > svg').viewBox.baseVal.width")
        seconds = [float(t.split()[0]) for t in zoomed]
        span = float(whole[-1].split()[0])
        self.assertLess(seconds[-1] - seconds[0], span * 90 / width * 1.3, "the axis shows what was dragged over")
        self.actions().double_click(self.find("#stage figure > svg")[0]).perform()
        self.assertEqual(self.ticks(), whole)

    def test_keys_move_the_cursor_zoom_and_reset(self):
        self.to_stage()
        whole = self.ticks()
        time = lambda: float(re.search(r"t = ([\d.]+) s", self.find("#shown")[0].text)[1])
        self.press("\ue014")  # right
        first = time()
        # The page shows times to the microsecond, and the mean step of a drive is not a round number. If samples are left out, a step leads to the next sample that is drawn.
        channel = self.shown["channels"][0]
        index = list(range(channel["samples"])) if channel["index"] is None else unpack(channel["index"])
        at = min(range(len(index)), key=lambda k: abs(index[k] * self.shown["dt"] - first))
        after = lambda steps: (index[at + steps] - index[at]) * self.shown["dt"]
        self.press("\ue014", "\ue014", "\ue014")
        self.assertAlmostEqual(time() - first, after(3), places=5)
        self.press("\ue012")  # left
        self.assertAlmostEqual(time() - first, after(2), places=5)
        self.actions().key_down("\ue008").send_keys("\ue014").key_up("\ue008").perform()
        self.assertAlmostEqual(time() - first, after(12), places=5)
        self.press("+", "+")
        self.assertNotEqual(self.ticks(), whole)
        self.press("-", "-", "-")
        self.assertEqual(self.ticks(), whole, "zooming out ends at the whole recording")
        self.press("+")
        self.press("\ue010")  # end
        self.assertAlmostEqual(time(), index[-1] * self.shown["dt"], places=5)
        self.assertAlmostEqual(float(self.ticks()[-1].split()[0]), time(), delta=1.0, msg="the view follows the cursor")
        self.press("\ue00c")  # escape
        self.assertEqual(self.ticks(), whole)
        self.assertNotIn("t =", self.find("#shown")[0].text)

    def test_zoom_stays_when_the_recording_changes_and_the_address_names_both(self):
        self.find(".card")[0].click()
        self.to_stage()
        self.press("+", "+")
        zoomed = self.ticks()
        self.press("\ue00f")  # page down
        self.assertEqual(self.ticks(), zoomed, "the other recording shows the same time")
        address = self.driver.current_url
        self.assertRegex(address, "#recording=" + re.escape(quote(self.data[1]["name"])) + r"&zoom=[\d.]+-[\d.]+$")
        self.driver.get("about:blank")
        self.driver.get(address)
        self.assertEqual(self.ticks(), zoomed, "a link shows what was linked")
        self.assertTrue(self.find("#shown")[0].text.startswith(self.data[1]["name"]))

    def test_every_plot_is_offered_as_svg_png_and_csv(self):
        figures = len(self.find("#stage figure")) + len(self.find("figure[data-csv]"))
        offered = [e.text for e in self.find(".save button")]
        self.assertEqual(offered, ["SVG", "PNG", "CSV"] * figures)
        # Downloads are intercepted.
        self.js("window.saved = []; HTMLAnchorElement.prototype.click = function () { window.saved.push([this.download, this.href]); }")
        for button in self.find("#stage figure:first-child .save button"):
            self.js("arguments[0].click()", button)
        from selenium.webdriver.support.wait import WebDriverWait

        saved = dict(WebDriverWait(self.driver, 5).until(lambda _: (lambda s: len(s) == 3 and s)(self.js("return window.saved"))))
        kinds = {name.rsplit(".", 1)[1]: href for name, href in saved.items()}
        self.assertTrue(base64.b64decode(kinds["png"].split(",", 1)[1]).startswith(b"\x89PNG"))
        from urllib.parse import unquote

        drawing, table = (unquote(kinds[kind].split(",", 1)[1]) for kind in ("svg", "csv"))
        self.assertTrue(drawing.startswith("<svg") and "class=" not in drawing, "looks stand in the file itself")
        lines = table.splitlines()
        self.assertEqual(lines[0], "time_s,car [rad/s],before [rad/s],after [rad/s]")
        channel = self.shown["channels"][0]
        self.assertEqual(len(lines) - 1, len(unpack(channel["real"])), "all samples in view")
        self.assertAlmostEqual(float(lines[5].split(",")[1]), unpack(channel["real"])[4] * channel["q"], places=6)

    def test_one_of_two_maps_shows(self):
        if not self.find("[data-map]"):
            self.skipTest("no effect was named")
        shown = lambda: [e.is_displayed() for e in self.find(".map")]
        self.assertEqual(shown(), [True, False])
        self.js("arguments[0].click()", self.find("[data-map=map-after]")[0])
        self.assertEqual(shown(), [False, True])

    def test_doubt_stands_above_the_fold(self):
        doubts = self.find(".doubts .grave")
        for doubt in doubts:
            self.assertLess(doubt.rect["y"] + doubt.rect["height"], 900)
        ambiguous = self.find(".ambiguity .pill.warn")
        self.assertEqual(bool(ambiguous), bool(self.find("h1 .or")), "what is ambiguous below is so in the headline")
        if ambiguous:
            self.assertNotIn("✓", self.find("header > .pill")[0].text)

    def test_screen_readers_hear_the_values(self):
        from selenium.webdriver.support.wait import WebDriverWait

        self.to_stage()
        self.press("\ue014")
        spoken = lambda _: self.js("return document.getElementById('spoken').textContent")
        text = WebDriverWait(self.driver, 3).until(spoken)
        self.assertRegex(text, r"seconds\. Flywheel speed: car [\d.]+, before [\d.]+ \(car minus model .*Disc speed: car")

    def test_recordings_curves_and_units_can_be_chosen(self):
        self.find(".card")[0].click()
        self.assertTrue(self.find("#shown")[0].text.startswith(self.data[0]["name"]))
        self.to_stage()
        self.press("\ue00f")  # page down
        self.assertTrue(self.find("#shown")[0].text.startswith(self.data[1]["name"]))
        top = lambda: float(self.find("#stage figure:first-child .tick")[0].text)
        slow = top()
        self.find("#rpm")[0].click()
        self.assertIn("rpm", self.find("#stage figcaption")[0].text)
        self.assertGreater(top(), 5 * slow)
        self.find("[data-curve=before]")[0].click()
        self.assertEqual(self.find("#stage .c-before"), [])
        self.assertNotIn("before", self.reads()[0])

    def test_everything_is_reached_by_keyboard_with_focus_visible(self):
        self.js("document.activeElement.blur(); window.scrollTo(0, 0)")
        self.press("\ue004")
        self.assertEqual(self.js("return document.activeElement.className"), "skip")
        box = self.js("const b = document.activeElement.getBoundingClientRect(); return [b.left, b.top, b.width]")
        self.assertTrue(box[0] >= 0 and box[1] >= 0 and box[2] > 50, f"the skip link shows when it has focus: {box}")
        seen = set()
        for _ in range(60):
            self.press("\ue004")
            where = self.js(
                "const e = document.activeElement, s = getComputedStyle(e); return [e.id || e.className || e.textContent, s.outlineStyle, parseFloat(s.outlineWidth)]"
            )
            if where[0] and self.js("return document.activeElement !== document.body"):
                self.assertTrue(where[1] != "none" and where[2] >= 2, f"focus is visible at {where}")
            seen.add(where[0])
        self.assertTrue({"stage", "card", "rpm", "scroll"} <= seen, seen)

    def test_text_and_curves_have_contrast_in_light_and_dark(self):
        grounds = set()
        for scheme in ("light", "dark"):
            self.media(scheme)
            grounds.add(self.js("return getComputedStyle(document.body).backgroundColor"))
            found = self.js(CONTRAST)
            self.assertGreater(len(found), 300)
            # WCAG 2 requires 4.5 for text and 3 for graphics.
            weak = [f for f in found if f[0] < (3.0 if f[1] == "curve" else 4.5)]
            self.assertEqual(weak, [], f"{scheme}: {len(weak)} without contrast")
            self.assertTrue(any(f[1] == "curve" for f in found))
        self.assertEqual(len(grounds), 2, "dark differs from light")

    def test_narrow_screen_does_not_scroll_sideways(self):
        self.screen(380, 800)
        self.driver.get(self.url)
        self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), 380)
        width = self.js("return document.querySelector('#stage figure > svg').getBoundingClientRect().width")
        self.assertTrue(240 <= width <= 380, width)

    def test_paper_shows_every_recording_and_cuts_nothing(self):
        self.media("dark", "print")
        self.screen(700, 1000)  # about the width of A4 inside its margins
        shown = self.js("return [...document.querySelectorAll('.stills svg[role=img]')].map((s) => s.getBoundingClientRect()).filter((b) => b.width > 150 && b.right <= innerWidth).length")
        self.assertEqual(shown, len(self.find(".stills svg[role=img]")))
        self.assertEqual(shown, sum(len(recording["channels"]) for recording in self.data))
        self.assertEqual(self.js("return getComputedStyle(document.body).backgroundColor"), "rgb(255, 255, 255)", "paper is white, also from a dark screen")
        over = self.js("return [...document.querySelectorAll('table')].filter((t) => t.getBoundingClientRect().right > innerWidth + 1).map((t) => t.className)")
        self.assertEqual(over, [], "tables fit on paper")
        self.assertEqual(self.js("return document.getElementById('viewer').getClientRects().length"), 0)
        pdf = base64.b64decode(self.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True, "preferCSSPageSize": True})["data"])
        self.assertTrue(pdf.startswith(b"%PDF"))

    def test_without_scripts_the_still_figures_show(self):
        self.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
        self.addCleanup(self.driver.execute_cdp_cmd, "Emulation.setScriptExecutionDisabled", {"value": False})
        self.driver.get(self.url)
        self.assertTrue(self.find(".stills svg[role=img]")[0].is_displayed())
        self.assertFalse(self.find("#viewer")[0].is_displayed())


class ReportOfTheBundledCampaign(Browser, unittest.TestCase):
    make = staticmethod(bundled)

    def test_the_pictures_of_the_documentation_show_it(self):
        image = pytest.importorskip("PIL.Image")
        if "KISSPOINT_REPORT" in os.environ:
            self.skipTest("another report is tested")
        head = re.search(r'<header id="verdict">(.*?)</header>', self.path.read_text(encoding="utf-8"), re.S)[1]
        for name in ("report.png", "labelled.png"):
            self.assertEqual(image.open(ROOT / "docs/pictures" / name).text["verdict"], words(head), f"{name}: packaging/docs.sh takes it anew")


@unittest.skipIf("KISSPOINT_REPORT" in os.environ, "another report is tested")
class ReportWithEverything(Browser, unittest.TestCase):
    make = staticmethod(made_up)
