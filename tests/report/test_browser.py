"""Pages in a real browser: they open, play, scrub, can be walked through, and execute nothing."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from PIL import Image
from pydantic import BaseModel
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

from agentflow.app.benchmark.card import read_card
from agentflow.app.benchmark.page import leaderboard_data
from agentflow.app.machines.files import read_one
from agentflow.app.pages.compare import compare
from agentflow.app.pages.gallery import gallery
from agentflow.app.pages.robustness import page_writer, robustness_figure
from agentflow.app.pages.runs import report, run_data
from agentflow.app.pages.training import training_report
from agentflow.env.drawing.glb import machine_glb
from agentflow.env.drawing.stills import png_url
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from agentflow.metrics.cells import Scores
from agentflow.metrics.tables import Column, Row, Table
from agentflow.report.page import page as whole_page
from agentflow.report.sweep import Spread, sweep_data
from agentflow.runs import read_result
from agentflow.training.record import About, TrainingRun
from tests.app.pages.test_robustness import FOUND
from tests.machine.builders import CAR
from tests.report.browser import chromium, complaints, on_phone
from tests.report.hostile import LONG, NASTY, hostile_run
from tests.training.folders import throws, write_training

pytestmark = pytest.mark.slow
PATIENCE = 60.0
VISIBLE = (
    NASTY.replace("\x00", "[U+0000]")
    .replace("\u202e", "[U+202E]")
    .replace("\u202c", "[U+202C]")
    .replace("\ufeff", "[U+FEFF]")
)
"""What the page makes of it: text, with the names of what would not be seen."""
STILL: dict[str, Any] = {"view": "three-quarter", "size": (32, 24)}
RECORDED = Path(__file__).parent.parent.parent / "runs" / "recorded-throwing"


def quiet(_done: int, _of: int) -> None:
    """Nobody watches."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    return report(hostile_run(folder), folder / "report.html", films=9, workers=1, say=quiet)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with chromium(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


@pytest.fixture
def opened(browser: webdriver.Chrome, page: Path) -> webdriver.Chrome:
    complaints(browser)  # whatever an earlier page said
    browser.get_log("performance")  # type: ignore[no-untyped-call]
    browser.get(page.as_uri())
    until(browser, lambda: not title(browser).startswith("no"))
    return browser


def until(driver: webdriver.Chrome, met: Any) -> None:
    WebDriverWait(driver, PATIENCE, 0.05).until(lambda _: met())


def find(driver: webdriver.Chrome, selector: str) -> WebElement:
    return driver.find_element(By.CSS_SELECTOR, selector)


def title(driver: webdriver.Chrome) -> str:
    return find(driver, ".view .title").text


def time_of(driver: webdriver.Chrome) -> float:
    return float(find(driver, "output").text.removesuffix(" s"))


def node(driver: webdriver.Chrome, name: str) -> WebElement:
    return find(driver, f"[role=treeitem][data-node='{name}']")


def reds(driver: webdriver.Chrome) -> int:
    """Pixels of the film in the colour of broken blocks."""
    return int(
        driver.execute_async_script(
            """const [done] = arguments; const player = document.querySelector(".player");
            player.addEventListener("frame", () => {
              const canvas = document.querySelector("canvas");
              const copy = document.createElement("canvas");
              [copy.width, copy.height] = [canvas.width, canvas.height];
              const pen = copy.getContext("2d");
              pen.drawImage(canvas, 0, 0);
              const { data } = pen.getImageData(0, 0, copy.width, copy.height);
              let count = 0;
              for (let i = 0; i < data.length; i += 4)
                count += data[i] > 110 && data[i + 1] < 40 && data[i + 2] < 40;
              done(count);
            }, { once: true });
            const slider = document.querySelector("input[type=range]");
            slider.dispatchEvent(new Event("input"));"""
        )
    )


def scrub(driver: webdriver.Chrome, time: float) -> None:
    driver.execute_script(
        """const slider = document.querySelector("input[type=range]");
        slider.value = arguments[0]; slider.dispatchEvent(new Event("input"));""",
        time,
    )
    until(driver, lambda: time_of(driver) == pytest.approx(time, abs=0.02))


def test_it_opens_without_a_word_and_loads_nothing(opened: webdriver.Chrome, page: Path) -> None:
    assert complaints(opened) == []
    logs = opened.get_log("performance")  # type: ignore[no-untyped-call]
    sent = [json.loads(entry["message"])["message"] for entry in logs]
    asked = [
        item["params"]["request"]["url"]
        for item in sent
        if item["method"] == "Network.requestWillBeSent"
        and item["params"]["documentURL"] == page.as_uri()  # not the browser's own first tab
    ]
    assert [url for url in asked if not url.startswith("data:")] == [page.as_uri()]
    assert find(opened, "h1").text == "throwing"
    assert (
        find(opened, ".score").text
        == "12.50 m is the best so far: the run is unfinished, so it is not verified"
    )


