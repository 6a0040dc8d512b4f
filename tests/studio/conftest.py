"""A studio with two runs, and a browser that has opened it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver

from tests.report.browser import chromium
from tests.studio.pages import NASTY, RECORDED
from tests.studio.serving import Served, studio


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    shutil.copytree(RECORDED, folder / "throwing")
    shutil.copytree(RECORDED, folder / NASTY)
    return folder


@pytest.fixture(scope="module")
def served(runs: Path) -> Iterator[Served]:
    with studio(runs) as found:
        yield found


@pytest.fixture(scope="module")
def browser(served: Served, tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with chromium(tmp_path_factory.mktemp("profile"), (1280, 863)) as driver:
        driver.get(served.address)
        yield driver
