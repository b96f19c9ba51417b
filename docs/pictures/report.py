"""Takes the pictures of the report: python docs/pictures/report.py REPORT.html (needs selenium, pillow, Chromium with its driver).

The report shown is that of the made-up campaign of `examples/report.rs`.
"""

import base64
import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver import ActionChains

WIDTH, HEIGHT = 1200, 1500
here = Path(__file__).resolve().parent
options = webdriver.ChromeOptions()
options.binary_location = shutil.which("chromium") or shutil.which("google-chrome")
for argument in ("--headless=new", "--no-sandbox", "--hide-scrollbars"):
    options.add_argument(argument)
driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
for scheme, name in (("light", "report.png"), ("dark", "report-dark.png")):
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False})
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
    driver.get(Path(sys.argv[1]).resolve().as_uri())
    plot = driver.find_elements("css selector", "#stage figure > svg")[0]
    ActionChains(driver).move_to_element_with_offset(plot, -260, -30).perform()
    picture = Image.open(io.BytesIO(base64.b64decode(driver.get_screenshot_as_base64())))
    picture.convert("RGB").save(here / name, optimize=True)
driver.quit()
