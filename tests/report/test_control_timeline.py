"""The control program of a machine under its film, in a real browser."""

from __future__ import annotations

from pathlib import Path

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from agentflow.env.simulation.simulate import simulate
from tests.env.levels import designed_task
from tests.env.test_controls import TURN
from tests.report.browser import chromium, complaints
from tests.report.one_film import one_film

pytestmark = pytest.mark.slow


def test_each_lane_shows_its_blocks_and_levels(tmp_path: Path) -> None:
    task = designed_task(window=1.4)
    file = tmp_path / "film.html"
    file.write_text(one_film(TURN, task, simulate(TURN, task)), encoding="utf-8")
    with chromium(tmp_path / "profile") as driver:
        driver.get(file.as_uri())
        WebDriverWait(driver, 60.0, 0.05).until(
            lambda _: driver.find_elements(By.CSS_SELECTOR, ".lanes li")
        )
        lanes = driver.find_elements(By.CSS_SELECTOR, ".lanes li")
        assert [lane.text for lane in lanes] == [
            "blocks 3, 6 (Powered Wheel)",
            "blocks 4, 5 (Powered Wheel)",
        ]
        slow, fast = (lane.find_element(By.CSS_SELECTOR, ".lane i") for lane in lanes)
        assert slow.get_attribute("title") == (
            "blocks 3, 6 (Powered Wheel): level 0.2 from 0 to 1.4 s"
        )
        assert slow.size["width"] == pytest.approx(fast.size["width"], abs=1)
        assert slow.size["height"] < fast.size["height"]
        assert complaints(driver) == []