def test_on_paper_a_still_is_in_place_of_the_film(opened: webdriver.Chrome) -> None:
    """Light and of one shape, whatever the window is; afterwards the film is as before."""
    copied = """dispatchEvent(new Event("beforeprint")); dispatchEvent(new Event("afterprint"));
    const paper = document.querySelector(".paper"), pen = paper.getContext("2d");
    const { data } = pen.getImageData(0, 0, paper.width, paper.height);
    let dark = 0;
    for (let i = 0; i < data.length; i += 4) dark += data[i] + data[i + 1] + data[i + 2] < 200;
    const canvas = document.querySelector(".view canvas");
    return [paper.width, paper.height, dark < data.length / 16, canvas.width / canvas.height,
      canvas.clientWidth / canvas.clientHeight];"""
    for width, dark in ((1280, False), (390, True)):
        with on_phone(opened, width, 844, dark=dark):
            *paper, shape, shown = opened.execute_script(copied)
            assert paper == [1440, 960, True]
            assert shape == pytest.approx(shown, abs=0.01)
            scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
            printed = {"media": "print", "features": [scheme]}
            opened.execute_cdp_cmd("Emulation.setEmulatedMedia", printed)
            style = "const style = (e) => getComputedStyle(document.querySelector(e)); return ["
            style += "style(':root').getPropertyValue('--paper'), style('.chosen').breakInside]"
            assert opened.execute_script(style) == ["#fff", "avoid"]
            assert 0 < find(opened, ".paper").size["width"] <= width
            opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


def test_it_plays_pauses_and_goes_slowly(opened: webdriver.Chrome) -> None:
    play = find(opened, ".play")
    play.click()
    until(opened, lambda: time_of(opened) > 0.3)
    play.click()
    assert play.text == "Play"
    stopped = time_of(opened)
    opened.find_element(By.CSS_SELECTOR, "canvas").send_keys(",")
    assert find(opened, ".transport select").get_attribute("value") == "0.5"
    assert time_of(opened) == stopped


def test_keys_play_step_and_jump(opened: webdriver.Chrome) -> None:
    canvas = find(opened, "canvas")
    canvas.send_keys(Keys.ARROW_RIGHT * 3)
    until(opened, lambda: time_of(opened) == pytest.approx(0.1, abs=0.011))
    canvas.send_keys(Keys.END)
    until(opened, lambda: time_of(opened) == 5.0)
    canvas.send_keys(" ")
    until(opened, lambda: 0.1 < time_of(opened) < 4.0)  # from the beginning again
    canvas.send_keys(" ")
    canvas.send_keys(Keys.HOME)
    until(opened, lambda: time_of(opened) == 0.0)


def test_the_tree_shows_a_machine_that_breaks(opened: webdriver.Chrome) -> None:
    assert title(opened) == "first design 1 · 12.50 m"
    assert reds(opened) == 0
    node(opened, "env_feedback/traj-1/node-1").click()
    until(opened, lambda: title(opened) == "design 1, round 1 · 0 m")
    until(opened, lambda: "broke off" in find(opened, ".events").text)
    assert "As recorded" not in find(opened, ".remark").text
    assert reds(opened) == 0
    scrub(opened, 1.0)
    assert reds(opened) > 100
    assert f"Add {NASTY[:20]}" in find(opened, ".edit pre").get_property("textContent")  # type: ignore[operator]


def test_first_machines_that_nobody_edited_stand_side_by_side(
    browser: webdriver.Chrome, page: Path, tmp_path: Path
) -> None:
    head, begin, rest = page.read_text(encoding="utf-8").partition('id="data">')
    text, end, tail = rest.partition("</script>")
    data = json.loads(text)
    bare: dict[str, Any] = {
        "machine": None,
        "parent": None,
        "lead": False,
        "best": False,
        "calls": [],
    }
    data["nodes"] += [{**data["nodes"][0], **bare, "id": f"other-{n}"} for n in range(40)]
    changed = json.dumps(data).replace("<", "\\u003c")
    file = tmp_path / "many.html"
    file.write_text(f"{head}{begin}{changed}{end}{tail}", encoding="utf-8")
    browser.get(file.as_uri())
    until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".tree [data-node=other-39]"))
    script = "return [...document.querySelectorAll('[data-node^=other] circle')]" + (
        ".map(({ cx, cy }) => [cx, cy].map((place) => place.baseVal.value))"
    )
    places = browser.execute_script(script)
    assert len({tuple(place) for place in places}) == 40
    assert len({y for _, y in places}) <= 5
    assert complaints(browser) == []


def test_arrow_keys_walk_the_tree(opened: webdriver.Chrome) -> None:
    node(opened, "initial/traj-1").click()
    opened.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
    until(opened, lambda: title(opened) == "rejected edit")
    opened.switch_to.active_element.send_keys(Keys.ARROW_UP)
    until(opened, lambda: title(opened) == "design 1, round 1 · 0 m")
    focused = opened.switch_to.active_element
    assert focused.get_attribute("aria-selected") == "true"
    assert focused.get_attribute("aria-level") == "2"


