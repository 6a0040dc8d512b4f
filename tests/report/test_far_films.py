"""A throw of 150 m in a real browser: machine, walls, boulder and labels are seen all the time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from tests.env.far_throw import far_throw
from tests.report.browser import chromium, complaints
from tests.report.one_film import one_film

pytestmark = pytest.mark.slow
MOMENTS = (0.0, 0.7, 1.2, 2.0, 3.0, 5.0)
"""Times of the film: at the start, as the boulder is released, in flight, landed, rolling, s."""
COUNT = """const [time, wide, done] = arguments, player = document.querySelector(".player");
const button = [...player.querySelectorAll("button")].find(({ title }) => title.includes("(W)"));
if (String(wide) !== button.getAttribute("aria-pressed")) button.click();
const slider = player.querySelector("input[type=range]");
slider.value = time;
slider.dispatchEvent(new Event("input"));
player.addEventListener("frame", () => {
  const canvas = player.querySelector("canvas"), copy = document.createElement("canvas");
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const pen = copy.getContext("2d");
  pen.drawImage(canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, copy.width, copy.height);
  const counts = { all: data.length / 4, wood: 0, spring: 0, ground: 0, red: 0, rightmost: 0 };
  const inked = new Set();
  for (let i = 0; i < data.length; i += 4) {
    const column = (i / 4) % copy.width;
    const [r, g, b] = data.subarray(i, i + 3);
    counts.wood += r - g > 20 && g - b > 20 && r < 200;
    counts.spring += g - r > 30 && g - b > 30;
    counts.ground += Math.abs(r - 223) < 4 && Math.abs(g - 227) < 4 && Math.abs(b - 218) < 4;
    if (r + b - 2 * g > 40 && b > r - 40) inked.add(column);
    if (r > 150 && g < 90 && b < 80) {
      counts.red += 1;
      counts.rightmost = Math.max(counts.rightmost, column);
    }
  }
  const columns = [...inked].sort((a, b) => a - b), words = [];
  for (const column of columns)
    if (words.length && column - words.at(-1)[1] < 9) words.at(-1)[1] = column;
    else words.push([column, column]);
  done({ ...counts, words: words.map(([first, last]) => 1 + last - first) });
}, { once: true });"""
"""Counts pixels of the film by colour. `rightmost`: column of the last red one; `words`: widths of
the labels, which are groups of columns with magenta pixels."""


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    """A page with the film of the throw, open."""
    folder = tmp_path_factory.mktemp("far")
    file = folder / "far.html"
    file.write_text(one_film(*far_throw()), encoding="utf-8")
    with chromium(folder / "profile", (1440, 900)) as driver:
        driver.get(file.as_uri())
        slider = driver.find_element(By.CSS_SELECTOR, "[type=range]")
        WebDriverWait(driver, 60).until(lambda _: slider.get_attribute("max") != "1")
        script = "document.documentElement.style.setProperty('--quiet', '#f0f')"
        driver.execute_script(script)  # for the labels, to tell them from all else
        for theme in ("dark", "light"):  # the page then reads its colours again
            features = [{"name": "prefers-color-scheme", "value": theme}]
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
            driver.execute_async_script("requestAnimationFrame(arguments[0])")
        yield driver
        assert complaints(driver) == []


def seen(driver: webdriver.Chrome, time: float, *, wide: bool) -> dict[str, Any]:
    """What `COUNT` finds in the frame of a time, in the view of the whole course if `wide`."""
    found: dict[str, Any] = driver.execute_async_script(COUNT, time, wide)
    return found


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("time", MOMENTS)
def test_machine_walls_and_ground_keep_their_colours(
    film: webdriver.Chrome, time: float, wide: bool
) -> None:
    found = seen(film, time, wide=wide)
    assert found["wood"] > 600
    assert found["ground"] > found["all"] / 2


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("time", MOMENTS)
def test_labels_are_equally_large_from_near_and_far(
    film: webdriver.Chrome, time: float, wide: bool
) -> None:
    words = seen(film, time, wide=wide)["words"]
    whole = [width for width in words if 30 <= width <= 42]  # "20 m" and "150 m"
    assert len(whole) >= (5 if time or wide else 2)
    assert len(words) - len(whole) <= 2  # partly behind the walls or outside


def test_the_boulder_is_seen_on_its_way(film: webdriver.Chrome) -> None:
    places = [seen(film, time, wide=True)["rightmost"] for time in MOMENTS]
    assert places == sorted(set(places))  # ever farther to the right
    assert places[-1] > 500


def test_springs_are_told_from_beams(film: webdriver.Chrome) -> None:
    assert seen(film, 0.0, wide=False)["spring"] > 400
    assert seen(film, 0.7, wide=False)["spring"] > 50
