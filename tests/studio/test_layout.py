"""The structure of every page at four widths: nothing overlaps, nothing is cut off."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By

import agentflow
from tests.report.browser import complaints, on_phone
from tests.studio.pages import NASTY, RECORDED, find, idle, open_page, until
from tests.studio.serving import Served
from tests.study.example import record

CARD = Path(__file__).parents[2] / "docs" / "cards" / "procedural.json"
WIDTHS = ((1440, 900), (1024, 768), (820, 1180), (390, 844))
PAGES = {
    "runs": "runs",
    "run": "run?run=throwing",
    "pair": f"pair?a=throwing&b={NASTY}",
    "curves": "curves?runs=%5B%22throwing%22%5D",
    "sessions": "sessions",
    "replay": "replay?session=one",
    "gallery": "gallery",
    "tasks": "tasks",
    "task": "tasks?task=throwing/4",
    "leaderboard": "leaderboard",
}
SHARED = {
    "card",
    "cards",
    "facts",
    "files",
    "guide",
    "kind-id",
    "picks",
    "player",
    "problem",
    "problems",
    "quiet",
    "said",
    "task",
    "views",
}
"""Names of classes that both style sheets use on purpose."""
FAULTS = """
const faults = [], nav = document.querySelector("nav").getBoundingClientRect();
const wide = document.documentElement.scrollWidth;
if (wide > innerWidth) faults.push(`the page is ${wide} wide`);
for (const { textContent, offsetHeight } of document.querySelectorAll("nav a"))
  if (offsetHeight > nav.height) faults.push(`${textContent} is broken`);
for (const item of document.querySelectorAll("main :is(button, a, input, select, summary)")) {
  const { left, top, width, height } = item.getBoundingClientRect();
  const [x, y] = [left + width / 2, top + height / 2];
  if (!item.checkVisibility() || y > innerHeight || y < 0) continue;
  if (item.closest(".table, .events")) continue; // they scroll
  const over = document.elementFromPoint(x, y);
  if (over && !item.contains(over) && !over.contains(item))
    faults.push(`${item.outerHTML} is under ${over.outerHTML}`);
}
const film = document.querySelector("aside .view"), small = innerWidth < 600;
if (film && small && film.offsetHeight < 0.45 * innerHeight) faults.push("the film is small");
for (const item of document.querySelectorAll(small ? ".view .under, .compare .table" : ".table"))
  if (item.checkVisibility() && (small || innerWidth > 1400) && item.scrollWidth > item.clientWidth)
    faults.push(`${item.textContent.slice(0, 40)} is cut`);
if (small && film?.querySelector(".under")) faults.push("the legend is over the film");
for (const track of document.querySelectorAll(".track"))
  if (track.checkVisibility() && track.offsetWidth < 150) faults.push("a slider is narrow");
return faults;"""


def classes(*path: str) -> set[str]:
    text = Path(agentflow.__file__).parent.joinpath(*path).read_text(encoding="utf-8")
    return set(re.findall(r"\.([a-z][\w-]*)", re.sub(r"\{[^{}]*\}", "", text)))


def test_the_names_of_the_studio_are_its_own() -> None:
    report, studio = classes("report", "web", "player.css"), classes("studio", "web", "studio.css")
    assert report & studio == SHARED


@pytest.fixture(scope="module")
def _scorecard(runs: Path) -> None:
    (runs / "bench").mkdir()
    record(runs / "sessions" / "one")
    shutil.copy(CARD, runs / "bench" / "card.json")


@pytest.mark.slow
@pytest.mark.usefixtures("_scorecard")
@pytest.mark.parametrize("page", PAGES)
def test_nothing_overlaps_or_is_cut_off(
    browser: webdriver.Chrome, served: Served, page: str
) -> None:
    found: dict[Any, Any] = {}
    for width, height in WIDTHS:
        with on_phone(browser, width, height, dark=width == 820):
            open_page(browser, served, PAGES[page])
            until(browser, lambda: not browser.find_elements(By.CSS_SELECTOR, ".player.empty"))
            if page == "runs":
                until(browser, lambda: find(browser, "td.verified").is_displayed())
            found[width] = browser.execute_script(FAULTS)
    assert found == {width: [] for width, _ in WIDTHS}
    assert complaints(browser) == []


@pytest.mark.slow
def test_on_a_phone_the_guide_covers_no_face_and_a_chosen_block_stays_in_sight(
    browser: webdriver.Chrome, served: Served
) -> None:
    with on_phone(browser, 390, 844, dark=False):
        open_page(browser, served, "build?task=movement&guide=car")
        boxes = "return [...document.querySelectorAll('.guide, .stage canvas')]" + (
            ".map((item) => item.getBoundingClientRect()).map(({ top, bottom }) => [top, bottom])"
        )
        (top, bottom), (other_top, other_bottom) = sorted(browser.execute_script(boxes))
        assert top < bottom <= other_top < other_bottom
        find(browser, ".palette [role=option]").click()
        idle(browser)
        assert browser.execute_script("return scrollY") == 0
        until(browser, lambda: find(browser, ".here").text == "Here")
        place = find(browser, ".here").rect
        assert other_top < place["y"] < place["y"] + place["height"] < other_bottom


@pytest.mark.slow
def test_the_stages_of_a_run_and_the_list_of_runs_fit_without_scrolling(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    path = shutil.copytree(RECORDED.parent / "language-model-throwing", runs / "by-a-model")
    over = """return [...document.querySelectorAll(arguments[0])]
        .map(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)"""
    for width in (1440, 1024, 390):
        with on_phone(browser, width, 900, dark=False):
            open_page(browser, served, "run?run=by-a-model")
            until(browser, lambda: find(browser, ".stacked").is_displayed())
            assert browser.execute_script(over, ".stacked") == [0], width
            open_page(browser, served, "runs")
            until(browser, lambda: find(browser, "tr[data-run=by-a-model] .reached").is_displayed())
            assert browser.execute_script(over, ".table") == [0], width
            row = find(browser, "tr[data-run=by-a-model]")
            if width == 1440:
                assert row.find_element(By.CSS_SELECTOR, ".seconds").text == "7:55 min"
                assert row.rect["height"] < 70
            if width > 1000:
                share = row.find_element(By.CSS_SELECTOR, ".share")
                bar = "return parseFloat(arguments[0].style.getPropertyValue('--share'))"
                assert f"{browser.execute_script(bar, share):.0f} %" == share.text == "45 %"
    shutil.rmtree(path)