def test_points_of_a_chart_say_what_they_are_and_pick_their_machine(
    opened: webdriver.Chrome,
) -> None:
    chart = find(opened, "svg[aria-label^='Score over']")
    until(opened, lambda: chart.find_elements(By.CSS_SELECTOR, ".dot"))
    chart.send_keys(Keys.ARROW_RIGHT, Keys.END)
    answer = find(opened, ".answer").text
    assert answer.startswith("score 0 m at ")
    chart.send_keys(Keys.ENTER)
    until(opened, lambda: title(opened).endswith(" · 0 m"))


def ticks(chart: WebElement) -> list[str]:
    """The numbers below a chart."""
    return [item.text for item in chart.find_elements(By.CSS_SELECTOR, ".tick.middle")]


def test_charts_are_logarithmic_and_saved_as_numbers_and_pictures(
    opened: webdriver.Chrome, tmp_path: Path
) -> None:
    opened.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    chart = find(opened, "figure:has(svg[aria-label^='Score over'])")
    until(opened, lambda: chart.find_elements(By.CSS_SELECTOR, ".dot"))
    dots = len(chart.find_elements(By.CSS_SELECTOR, ".dot"))
    buttons = {b.text: b for b in chart.find_elements(By.CSS_SELECTOR, ".exports button")}
    assert list(buttons) == ["log x", ".csv", ".svg"]  # one score is above 0
    for suffix in (".csv", ".svg"):
        buttons[suffix].click()
        until(opened, lambda suffix=suffix: list(tmp_path.glob(f"score-over-*{suffix}")))
    [numbers], [picture] = tmp_path.glob("*.csv"), tmp_path.glob("*.svg")
    assert len(numbers.read_text(encoding="utf-8").splitlines()) == dots + 1
    root = ElementTree.fromstring(picture.read_text(encoding="utf-8"))
    circles = root.findall("{http://www.w3.org/2000/svg}circle")
    assert len(circles) == dots
    assert circles[0].attrib["fill"].startswith("rgb(")
    before = ticks(chart)
    buttons["log x"].click()
    assert buttons["log x"].get_attribute("aria-pressed") == "true"
    assert ticks(chart) != before
    assert complaints(opened) == []


def test_equal_scores_have_the_strongest_colour_and_only_zeros_a_reason(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    _, data = run_data(RECORDED)
    nodes = [{**node, "score": 5.0} for node in data["nodes"]]
    first = {**nodes[0], "parent": nodes[0]["id"], "lead": False, "best": False}
    nodes += [{**first, "id": f"leaf-{number}"} for number in range(9)]  # nobody edits these
    nothing = [{**point, "score": 0.0} for point in data["progress"]]
    bare = {**data, "nodes": nodes, "progress": nothing, "machines": {}, "shapes": [], "files": ""}
    (tmp_path / "run.html").write_text(whole_page("run", bare), encoding="utf-8")
    browser.get((tmp_path / "run.html").as_uri())
    until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".node circle"))
    circles = browser.find_elements(By.CSS_SELECTOR, ".node circle")
    assert {circle.get_attribute("style") for circle in circles} == {"--share: 100%;"}
    leaves = browser.find_elements(By.CSS_SELECTOR, "[data-node^=leaf] circle")
    assert len({leaf.get_attribute("cy") for leaf in leaves}) < 9
    assert find(browser, ".worth").text.startswith("Good from 45 m · record ")
    reason = "All 8 machines score 0. Most frequent failure: breakage, in 6 machines ("
    assert find(browser, ".failing").text.startswith(reason)


def test_the_score_at_the_top_is_the_verified_one_and_its_fall_is_told(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    _, data = run_data(RECORDED)
    verified = {**data["run"]["verified"], "score": 9.0}
    data["task"]["greatest"] = 6000.0
    bare = {"machines": {}, "shapes": [], "files": ""}
    unverified = {**data["run"], "score": 12.0, "verified": None}
    page = whole_page("run", {**data, **bare, "run": unverified})
    (tmp_path / "unverified.html").write_text(page, encoding="utf-8")
    browser.get((tmp_path / "unverified.html").as_uri())
    until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".score b"))
    assert browser.find_elements(By.CSS_SELECTOR, ".failing") == []
    for score, warned in ((9.5, []), (12, ["Its score of 12 m falls to 9 m when verified"])):
        told_run = {**data["run"], "score": score, "verified": verified}
        page = whole_page("run", {**data, **bare, "run": told_run})
        (tmp_path / "run.html").write_text(page, encoding="utf-8")
        browser.get((tmp_path / "run.html").as_uri())
        until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".score b"))
        assert find(browser, ".score").text.startswith("9 m of 6,000 m (verified) by the best")
        reached = browser.execute_script(
            "return document.querySelector('.reached').style.getPropertyValue('--at')"
        )
        most = data["task"]["record"]["verified"]
        assert float(reached[:-1]) == pytest.approx(100 * 9 / most)
        told = [each.text for each in browser.find_elements(By.CSS_SELECTOR, ".failing")]
        assert [text.partition(":")[0] for text in told] == warned


