"""The questions which way blocks face, and where their centres are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle, islice
from random import Random
from typing import Any, ClassVar

from agentflow.app.diagnose.machines import (
    SIZES,
    describe_blocks,
    diagnosed_levels,
    draw_design,
    list_ids,
)
from agentflow.app.diagnose.question import Diagnostic, Mark, Question
from agentflow.app.diagnose.reading import read_poses
from agentflow.machine import Machine, place
from agentflow.machine.edits.random import random_machine
from agentflow.metrics.intervals import Rate

ASKED = 4
"""Blocks of each machine that are asked about: the smallest machine has as many."""
CLOSE = 0.1
"""Greatest error of a right centre along each axis, m: answers are rounded to one decimal."""
_ROUNDING = 1e-6


class Facing(Diagnostic):
    """Which way blocks face and where their centres are."""

    name: ClassVar[str] = "facing"

    def questions(self, size: int, seed: int) -> list[Question]:
        """`size` valid machines, alternating between random ones and designs."""
        rng = Random(f"diagnose/facing/{seed}")
        machines = (next(source) for source in cycle((_random(rng), _designs(rng))))
        return [
            _question(f"facing/{number}", machine, rng)
            for number, machine in enumerate(islice(machines, size))
        ]

    def variables(self, question: Question) -> Mapping[str, object]:
        return {
            **describe_blocks(question.machine),
            "asked": list_ids([item["id"] for item in question.truth]),
        }

    def read(self, text: str, question: Question) -> list[dict[str, Any]] | None:
        """The poses of the blocks that were asked about."""
        poses = read_poses(text)
        asked = [item["id"] for item in question.truth if item["id"] in poses]
        return [{"id": block, **poses[block]._asdict()} for block in asked] or None

    def score(self, marks: Sequence[Mark]) -> dict[str, Any]:
        """Shares of blocks with the right facing, and with the right centre."""
        pairs = [pair for mark in marks for pair in _answered(mark)]
        facing = sum(true["facing"] == said["facing"] for true, said in pairs)
        centre = sum(_is_close(true["centre"], said["centre"]) for true, said in pairs)
        return {
            "blocks": len(pairs),
            "facing": Rate(facing, len(pairs)).to_json(),
            "centre": Rate(centre, len(pairs)).to_json(),
        }


def _random(rng: Random) -> Iterator[Machine]:
    while True:
        machine = random_machine(rng, size=SIZES)
        if len(_boxed(machine)) >= ASKED:
            yield machine


def _designs(rng: Random) -> Iterator[Machine]:
    levels = diagnosed_levels()
    while True:
        yield draw_design(rng, rng.choice(levels))


def _question(label: str, machine: Machine, rng: Random) -> Question:
    """A question about blocks other than the root, which always faces z+."""
    geometry = place(machine)
    asked = sorted(rng.sample(_boxed(machine), ASKED))
    truth = [
        {"id": block, "facing": geometry[block].facing, "centre": list(geometry[block].center)}
        for block in asked
    ]
    return Question(label, machine, truth)


def _boxed(machine: Machine) -> list[int]:
    """Ids of the standard blocks, without the root."""
    return [step.id for step in machine.steps[1:] if not step.two_ended]


def _answered(mark: Mark) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """The true and the given pose of each block that was asked about."""
    said = {item["id"]: item for item in mark.answer or ()}
    for true in mark.truth:
        yield true, said.get(true["id"], {"facing": None, "centre": None})


def _is_close(true: Sequence[float], said: Sequence[float] | None) -> bool:
    if said is None:
        return False
    return all(abs(a - b) <= CLOSE + _ROUNDING for a, b in zip(true, said, strict=True))
