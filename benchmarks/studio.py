"""Measures the studio: frames per second while the view of a large machine turns, when the list of
many runs shows the first, and how long its frames take while it scrolls.

    python benchmarks/studio.py [--pictures docs/pictures]

Chromium renders without a GPU; the page itself counts the frames. With --pictures, takes the
screenshots for docs/how-to/studio.md instead.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import random
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

sys.path.insert(0, str(Path(__file__).parent.parent))

from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from agentflow.machine.edits.random import random_machine
from tests.report.browser import chromium
from tests.studio.serving import studio
from tests.study.example import record

BLOCKS = 60
RUNS = 500
"""Runs of the list."""
SECONDS = 4.0
"""Time for which the view turns, s."""
PATIENCE = 60.0
RECORDED = {
    "throwing": Path("runs/recorded-throwing"),
    "language-model": Path("runs/language-model-throwing"),
}
SIZES = ((1280, 720), (820, 1180))
TURN = """const [seconds, done] = arguments;
const canvas = document.querySelector(".stage canvas");
let frames = 0;
canvas.addEventListener("frame", () => {
  frames += 1;
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
});
canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
const start = performance.now();
setTimeout(() => done((1000 * frames) / (performance.now() - start)), 1000 * seconds);"""

FIRST = """const [done] = arguments;
const look = () => {
  if (document.querySelector("tr[data-run]")) done(performance.now()); else setTimeout(look, 5);
};
look();"""
"""Milliseconds from opening the page to its first row."""
SCROLL = """const [done] = arguments, frames = [];
let last = performance.now(), at = 0;
const step = (now) => {
  frames.push(now - last);
  [last, at] = [now, at + 120];
  scrollTo(0, at);
  if (at < 9000) requestAnimationFrame(step); else done(frames);
};
requestAnimationFrame(step);"""
"""Milliseconds of each frame while the list scrolls by 120 pixels a frame."""

BEGIN = """const done = arguments[0], root = { type: 0, id: 0, parent: -1, face_id: -1 };
const block = (id, type, parent, face_id) => ({ type, id, parent, face_id });
const machine = [root, block(1, 1, 0, 0), block(2, 1, 0, 1), block(3, 2, 1, 1), block(4, 2, 1, 3)];
const form = { task: "movement", machine, mode: "guided", limit_s: 1200,
  rationale: "Begin with what carries the rest. Say what you expect before each test." };
fetch("/api/session/begin", { method: "POST", headers: { "content-type": "application/json" },
  body: JSON.stringify(form) }).then(done);"""


@dataclass(frozen=True)
class Shot:
    """One screenshot: page, size of the page in pixels, and colours."""

    name: str
    page: str
    size: tuple[int, int]
    dark: bool = False
    session: bool = False
    """Whether a guided session is recorded."""


SHOTS = (
    Shot("studio-runs", "runs", SIZES[0], dark=True),
    Shot("studio-build", "build?run=throwing", SIZES[0]),
    Shot("studio-session", "build", SIZES[1], session=True),
    Shot("studio-replay", "replay?session=one", SIZES[0]),
)


def main() -> None:
    """Print one line per figure, or write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path, help="folder for screenshots")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for run, recorded in RECORDED.items():
            shutil.copytree(recorded, folder / "runs" / run)
        record(folder / "runs" / "sessions" / "one")
        if given.pictures:
            out = given.pictures.resolve()
            os.chdir(folder)  # so that the page names no path of this computer
            for shot in SHOTS:
                photograph(shot).save(out / f"{shot.name}.webp", quality=82, method=6)
        else:
            for size in SIZES:
                print_speed(folder, size)
            print_list(folder)


