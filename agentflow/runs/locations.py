"""Locations in a run: what the labels of events and of model calls name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

StageName = Literal["initial", "blind_refinement", "env_feedback"]
INITIAL: StageName = "initial"
"""The stage of the first designs."""
BLIND: StageName = "blind_refinement"
FEEDBACK: StageName = "env_feedback"
STAGES = (INITIAL, BLIND, FEEDBACK)
STAGE_WORDS: dict[str, str] = {
    INITIAL: "first designs",
    BLIND: "refinement without simulation",
    FEEDBACK: "refinement with feedback",
}
"""Stage -> what pages call it."""
RANDOM_EDITS = "none (random edits)"
"""Stands for the model of a run that asks none."""

_PARTS = {
    "structure": "structure",
    "traj": "trajectory",
    "candidate": "candidate",
    "round": "round",
    "node": "node",
    "try": "try_",
    "attempt": "attempt",
    "call": "call",
}
"""Word of a numbered part in a label -> attribute of a `Location`, in the order of labels."""
_SHOWN = {"traj": "design"}
"""Word of a numbered part in a label -> what pages call it, where that differs: a trajectory is a
first design with everything made from it."""
_LOCATION = re.compile(
    "(?P<name>.*?)"
    + "".join(
        rf"(?:(?:^|(?<=.)/){word}-(?P<{part}>{'0|' * (word == 'node')}[1-9][0-9]{{0,8}}))?"
        for word, part in _PARTS.items()
    ),
    re.DOTALL,
)


@dataclass(frozen=True)
class Location:
    """Where in a run something happens, or what a model call is for.

    As text: "env_feedback/traj-1/round-2", "refiner/feedback/traj-1/round-2/node-0/try-1/attempt-1"
    """

    name: str = ""
    """Stage of an event; role of a call, and what it is asked for if it has several uses."""
    structure: int = 0
    """This and the other numbers count from 1; 0 is none."""
    trajectory: int = 0
    candidate: int = 0
    round: int = 0
    node: int | None = None
    """Counts from 0, the root of a search."""
    try_: int = 0
    attempt: int = 0
    call: int = 0
    """Number of a call of a tool in its stage."""

    @classmethod
    @lru_cache(maxsize=20_000)
    def parse(cls, label: str) -> Location:
        """Read a label; everything before the numbered parts at its end is the name."""
        found = _LOCATION.fullmatch(label)
        assert found is not None
        numbers = {part: int(found[part]) for part in _PARTS.values() if found[part]}
        return cls(found["name"], **numbers)

    def __str__(self) -> str:
        parts = [f"{word}-{getattr(self, part)}" for word, part in _PARTS.items() if self.has(part)]
        return "/".join([self.name, *parts] if self.name else parts)

    @property
    def words(self) -> str:
        """As pages show it: "refiner, feedback, design 1, round 2, attempt 2"."""
        numbers = {word: getattr(self, part) for word, part in _PARTS.items() if word != "node"}
        numbers |= {word: 0 for word in ("try", "attempt") if numbers[word] == 1}
        name = STAGE_WORDS.get(self.name, self.name.replace("/", ", ").replace("_", " "))
        told = (f"{_SHOWN.get(word, word)} {number}" for word, number in numbers.items() if number)
        return ", ".join(filter(None, (name, *told)))

    @property
    def role(self) -> str:
        """Role that a call is made to."""
        return self.name.partition("/")[0]

    @property
    def purpose(self) -> str:
        """What a role with several uses is asked for, such as "blind"; else ""."""
        return self.name.partition("/")[2]

    def has(self, part: str) -> bool:
        """Whether a number is given."""
        return bool(getattr(self, part) != getattr(Location, part))


def stage_words(stage: str, model: str) -> str:
    """What pages call a stage of a run: without a model, nothing is refined."""
    words = Location(stage).words
    return words.replace("refinement", "random edits") if model == RANDOM_EDITS else words