def test_a_tree_higher_than_its_box_can_be_shown_whole(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    _, data = run_data(RECORDED)
    known = {**data["nodes"][0], "best": False, "lead": False}
    pairs = [
        [{**known, "id": f"{n}"}, {**known, "id": f"{n}+", "parent": f"{n}"}] for n in range(40)
    ]
    for count, shown in ((40, True), (3, False)):
        nodes = [node for pair in pairs[:count] for node in pair]
        bare = {**data, "nodes": nodes, "machines": {}, "shapes": [], "files": ""}
        (tmp_path / "run.html").write_text(whole_page("run", bare), encoding="utf-8")
        browser.get((tmp_path / "run.html").as_uri())
        until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".node circle"))
        box, tree = find(browser, ".tall"), find(browser, "svg.tree")
        button = box.find_element(By.XPATH, "following-sibling::button")
        until(browser, lambda b=button, s=shown: b.is_displayed() is s)
        assert (box.rect["height"] < tree.rect["height"]) is shown
        if shown:
            button.click()
            assert box.rect["height"] >= tree.rect["height"]
            assert not button.is_displayed()


def test_a_higher_score_that_was_not_chosen_is_explained_and_leads_to_its_machine(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    _, data = run_data(RECORDED)
    scored = [node for node in data["nodes"] if node["score"]]
    high, own = sorted(scored, key=lambda node: -node["score"])[:2]
    nodes = [{**node, "best": node == own} for node in data["nodes"]]
    tested = {"score": 29.9, "verified": 14.0, "mean": 13.0, "chosen": 19.2, "holds": 5, "of": 8}
    passed = {**tested, "machine": high["machine"], "title": high["title"]}
    bare = {"machines": {}, "shapes": [], "files": "", "nodes": nodes}
    for told_run, rings in (({**data["run"], "passed": passed}, 1), (data["run"], 0)):
        page = whole_page("run", {**data, **bare, "run": told_run})
        (tmp_path / "run.html").write_text(page, encoding="utf-8")
        browser.get((tmp_path / "run.html").as_uri())
        until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".chart .dot"))
        assert len(browser.find_elements(By.CSS_SELECTOR, ".chart .ring")) == rings
        notes = find(browser, "main").text.count("by scores before verification")
        assert notes == 2 * rings, "the chart and the stages"
        if rings:
            assert find(browser, ".passed").text == (
                f"29.90 m was reached by {high['title']}, but holds in 5 of 8 simulations (median "
                "14 m, mean 13 m). The best machine is the one with the highest mean when "
                "verified, 19.20 m."
            )
            assert find(browser, ".chosen h2").text.startswith(own["title"])
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
            name = find(browser, ".passed button")
            assert name.is_displayed(), "it is in a sentence"
            assert name.value_of_css_property("border-top-width") == "0px"
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
            find(browser, ".passed button").click()
            assert find(browser, ".chosen h2").text.startswith(high["title"])


def test_a_refused_edit_says_why_and_has_no_film(opened: webdriver.Chrome) -> None:
    node(opened, "env_feedback/traj-1/round-1/node-0/try-2").click()
    until(opened, lambda: "refused because of <script>" in find(opened, ".chosen .problem").text)
    assert find(opened, ".nothing").text == "No machine to show."


def test_hostile_text_is_shown_and_executes_nothing(opened: webdriver.Chrome) -> None:
    opened.execute_script("document.querySelectorAll('.role').forEach((e) => (e.open = true))")
    until(opened, lambda: opened.find_elements(By.CSS_SELECTOR, ".role .call"))
    opened.execute_script("document.querySelectorAll('.call').forEach((e) => (e.open = true))")
    until(opened, lambda: opened.find_elements(By.CSS_SELECTOR, ".role .said"))
    opened.execute_script("document.querySelectorAll('.said').forEach((e) => (e.open = true))")
    until(opened, lambda: opened.find_elements(By.CSS_SELECTOR, ".role pre"))
    texts = opened.execute_script(
        "return [...document.querySelectorAll('.role pre')].map((pre) => pre.textContent)"
    )
    assert set(texts) == {VISIBLE, LONG[:20000]}
    more = find(opened, ".role pre + button")
    assert more.get_property("textContent") == "Show all 1,000,007 characters"
    opened.execute_script("arguments[0].click()", more)
    lengths = opened.execute_script(
        "return [...document.querySelectorAll('.role pre')].map((pre) => pre.textContent.length)"
    )
    assert max(lengths) == len(LONG)
    about = find(opened, ".lede").get_property("textContent")
    assert about == f"{VISIBLE}: 3 calls, 2 machines simulated"
    assert opened.execute_script("return window.owned ?? null") is None
    made = "main img:not(.card img), main a, main script, main b b"
    assert opened.find_elements(By.CSS_SELECTOR, made) == []
    assert opened.execute_script("return document.querySelectorAll('script').length") == 2
    assert complaints(opened) == []


