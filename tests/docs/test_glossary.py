"""The glossary has short entries in order, and every page that people write links it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.make.pages import DOCS
from docs.make.reference import PAGES as GENERATED
from tests.docs.test_links import targets

ROOT = DOCS.parent
GLOSSARY = DOCS / "reference/glossary.md"
ENTRIES = re.findall(
    r"(?ms)^### (.+?)\n\n(.+?)\n*(?=^###|\Z)", GLOSSARY.read_text(encoding="utf-8")
)
SECTIONS = ("tutorials", "how-to", "explanation", "reference")
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *(
        path
        for section in SECTIONS
        for path in sorted((DOCS / section).glob("*.md"))
        if path != GLOSSARY and path.relative_to(DOCS).as_posix() not in GENERATED
    ),
]
LONGEST = 45
"""Most words of an entry."""


def test_the_terms_are_in_alphabetical_order() -> None:
    terms = [term.casefold() for term, _ in ENTRIES]
    assert 35 <= len(terms) <= 60
    assert terms == sorted(terms)
    names = [name for term in terms for name in term.split(", ")]
    assert len(set(names)) == len(names)


def test_every_term_is_explained() -> None:
    assert len(ENTRIES) == GLOSSARY.read_text(encoding="utf-8").count("\n### ")


@pytest.mark.parametrize(("term", "text"), ENTRIES)
def test_an_entry_is_one_sentence_that_says_the_term(term: str, text: str) -> None:
    plain = re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", text)
    assert re.fullmatch(r"[A-Z][^\n]*\.", plain)
    assert not re.search(r"[.!?] [A-Z`]", plain)
    assert len(plain.split()) <= LONGEST
    for name in term.split(", "):
        assert name.casefold() in plain.casefold()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_links_the_glossary(page: Path) -> None:
    linked = {(page.parent / target.partition("#")[0]).resolve() for target in targets(page)}
    assert GLOSSARY in linked


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120
