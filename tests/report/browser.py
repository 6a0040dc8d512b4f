"""A real browser for pages on disk: Debian's Chromium, without a display and without a network."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

BROWSER, DRIVER = Path("/usr/bin/chromium"), Path("/usr/bin/chromedriver")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--use-fake-device-for-media-stream",  # a microphone that beeps
    "--use-fake-ui-for-media-stream",  # and that a page may use without asking
)
LOGS = {"browser": "ALL", "performance": "ALL"}


@contextmanager
def chromium(
    profile: Path, size: tuple[int, int] = (1280, 800), *, dark: bool = False
) -> Iterator[webdriver.Chrome]:
    """A browser with a fresh profile; skips without Chromium, but fails where CI=true."""
    if not (BROWSER.exists() and DRIVER.exists()):
        assert os.environ.get("CI") != "true", "CI needs Debian's chromium and chromium-driver"
        pytest.skip("needs Debian's packages chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = str(BROWSER)
    for option in (*OPTIONS, f"--window-size={size[0]},{size[1]}", f"--user-data-dir={profile}"):
        options.add_argument(option)
    if dark:
        options.add_argument("--blink-settings=preferredColorScheme=0")
    options.set_capability("goog:loggingPrefs", LOGS)
    driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    try:
        yield driver
    finally:
        driver.quit()


@contextmanager
def on_phone(
    driver: webdriver.Chrome, width: int, height: int, *, dark: bool, scale: int = 1
) -> Iterator[None]:
    """Have pages shown as on a phone, light or dark, while the context is open."""
    screen = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": True}
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    try:
        yield
    finally:
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def complaints(driver: webdriver.Chrome) -> list[str]:
    """Errors and warnings of the page's console; the software renderer's on its speed left out."""
    entries: list[dict[str, Any]] = driver.get_log("browser")  # type: ignore[no-untyped-call]
    return [entry["message"] for entry in entries if "GL Driver Message" not in entry["message"]]
