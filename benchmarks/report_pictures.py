"""Takes the screenshots for docs/how-to/report.md: light, dark, and on a phone.

python benchmarks/report_pictures.py [docs/pictures]
"""

from __future__ import annotations

import io
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from selenium import webdriver

sys.path.insert(0, str(Path(__file__).parent.parent))

from agentflow.app.pages.runs import report
from tests.report.browser import chromium

RUN = Path("runs/recorded-throwing")
SCRUB = """const [time, done] = arguments, slider = document.querySelector("[type=range]");
slider.value = time;
slider.dispatchEvent(new Event("input"));
setTimeout(done, 600);"""


@dataclass(frozen=True)
class Shot:
    """One screenshot: window size in pixels, time of the film in seconds, and page settings."""

    name: str
    size: tuple[int, int]
    time: float
    dark: bool = False
    loads: bool = False
    phone: bool = False


SHOTS = (
    Shot("report-light", (1440, 900), 1.3),
    Shot("report-dark", (1440, 900), 0.2, dark=True, loads=True),
    Shot("report-phone", (390, 844), 0.8, phone=True),
)


def main() -> None:
    """Write the pictures."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures")
    with tempfile.TemporaryDirectory() as name:
        page = report(RUN, Path(name) / "r.html", films=9, workers=2, say=lambda *_: None)
        for shot in SHOTS:
            with chromium(Path(name) / shot.name, (1440, 1000), dark=shot.dark) as driver:
                picture = photograph(driver, page, shot)
            picture.save(out / f"{shot.name}.webp", quality=82, method=6)


def photograph(driver: webdriver.Chrome, page: Path, shot: Shot) -> Image.Image:
    """Take a screenshot of a page at one moment of its film."""
    width, height = shot.size
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": shot.phone}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    driver.get(page.as_uri())
    driver.set_script_timeout(30)
    driver.execute_async_script("setTimeout(arguments[0], 1000)")
    if shot.loads:
        driver.execute_script("document.querySelector('[aria-pressed]').click()")
    driver.execute_async_script(SCRUB, shot.time)
    return Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")


if __name__ == "__main__":
    main()