def test_kinds_of_machines_open_their_films(opened: webdriver.Chrome) -> None:
    cells = opened.find_elements(By.CSS_SELECTOR, ".heat td button")
    assert [cell.get_property("title") for cell in cells] == [
        f"{VISIBLE}: 0 m, 1 machine",
        f"{VISIBLE}: 12.50 m, 1 machine",
    ]
    names = opened.find_elements(By.CSS_SELECTOR, ".heat tfoot th")
    assert [name.get_property("textContent") for name in names] == [VISIBLE, "motors"]
    cells[0].click()
    until(opened, lambda: title(opened) == "design 1, round 1 · 0 m")
    card = find(opened, ".card")
    assert card.find_element(By.TAG_NAME, "span").get_property("textContent") == VISIBLE
    assert card.text.startswith("12.50 m")
    picture = card.find_element(By.TAG_NAME, "img")
    opened.execute_script("arguments[0].scrollIntoView()", picture)
    until(opened, lambda: picture.get_property("naturalWidth") == 320)
    drawn = base64.b64decode(str(picture.get_attribute("src")).partition(",")[2])
    assert len(Image.open(io.BytesIO(drawn)).convert("RGB").getcolors(1 << 20) or ()) > 50
    assert card.find_element(By.TAG_NAME, "small").text == "2 machines"
    card.click()
    until(opened, lambda: title(opened).endswith("12.50 m"))
    assert opened.execute_script("return window.owned ?? null") is None
    assert complaints(opened) == []


def test_the_policy_forbids_what_the_page_does_not_need(opened: webdriver.Chrome) -> None:
    assert opened.execute_script(
        """const script = document.createElement("script");
        try { script.textContent = "window.owned = 4"; document.body.append(script); } catch {}
        return window.owned ?? null"""
    ) is None  # fmt: skip
    refused = opened.execute_async_script(
        "const [done] = arguments; fetch('data:,x').then(() => done(false), () => done(true))"
    )
    assert refused is True
    assert complaints(opened) != []  # and says so


@pytest.mark.parametrize("dark", [False, True])
def test_nothing_is_wider_than_a_phone(browser: webdriver.Chrome, page: Path, dark: bool) -> None:
    with on_phone(browser, 360, 760, dark=dark, scale=2):
        browser.get(page.as_uri())
        until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "run")
        browser.execute_script(
            "document.querySelectorAll('details').forEach((e) => (e.open = true))"
        )
        widths = browser.execute_script(
            "return [document.documentElement.scrollWidth, getComputedStyle(document.body)"
            ".backgroundColor]"
        )
        assert widths == [360, "rgb(20, 24, 26)" if dark else "rgb(252, 251, 248)"]


def test_the_gallery_plays_one_machine_at_a_time(browser: webdriver.Chrome, tmp_path: Path) -> None:
    out = gallery([RECORDED, RECORDED], tmp_path / "gallery.html", workers=1, say=quiet)
    result = read_result(RECORDED)
    scores = f"{result.score:.2f} m (verified: {result.verified_score:.2f} m)"
    complaints(browser)
    browser.get(out.as_uri())
    until(browser, lambda: title(browser) == f"throwing · {scores}")
    [part] = browser.find_elements(By.CSS_SELECTOR, "section:has(.card)")
    assert part.text.startswith("throwing · walled arena\nBuild a machine that throws")
    cards = part.find_elements(By.CSS_SELECTOR, ".card")
    assert [card.get_attribute("aria-pressed") for card in cards] == ["true", "false"]
    assert cards[1].text.startswith(
        f"{result.verified_score:.2f} m verified\n5 % of 224.66 m, the "
    )
    assert "Good from 45 m · record 224.66 m." in part.text
    cards[1].click()
    assert [card.get_attribute("aria-pressed") for card in cards] == ["false", "true"]
    assert browser.execute_script(
        "return [...document.images].map((image) => image.naturalWidth)"
    ) == [320, 320]
    assert complaints(browser) == []


def test_a_comparison_plays_both_films(browser: webdriver.Chrome, tmp_path: Path) -> None:
    car, lame = tmp_path / "car.json", tmp_path / "lame.json"
    car.write_text(CAR.to_text())
    lame.write_text(Machine(CAR.steps[:-1]).to_text())
    out = tmp_path / "compare.html"
    task = get_task("movement", {"window": 1})
    found = compare((str(car), str(lame)), task, 0, out=out, workers=2, say=quiet)
    complaints(browser)
    browser.get(out.as_uri())
    titles = [
        f"{side} · {m['score']:.2f} m" for side, m in zip("AB", found["machines"], strict=True)
    ]
    until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, "output")) == 2)
    assert [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".title")] == titles
    find(browser, ".both").click()
    clocks = browser.find_elements(By.CSS_SELECTOR, "output")
    until(browser, lambda: all(float(c.text.removesuffix(" s")) > 0.3 for c in clocks))
    find(browser, "details:has(table) summary").click()
    heads = [cell.text for cell in browser.find_elements(By.CSS_SELECTOR, "caption")]
    assert heads == ["Both machines", "Only in A"]
    assert browser.execute_script("return window.owned ?? null") is None
    assert complaints(browser) == []


