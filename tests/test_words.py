"""Texts for people: listed, so that every change shows in review, and free of known odd phrases."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agentflow.env.tasks.registry import get_task, task_names
from tests.messages import LIST, PACKAGE, messages

ROOT = PACKAGE.parent
PAGES = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
TEXTS = [
    *(
        path
        for kind in ("py", "json", "yaml", "j2", "js", "css")
        for path in PACKAGE.rglob(f"*.{kind}")
        if path.parent.name != "bundle"
    ),
    *(path for path in ROOT.glob("*.md") if path not in PAGES),
    *(
        path
        for part in ("benchmarks", "configs", "examples", "scripts")
        for path in (ROOT / part).rglob("*")
        if path.is_file() and path.suffix not in (".pyc", ".png")
    ),
]
ODD = re.compile(
    r"\bOwns\b|\bspec \d|Of everything|a begun\b|\bGo on with\b|finds out\b|\ban own\b|Whose model|"
    r"tell of\b|taken over\b|\bis no (run|sweep|folder|saved)\b|stands there twice|"
    r"came out otherwise|\bwith room\b|in money is spent|taken hold of|open hands|"
    r"nothing came to again|further left, the stronger|\bunheeded\b|no recorded question|"
    r"in the median\b|in the mean\b|(would|that) hang on\b|\bstands? beside\b|counted apart|"
    r"measured apart|off the weight|climbs hills|fared differently|was at hand\b|"
    r"keep telling\b|also tells the|Nothing leaves this computer(?! unless)"
)
"""Phrases that puzzled readers, and citations of documents that are not in the repository."""
LITERAL = re.compile(
    r"brakes with it|(turns?|moves?) against (its|the) parent|before (its|the) building point|"
    r"in two points\b|costs no more than its|besides gravity|than themselves|except it and its|"
    r"root's too\b|let go held|it is continued\b|will become of|begin no further|take turns|"
    r"need each other|may not be run|attach it anew|valid at once|last one begun\b|begun anew|"
    r"(is|are|was|were|been) begun\b|\bmend(ed|s|ing)?\b|Most answers in all|\"Most calls\"|"
    r"[Cc]lock stands|when you go on\b|by click\b|Take its answer|Calls of tools|lets go\.|"
    r"Samples in numbers|\"Begun\"|[Nn]othing leaves this computer[;,.]|"
    r"\b(is|are|am|was|were|been|be) told\b|no further (run|bench|one)s?\b|"
    r"(?<!there )\bis no (edit|language|difference|variant|failure|motion|time|call|command|wheel|"
    r"plain|part|role|model|source|block|marginal|load)\b|(?<!there )\bare no (edit|part)s?\b|"
    r"[.;] Of (several|all|every|each|two|other|equal|designs|joints|runs|sweeps|events) |"
    r"\b(Reward|10|points?|N|m|kg|s) less the\b|\b(N|m|kg) less\b|things? of the scene\b|"
    r"\bis ours\b|\bours only\b|needs no node\b|in turn\b[,.]"
)
"""Words used as in another language: told for shown, begun for started, no edit for not an edit."""


def test_the_list_of_messages_is_current() -> None:
    """Update it with: python -m tests.messages --update"""
    assert "\n".join(messages()) + "\n" == LIST.read_text(encoding="utf-8")


def read(path: Path) -> str:
    """A text without the line breaks inside its sentences."""
    joined = re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8"))
    return " ".join(joined.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("odd", "paths"),
    [(ODD, [*TEXTS, *PAGES]), (LITERAL, TEXTS)],
    ids=["everywhere", "outside the documentation"],
)
def test_no_odd_phrase_is_left(odd: re.Pattern[str], paths: list[Path]) -> None:
    found = {
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in paths
        for match in odd.finditer(read(path))
    }
    assert found == set()


@pytest.mark.parametrize("task", task_names())
def test_briefs_have_whole_short_sentences_about_objects(task: str) -> None:
    brief = get_task(task).brief
    for text in (brief.objective, *brief.scene, *brief.schedule, *brief.score):
        assert text.endswith(".")
        assert not re.search(r"\bthings?\b", text)
        assert max(len(sentence.split()) for sentence in re.split(r"(?<=[.;:]) ", text)) <= 60