def print_speed(folder: Path, size: tuple[int, int]) -> None:
    """Open a large machine, look for faces of a block, and turn the view."""
    machine = large_machine()
    file = folder / "large.json"
    file.write_text(machine.to_text(), "utf-8")
    with studio(folder / "runs") as served, chromium(folder / f"profile-{size[0]}") as driver:
        resize(driver, size)
        driver.get(served.address)
        open_page(driver, served.base, "build?task=movement")
        driver.execute_script("document.querySelector('.more details').open = true")
        driver.find_element(By.CSS_SELECTOR, "input[type=file]").send_keys(str(file))
        wait(driver, f"document.querySelectorAll('[role=treeitem]').length === {len(machine)}")
        driver.find_element(By.CSS_SELECTOR, ".palette [role=option]").click()
        wait(driver, "document.querySelectorAll('#faces .list > div').length > 0")
        faces = len(driver.find_elements(By.CSS_SELECTOR, "#faces .list > div"))
        frames = driver.execute_async_script(TURN, SECONDS)
        pixels = driver.execute_script(
            "const c = document.querySelector('.stage canvas'); return [c.width, c.height]"
        )
    print(
        f"{len(machine)} blocks, {faces} faces lit: {frames:.0f} frames per second "
        f"at {json.dumps(pixels)} pixels of a page of {size[0]} x {size[1]}"
    )


def print_list(folder: Path) -> None:
    """Open a list of many runs, and scroll it twice: the first time, pictures are drawn."""
    for number in range(RUNS):
        place = folder / "many" / f"{number:03}"
        shutil.copytree(RECORDED["throwing"], place, ignore=shutil.ignore_patterns("rollouts"))
    with studio(folder / "many") as served, chromium(folder / "profile-list") as driver:
        resize(driver, SIZES[0])
        driver.set_script_timeout(PATIENCE)
        driver.get(served.address)
        first = driver.execute_async_script(FIRST)
        wait(driver, f"document.querySelector('.filters').textContent.includes('{RUNS} runs')")
        wait(driver, "!document.querySelector('.filters').textContent.includes('reading')")
        driver.execute_script("document.querySelector('main > button').click()")
        wait(driver, f"document.querySelectorAll('tr[data-run]').length === {RUNS}")
        for turn in ("first", "second"):
            frames = sorted(driver.execute_async_script(f"scrollTo(0, 0);{SCROLL}"))
            print(
                f"{RUNS} runs: first row after {first:.0f} ms; {turn} scroll: median frame "
                f"{frames[len(frames) // 2]:.0f} ms, slowest {frames[-1]:.0f} ms"
            )


def photograph(shot: Shot) -> Image.Image:
    """Take a screenshot of a page of the runs in this directory."""
    profile = Path.cwd() / f"profile-{shot.name}"
    with studio(Path("runs")) as served, chromium(profile, dark=shot.dark) as driver:
        resize(driver, shot.size)
        driver.get(served.address)
        if shot.session:
            driver.execute_async_script(BEGIN)
        open_page(driver, served.base, shot.page)
        if shot.page.startswith("build"):
            driver.find_element(By.CSS_SELECTOR, ".palette [role=option]").click()
            wait(driver, "document.querySelectorAll('#faces .list > div').length > 0")
        elif shot.page.startswith("replay"):
            driver.find_element(By.CSS_SELECTOR, ".told .note").click()
        else:
            driver.find_element(By.CSS_SELECTOR, ".design summary").click()
            wait(driver, "document.querySelector('.design [role=status].wide')?.textContent")
            wait(driver, "document.images.length > 0")
        wait(driver, "[...document.images].every(({ naturalWidth }) => naturalWidth > 0)")
        driver.execute_async_script("setTimeout(arguments[0], 1000)")
        return Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")


def resize(driver: webdriver.Chrome, size: tuple[int, int]) -> None:
    """Set the size of the page in pixels."""
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def open_page(driver: webdriver.Chrome, base: str, page: str) -> None:
    """Open a page and wait until it is ready."""
    driver.get("about:blank")
    driver.get(f"{base}/#{page}")
    wait(driver, f"document.body.dataset.ready === '{page.partition('?')[0]}'")


def wait(driver: webdriver.Chrome, condition: str) -> None:
    """Wait until an expression is true in the page."""
    WebDriverWait(driver, PATIENCE, 0.05).until(
        lambda _: driver.execute_script(f"return {condition}")
    )


def large_machine() -> Machine:
    """A random machine of many blocks."""
    task, chance = get_task("movement", {"blocks.max": 0}), random.Random(4)
    return random_machine(chance, task.brief, size=(BLOCKS, BLOCKS))


if __name__ == "__main__":
    main()
