"""Takes the pictures of the report for README.md and docs/report.md: those of the bundled campaign. Needs selenium, pillow, Chromium with its driver.

    packaging/docs.sh               the pictures, and all else that the documentation shows of the program

The words of the verdict go into the files as text, so that a picture that is out of date can be told.
"""

import base64
import io
import re
import sys
from pathlib import Path

from PIL import Image, PngImagePlugin

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tests/python"))
from conftest import chromium  # noqa: E402
from test_quoted import words  # noqa: E402

WIDTH, HEIGHT = 1160, 1380
# The parts of the page that docs/report.md numbers, in its order.
PARTS = ("header > .pill", "h1", ".lead", ".tiles", ".confidence", ".doubts", "#where-title", "#curves-title", "#what-if", "#stage")
LABELS = """
arguments[0].forEach((selector, k) => {
  const part = document.querySelector(selector);
  if (!part) return;
  const box = part.getBoundingClientRect(), label = document.createElement("b");
  label.textContent = k + 1;
  label.style.cssText = `position: absolute; left: ${box.left - 46 + scrollX}px; top: ${box.top + scrollY}px; width: 30px; height: 30px; border-radius: 50%;
    background: #0b63b5; color: #fff; font: 700 17px/30px system-ui, sans-serif; text-align: center`;
  document.body.append(label);
});
"""


def save(driver, name, height, verdict):
    clip = {"x": 0, "y": 0, "width": WIDTH, "height": height, "scale": 1}
    shot = driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": clip})
    # A palette is enough for lines and text, and keeps the file small.
    picture = Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB").quantize(256)
    shown = PngImagePlugin.PngInfo()
    shown.add_itxt("verdict", verdict)
    picture.save(HERE / name, optimize=True, pnginfo=shown)


def main(report):
    verdict = words(re.search(r'<header id="verdict">(.*?)</header>', report.read_text(encoding="utf-8"), re.S)[1])
    driver = chromium()
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False})
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "light"}]})
    driver.get(report.as_uri())
    save(driver, "report.png", HEIGHT, verdict)
    driver.execute_script(LABELS, PARTS)
    stage = driver.execute_script("return document.getElementById('stage').getBoundingClientRect().top + scrollY")
    save(driver, "labelled.png", int(stage) + 420, verdict)
    driver.quit()


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
