"""Counts the failures in a run or in all runs of a folder.

Designs that lack the blocks which their own rationale counts are found here, by the rule of
`failure_kinds.RATIONALE`: a number right before a block name counts blocks; the rest of the
rationale is ignored.
"""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from agentflow.agents.designer import Designer, extract_rationale
from agentflow.agents.registry import replies_of
from agentflow.env.tasks.family import Family
from agentflow.env.tasks.registry import FAMILIES
from agentflow.machine import Machine, library, place
from agentflow.metrics.failure_kinds import KINDS
from agentflow.metrics.failures import Failures, failures
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import read_calls, read_document
from agentflow.runs.events import AttemptEvent, read_typed_events
from agentflow.runs.locations import Location
from agentflow.runs.reading import require_runs

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


def count_failures(path: Path) -> dict[str, Any]:
    """Count what went wrong in a run, or in all runs below a folder.

    Returns:
        `runs`, `replies`, `refused`, `machines`; `kinds`, each with name, level, unit, rule and
        count; `codes` of the refused replies and their counts.
    """
    runs = require_runs(path)
    total = sum(map(_failures_of, runs), Failures())
    return {
        "runs": len(runs),
        "replies": total.replies,
        "refused": total.refused,
        "machines": total.machines,
        "kinds": [
            {key: getattr(kind, key) for key in ("name", "level", "unit", "rule")}
            | {"count": total.kinds[kind.name]}
            for kind in KINDS
        ],
        "codes": dict(total.codes.most_common()),
    }


def _failures_of(run: Path) -> Failures:
    name = str(read_document(run).get("config", {}).get("task", "")).partition("/")[0]
    # Runs can be of a family that is not installed here, or of a level from a file.
    known = name in FAMILIES
    family = FAMILIES[name] if known else Family
    return failures(
        read_typed_events(run),
        lambda digest: faces_wrong_way(recorded_machine(run, digest), family),
        replies_of,
        unfollowed_rationales(run),
        in_place=family.stays,
    )


def faces_wrong_way(machine: Machine, family: type[Family]) -> bool:
    """Whether a block faces the wrong way, by the rule of `failure_kinds.FACING`."""
    geometry = place(machine)
    for block in geometry.blocks:
        kind = library()[block.type]
        loaded = kind.shape == "container" and geometry.children(block.id)
        if loaded and block.facing != "y+":
            return True
        if kind.powered_wheel and family.drives and block.facing[0] != "x":
            return True
    return False
