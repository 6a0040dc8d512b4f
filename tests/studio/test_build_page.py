"""The Build page in a real browser: machines are built by keyboard, mouse and touch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.interaction import POINTER_MOUSE, POINTER_TOUCH
from selenium.webdriver.common.actions.pointer_input import PointerInput
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import Select

from agentflow.app.inspect.overview import run_list
from agentflow.app.machines.files import read_one
from agentflow.app.tasks import task_info
from agentflow.extras import is_installed
from benchmarks.controllers import STOPPING
from tests.machine.builders import CAR, build
from tests.report.browser import complaints
from tests.studio.pages import (
    attach,
    blocks,
    fill,
    find,
    idle,
    keys,
    open_page,
    said,
    take_block,
    tree,
    until,
)
from tests.studio.serving import Served

pytestmark = pytest.mark.slow
RECORD = task_info("movement", {}).record["full"]  # type: ignore[index]


def test_a_car_is_built_by_keyboard_alone_tested_and_undone(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    open_page(browser, served, "build?task=movement")
    take_block(browser, "wooden block")
    for number, face in enumerate(("0.0", "0.1"), start=2):
        attach(browser, face)
        blocks(browser, number)
    take_block(browser, "powered wheel")
    for number, face in enumerate(("1.1", "1.3", "2.1", "2.3"), start=4):
        attach(browser, face)
        blocks(browser, number)
    keys(browser, "p")
    said(browser, "Test 1: score")
    score = float(find(browser, ".strip b").text.removesuffix(" m"))
    assert score >= 40
    told = f"score {score:.2f} m, {round(100 * score / RECORD)} % of the record. Starting Block: "
    assert told in find(browser, ".said").text
    until(browser, lambda: find(browser, ".player .title").text == "Test 1")
    clock = find(browser, ".player output")
    until(browser, lambda: float(clock.text.removesuffix(" s")) > 0.3)
    assert view(browser) == "Film"
    loads = browser.find_element(By.XPATH, "//button[text()='Loads']")
    assert loads.get_attribute("aria-pressed") != "true"
    assert not any("Starting" in item.text for item in palette(browser))
    for left in range(6, 0, -1):
        keys(browser, Keys.CONTROL, "z", Keys.NULL)
        blocks(browser, left)
        assert view(browser) == "Machine"  # where what is edited is seen
    keys(browser, Keys.CONTROL, "z", Keys.NULL)
    said(browser, "nothing to undo")
    for count in range(2, 8):
        keys(browser, Keys.CONTROL, "y", Keys.NULL)
        blocks(browser, count)
    find(browser, ".trials-strip p button").click()
    said(browser, "is complete")
    [row] = [row for row in run_list(runs) if row["task"] == "movement"]
    assert (row["state"], row["model"]) == ("done", "a person in the studio")
    assert row["score"] == pytest.approx(score, abs=0.005)
    assert read_one(row["run"]) == CAR
    assert complaints(browser) == []


def view(driver: webdriver.Chrome) -> str:
    """The tab that is chosen, which is what is seen."""
    name = find(driver, ".top [aria-selected=true]").text
    assert find(driver, ".centre .player").is_displayed() == (name == "Film")
    assert find(driver, ".centre .stage").is_displayed() == (name == "Machine")
    return name


def palette(driver: webdriver.Chrome) -> list[WebElement]:
    return driver.find_elements(By.CSS_SELECTOR, ".palette [role=option]")


def test_work_is_kept_in_the_browser_and_two_tabs_never_share_it(
    browser: webdriver.Chrome, served: Served, tmp_path: Path
) -> None:
    (tmp_path / "car.json").write_text(CAR.to_text(), encoding="utf-8")
    open_page(browser, served, "build?task=movement/2")
    assert not browser.find_elements(By.CSS_SELECTOR, ".earlier")
    browser.execute_script("document.querySelector('.more details').open = true")
    find(browser, "input[type=file]").send_keys(str(tmp_path / "car.json"))
    blocks(browser, 7)
    keys(browser, "p")
    said(browser, "Test 1: score")
    score = find(browser, ".strip b").text
    for page in ("build", "runs", "build"):  # leaving and coming back, then reloading
        open_page(browser, served, page)
    browser.refresh()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "build")
    assert len(tree(browser)) == 1
    go_on = find(browser, ".earlier button")
    assert go_on.text == f"Continue (7 blocks, best {score})"
    go_on.click()
    blocks(browser, 7)
    assert find(browser, ".strip b").text == score
    first = find(browser, ".trials-strip a").text
    browser.switch_to.new_window("tab")
    open_page(browser, served, "build?task=movement/2")
    find(browser, ".earlier button").click()
    said(browser, "Another tab works on this machine too")
    blocks(browser, 7)
    keys(browser, Keys.CONTROL, "z", Keys.NULL)
    blocks(browser, 1)
    browser.close()
    browser.switch_to.window(browser.window_handles[0])
    browser.refresh()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "build")
    texts = [button.text for button in browser.find_elements(By.CSS_SELECTOR, ".earlier button")]
    assert texts == [
        *(f"Continue ({n}, best {score})" for n in ("1 block", "7 blocks")),
        "Start new",
    ]
    find(browser, "input[type=file]").send_keys(str(tmp_path / "car.json"))
    blocks(browser, 7)
    until(browser, lambda: not browser.find_elements(By.CSS_SELECTOR, ".earlier"))
    keys(browser, "p")
    said(browser, "Test 1: score")
    assert find(browser, ".trials-strip a").text != first  # nobody asked to join it
    assert complaints(browser) == []


def place_of(driver: webdriver.Chrome, block: int, face: int) -> list[float]:
    """Where the mark of a face is, from the middle of the canvas, pixels."""
    canvas = find(driver, ".stage canvas")
    script = "return arguments[0].placeOf(arguments[1], arguments[2])"
    return list(driver.execute_script(script, canvas, block, face))


def click_face(driver: webdriver.Chrome, key: str, pointer: str) -> None:
    """Click or tap the mark of a face."""
    block, face = map(int, key.split("."))
    canvas = find(driver, ".stage canvas")
    x, y = place_of(driver, block, face)
    hand = ActionBuilder(driver, mouse=PointerInput(pointer, pointer))
    hand.pointer_action.move_to(canvas, round(x), round(y)).click()
    hand.perform()
    idle(driver)


@pytest.fixture
def screen(browser: webdriver.Chrome) -> Iterator[Callable[[int, int], None]]:
    """Sets the size of what is seen; afterwards it is as before."""
    before = browser.get_window_size()
    bars = before["height"] - int(browser.execute_script("return innerHeight"))

    def set_size(width: int, height: int) -> None:
        browser.set_window_size(width, height + bars)
        seen = browser.execute_script("return [innerWidth, innerHeight]")
        assert seen == [width, height]

    yield set_size
    browser.set_window_size(before["width"], before["height"])


@pytest.mark.parametrize(
    ("width", "height", "pointer"), [(1280, 720, POINTER_MOUSE), (820, 1180, POINTER_TOUCH)]
)
def test_a_car_is_built_by_mouse_or_touch_saved_and_reopened(
    browser: webdriver.Chrome,
    served: Served,
    tmp_path: Path,
    screen: Callable[[int, int], None],
    width: int,
    height: int,
    pointer: str,
) -> None:
    screen(width, height)
    open_page(browser, served, "build?task=movement")
    browser.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )

    def choose(name: str) -> None:
        next(item for item in palette(browser) if name in item.text).click()
        idle(browser)
        assert name in find(browser, "#faces h2").text

    choose("Wooden Block")
    for number, key in enumerate(("0.1", "1.0"), start=2):
        click_face(browser, key, pointer)
        blocks(browser, number)
    choose("Powered Wheel")
    click_face(browser, "1.1", pointer)
    blocks(browser, 4)
    click_face(browser, "2.2", pointer)
    blocks(browser, 5)
    for wheel, count in ((3, 6), (4, 7)):
        blocks(browser, count - 1)
        at = next(i for i, text in enumerate(tree(browser), 1) if text.startswith(f"{wheel} "))
        find(browser, f"[role=treeitem]:nth-child({at})").click()
        find(browser, "button[title^=Mirror]").click()
        blocks(browser, count)
    find(browser, ".test").click()
    said(browser, "Test 1: score")
    assert float(find(browser, ".strip b").text.removesuffix(" m")) >= 40
    find(browser, ".top .tab").click()
    details = browser.find_elements(By.CSS_SELECTOR, ".more summary")
    next(item for item in details if item.text == "Open and save").click()
    for button in browser.find_elements(By.CSS_SELECTOR, ".more .files button[title]"):
        name = button.get_attribute("title")
        assert name
        button.click()
        until(browser, (tmp_path / name).exists)
    guide, step, _ = browser.find_elements(By.CSS_SELECTOR, ".more .files button:not([title])")
    guide.click()
    said(browser, "Saved as machine-")
    until(browser, lambda: list(tmp_path.glob("machine-*.html")))
    [steps] = tmp_path.glob("machine-*.html")
    assert "Step 1 of 2" in steps.read_text(encoding="utf-8")
    assert [button.text for button in (guide, step)] == ["instructions", "CAD"]
    step.click()
    said(browser, f"Saved as {steps.stem}.step" if is_installed("OCP") else "OCP is not installed")
    saved = next(tmp_path.glob("*.json"))
    assert read_one(str(next(tmp_path.glob("*.bsg")))).count(2) == 4
    open_page(browser, served, "build?task=movement")
    browser.execute_script("document.querySelector('.more details').open = true")
    find(browser, "input[type=file]").send_keys(str(saved))
    blocks(browser, 7)
    said(browser, f"Opened {saved.name}")
    assert complaints(browser) == []


CATAPULT = (
    *(("wooden block", f"0.{face}") for face in (0, 1, 3, 2)),
    ("log", "0.4"),
    ("hinge", "5.0"),
    ("log", "6.4"),
    ("log", "6.3"),
    ("container", "8.9"),
    ("boulder", "9.0"),
    ("ballast", "1.6"),
    ("spring", "7.12", "11.3"),
    ("spring", "7.0", "0.3"),
    ("brace", "2.2", "5.8"),
)
"""Blocks of a catapult in building order, and the faces that they are attached to."""


def test_a_catapult_with_springs_and_a_brace_is_built_tested_and_undone(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_page(browser, served, "build?task=throwing")
    for count, (name, *faces) in enumerate(CATAPULT, start=2):
        take_block(browser, name)
        for face in faces:
            attach(browser, face)
        blocks(browser, count)
    assert find(browser, ".facts-panel .quiet").text == "None: ready to test."
    [boulder] = (item for item in palette(browser) if "Boulder" in item.text)
    assert boulder.text.endswith("1 of 1")
    assert boulder.get_attribute("aria-disabled") == "true"
    keys(browser, "p")
    said(browser, "Test 1: score")
    assert float(find(browser, ".strip b").text.removesuffix(" m")) > 5
    keys(browser, "e")
    whole = tree(browser)
    for left in range(14, 0, -1):
        keys(browser, Keys.CONTROL, "z", Keys.NULL)
        blocks(browser, left)
    keys(browser, *(Keys.CONTROL, "y" * 14, Keys.NULL))
    until(browser, lambda: tree(browser) == whole)
    assert complaints(browser) == []


def test_blocks_are_moved_turned_copied_mirrored_and_removed_by_keyboard(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_page(browser, served, "build?task=movement")
    for name, face in (("wooden block", "0.3"), ("powered wheel", "1.1")):
        take_block(browser, name)
        attach(browser, face)
    root, plank, wheel = "0 Starting Block z+ (given)", "Wooden Block", "Powered Wheel"
    built = [root, f"1 {plank} x+", f"2 {wheel} z+"]
    assert tree(browser) == built
    both = [*built, f"3 {plank} x-", f"4 {wheel} z-"]
    mirrored = [*built, f"3 {plank} x-", f"4 {wheel} z+"]
    for chosen, pressed, face, found in (
        ("1", "m", "0.0", [root, f"1 {plank} z+", f"2 {wheel} x-"]),
        ("1", "r", "", [root, f"1 {plank} z-", f"2 {wheel} x+"]),
        ("1", "m", "0.3", built),
        ("1", "c", "0.2", both),
        ("3", Keys.DELETE, "", built),
        ("1", "x", "", mirrored),
    ):
        keys(browser, Keys.ESCAPE)
        keys(browser, "t")
        keys(browser, chosen, pressed)
        idle(browser)
        if face:
            attach(browser, face)
        assert tree(browser) == found, pressed
    keys(browser, Keys.CONTROL, "z" * 8, Keys.NULL)
    blocks(browser, 1)
    assert complaints(browser) == []


def test_a_face_that_does_not_fit_says_why_before_the_click(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_page(browser, served, "build?task=movement")
    take_block(browser, "wooden block")
    attach(browser, "0.0")
    blocks(browser, 2)
    take_block(browser, "powered wheel")
    attach(browser, "1.1")
    blocks(browser, 3)
    keys(browser, "1.2")
    said(browser, "overlap by")
    assert "bad" in str(find(browser, ".said").get_attribute("class"))
    until(browser, lambda: "overlap by" in find(browser, ".stage .tip").text)  # beside the face
    keys(browser, Keys.ENTER)
    said(browser, "overlap by")
    assert len(tree(browser)) == 3
    keys(browser, "1.3")
    until(browser, lambda: not find(browser, ".stage .tip").is_displayed())
    before = place_of(browser, 1, 3)
    find(browser, ".axis[title='Look from the front']").click()
    until(browser, lambda: place_of(browser, 1, 3) != before)
    browser.find_element(By.XPATH, "//button[text()='Undo view']").click()
    until(browser, lambda: place_of(browser, 1, 3) == pytest.approx(before, abs=1))


def test_a_problem_is_shown_and_fixed(
    browser: webdriver.Chrome, served: Served, tmp_path: Path
) -> None:
    crowded = build((1, 0, 0), (2, 1, 1), (2, 1, 2))
    (tmp_path / "crowded.json").write_text(crowded.to_text(), encoding="utf-8")
    open_page(browser, served, "build?task=movement/3")
    browser.execute_script("document.querySelector('.more details').open = true")
    find(browser, "input[type=file]").send_keys(str(tmp_path / "crowded.json"))
    until(browser, lambda: "overlap by" in find(browser, ".problems .bad").text)
    show, fix = browser.find_elements(By.CSS_SELECTOR, ".problems .bad button")
    show.click()
    assert "3 Powered Wheel" in find(browser, "[role=treeitem][aria-selected]").text
    fix.click()
    said(browser, "Moved to a face where it fits: block 3")
    assert find(browser, ".facts-panel .quiet").text == "None: ready to test."
    assert complaints(browser) == []


def test_a_model_refines_a_machine_and_its_answer_can_be_undone(
    browser: webdriver.Chrome, served: Served, tmp_path: Path, stub_url: str
) -> None:
    """One at an endpoint; in test_person_runs.py it is the procedural model."""
    (tmp_path / "car.json").write_text(CAR.to_text(), encoding="utf-8")
    open_page(browser, served, "build?task=movement")
    browser.execute_script(
        "document.querySelectorAll('.more details').forEach((d) => d.open = true)"
    )
    find(browser, "input[type=file]").send_keys(str(tmp_path / "car.json"))
    blocks(browser, 7)
    before = tree(browser)
    form = find(browser, ".more form")
    fill(form, workflow="iterative", trajectories="1", rounds="1")
    Select(form.find_element(By.CSS_SELECTOR, "select")).select_by_value("Another endpoint")
    fill(form, model="some-model", base_url=stub_url)
    form.find_element(By.CSS_SELECTOR, "[type=submit]").click()
    take = "//button[text()='Use this machine']"
    until(browser, lambda: browser.find_elements(By.XPATH, take))
    browser.find_element(By.XPATH, take).click()
    said(browser, "This is the model's machine")
    assert len(tree(browser)) >= 7
    find(browser, ".top button").click()
    until(browser, lambda: tree(browser) == before)
    assert complaints(browser) == []


def test_control_is_edited_checked_and_shown_as_curves_under_the_film(
    browser: webdriver.Chrome, served: Served, tmp_path: Path
) -> None:
    (tmp_path / "stops.json").write_text(STOPPING.sensing().to_text(), encoding="utf-8")
    open_page(browser, served, f"build?task={STOPPING.task}")
    assert "No control yet" in find(browser, ".facts-panel .warned").text
    browser.execute_script(
        "document.querySelectorAll('.more details').forEach((e) => (e.open = 1))"
    )
    find(browser, "input[type=file]").send_keys(str(tmp_path / "stops.json"))
    blocks(browser, 7)
    text, apply = find(browser, ".control textarea"), find(browser, ".control .play")
    written = str(text.get_property("value"))
    assert '"approach": {"kind":"pd","sensor":"ahead","target":2,"p":-0.1}' in written
    assert not apply.is_enabled()
    assert not browser.find_elements(By.CSS_SELECTOR, ".facts-panel .warned")
    find(browser, ".control button").click()  # an example with what this machine has
    until(browser, apply.is_enabled)
    looks = '"ahead_2": {"kind":"distance","block":1,"axis":"z+"}'
    assert looks in str(text.get_property("value"))
    find(browser, ".control .play + button").click()

    def write(content: str) -> None:
        script = "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))"
        browser.execute_script(script, text, content)

    def told() -> list[str]:
        script = "return [...document.querySelectorAll('.control li')].map((li) => li.innerText)"
        return list(browser.execute_script(script))

    write(written.replace(',"p":-0.1', ""))
    until(browser, lambda: told() == ["controllers: laws.approach.p is missing Show"])
    assert not apply.is_enabled()
    find(browser, ".test").click()
    said(browser, "cannot be applied: controllers: laws.approach.p is missing")
    assert not browser.find_elements(By.CSS_SELECTOR, ".strip li")
    find(browser, ".control li button").click()
    marked = (
        "return arguments[0].value.slice(arguments[0].selectionStart, arguments[0].selectionEnd)"
    )
    assert browser.execute_script(marked, text) == '"approach"'
    write(written[:-1])
    until(browser, lambda: told() and told()[0].startswith("this is not JSON: "))
    write(written.replace("-0.1", "-0.2"))
    until(browser, lambda: told() == [] and apply.is_enabled())
    Select(find(browser, ".control select")).select_by_value("sensors tilt")
    until(browser, lambda: "tilt" in str(text.get_property("value")) and apply.is_enabled())
    box = "//fieldset[starts-with(normalize-space(legend), '{}')]//label[starts-with(., '{}')]/*"
    Select(browser.find_element(By.XPATH, box.format("Sensor tilt", "axis"))).select_by_value("z")
    gain = browser.find_element(By.XPATH, box.format("Law approach", "p, gain"))
    assert gain.get_property("value") == "-0.2"
    gain.clear()
    gain.send_keys("-0.25")
    drives = browser.find_element(By.XPATH, box.format("Output 1", "drives"))
    assert drives.get_property("value")
    for part in ('"tilt": {"kind":"tilt","block":0,"axis":"z"}', '"p":-0.25'):
        assert part in str(text.get_property("value"))
    until(browser, apply.is_enabled)
    find(browser, ".test").click()  # with what is written
    said(browser, "Test 1: score")
    assert not apply.is_enabled()
    until(browser, lambda: len(browser.find_elements(By.CSS_SELECTOR, ".player .lanes li")) == 3)
    lanes = [item.text for item in browser.find_elements(By.CSS_SELECTOR, ".player .lanes li span")]
    assert lanes[-1].startswith("law approach (target 2)")
    find(browser, ".top .tab").click()
    keys(browser, Keys.CONTROL, "z", Keys.NULL)
    until(browser, lambda: text.get_property("value") == written)
    open_page(browser, served, "build?task=movement")
    assert not browser.find_elements(By.CSS_SELECTOR, ".control textarea")
    open_page(browser, served, "build?task=movement/7&record=yes")
    text, apply = find(browser, ".control textarea"), find(browser, ".control .play")
    until(browser, lambda: "sensors" in str(text.get_property("value")))
    write("{")
    until(browser, lambda: told() and told()[0].startswith("this is not JSON: "))
    above, below = find(browser, ".control li").rect, apply.rect  # in sight without scrolling
    assert above["y"] + above["height"] <= below["y"]
    told_at = browser.execute_script(
        "return arguments[0].getBoundingClientRect().bottom - innerHeight",
        find(browser, ".control li"),
    )
    assert told_at <= 0
    write("{}")
    find(browser, ".control button").click()  # a law that balances
    until(browser, lambda: "lean" in str(text.get_property("value")) and apply.is_enabled())
    find(browser, ".test").click()
    said(browser, "Test 1: score 10")
    open_page(browser, served, "build?task=rocket/5")
    assert browser.find_elements(By.CSS_SELECTOR, ".side > .control[open]:first-child")
    assert "no faster than 4 m/s and at most 20 m" in find(browser, ".task-card summary").text
    assert complaints(browser) == []
