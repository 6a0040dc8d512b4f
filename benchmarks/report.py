"""Measures reports: file size, time until interactive, frames per second.

    python benchmarks/report.py [--run RUN]

Without --run, makes a run with 200 candidates first. Chromium renders without a GPU; the page
itself counts the frames.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

sys.path.insert(0, str(Path(__file__).parent.parent))

from agentflow.app.design.run import design
from agentflow.app.pages.runs import FINE, report
from agentflow.config.run import build_config
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.edits.random import random_machine
from agentflow.runs.events import read_typed_events
from agentflow.runs.record import RunRecord
from tests.report.browser import chromium
from tests.report.one_film import one_film

BLOCKS = 60
SECONDS = 4.0
"""Time for which a film is played, s."""
COUNT = """const [seconds, done] = arguments;
const player = document.querySelector(".player"), speed = player.querySelector(".transport select");
let frames = 0;
player.addEventListener("frame", () => (frames += 1));
speed.value = 0.5;
speed.dispatchEvent(new Event("change"));
player.querySelector(".play").click();
const start = performance.now();
setTimeout(() => done((1000 * frames) / (performance.now() - start)), 1000 * seconds);"""


def main() -> None:
    """Print one line per figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path, help="run directory")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = given.run or make_run(folder)
        begun = time.monotonic()
        file = report(run, folder / "run.html", films=200, workers=2, say=lambda *_: None)
        machines = RunRecord.of(read_typed_events(run)).machines
        print(f"machines in the run   {len(machines)}")
        print(f"time to write         {time.monotonic() - begun:.1f} s")
        print(f"size                  {file.stat().st_size / 1e6:.2f} MB")
        with chromium(folder / "profile", (1440, 900)) as driver:
            print_speed(driver, "run", file)
            print_speed(driver, f"{BLOCKS} blocks", large_machine(folder))


def print_speed(driver: webdriver.Chrome, name: str, file: Path) -> None:
    """Open a page three times, then play its film."""
    fastest = min(open_page(driver, file) for _ in range(3))
    frames = driver.execute_async_script(COUNT, SECONDS)
    size = driver.execute_script(
        "const { width, height } = document.querySelector('canvas'); return [width, height]"
    )
    print(f"{name}: interactive   {fastest:.2f} s")
    print(f"{name}: film          {frames:.0f} frames per second at {json.dumps(size)} pixels")


def open_page(driver: webdriver.Chrome, file: Path) -> float:
    """Seconds until the film's first frame is visible and its buttons work."""
    driver.get("about:blank")
    begun = time.monotonic()
    driver.get(file.as_uri())
    WebDriverWait(driver, 30, 0.01).until(
        lambda _: driver.find_element(By.CSS_SELECTOR, "[type=range]").get_attribute("max") != "1"
    )
    driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    return time.monotonic() - begun


def make_run(folder: Path) -> Path:
    """Make a run of the procedural model with about 200 candidates."""
    settings = {"trajectories": 8, "search": {"rounds": 6}}
    config = build_config({"task": "throwing", "seed": 0, "settings": settings})
    return Path(design(config, folder).run)


def large_machine(folder: Path) -> Path:
    """Write a page with one large random machine."""
    task, chance = get_task("movement", {"blocks.max": 0}), random.Random(4)
    machine = random_machine(chance, task.brief, size=(BLOCKS, BLOCKS))
    file = folder / "large.html"
    file.write_text(one_film(machine, task, simulate(machine, task, interval=FINE)), "utf-8")
    return file


if __name__ == "__main__":
    main()
