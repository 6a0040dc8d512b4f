"""Links, anchors and pictures of every page lead somewhere, and every page can be reached."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote, urlsplit

from markdown_it import MarkdownIt
from markdown_it.token import Token

from docs.make.markdown import anchor
from docs.make.pages import DOCS, SECTIONS, pages_of
from tests.loops import for_each

ROOT = DOCS.parent
PAGES = sorted(
    path
    for pattern in (
        "*.md",
        "docs/**/*.md",
        "examples/**/*.md",
        "recipes/**/*.md",
        "benchmarks/*.md",
    )
    for path in ROOT.glob(pattern)
)


@cache
def tokens(page: Path) -> list[Token]:
    parser = MarkdownIt("commonmark").enable("table")
    return list(_flat(parser.parse(page.read_text(encoding="utf-8"))))


def _flat(found: list[Token]) -> Iterator[Token]:
    for token in found:
        yield token
        yield from _flat(token.children or [])


def targets(page: Path) -> list[str]:
    """Where links and pictures of a page lead, but for other sites."""
    found = [str(token.attrGet("href") or token.attrGet("src") or "") for token in tokens(page)]
    return [target for target in found if target and not urlsplit(target).scheme]


@cache
def anchors(page: Path) -> Counter[str]:
    found = tokens(page)
    headings = [after for token, after in pairwise(found) if token.type == "heading_open"]
    return Counter(
        anchor("".join(part.content for part in item.children or [])) for item in headings
    )


def test_there_are_pages_with_links() -> None:
    assert len(PAGES) > 30
    assert sum(len(targets(page)) for page in PAGES) > 400
    assert "verified-scores" in anchors(ROOT / "docs/explanation/scores.md")


@for_each(PAGES)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    for target in targets(page):
        split = urlsplit(target)
        file = (page.parent / unquote(split.path)).resolve() if split.path else page
        assert file.exists(), target
        assert file.is_relative_to(ROOT), target
        if split.fragment:
            assert anchors(file)[split.fragment] == 1, target


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached: set[Path] = set()
    waiting = [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        reached.add(page)
        linked = {(page.parent / urlsplit(target).path).resolve() for target in targets(page)}
        waiting += [path for path in linked - reached if path.suffix == ".md" and path.exists()]
    assert set(DOCS.rglob("*.md")) <= reached


def test_every_page_is_in_a_section() -> None:
    listed = [DOCS / page.path for folder in SECTIONS for page in pages_of(folder)]
    assert Counter([DOCS / "index.md", *listed]) == Counter(DOCS.rglob("*.md"))
