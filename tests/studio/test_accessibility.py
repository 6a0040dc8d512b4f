"""Every page: what it says at its top, and the rules of axe-core."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select

from agentflow.app.benchmark.card import read_card
from agentflow.app.benchmark.page import leaderboard_page
from agentflow.app.machines.convert import write_guide
from agentflow.app.pages.compare import compare
from agentflow.app.pages.gallery import gallery
from agentflow.app.pages.robustness import page_writer
from agentflow.app.pages.runs import report
from agentflow.app.pages.tasks import write_page as write_tasks
from agentflow.app.pages.training import training_report
from agentflow.env.tasks.registry import get_task
from agentflow.metrics.cells import Scores
from agentflow.metrics.tables import Column, Row, Table
from agentflow.report.page import page as whole_page
from agentflow.report.sweep import Spread, sweep_data
from tests.app.pages.test_robustness import FOUND
from tests.app.sweeps.test_tables import sweep
from tests.machine.builders import CAR
from tests.metrics.events import candidate
from tests.report.accessibility import SCREENS, violations
from tests.report.browser import on_phone
from tests.report.hostile import hostile_run
from tests.studio.pages import RECORDED, find, open_page, until
from tests.studio.serving import Served
from tests.study.example import record
from tests.training.folders import write_training

pytestmark = pytest.mark.slow
CARD = Path(__file__).parents[2] / "docs" / "cards" / "procedural.json"
STUDIO = {
    "runs": "runs?open",
    "run": "run?run=throwing",
    "pair": "pair?a=throwing&b=again",
    "gallery": "gallery",
    "leaderboard": "leaderboard",
    "curves": "curves?runs=%5B%22throwing%22%2C%22again%22%5D",
    "tasks": "tasks",
    "task": "tasks?task=throwing/4",
    "sessions": "sessions",
    "replay": "replay?session=one",
    "build": "build?task=movement&guide=car",
    "control": "build?task=transport/6",
    "sweep": "sweep?sweep=study",
}

HEADS = {
    "runs": ("Runs", "Language models design machines from blocks; physics scores them."),
    "run": ("agentflow run · hierarchical · seed 0", "throwing", "walled arena", "11.63 m"),
    "pair": ("agentflow comparison · both simulated with seed 0 on ", "throwing"),
    "gallery": ("Gallery", "The best machines of each task, those nearest to a record first."),
    "leaderboard": ("Models side by side", "Leaderboard", "2 models on 33 items, 3 per family."),
    "curves": ("2 runs compared at throwing", "Build a machine that throws"),
    "tasks": ("agentflow tasks", "Tasks", "What machines are built for: "),
    "task": ("agentflow task · throwing/4", "one ring", "Build a machine that throws"),
    "sessions": ("Sessions", "A session records what a person does while building"),
    "replay": ("Sessions / one", "movement", "free · "),
    "build": ("Build for movement",),
    "control": ("Build for transport/6",),
    "sweep": ("agentflow sweep", "Hand"),
}
"""What each page says at its top: how the lines begin."""
HEADS_OF_REPORTS = {
    "tasks": HEADS["tasks"],
    "leaderboard": (*HEADS["leaderboard"][:2], "1 model on 33 items, 3 per family."),
    "run": ("agentflow run · hierarchical · seed 0", "throwing", "walled arena", "12.50 m"),
    "gallery": ("agentflow gallery", "Machines · ", "The best machine of each run, by task"),
    "compare": ("agentflow comparison · both simulated with seed 0 on ", "movement"),
    "robustness": ("agentflow robustness", "movement", "pybullet 3.2.7, seed 0"),
    "training": ("agentflow training · reinforcement learning (GRPO), 6 steps", "training", "m"),
    "sweep": ("agentflow sweep", "sweep", "about"),
    "guide": ("Instructions: car",),
}
HEAD = """return [...document.querySelectorAll(
  "main header > *, main > h1, main > section > h1")].map((item) => item.textContent)"""

REPORTS = (
    "run", "gallery", "compare", "leaderboard", "robustness", "training", "sweep", "tasks"
)  # fmt: skip
WRITTEN = ("guide",)
"""Pages without a script."""


def found_on(driver: webdriver.Chrome) -> dict[str, list[str]]:
    """What is wrong with the page that is open, by screen, with everything unfolded."""
    found = {}
    for width, height, dark in SCREENS:
        with on_phone(driver, width, height, dark=dark):
            driver.execute_script(
                "for (const e of document.querySelectorAll('details')) e.open = 1"
            )
            if told := violations(driver):
                found[f"{width} {'dark' if dark else 'light'}"] = told
    return found


def says(driver: webdriver.Chrome, beginnings: tuple[str, ...]) -> bool:
    """Whether the lines at the top of the page begin like this."""
    lines = driver.execute_script(HEAD)
    return all(map(str.startswith, lines, beginnings)) and len(lines) >= len(beginnings)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for name in ("throwing", "again"):
        shutil.copytree(RECORDED, folder / name)
    (folder / "bench").mkdir()
    record(folder / "sessions" / "one")
    shutil.copy(CARD, folder / "bench" / "card.json")
    found = {f"seed-{seed}": [candidate("initial", 1, 2.0 + seed)] for seed in (0, 1)}
    made = sweep(tmp_path_factory.mktemp("swept"), found, seeds=[0, 1])
    shutil.copytree(made, folder / "study")
    return folder


@pytest.mark.parametrize("page", STUDIO)
def test_each_page_says_what_it_is_and_axe_finds_nothing(
    browser: webdriver.Chrome, served: Served, page: str
) -> None:
    open_page(browser, served, STUDIO[page])
    if page == "control":
        for part in ("controls", "sensors tilt", "laws states", "outputs group"):
            Select(find(browser, ".control select")).select_by_value(part)
        assert len(browser.find_elements(By.CSS_SELECTOR, ".control fieldset")) == 4
    assert says(browser, HEADS[page])
    heading = find(browser, "h1").get_property("textContent")
    assert browser.title.endswith(f"{heading} · agentflow studio")
    assert found_on(browser) == {}


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of each kind on disk."""
    folder = tmp_path_factory.mktemp("pages")
    car, quick = folder / "car.json", {"films": 1, "workers": 1, "say": lambda _done, _of: None}
    car.write_text(CAR.to_text(), encoding="utf-8")
    made = {name: folder / f"{name}.html" for name in (*REPORTS, *WRITTEN)}
    report(hostile_run(folder), made["run"], **quick)
    gallery([RECORDED], made["gallery"], workers=1, say=quick["say"])
    task = get_task("movement", {"window": 1})
    compare((str(car), str(car)), task, 0, out=made["compare"], workers=1, say=quick["say"])
    leaderboard_page([read_card(CARD)], made["leaderboard"])
    page_writer(made["robustness"])(FOUND)
    training_report(write_training(folder / "training", label="m"), made["training"], **quick)
    spreads = {("throwing", "none"): Spread(Scores((0.0, 1.0), 0))}
    table = Table("", ("task", "variant"), (Column("", "a"),), (Row(("throwing", "none"), (0.0,)),))
    data = sweep_data("sweep", "about", spreads, [table])
    made["sweep"].write_text(whole_page("sweep", data), encoding="utf-8")
    write_guide(str(car), made["guide"])
    write_tasks(("movement", "throwing/2"), made["tasks"])
    return made


@pytest.mark.parametrize("page", [*REPORTS, *WRITTEN])
def test_each_report_says_what_it_is_and_axe_finds_nothing(
    browser: webdriver.Chrome, pages: dict[str, Path], page: str
) -> None:
    browser.get(pages[page].as_uri())
    if page in REPORTS:
        until(browser, lambda: find(browser, "body").get_attribute("data-ready") == page)
    assert says(browser, HEADS_OF_REPORTS[page])
    assert found_on(browser) == {}


def test_axe_finds_a_fault_where_there_is_one(browser: webdriver.Chrome) -> None:
    browser.get("data:text/html,<html lang=en><title>a</title><main><h1>a</h1><img src=x></main>")
    assert {told.split(":")[0] for told in violations(browser)} == {"image-alt"}
