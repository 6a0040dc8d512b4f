"""What goes wrong outside the studio, as its pages show it: endpoints, machines, lost runs."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select

from tests.llm.hostile import Answer, body, serving, silence
from tests.report.browser import complaints
from tests.studio.pages import RECORDED, blocks, fill, find, open_page, said, until
from tests.studio.serving import Served

pytestmark = pytest.mark.slow
REFUSING = "http://127.0.0.1:9/v1"


@contextmanager
def endpoint(*answers: Answer) -> Iterator[str]:
    """The base URL of a server with these answers, in a thread of its own."""
    loop, ready, ended = asyncio.new_event_loop(), [], asyncio.Event()

    async def serve() -> None:
        async with serving(*answers) as server:
            ready.append(server.base_url)
            await ended.wait()

    thread = Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    while not ready:
        thread.join(0.01)
    try:
        yield ready[0]
    finally:
        loop.call_soon_threadsafe(ended.set)
        thread.join(10)
        loop.close()


def open_form(driver: webdriver.Chrome, served: Served, url: str) -> None:
    open_page(driver, served, "runs")
    find(driver, ".design summary").click()
    form = find(driver, ".design form")
    Select(find(driver, ".who select")).select_by_visible_text("Another endpoint")
    fill(form, task="movement", model="gpt", base_url=url)


def heading(driver: webdriver.Chrome) -> str:
    return str(driver.execute_script("return document.querySelector('h1')?.textContent"))


def connected(driver: webdriver.Chrome) -> str:
    """What is said once the connection was tested."""
    button, told = find(driver, ".connect button"), find(driver, ".connect p")
    button.click()
    until(driver, lambda: button.is_enabled() and told.text and "Asking" not in told.text)
    assert "problem" in str(told.get_attribute("class"))
    return told.text


def test_an_endpoint_that_refuses_or_answers_nonsense_says_so_when_it_is_tested(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_form(browser, served, REFUSING)
    assert "connection refused" in connected(browser)
    with endpoint(body("<html>Welcome to nginx!</html>", kind="text/html")) as url:
        open_form(browser, served, url)
        assert "(an HTML page)" in connected(browser)
    assert complaints(browser) == []


def test_a_design_whose_endpoint_refuses_shows_retries_and_its_reason_and_can_be_edited(
    browser: webdriver.Chrome, served: Served
) -> None:
    open_form(browser, served, REFUSING)
    find(browser, ".design [type=submit]").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "run")
    until(browser, lambda: "tried again" in find(browser, ".live").text)
    said = r"Waiting for the endpoint\. Meta designer: .*connection refused.*\.\s+"
    counts = set[str]()

    def counted_down() -> bool:
        text = find(browser, ".waiting").text
        if found := re.fullmatch(said + r"Next attempt in (\d+) s\.", text):
            counts.add(found[1])
        return len(counts) > 1

    until(browser, counted_down)
    until(browser, lambda: heading(browser) == "This design failed")
    assert "connection refused" in find(browser, ".problem").text
    find(browser, ".actions a").click()
    until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "runs")
    fields = {name: find(browser, f"[name={name}]") for name in ("task", "model", "base_url")}
    values = {name: item.get_attribute("value") for name, item in fields.items()}
    assert values == {"task": "movement", "model": "gpt", "base_url": REFUSING}
    until(browser, lambda: "connection refused" in find(browser, "tr.failed .why").text)
    browser.refresh()
    until(browser, lambda: "connection refused" in find(browser, "tr.failed .why").text)


def test_a_design_whose_endpoint_hangs_shows_how_long_it_waits_and_is_stopped(
    browser: webdriver.Chrome, served: Served
) -> None:
    with endpoint(silence) as url:
        open_form(browser, served, url)
        find(browser, ".design [type=submit]").click()
        until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "run")
        until(browser, lambda: find(browser, ".live .state").text.endswith("running"))
        until(browser, lambda: "0:02 min" in find(browser, ".live").text)
        assert "0 of about" in find(browser, ".live").text
        stop = browser.find_element(By.XPATH, "//div[@class='live']/button[text()='Stop']")
        until(browser, stop.is_displayed)
        stop.click()
        until(browser, lambda: find(browser, ".live .state").text.startswith("Stopped after"))
    assert complaints(browser) == []


def test_a_machine_of_800_blocks_is_opened_slowly_or_refused_plainly(
    browser: webdriver.Chrome, served: Served, tmp_path: Path
) -> None:
    row = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    row += [{"type": 15, "id": n, "parent": n - 1, "face_id": 0} for n in range(1, 800)]
    (tmp_path / "long.json").write_text(json.dumps(row), encoding="utf-8")
    open_page(browser, served, "build?task=movement")
    browser.execute_script(
        "document.querySelectorAll('.more details').forEach((e) => (e.open = 1))"
    )
    find(browser, "input[type=file]").send_keys(str(tmp_path / "long.json"))
    blocks(browser, 800)
    said(browser, "Opened long.json")
    assert "800" in find(browser, ".facts-panel dd").text
    assert "at most 40" in find(browser, ".facts-panel .problems").text
    find(browser, ".test").click()
    until(browser, lambda: "bad" in str(find(browser, ".said").get_attribute("class")))
    assert complaints(browser) == []


def test_a_run_that_is_deleted_while_it_is_watched_says_so(
    browser: webdriver.Chrome, served: Served, runs: Path
) -> None:
    shutil.copytree(RECORDED, runs / "brief")
    (runs / "brief" / "result.json").unlink()
    open_page(browser, served, "run?run=brief")
    until(browser, lambda: find(browser, ".live .state").text.startswith("Stopped after"))
    shutil.rmtree(runs / "brief")
    until(browser, lambda: "was deleted" in find(browser, ".live .problem").text)
    assert find(browser, ".live .state").text == "gone"
    assert heading(browser) == "throwing"  # what was read stays
    open_page(browser, served, "run?run=brief")
    assert heading(browser) == "This run cannot be shown"
    assert "does not hold a run named 'brief'" in find(browser, ".problem").text