def test_the_shown_machine_can_be_downloaded(opened: webdriver.Chrome, tmp_path: Path) -> None:
    opened.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    made = opened.find_elements(By.CSS_SELECTOR, ".files button")[4]
    assert made.text == "instructions"  # of the best machine
    made.click()
    until(opened, lambda: list(tmp_path.glob("*.html")))
    assert "Step 1 of" in next(tmp_path.glob("*.html")).read_text(encoding="utf-8")
    node(opened, "env_feedback/traj-1/node-1").click()
    until(opened, lambda: title(opened) == "design 1, round 1 · 0 m")
    digest = find(opened, ".chosen p").text.rpartition(" · hash ")[-1]
    buttons = opened.find_elements(By.CSS_SELECTOR, ".files button")
    words = ["JSON", "Besiege", "3D model", "parts list"]
    assert [button.text for button in buttons] == words
    for button, suffix in zip(buttons, (".json", ".bsg", ".glb", ".csv"), strict=True):
        name = f"machine-{digest}{suffix}"
        button.click()
        until(opened, (tmp_path / name).exists)
    tree = read_one(str(tmp_path / f"machine-{digest}.json"))
    assert tree.digest == digest
    assert read_one(str(tmp_path / f"machine-{digest}.bsg")) == tree
    assert (tmp_path / f"machine-{digest}.glb").read_bytes() == machine_glb(tree)
    node(opened, "env_feedback/traj-1/round-1/node-0/try-2").click()
    until(opened, lambda: not find(opened, ".files").is_displayed())
    assert complaints(opened) == []


def test_a_sweep_shows_its_tables_and_spreads(browser: webdriver.Chrome, tmp_path: Path) -> None:
    columns = tuple(Column("", name) for name in "abcdefghijk")
    values = tuple(float(value) for value in range(11))
    wide = Table(NASTY, ("task", "variant"), columns, (Row(("throwing", NASTY), values),))
    failed = {"name": NASTY, "state": "failed", "score": None, "why": NASTY}
    best = {"run": NASTY, "score": 2.0, "picture": "data:,"}
    spread = Spread(Scores((1.0, 2.0), 1), ["r-1", NASTY, NASTY], "m", best)
    long = Row(("throwing", "procedural (no language model)", "hierarchical"), (1.5,))
    other = Row(("throwing", "none (random edits)", "random-dsl"), (0.5,))
    narrow = Table("", ("task", "model", "variant"), (Column("", "a"),), (long, other))
    rows = [failed, {**failed, "name": "r-1"}]
    data = sweep_data(NASTY, "about", {("throwing", NASTY): spread}, [wide, narrow], rows)
    file = tmp_path / "sweep.html"
    file.write_text(whole_page("sweep", data), encoding="utf-8")
    complaints(browser)
    browser.get(file.as_uri())
    until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".chart .dot")) == 3)
    find(browser, ".chart").send_keys(Keys.HOME, Keys.ENTER)
    assert find(browser, ".answer").text == "0 in r-1"
    assert browser.execute_script("return getSelection().toString()").startswith("r-1")
    assert find(browser, "h1").get_property("textContent") == VISIBLE
    cells = [cell.text for cell in browser.find_elements(By.CSS_SELECTOR, "tbody td")]
    assert cells[:4] == ["b", "1.00", "c", "2.00"]  # one row of ten numbers is turned
    assert "failed" in cells  # its reason is in sight
    told = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".chart text, .card b")]
    assert {"score, m", "2 m"} <= set(told)
    with on_phone(browser, 390, 844, dark=False):
        browser.get(file.as_uri())
        boxes = "return [...document.querySelectorAll('table')].at(-2).rows[1].cells"
        label, number = browser.execute_script(boxes)
        assert label.rect["width"] > 130, "its words are not stacked"
        assert number.rect["x"] + number.rect["width"] < 390, "a number is beside its label"
    assert browser.execute_script("return window.owned ?? null") is None
    assert complaints(browser) == []


