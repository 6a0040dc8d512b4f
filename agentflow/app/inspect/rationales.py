"""Owns whether designs of a run have the blocks that their own rationale counts (spec 6.3).

The rule is `metrics.failures.RATIONALE`. It takes a number right before the name of a block, which
prose rarely means in another way, and passes over everything else that a rationale says.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from agentflow.agents.designer import Designer, rationale_of
from agentflow.app.inspect.reading import recorded_machine
from agentflow.machine import Machine, library
from agentflow.runs import read_calls, read_events

WORDS = (
    *("one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_PART = re.compile(r"designer/structure-(\d+)/")


def unkept(run: Path) -> frozenset[str]:
    """Labels of the accepted designs that have fewer blocks of a type than their rationale counts.

    Of designs that are built structure by structure only those of the last structure are judged,
    each as the whole machine that it is.

    Raises:
        RunError: The record is damaged.
    """
    designs = _whole_designs(run)
    return frozenset(
        call["request"]["label"]
        for call in read_calls(run)
        if (digest := designs.get(call["request"]["label"])) is not None
        and _lacks(recorded_machine(run, digest), rationale_of(call["reply"]["text"]))
    )


def counted(text: str) -> Iterator[tuple[int, int]]:
    """(block type, number) of each "four Powered Wheels", "2 logs" in a text.

    What names a range or a most ("2-3 logs", "up to four", "one or two") counts nothing.
    """
    for number, name in _pattern().findall(text):
        word = number.lower()
        count = WORDS.index(word) + 1 if word in WORDS else int(word)
        yield library().find(name).type, count


def _lacks(machine: Machine, rationale: str) -> bool:
    has = [step.type for step in machine.steps]
    return any(has.count(block_type) < count for block_type, count in counted(rationale))


def _whole_designs(run: Path) -> dict[str, str]:
    """Label -> content hash of the machine, of accepted designs of whole machines."""
    designs: dict[str, str] = {}
    last = 0
    for event in read_events(run):
        if event.kind == "attempt" and event.data["role"] == Designer.name:
            last = max(last, _structure(event.label))
            if event.data["valid"]:
                designs[event.label] = event.data["machine"]
    return {label: digest for label, digest in designs.items() if _structure(label) == last}


def _structure(label: str) -> int:
    """Number of the structure that a design adds; 0 where it is the whole machine at once."""
    part = _PART.match(label)
    return int(part[1]) if part else 0


@cache
def _pattern() -> re.Pattern[str]:
    names = sorted((block.name for block in library().values()), key=len, reverse=True)
    number = rf"\d{{1,3}}|{'|'.join(WORDS)}"
    bound = r"(?<![\w.-])(?<!\bto )(?<!\bmost )(?<!\bor )"
    return re.compile(rf"{bound}({number})\s+({'|'.join(names)})s?\b", re.IGNORECASE)
