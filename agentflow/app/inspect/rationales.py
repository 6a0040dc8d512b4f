"""Checks whether a run's designs have the blocks that their own rationale counts.

The rule is `failure_kinds.RATIONALE`: a number right before a block name counts blocks; the rest
of the rationale is ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from agentflow.agents.designer import Designer, extract_rationale
from agentflow.machine import Machine, library
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import read_calls
from agentflow.runs.events import AttemptEvent, read_typed_events
from agentflow.runs.locations import Location

WORDS = (
    *("one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)


def unfollowed_rationales(run: Path) -> frozenset[str]:
    """Labels of the accepted designs that have fewer blocks of a type than their rationale counts.

    For designs built structure by structure, only those of the last structure are judged, each as a
    whole machine.
    """
    designs = _whole_designs(run)
    return frozenset(
        call["request"]["label"]
        for call in read_calls(run)
        if (digest := designs.get(call["request"]["label"])) is not None
        and _lacks(recorded_machine(run, digest), extract_rationale(call["reply"]["text"]))
    )


def count_blocks(text: str) -> Iterator[tuple[int, int]]:
    """(block type, number) of each "four Powered Wheels", "2 logs" in a text.

    Ranges and limits ("2-3 logs", "up to four", "one or two") are skipped.
    """
    for number, name in _pattern().findall(text):
        word = number.lower()
        count = WORDS.index(word) + 1 if word in WORDS else int(word)
        yield library().find(name).type, count


def _lacks(machine: Machine, rationale: str) -> bool:
    has = [step.type for step in machine.steps]
    return any(has.count(block_type) < count for block_type, count in count_blocks(rationale))


def _whole_designs(run: Path) -> dict[str, str]:
    """Label -> content hash of the machine, for accepted designs of whole machines."""
    designs: dict[Location, str] = {}
    last = 0
    for event in read_typed_events(run):
        if isinstance(event, AttemptEvent) and event.role == Designer.name:
            last = max(last, event.location.structure)
            if event.valid and event.machine is not None:
                designs[event.location] = event.machine
    return {
        str(location): digest for location, digest in designs.items() if location.structure == last
    }


@cache
def _pattern() -> re.Pattern[str]:
    names = sorted((block.name for block in library().values()), key=len, reverse=True)
    number = rf"\d{{1,3}}|{'|'.join(WORDS)}"
    bound = r"(?<![\w.-])(?<!\bto )(?<!\bmost )(?<!\bor )"
    return re.compile(rf"{bound}({number})\s+({'|'.join(names)})s?\b", re.IGNORECASE)