def test_training_shows_curves_and_films_and_executes_nothing(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    path = tmp_path / "run"
    about = About(kind="grpo", label=NASTY)
    with TrainingRun.open(path, about, Hostile(), resume=False) as run:
        for step in range(1, 6):
            run.note(step, {"reward": step / 2, "score": step / 3, NASTY: 0.1 * step})
        run.note(5, {"eval": {"throwing": {"valid": {"share": 0.5}, "best_at": {"4": 9.0}}}})
        best, worst = throws()[2], throws()[3]
        run.samples(5, [*throws(), worst.model_copy(update={"text": NASTY, "problem": NASTY})])
        run.samples(4, [best.model_copy(update={"text": NASTY})])
    out = training_report(path, tmp_path / "r.html", films=1, workers=1, say=quiet)
    complaints(browser)
    browser.get(out.as_uri())
    until(browser, lambda: title(browser) == f"step 5 · {best.score:.2f} m")
    find(browser, ".play").click()
    until(browser, lambda: time_of(browser) > 0.3)
    until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".chart .line")) == 5 + 1)
    keys = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".key span")]
    assert keys == ["reward", "score"]
    find(browser, ".picks button + button").click()
    until(browser, lambda: title(browser) == f"step 5 · {throws()[1].score:.2f} m")
    browser.execute_script("document.querySelectorAll('details').forEach((e) => (e.open = true))")
    buttons = browser.find_elements(By.CSS_SELECTOR, ".picks button")
    buttons[-1].click()
    until(browser, lambda: title(browser) == f"step 4 · {best.score:.2f} m")
    browser.execute_script("document.querySelectorAll('details').forEach((e) => (e.open = true))")
    texts = browser.execute_script(
        "return [...document.querySelectorAll('main pre')].map((pre) => pre.textContent)"
    )
    assert texts.count(VISIBLE) == 2
    assert find(browser, ".lede").get_property("textContent") == VISIBLE
    assert browser.execute_script("return window.owned ?? null") is None
    assert browser.find_elements(By.CSS_SELECTOR, "main img, main a, main script") == []
    assert complaints(browser) == []


class Hostile(BaseModel):
    """Settings of a training run."""

    tasks: tuple[str, ...] = ("throwing",)
    name: str = NASTY


@pytest.mark.parametrize("dark", [False, True])
def test_a_training_page_fits_a_phone(
    browser: webdriver.Chrome, tmp_path: Path, dark: bool
) -> None:
    path = write_training(tmp_path / "run", label="m")
    out = training_report(path, tmp_path / "r.html", films=0, workers=1, say=quiet)
    with on_phone(browser, 360, 760, dark=dark, scale=2):
        browser.get(out.as_uri())
        until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "training")
        browser.execute_script(
            "document.querySelectorAll('details').forEach((e) => (e.open = true))"
        )
        until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".chart .line"))
        width = browser.execute_script("return document.documentElement.scrollWidth")
        assert width == 360
        paper = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert paper == ("rgb(20, 24, 26)" if dark else "rgb(252, 251, 248)")


def test_where_nothing_scored_the_axis_has_plain_numbers(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    best = {"run": "a", "score": 0.0, "picture": png_url(CAR, **STILL)}
    spread = Spread(Scores((0.0, 0.0), 0), unit="m", best=best)
    table = Table("", ("task", "variant"), (Column("", "a"),), (Row(("throwing", "none"), (0.0,)),))
    file = tmp_path / "sweep.html"
    data = sweep_data("zero", "about", {("throwing", "none"): spread}, [table])
    file.write_text(whole_page("sweep", data), "utf-8")
    browser.get(file.as_uri())
    until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".chart .tick"))
    ticks = browser.find_elements(By.CSS_SELECTOR, ".chart .tick.middle")
    assert [tick.text for tick in ticks] == ["0", "0.2", "0.4", "0.6", "0.8", "1"]
    assert "score, m" in find(browser, ".chart").text
    assert find(browser, ".cards .card").text == "0 m\nthrowing, none"
    assert find(browser, ".cards img").get_property("naturalWidth") == 32


