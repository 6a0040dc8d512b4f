"""The static site: complete, without a broken link, and of use from disk without a network."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from agentflow.progress import silent
from docs.make.links import ROOT, rewrite, show, site_path
from docs.make.pages import DOCS
from docs.make.site import build
from docs.make.stage import Nav, navigation, stage
from tests.llm.foreign import foreign_python
from tests.report.browser import chromium, complaints, on_phone

LEVELS = ("gearing", "throwing/3")
LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src"}
"""Tag -> attribute whose address a browser loads by itself; and so do links of these kinds:"""
LINKED = {"stylesheet", "icon", "preload", "prefetch", "preconnect", "manifest"}


class Page(HTMLParser):
    """Where a page leads, what it loads, and its anchors."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.anchors |= {found[name] for name in ("id", "name") if name in found}
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        if tag == "link" and LINKED & set(found.get("rel", "").split()):
            self.loaded.append(found["href"])
        if LOADED.get(tag, "") in found:
            self.loaded.append(found[LOADED[tag]])


read = cache(Page)


def flat(nav: Nav) -> Iterator[str]:
    for entry in nav:
        for inner in entry.values():
            yield from [inner] if isinstance(inner, str) else flat(inner)


def test_the_navigation_has_every_page_once() -> None:
    pages = [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")]
    assert Counter(flat(navigation({}))) == Counter([*pages, "gallery/index.md"])


def test_links_out_of_the_documentation_lead_to_pages_of_the_site() -> None:
    text = (
        "[a](../../configs/design.yaml) [b](../../examples) [c](runs.md#resume) [d](https://e.org)\n"
        "```md\n[e](../../configs/design.yaml)\n```\n[f](../index.md)\n"
    )
    found: list[Path] = []
    assert rewrite(DOCS / "reference/tools.md", text, found.append) == (
        "[a](../repository/configs/design.yaml.md) [b](../repository/examples/README.md) "
        "[c](runs.md#resume) [d](https://e.org)\n"
        "```md\n[e](../../configs/design.yaml)\n```\n[f](../index.md)\n"
    )
    assert [path.relative_to(ROOT).as_posix() for path in found] == [
        "configs/design.yaml",
        "examples/README.md",
        "docs/reference/runs.md",
        "docs/index.md",
    ]
    assert (
        site_path(ROOT / "agentflow" / "tools").as_posix() == "repository/agentflow/tools/index.md"
    )


def test_files_and_folders_become_pages() -> None:
    assert "\n* `bench.py`\n" in show(ROOT / "agentflow" / "tools")
    shown = show(ROOT / "agentflow" / "version.py")
    assert shown.startswith("# agentflow/version.py\n\n```python\n")
    assert shown.endswith("\n```\n")


def test_settings_hold_the_navigation(tmp_path: Path) -> None:
    stage(tmp_path)
    settings = (tmp_path / "zensical.toml").read_text(encoding="utf-8")
    assert '{ "Command line" = "reference/command-line.md" }' in settings
    assert "nav = []" not in settings
    assert (tmp_path / "docs/repository/README.md").exists()
    assert not (tmp_path / "docs/make").exists()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    foreign_python(".venv-docs")
    out = tmp_path_factory.mktemp("built") / "site"
    build(out, LEVELS, workers=2, say=silent)
    return out


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with chromium(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


def until(driver: webdriver.Chrome, script: str) -> Any:
    return WebDriverWait(driver, 60.0, 0.05).until(lambda _: driver.execute_script(script))


@pytest.mark.slow
def test_no_link_is_broken(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert {path.relative_to(DOCS).with_suffix(".html") for path in DOCS.rglob("*.md")} <= {
        path.relative_to(site) for path in pages
    }
    assert sum(len(read(path).links) for path in pages) > 1000
    broken = []
    for path in pages:
        for link in (*read(path).links, *read(path).loaded):
            split = urlsplit(link)
            if split.scheme or split.netloc:
                continue
            file = (path.parent / unquote(split.path)).resolve() if split.path else path
            anchors = read(file).anchors if file.suffix == ".html" and file.exists() else set()
            whole = not split.fragment or unquote(split.fragment) in anchors
            if not file.is_file() or not (whole or file.name == "machines.html"):
                broken.append((path.relative_to(site).as_posix(), link))
    assert not broken


@pytest.mark.slow
def test_it_loads_nothing_from_elsewhere(site: Path) -> None:
    for path in site.rglob("*.html"):
        for address in read(path).loaded:
            assert urlsplit(address).scheme in ("", "data"), (path, address)
            assert not urlsplit(address).netloc, (path, address)
    for path in site.rglob("*.css"):
        assert "url(http" not in path.read_text(encoding="utf-8"), path
        assert "@import" not in path.read_text(encoding="utf-8"), path


@pytest.mark.slow
def test_the_search_works_from_disk(site: Path, browser: webdriver.Chrome) -> None:
    browser.get((site / "reference" / "tasks.html").as_uri())
    until(browser, "return document.querySelector('.md-search__button')")
    browser.find_element(By.CSS_SELECTOR, ".md-search__button").click()
    # the dialog is in a shadow tree, whose host has the focus
    dialog = "[...document.querySelectorAll('*')].map(e => e.shadowRoot).find(Boolean)"
    until(browser, f"return {dialog}?.activeElement")
    browser.switch_to.active_element.send_keys("exploration constant")
    results = f"return [...{dialog}.querySelectorAll('a')].map(link => link.href)"
    until(browser, f"{results}.length")
    found = browser.execute_script(results)
    assert any("/reference/configuration.html" in link for link in found), found
    assert complaints(browser) == []


@pytest.mark.slow
def test_it_asks_for_files_only(site: Path, browser: webdriver.Chrome) -> None:
    browser.get_log("performance")  # type: ignore[no-untyped-call]
    for name in ("index.html", "reference/blocks.html", "gallery/index.html"):
        browser.get((site / name).as_uri())
        until(browser, "return document.readyState === 'complete'")
    logs = browser.get_log("performance")  # type: ignore[no-untyped-call]
    sent = [json.loads(entry["message"])["message"] for entry in logs]
    asked = [
        item["params"]["request"]["url"]
        for item in sent
        if item["method"] == "Network.requestWillBeSent"
    ]
    assert len(asked) > 10
    assert {urlsplit(url).scheme for url in asked} <= {"file", "data", "blob"}


@pytest.mark.slow
def test_a_picture_of_the_gallery_opens_its_machine(site: Path, browser: webdriver.Chrome) -> None:
    browser.get((site / "gallery" / "index.html").as_uri())
    cards = browser.find_elements(By.CSS_SELECTOR, ".machines a")
    assert [card.text.partition(" ")[0] for card in cards] == list(LEVELS)
    cards[1].click()
    until(browser, "return document.body.dataset.ready === 'gallery'")
    shown = "document.querySelector('.chosen h2').textContent.split(' ')[0]"
    assert browser.execute_script(f"return {shown}") == "throwing/3"
    browser.execute_script("location.hash = 'gearing'")
    until(browser, f"return {shown} === 'gearing'")
    assert complaints(browser) == []


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_it_is_light_or_dark_and_fits_a_phone(
    site: Path, browser: webdriver.Chrome, dark: bool
) -> None:
    with on_phone(browser, 390, 844, dark=dark):
        for name in ("index", "reference/configuration", "gallery/index"):
            browser.get((site / f"{name}.html").as_uri())
            assert browser.execute_script("return document.documentElement.scrollWidth") == 390
            scheme = browser.execute_script("return document.body.dataset.mdColorScheme")
            assert scheme == ("slate" if dark else "default")
