"""The questions which blocks of a machine overlap, which way blocks face, and where they are."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import cycle, islice
from random import Random
from typing import Any, ClassVar

from agentflow.agents.base import chat_prompt
from agentflow.agents.context import types_context
from agentflow.agents.designer import Designer
from agentflow.app.diagnose.question import Diagnostic, Mark, Question
from agentflow.app.diagnose.reading import Pair, read_pairs, read_poses
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.llm.messages import Message
from agentflow.llm.procedural.designing import build_machine
from agentflow.llm.procedural.reading import PromptContent, read_prompt
from agentflow.machine import ROOT, Machine, check, library, place
from agentflow.machine.edits.moves import MOVES, additions
from agentflow.machine.edits.random import random_machine
from agentflow.metrics.intervals import Rate

SIZES = (5, 20)
"""Fewest and most blocks of a machine; as in the published question."""


def draw_design(rng: Random, level: str) -> Machine:
    """A design of the built-in model for a level, of a size in `SIZES`."""
    while True:
        machine, _ = build_machine(_prompt(level), rng)
        if SIZES[0] <= len(machine) <= SIZES[1]:
            return machine


@cache
def _prompt(level: str) -> PromptContent:
    """The prompt of a designer, as the built-in model reads it."""
    _, user = chat_prompt(Designer, get_task(level).brief)
    return read_prompt([Message(role="user", text=user["content"])])


def describe_blocks(machine: Machine) -> Mapping[str, object]:
    """Template variables of a machine and of the types that it uses, without its geometry."""
    kinds = [library()[kind] for kind in sorted({step.type for step in machine})]
    return {"representation": "tree", "machine": machine.to_text(), **types_context(kinds)}


MOST = 8
"""Most overlapping pairs of one machine; a random machine of 20 blocks often has more."""
BREAKING = ("swap", "re-attach", "re-orient")
"""Kinds of edits that break a design: one block gets another type, place or orientation."""
EDITS = 20
"""Edits of a design that are tried before the next design."""


class Overlap(Diagnostic):
    """Which pairs of blocks overlap."""

    name: ClassVar[str] = "overlap"

    def questions(self, size: int, seed: int) -> list[Question]:
        """Machines with `size` overlapping pairs in total, alternately random and broken."""
        rng = Random(f"diagnose/overlap/{seed}")
        sources = cycle((_random_machines, _broken_designs))
        found: list[Question] = []
        left = size
        while left:
            machine, pairs = _first_overlapping(next(sources)(rng), min(left, MOST))
            left -= len(pairs)
            found.append(Question(f"overlap/{len(found)}", machine, pairs))
        return found

    def variables(self, question: Question) -> Mapping[str, object]:
        return describe_blocks(question.machine)

    def read(self, text: str, question: Question) -> list[Pair] | None:  # noqa: ARG002
        return read_pairs(text)

    def score(self, marks: Sequence[Mark]) -> dict[str, Any]:
        """Found pairs / true pairs (`accuracy`), and what this costs (`precision`, `f1`)."""
        pairs = [({*map(tuple, mark.truth)}, {*map(tuple, mark.answer or ())}) for mark in marks]
        found = sum(len(true & named) for true, named in pairs)
        recall = Rate(found, sum(len(true) for true, _ in pairs))
        precision = Rate(found, sum(len(named) for _, named in pairs))
        return {
            "pairs": recall.of,
            "found": found,
            "named": precision.of,
            "accuracy": recall.value,
            "interval": recall.interval,
            "precision": precision.value,
            "f1": 2 * found / (recall.of + precision.of),
        }


def _first_overlapping(machines: Iterator[Machine], most: int) -> tuple[Machine, list[Pair]]:
    """The first machine with one to `most` overlaps and no other problem, and its overlaps."""
    for machine in machines:
        report = check(machine)
        codes = {problem.code for problem in report.problems}
        if codes == {"overlap"} and len(report.overlaps) <= most:
            return machine, list(report.overlaps)
    raise AssertionError("the machines never end")


def _random_machines(rng: Random) -> Iterator[Machine]:
    """Random machines of standard blocks, grown without regard to overlaps."""
    types = [kind for kind in sorted(library().core) if kind and not library()[kind].linear]
    while True:
        machine = Machine((ROOT,))
        for _ in range(rng.randint(*SIZES) - 1):
            machine = rng.choice(additions(machine, types))(rng) or machine
        yield machine


def _broken_designs(rng: Random) -> Iterator[Machine]:
    """Designs of the built-in model after one random edit, legal or not."""
    for design in _designs(rng):
        types = sorted({step.type for step in design.steps[1:]})
        for _ in range(EDITS):
            moves = MOVES[rng.choice(BREAKING)](design, types)
            yield (rng.choice(moves)(rng) if moves else None) or design


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
        *first, last = (str(item["id"]) for item in question.truth)
        asked = f"{', '.join(first)} and {last}"
        return {**describe_blocks(question.machine), "asked": asked}

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
    """Designs for the first level of each family that is `diagnosed`."""
    levels = [name for name, family in FAMILIES.items() if family.diagnosed]
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
    return said is not None and all(
        abs(a - b) <= CLOSE + _ROUNDING for a, b in zip(true, said, strict=True)
    )