def test_a_sweep_words_ties_tells_ticks_apart_and_has_conditions_side_by_side_on_a_phone(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    record = {"verified": 224.66, "fragile": False, "engine": "pybullet 3.2.7"}
    goal = {"level": "throwing", "good": 45.0, "record": {**record, "share": 0.5, "of": "record"}}
    best = {"run": "a", "score": 90.0, "picture": png_url(CAR, **STILL)}
    scores = {"a": (1.0, 9.0, 2.0), "b": (2.0, 8.0, 3.0), "c": (20.0, 21.0, 22.0)}
    close = {"a": (500.001, 500.004), "b": (500.002, 500.003)}
    spreads = {
        **{
            ("throwing", name): Spread(Scores(s, 0), (), "m", best, goal)
            for name, s in scores.items()
        },
        **{("movement", name): Spread(Scores(s, 0), (), "m") for name, s in close.items()},
    }
    columns = tuple(Column(group, name) for group in ("all", "valid") for name in ("mean", "max"))
    rows = tuple(Row(key, (1.0, 2.0, 3.0, 4.0)) for key in spreads)
    tables = [Table(title, ("task", "variant"), columns, rows) for title in ("ties", "Scores")]
    most = {**goal, "level": "bridge", "record": {**record, "of": "greatest possible score"}}
    most["record"] |= {"share": 0.24, "full": 6000.0}
    spreads["bridge", "d"] = Spread(Scores((1.0,), 0), (), "kg", {**best, "run": "d"}, most)
    file = tmp_path / "sweep.html"
    file.write_text(whole_page("sweep", sweep_data("ties", "about", spreads, tables)), "utf-8")
    with on_phone(browser, 390, 844, dark=False):
        browser.get(file.as_uri())
        until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".chart .tick")) > 9)
        told = [item.text for item in browser.find_elements(By.CSS_SELECTOR, "main section > p")]
        assert told[0] == (
            "At throwing, c has the highest mean, 21 m, before b with 4.33 m. Their intervals are "
            "apart. Good from 45 m · record 224.66 m."
        )
        assert told[1] == "At movement, a and b are alike: their means are equal, 500.00 m."
        ticks = browser.find_elements(By.CSS_SELECTOR, ".chart")[1].find_elements(
            By.CSS_SELECTOR, ".tick.middle"
        )
        assert len({tick.text for tick in ticks}) == len(ticks) > 2
        assert find(browser, ".card small").text == (
            "50 % of 224.66 m, the record of throwing on pybullet 3.2.7"
        )
        shares = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".card small")]
        assert shares[-1] == "24 % of 6,000 kg, the greatest possible score"
        first, folded = browser.find_elements(By.CSS_SELECTOR, "section:has(.table)")
        assert [item.is_displayed() for item in first.find_elements(By.CSS_SELECTOR, ".table")] == [
            True
        ] * 2
        assert not folded.find_element(By.CSS_SELECTOR, ".table").is_displayed()
        folded.find_element(By.CSS_SELECTOR, "summary h2").click()
        assert folded.find_element(By.CSS_SELECTOR, ".table").is_displayed()
        heads = [item.text for item in first.find_elements(By.CSS_SELECTOR, "thead th")]
        assert heads == ["a", "b", "c", "a", "b"]
        for found in first.find_elements(By.CSS_SELECTOR, ".table table"):
            assert found.rect["x"] + found.rect["width"] <= 390
    goal = {"good": 1.0, "calls": 10.0}
    uneven = {key: replace(each, goal=goal) for key, each in spreads.items()}
    uneven["throwing", "b"] = replace(spreads["throwing", "b"], goal={**goal, "calls": 40.0})
    runs = [{"name": "a.1", "state": "running"}, {"name": "a.2", "state": "not started"}]
    notes = ((short := "INCOMPLETE: 2 of 2 runs are missing, 0 of them failed."),)
    for state, problems in (("running", []), ("stopped", [short])):
        runs[0] |= {"state": state, "score": None, "verified": None}
        data = sweep_data("ties", "", uneven, [replace(tables[0], notes=notes)], runs)
        file.write_text(whole_page("sweep", data), "utf-8")
        browser.get(file.as_uri())
        until(browser, lambda: browser.find_elements(By.CSS_SELECTOR, ".chart .tick"))
        found = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".problem")]
        assert found == problems
        told = [item.text for item in browser.find_elements(By.CSS_SELECTOR, "main p")]
        waits = "1 of 2 runs is still running, 1 not started: no verdict yet."
        assert (waits in told) == (state == "running")
        verdicts = [text for text in told if text.startswith("At throwing")]
        spent = "a run of c makes 10 calls, a run of b makes 40 calls and a run of a makes 10 calls"
        if state == "running":
            assert verdicts == ["At throwing: Good from 1 m."]
        else:
            assert f"Their budgets differ: {spent}." in verdicts[0]


@pytest.mark.parametrize("dark", [False, True])
def test_parts_of_a_benchmark_differ_in_colour_and_in_shape(
    browser: webdriver.Chrome, tmp_path: Path, dark: bool
) -> None:
    data = leaderboard_data([read_card(RECORDED.parents[1] / "docs/cards/procedural.json")])
    known, parts = data["parts"][0], ["a", "b", "c", "d"]
    card = data["cards"][0]
    for of_part in (card["total"], card["outcomes"], *card["families"].values()):
        of_part.update(dict.fromkeys(parts, of_part[known]))
    data.update(parts=parts, words={part: part for part in parts}, machines={})
    file = tmp_path / "parts.html"
    file.write_text(whole_page("parts", data), "utf-8")
    with on_phone(browser, 900, 700, dark=dark):
        browser.get(file.as_uri())
        until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".chart .tick")) > 4)
        looks = browser.execute_script(
            """return [...document.querySelectorAll(".key svg")].map((key) => {
              const { fill, stroke } = getComputedStyle(key.firstChild);
              const ways = [...key.children].map((part) => part.getAttribute("d"));
              return [stroke, `${ways} ${fill === stroke}`];
            })"""
        )
    assert [len(set(each)) for each in zip(*looks, strict=True)] == [4, 4]


def test_robustness_is_a_chart_and_a_picture(browser: webdriver.Chrome, tmp_path: Path) -> None:
    out = tmp_path / "robust.html"
    page_writer(out)(FOUND)
    complaints(browser)
    browser.get(out.as_uri())
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "robustness")
    until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".chart .name")) == 5)
    dots = browser.find_elements(By.CSS_SELECTOR, ".chart .dot")
    assert len(dots) == sum(len(row["values"]) for row in robustness_figure(FOUND)["rows"])
    assert len(browser.find_elements(By.CSS_SELECTOR, ".chart .mark")) == 1
    assert find(browser, "figure img").get_property("naturalWidth") == 640
    assert "block 5 (Powered Wheel)" in find(browser, "main").text
    assert complaints(browser) == []
