"""Cells in a real browser: the viewer plays in its frame and can reach nothing of the notebook."""

from __future__ import annotations

from pathlib import Path

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

import agentflow
from agentflow.machine import Machine
from agentflow.notebook.display.html import to_html
from tests.notebook.made import RECORDED
from tests.report.browser import chromium, complaints

pytestmark = pytest.mark.slow
CAR = Machine.from_file(Path(__file__).parents[3] / "examples" / "car.json")


def test_frames_show_the_machine_the_film_and_the_run(tmp_path: Path) -> None:
    rollout = agentflow.simulate(CAR, "movement", knobs={"window": 1}, interval=0.1)
    shown = [CAR, rollout, agentflow.Run(RECORDED)]
    page = tmp_path / "cells.html"
    page.write_text("<!doctype html><meta charset=utf-8>" + "".join(map(to_html, shown)))
    with chromium(tmp_path / "profile") as driver:
        driver.get(page.as_uri())
        for frame, kind in zip(
            driver.find_elements(By.TAG_NAME, "iframe"), ("cell", "cell", "run"), strict=True
        ):
            driver.execute_script("arguments[0].scrollIntoView()", frame)  # type: ignore[no-untyped-call]
            driver.switch_to.frame(frame)
            WebDriverWait(driver, 60).until(
                lambda d, kind=kind: (
                    d.find_element(By.TAG_NAME, "body").get_attribute("data-ready") == kind
                )
            )
            picture = driver.find_element(By.TAG_NAME, "canvas")
            assert picture.size["height"] > 150
            assert driver.execute_script("return self.origin") == "null"  # type: ignore[no-untyped-call]
            driver.switch_to.default_content()
        driver.switch_to.frame(1)
        play = next(b for b in driver.find_elements(By.TAG_NAME, "button") if b.text == "Play")
        play.click()
        WebDriverWait(driver, 60).until(
            lambda d: "0.00 s" not in d.find_element(By.CSS_SELECTOR, ".transport").text
        )
        assert not complaints(driver)
