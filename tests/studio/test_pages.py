"""The other pages in a real browser: runs, designs, comparisons and sessions."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import suppress
from pathlib import Path
from statistics import mean

import pytest
from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from agentflow.app.inspect.overview import run_list
from agentflow.app.pages.tasks import SMALL
from agentflow.env.tasks.records import record_of
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.runs import read_calls
from agentflow.study.session import Action, Pause, StudioTest, read_session
from tests.report.accessibility import violations
from tests.report.browser import complaints, on_phone
from tests.studio.pages import (
    NASTY,
    RECORDED,
    attach,
    blocks,
    fill,
    find,
    keys,
    open_page,
    said,
    take_block,
    tree,
    until,
)
from tests.studio.serving import Served, studio

pytestmark = pytest.mark.slow


def listed(driver: webdriver.Chrome) -> list[str]:
    """The names of the runs that are shown, as a reader sees them."""
    script = "return [...document.querySelectorAll('tbody tr[data-run] a')].map((a) => a.innerText)"
    return list(driver.execute_script(script))


def test_runs_are_listed_filtered_and_opened_and_names_stay_text(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_page(browser, served, "runs")
    until(browser, lambda: {"throwing", NASTY} <= set(listed(browser)))
    find(browser, "input[type=search]").send_keys("onerror")
    until(browser, lambda: listed(browser) == [NASTY])
    assert browser.current_url.endswith("#runs?words=onerror")
    browser.refresh()
    until(browser, lambda: listed(browser) == [NASTY])
    find(browser, "input[type=search]").send_keys(" nothing")
    until(browser, lambda: "No run fits" in find(browser, ".lines tbody").text)
    find(browser, ".lines tbody button").click()
    until(browser, lambda: {"throwing", NASTY} <= set(listed(browser)))
    find(browser, "input[type=search]").send_keys("hierarchical throwing")
    until(browser, lambda: sorted(listed(browser)) == [NASTY, "throwing"])
    with on_phone(browser, 390, 844, dark=False):
        assert find(browser, "tr[data-run=throwing] .task").text == "throwing"
        assert find(browser, "tr[data-run=throwing] .model").text.startswith("procedural")
    find(browser, "tr[data-run=throwing] a").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "run")
    until(browser, lambda: find(browser, ".live .state").text.endswith("done"))
    until(browser, lambda: find(browser, ".player").get_attribute("class") != "player empty")
    explained = find(browser, "abbr[title='one of several independent attempts']")
    assert explained.text.lower() == "trajectories"
    saved = [button.text for button in browser.find_elements(By.CSS_SELECTOR, ".files button")]
    assert {"Besiege", "instructions", "3D print"} <= set(saved)
    find(browser, ".chosen .button").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "build")
    assert find(browser, "select[aria-label=Task]").get_attribute("value") == "throwing"
    assert len(tree(browser)) == len(
        json.loads((RECORDED / "result.json").read_text(encoding="utf-8"))["machine"]
    )
    assert browser.execute_script("return window.owned ?? null") is None
    assert complaints(browser) == []


def test_a_session_is_recorded_while_a_person_builds(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    open_page(browser, served, "sessions")
    Select(find(browser, "select[name=task]")).select_by_value("movement")
    Select(find(browser, "select[name=mode]")).select_by_value("guided")
    find(browser, "input[name=minutes]").send_keys("10")
    fill(find(browser, "form.begin"), participant="P-07", refine="", consent="All is recorded.")
    rationale = find(browser, "textarea[name=rationale]")
    browser.execute_script("arguments[0].value = arguments[1]", rationale, NASTY)
    find(browser, "form.begin button").click()
    assert "All is recorded." in find(browser, ".ended").text
    find(browser, ".ended button:not(.play)").click()
    until(browser, lambda: "has not agreed" in find(browser, "form.begin .problem").text)
    find(browser, "form.begin button").click()
    find(browser, ".ended .play").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "build")
    assert NASTY in find(browser, ".rationale").text
    assert not find(browser, ".top button[title^=Undo]").is_enabled()
    assert "Refine this" not in find(browser, ".more").text
    assert re.fullmatch(r"9:\d\d left", find(browser, ".clock").text)
    microphone = find(browser, ".microphone")
    assert microphone.text == "Record voice"
    microphone.click()
    until(browser, lambda: microphone.text == "Recording voice")
    browser.execute_async_script("setTimeout(arguments[0], 500)")
    microphone.click()
    until(browser, lambda: list((runs / "sessions").glob("*/speech-1.webm")))
    take_block(browser, "wooden block")
    attach(browser, "0.0")
    find(browser, ".notes input").send_keys(NASTY, Keys.ENTER)
    until(browser, lambda: "Noted." in find(browser, ".session").text)
    pause = find(browser, ".session > button")
    pause.click()
    until(browser, lambda: find(browser, ".clock").text == "paused")
    assert not find(browser, ".stage").is_displayed()
    pause.click()
    until(browser, lambda: find(browser, ".clock").text.endswith("left"))
    browser.refresh()
    blocks(browser, 2)
    find(browser, ".test").click()
    said(browser, "Test 1: score")
    until(browser, lambda: "filming" in str(find(browser, ".centre").get_attribute("class")))
    find(browser, ".top .tab").click()
    keys(browser, Keys.CONTROL, "z", Keys.NULL)
    blocks(browser, 1)
    end = find(browser, ".session > button:nth-of-type(3)")
    end.click()
    assert (end.text, find(browser, ".ended").is_displayed()) == ("End it for good?", False)
    end.click()
    until(browser, lambda: find(browser, ".ended").is_displayed())
    [path] = (runs / "sessions").iterdir()
    assert "Please tell the person who leads the study" in find(browser, ".ended").text
    assert not browser.find_elements(By.CSS_SELECTOR, ".ended a")  # to what others did
    open_page(browser, served, f"replay?session={path.name}")
    assert "participant P-07" in find(browser, ".lede").text
    notes = browser.find_elements(By.CSS_SELECTOR, ".marks .note")
    assert [note.get_attribute("title") for note in notes] == [NASTY]
    find(browser, ".told .trial").click()
    until(browser, lambda: find(browser, ".player .title").text.startswith("test: "))
    find(browser, ".replay p > button:last-of-type").click()
    clock = find(browser, ".player output")
    until(browser, lambda: clock.text and float(clock.text.removesuffix(" s")) > 0.3)
    find(browser, ".replay .play").click()
    last = find(browser, ".told li:last-child button")
    until(browser, lambda: last.get_attribute("aria-current") == "step")
    find(browser, "header a").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "sessions")
    until(browser, lambda: path.name in find(browser, "table").text)
    found = read_session(path)
    assert (found.start.task, found.start.limit_s, found.start.rationale) == (
        *("movement", 600),
        NASTY,
    )
    done = [
        event.do if isinstance(event, Action) else event.kind
        for event in found.events
        if not isinstance(event, Pause) or event.asked  # others depend on how fast this computer is
    ]
    assert done == ["audio", "add", "note", "pause", "trial", "watch", "undo", "end"]
    assert (path / "speech-1.webm").read_bytes().startswith(b"\x1aE\xdf\xa3")  # as WebM does
    assert [len(action.machine) for action in found.of(Action)] == [2, 2, 1]
    [trial] = found.of(StudioTest)
    assert (trial.status, len(trial.machine)) == ("ok", 2)
    until(browser, (runs / trial.run / "result.json").is_file)  # its run ends with the session
    assert browser.execute_script("return window.owned ?? null") is None
    assert complaints(browser) == []


def test_a_design_is_started_watched_and_stopped(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    open_page(browser, served, "runs")
    find(browser, ".design summary").click()
    form = find(browser, ".design form")
    form.find_element(By.CSS_SELECTOR, "summary").click()
    fill(form, task="throwing", seed="-3.5", rounds="50")
    until(browser, lambda: "Seed: a whole number of 0 or more" in form.text)
    form.find_element(By.NAME, "seed").clear()
    fill(form, seed="5")
    until(browser, lambda: "simulations: " in form.text)
    assert "Good from 45 m" in find(browser, ".design .asked").text
    assert "calls" not in find(browser, ".design .wide[role=status]").text  # no model is asked
    until(browser, lambda: find(browser, ".asked img").get_property("naturalWidth"))
    form.find_element(By.CSS_SELECTOR, "[type=submit]").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "run")
    until(browser, lambda: find(browser, ".live .state").text.endswith("running"))
    until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, "svg[aria-label^='Score over']"))
    assert "of about" in find(browser, ".live").text
    assert re.match(r"Runs / throwing-.+-seed5", find(browser, "main > p").text)
    shown = "[s, t] = ['.score b', '.title'].map((e) => document.querySelector(e)?.textContent);"
    until(browser, lambda: browser.execute_script(f"{shown} return s && t?.endsWith(' · ' + s)"))
    assert find(browser, ".worth").text.startswith("Good from 45 m · record ")
    stop, resume, follow = browser.find_elements(By.CSS_SELECTOR, ".live button")
    assert (follow.get_attribute("aria-pressed"), follow.text) == ("true", "Following the best")

    def pick_another() -> bool:
        with suppress(StaleElementReferenceException):  # the tree is drawn again while it grows
            find(browser, ".tree .node:not([aria-selected=true])").click()
        return follow.get_attribute("aria-pressed") == "false"

    until(browser, pick_another)
    assert follow.text == "Follow the best"
    until(browser, stop.is_displayed)
    until(browser, lambda: find(browser, ".live").text.count(" more") == 1)
    browser.execute_script("scrollTo(0, 0)")  # from below the bar
    stop.click()
    stopping = "return document.querySelector('.score').textContent.endsWith('is stopping')"
    assert browser.execute_script(stopping)
    assert " more" not in find(browser, ".live").text
    ended = r"Stopped after [\d,]+ of about [\d,]+ simulations; the best machine is not verified"
    until(browser, lambda: re.fullmatch(ended, find(browser, ".live .state").text))
    until(browser, resume.is_displayed)
    until(browser, lambda: "is unfinished" in find(browser, ".score").text)
    assert violations(browser) == []
    assert find(browser, ".live .problem").text == ""
    [row] = [row for row in run_list(runs) if row["seed"] == 5]
    assert (row["task"], row["state"]) == ("throwing", "stopped")
    assert complaints(browser) == []


def test_a_new_design_tells_what_it_will_take_by_the_last_run_of_its_model(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    path = shutil.copytree(RECORDED.parent / "language-model-throwing", runs / "by-a-model")
    open_page(browser, served, "runs")
    until(browser, lambda: "by-a-model" in listed(browser))
    find(browser, ".design summary").click()
    form = find(browser, ".design form")
    groups = [item.get_attribute("label") for item in form.find_elements(By.TAG_NAME, "optgroup")]
    assert groups == [name.capitalize() for name in task_names() if "/" not in name]
    told = find(browser, ".design [role=status].wide")
    Select(find(browser, ".design .who select")).select_by_visible_text("Another endpoint")
    fill(form, model="new", base_url="https://models.example.org/v1")
    until(browser, lambda: "on this computer, plus the model's time. Its price is not" in told.text)
    assert re.match(r"About [\d,]+ simulations and [\d,]+ model calls: about [\d.]+ ", told.text)
    form.find_element(By.NAME, "model").clear()
    calls = list(read_calls(path))
    fill(form, model=calls[0]["model"])
    took = f"took {mean(call['reply']['latency_s'] for call in calls):.1f} s a call in its last run"
    until(browser, lambda: took in told.text)
    with on_phone(browser, 1440, 900, dark=False):
        picture, task = find(browser, ".asked img").rect, form.find_element(By.NAME, "task").rect
        assert picture["x"] > task["x"] + task["width"]
        assert picture["y"] < task["y"]
    shutil.rmtree(path)
    assert complaints(browser) == []


def test_a_run_from_elsewhere_fills_the_form_and_what_is_left_out_is_named(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    path = shutil.copytree(RECORDED.parent / "language-model-throwing", runs / "by-a-model")
    open_page(browser, served, "run?run=by-a-model")
    until(browser, lambda: find(browser, ".live .actions a").text == "Run again")
    find(browser, ".live .actions a").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "runs")
    values = """return Object.fromEntries([...document.querySelectorAll(".design [name]")]
        .filter(({ value }) => value).map(({ name, value }) => [name, value]))"""
    assert browser.execute_script(values) == {
        "task": "throwing/2",
        "workflow": "iterative",
        "seed": "1",
        "model": "large language model (recorded)",
        "base_url": "http://127.0.0.1:8144/v1",
        "trajectories": "1",
        "rounds": "2",
    }
    told = find(browser, ".design [role=note]").text
    assert 'search.strategy = "mcts", search.width = 2.' in told
    assert told.endswith(f"agentflow design --config '{path}/run.yaml' --seed 1")
    shutil.rmtree(path)
    assert complaints(browser) == []


def test_two_runs_are_shown_side_by_side_in_step(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    result = runs / NASTY / "result.json"
    document = json.loads(result.read_text(encoding="utf-8"))
    document["machine"] = document["machine"][:-1]
    result.write_text(json.dumps(document), encoding="utf-8")
    open_page(browser, served, "runs")
    for name in ("throwing", NASTY):
        until(browser, lambda name=name: name in listed(browser))
        next(
            line.find_element(By.CSS_SELECTOR, "input")
            for line in browser.find_elements(By.CSS_SELECTOR, "tr[data-run]")
            if line.get_attribute("data-run") == name
        ).click()
    find(browser, ".filters button").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "pair")
    find(browser, ".both").click()
    clocks = browser.find_elements(By.CSS_SELECTOR, ".player output")
    until(browser, lambda: all(float(c.text.removesuffix(" s")) > 0.3 for c in clocks))
    assert len(clocks) == 2
    browser.find_elements(By.CSS_SELECTOR, ".player .play")[0].click()
    until(browser, lambda: len({clock.text for clock in clocks}) == 1)
    differ = browser.find_element(By.XPATH, "//button[text()='Mark differences']")
    assert differ.get_attribute("aria-pressed") == "true"
    assert "Verified, m" in find(browser, "main.compare").text
    assert browser.title == "throwing · agentflow studio"
    views = [view.size for view in browser.find_elements(By.CSS_SELECTOR, ".view")]
    assert views[0] == views[1], "both films have one scale"
    assert browser.execute_script("return window.owned ?? null") is None
    assert complaints(browser) == []


def test_the_best_scores_of_three_runs_are_in_one_chart(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    shutil.copytree(RECORDED, runs / "third", dirs_exist_ok=True)
    open_page(browser, served, "runs")
    until(browser, lambda: "third" in listed(browser))
    compare = find(browser, ".filters button")
    assert not compare.is_enabled()
    for name in ("third", "throwing", NASTY):
        find(browser, f'input[aria-label="Compare {name}"]').click()
    assert compare.text == "Compare 3 runs"
    compare.click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "curves")
    until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".chart .line")) == 3)
    keys = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".key span")]
    assert keys == ["A third", "B throwing", f"C {NASTY}"]
    ends = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".chart text.name")]
    assert ends == ["A", "B", "C"]  # without colours, the letters tell lines apart
    assert len(browser.find_elements(By.CSS_SELECTOR, ".card img")) == 3
    Select(find(browser, "select")).select_by_visible_text("over calls")
    assert browser.find_elements(By.CSS_SELECTOR, "svg[aria-label='Best score so far over calls']")
    shutil.rmtree(runs / "third")
    assert complaints(browser) == []


def marked(driver: webdriver.Chrome) -> list[str]:
    """The faces that are marked in 3D."""
    script = """const canvas = document.querySelector(".stage canvas"), found = [];
    for (let block = 0; block < 7; block++) for (let face = 0; face < 10; face++)
      try { canvas.placeOf(block, face); found.push(`${block}.${face}`); } catch { /* none */ }
    return found;"""
    return list(driver.execute_script(script))


def test_an_empty_list_says_where_to_begin(browser: webdriver.Chrome, tmp_path: Path) -> None:
    with studio(tmp_path / "none") as empty:
        browser.get(empty.address)
        until(browser, lambda: find(browser, ".first").is_displayed())
        offers = [
            item.text for item in browser.find_elements(By.CSS_SELECTOR, ".first :is(a, button)")
        ]
        assert offers == ["Run the demo", "Build a car", "Open the example"]
        browser.find_elements(By.CSS_SELECTOR, ".first a")[0].click()
        until(browser, lambda: "Step 1 of 5" in find(browser, ".guide").text)
        take_block(browser, "wooden block")
        assert marked(browser) == ["0.0"]  # the front, which the first step is about
        attach(browser, "0.3")
        until(browser, lambda: "that is another face" in find(browser, ".guide").text)
        find(browser, ".top button").click()
        until(browser, lambda: len(tree(browser)) == 1)
        take_block(browser, "wooden block")
        attach(browser, "0.0")
        until(browser, lambda: "Step 2 of 5" in find(browser, ".guide").text)
        attach(browser, "0.1")
        take_block(browser, "powered wheel")
        for parent in (1, 2):
            until(browser, lambda: len(marked(browser)) == 4)
            attach(browser, marked(browser)[0])
            until(browser, lambda: len(marked(browser)) == 1)  # what makes a straight axle
            [opposite] = marked(browser)
            assert opposite.startswith(f"{parent}.")
            attach(browser, opposite)
        until(browser, lambda: "Step 5 of 5" in find(browser, ".guide").text)
        assert find(browser, "#faces h2").text == "Faces"
        browser.get(f"{empty.base}/#guide")
        until(browser, lambda: find(browser, ".problem").text == "There is no page #guide.")
        browser.get(f"{empty.base}/guide")
        until(browser, lambda: find(browser, "h1").text == "There is no such page")
        assert find(browser, ".problem").text == "There is nothing at the address /guide."
        assert "404" in "".join(complaints(browser))
        find(browser, "main .button").click()
        until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "runs")
        open_page(browser, empty, "leaderboard")
        commands = [item.text for item in browser.find_elements(By.CSS_SELECTOR, "main li code")]
        assert len(commands) == 3
        assert all(command.endswith(f" --out {tmp_path / 'none'}") for command in commands)
        open_page(browser, empty, "build?example=catapult")
        assert len(tree(browser)) == 21
        assert complaints(browser) == []


def test_each_benchmark_has_a_leaderboard_that_leads_to_runs(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    cards, run = RECORDED.parents[1] / "docs" / "cards", "runs/search.throwing-1.seed-0"
    shutil.copytree(cards / "language-model" / run, tmp_path / "a" / run)
    for name, card in (("a", "language-model/card.json"), ("b", "procedural.json")):
        (tmp_path / name).mkdir(exist_ok=True)
        shutil.copy(cards / card, tmp_path / name / "card.json")
    with studio(tmp_path) as two:
        browser.get(two.address)
        open_page(browser, two, "leaderboard")
        others = browser.find_elements(By.CSS_SELECTOR, ".picks a")
        assert [item.get_attribute("aria-current") for item in others] == ["page", None, None]
        assert others[0].text == "3 models on 11 items, 1 per family"  # with those that ship
        assert "Score 114.11 m; 100 % is 118.93 m." in find(browser, ".actions").text
        assert (
            find(browser, ".actions a")
            .get_attribute("href")
            .endswith("#run?run=a%2Fruns%2Fsearch.throwing-1.seed-0")
        )
        others[1].click()
        chosen = 'return document.querySelector(".picks [aria-current]")?.innerText'
        until(browser, lambda: "33 items, 3 per" in (browser.execute_script(chosen) or ""))
        assert browser.find_elements(By.CSS_SELECTOR, ".actions a") == []
        with on_phone(browser, 390, 844, dark=False):
            open_page(browser, two, "leaderboard")
            heads = [
                item.text for item in browser.find_elements(By.CSS_SELECTOR, ".turned thead th")
            ]
            short = ["large language model", "procedural", "random edits"]
            assert heads == ["family", *short, "item", *short]
            assert find(browser, ".turned td").rect["y"] > find(browser, ".turned th").rect["y"]
            for shares in browser.find_elements(By.CSS_SELECTOR, ".shares"):
                assert shares.rect["x"] + shares.rect["width"] <= 390
            assert "throwing-1\nwalled arena" in [
                item.text for item in browser.find_elements(By.CSS_SELECTOR, ".shares tbody th")
            ]
        assert complaints(browser) == []


def test_cards_of_the_gallery_say_what_scores_are_worth(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_page(browser, served, "gallery")
    assert "Good from 45 m · record 224.66 m." in find(browser, "main section > p").text
    for width in (1440, 820, 390):
        with on_phone(browser, width, 900, dark=False):
            cards = len(find(browser, "main section").find_elements(By.CSS_SELECTOR, ".card"))
            room = min(cards * 352, width - 24)  # so that others have room beside it
            assert 0 < find(browser, "main section").rect["width"] <= room
    told = r"\d+ % of 224\.66 m, the record of throwing on pybullet 3\.2\.7"
    assert re.fullmatch(told, find(browser, ".card span ~ small").text)
    open_page(browser, served, "runs")
    until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, "[data-run=throwing] td.share"))
    title = str(find(browser, "[data-run=throwing] td.share").get_attribute("title"))
    assert re.fullmatch(told, title.replace("\u00a0", " "))
    assert complaints(browser) == []


def test_verified_machines_come_first_and_those_made_by_hand_say_so(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    shutil.copytree(RECORDED, tmp_path / "recorded")
    with studio(tmp_path) as own:
        browser.get(own.address)
        open_page(browser, own, "build?task=throwing&record=yes")
        blocks(browser, 40)
        find(browser, ".test").click()
        said(browser, "Test 1: score")
        for page in ("gallery", "tasks?task=throwing"):
            open_page(browser, own, page)
            best, hand = (item.text for item in browser.find_elements(By.CSS_SELECTOR, ".card b"))
            assert best == "11.63 m verified"
            assert re.fullmatch(r"[\d.]+ m not verified ?made by hand", hand.replace("\n", " "))
            assert float(hand.split()[0]) > 11.63
        with on_phone(browser, 390, 844, dark=False):
            open_page(browser, own, "runs")
            until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, "td.share")) == 2)
            for cell in browser.find_elements(By.CSS_SELECTOR, "td.share"):
                assert 0 < cell.rect["width"] <= 390 - cell.rect["x"]
                shown = "return getComputedStyle(arguments[0], '::after').content"
                told = str(browser.execute_script(shown, cell)).replace("\u00a0", " ")
                assert " % of 224.66 m, the record of throwing" in told
        assert complaints(browser) == []


def test_all_tasks_are_shown_and_one_leads_to_a_machine_or_a_design(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_page(browser, served, "tasks")
    cards = browser.find_elements(By.CSS_SELECTOR, ".card")
    assert [card.get_attribute("data-task") for card in cards] == list(task_names())
    find(browser, "input[type=search]").send_keys("ring")
    Select(find(browser, "select[aria-label=family]")).select_by_visible_text("throwing")
    filters = "#tasks?words=ring&family=throwing"
    until(browser, lambda: browser.current_url.endswith(filters))
    browser.refresh()
    status = f"2 of {len(cards)} levels"
    until(browser, lambda: find(browser, ".filters [role=status]").text == status)
    shown = [card for card in browser.find_elements(By.CSS_SELECTOR, ".card") if card.text]
    assert [card.get_attribute("data-task") for card in shown] == ["throwing/4", "throwing/5"]
    assert browser.current_url.endswith(filters)
    find(browser, "input[type=search]").send_keys(" nothing")
    until(browser, lambda: "No level fits" in find(browser, ".filters [role=status]").text)
    find(browser, ".filters button").click()
    until(browser, lambda: not browser.find_elements(By.CSS_SELECTOR, ".card[hidden]"))
    drawn = "return document.querySelector('.card img').naturalWidth"
    until(browser, lambda: browser.execute_script(drawn) == SMALL[0])
    find(browser, '.card[data-task="throwing/4"]').click()
    title = "return document.querySelector('h1')?.innerText"
    until(browser, lambda: browser.execute_script(title) == "One ring")
    assert browser.title == "throwing/4 · one ring · agentflow studio"
    with on_phone(browser, 390, 844, dark=False):
        for plan in browser.find_elements(By.CSS_SELECTOR, ".plan"):
            assert plan.rect["x"] + plan.rect["width"] <= 390  # whole, with its target
    links = {a.text: a.get_attribute("href") for a in browser.find_elements(By.CSS_SELECTOR, "a")}
    assert links["Build a machine"].endswith("#build?task=throwing%2F4")
    browser.find_element(By.LINK_TEXT, "Let a model design one").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "runs")
    assert find(browser, ".design select[name=task]").get_attribute("value") == "throwing/4"
    record = record_of(get_task("throwing/4"))
    assert record
    browser.get(str(links["Open the machine of the record"]))
    until(browser, lambda: "machine of the record" in find(browser, ".said").text)
    assert len(tree(browser)) == record.size
    open_page(browser, served, "build?task=jumping")
    assert "middle at z = 12 m: 0.5 m high" in find(browser, ".task-card").text
    assert complaints(browser) == []
