"""Takes the picture of the report for README.md: that of the bundled campaign. Needs selenium, pillow, Chromium with its driver.

    packaging/docs.sh               the picture, and all else that the documentation shows of the program

The words of the verdict go into the file as text, so that a picture that is out of date can be told.
"""

import base64
import io
import re
import shutil
import sys
from pathlib import Path

from PIL import Image, PngImagePlugin
from selenium import webdriver

WIDTH, HEIGHT = 1160, 1380
here = Path(__file__).resolve().parent
options = webdriver.ChromeOptions()
options.binary_location = shutil.which("chromium") or shutil.which("google-chrome")
for argument in ("--headless=new", "--no-sandbox", "--hide-scrollbars"):
    options.add_argument(argument)
driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False})
driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "light"}]})
driver.get(Path(sys.argv[1]).resolve().as_uri())
picture = Image.open(io.BytesIO(base64.b64decode(driver.get_screenshot_as_base64())))
sys.path.insert(0, str(here.parents[1] / "tests/python"))
from test_quoted import words  # noqa: E402

text = Path(sys.argv[1]).read_text(encoding="utf-8")
shown = PngImagePlugin.PngInfo()
shown.add_itxt("verdict", words(re.search(r'<header id="verdict">(.*?)</header>', text, re.S)[1]))
# A palette is enough for lines and text, and keeps the file small.
picture.convert("RGB").quantize(256).save(here / "report.png", optimize=True, pnginfo=shown)
driver.quit()
