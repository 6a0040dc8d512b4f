"""What tests do with the studio's pages in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.common.exceptions import NoSuchElementException, StaleElementReferenceException
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import Select, WebDriverWait

from tests.report.browser import complaints
from tests.studio.serving import Served

PATIENCE = 60.0
RECORDED = Path(__file__).parent.parent.parent / "runs" / "recorded-throwing"
NASTY = "<img src=x onerror=window.owned=1>"
"""A name that would run as a script if it were read as HTML."""


REDRAWN = (NoSuchElementException, StaleElementReferenceException)
"""What happens while a page is drawn again."""


def until(driver: webdriver.Chrome, met: Any) -> None:
    WebDriverWait(driver, PATIENCE, 0.05, REDRAWN).until(lambda _: met())


def find(driver: webdriver.Chrome, selector: str) -> WebElement:
    return driver.find_element(By.CSS_SELECTOR, selector)


def open_page(driver: webdriver.Chrome, served: Served, name: str) -> None:
    complaints(driver)  # whatever an earlier page said
    driver.get("about:blank")
    driver.get(f"{served.base}/#{name}")
    page = name.partition("?")[0]
    until(driver, lambda: find(driver, "body").get_attribute("data-ready") == page)


def keys(driver: webdriver.Chrome, *pressed: str) -> None:
    driver.switch_to.active_element.send_keys(*pressed)


def said(driver: webdriver.Chrome, text: str) -> None:
    until(driver, lambda: text in find(driver, ".said").text)


def idle(driver: webdriver.Chrome) -> None:
    """Wait until everything that was asked for is done."""
    main = find(driver, "main.build")
    until(driver, lambda: main.get_attribute("aria-busy") == "false")


def attach(driver: webdriver.Chrome, face: str) -> None:
    """Go to a face in the list by typing, and choose it."""
    keys(driver, face, Keys.ENTER)
    idle(driver)


def take_block(driver: webdriver.Chrome, name: str) -> None:
    keys(driver, "b")
    keys(driver, name, Keys.ENTER)
    idle(driver)
    until(driver, lambda: name in find(driver, "#faces h2").text.lower())
    until(driver, lambda: driver.switch_to.active_element.get_attribute("aria-label") == "Faces")


def tree(driver: webdriver.Chrome) -> list[str]:
    script = "return [...document.querySelectorAll('[role=treeitem]')].map((i) => i.textContent)"
    return list(driver.execute_script(script))


def blocks(driver: webdriver.Chrome, count: int) -> None:
    until(driver, lambda: len(tree(driver)) == count)


def fill(form: WebElement, **values: str) -> None:
    for name, value in values.items():
        item = form.find_element(By.NAME, name)
        if item.tag_name == "select":
            Select(item).select_by_value(value)
        else:
            item.send_keys(value)
