"""Texts for people: listed, so that every change shows in review, and free of known odd phrases."""

from __future__ import annotations

import re

from tests.messages import LIST, PACKAGE, messages

ROOT = PACKAGE.parent
TEXTS = [
    *(
        path
        for kind in ("py", "json", "yaml", "j2", "js", "css")
        for path in PACKAGE.rglob(f"*.{kind}")
    ),
    *ROOT.glob("*.md"),
    *(ROOT / "docs").rglob("*.md"),
    *(
        path
        for part in ("benchmarks", "configs", "examples", "scripts")
        for path in (ROOT / part).rglob("*")
    ),
]
ODD = re.compile(
    r"\bOwns\b|\bspec \d|Of everything|a begun\b|\bGo on with\b|finds out\b|\ban own\b|Whose model|"
    r"tell of\b|taken over\b|\bis no (run|sweep|folder|saved)\b|stands there twice|"
    r"came out otherwise|\bwith room\b|in money is spent|taken hold of|open hands|"
    r"nothing came to again|further left, the stronger|\bunheeded\b|no recorded question|"
    r"in the median\b|in the mean\b|(would|that) hang on\b|\bstands? beside\b|counted apart|"
    r"measured apart|off the weight|climbs hills|fared differently|was at hand\b|"
    r"keep telling\b|also tells the"
)
"""Phrases that puzzled readers, and citations of documents that are not in the repository."""


def test_the_list_of_messages_is_current() -> None:
    """Update it with: python -m tests.messages --update"""
    assert "\n".join(messages()) + "\n" == LIST.read_text(encoding="utf-8")


def test_no_odd_phrase_is_left() -> None:
    odd = {
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in TEXTS
        if path.is_file() and path.suffix not in (".pyc", ".png")
        for match in ODD.finditer(path.read_text(encoding="utf-8"))
    }
    assert odd == set()
