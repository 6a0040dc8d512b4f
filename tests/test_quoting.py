"""Values that a shell would change are quoted wherever an option is shown."""

from __future__ import annotations

import re

import pytest

from tests.pages import PAGES, ROOT

UNQUOTED = re.compile(r"--(?:set|knob)[ =][\w.]+=[^\s'\"`]*[\[{*?(<>|;&~$!]")
"""What a shell would read as a pattern of file names, or otherwise; zsh refuses it."""


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        ("agentflow design --set emitters=[edit]", True),
        ("agentflow tasks throwing --set blocks.without=[9]", True),
        ("agentflow design --set 'emitters=[edit]'", False),
        ("agentflow design --set search.rounds=2 --seeds 3", False),
    ],
)
def test_what_a_shell_would_change_is_found(line: str, wrong: bool) -> None:
    assert bool(UNQUOTED.search(line)) == wrong


def test_values_that_a_shell_would_change_are_quoted() -> None:
    places = ("scripts/*", "recipes/**/*.*", "benchmarks/*.*", "agentflow/**/*.py")
    more = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for place in places
        for path in ROOT.glob(place)
        if path.is_file()
    }
    unquoted = [
        f"{name}:{text.count(chr(10), 0, match.start()) + 1}: {match[0]}"
        for name, text in {**PAGES, **more}.items()
        for match in UNQUOTED.finditer(text)
    ]
    assert unquoted == []
