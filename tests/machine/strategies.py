"""Hypothesis strategies for machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hypothesis import strategies as st

from agentflow.machine import ROOT, Machine, Step, library, place, spatial_problems
from agentflow.machine.blocks.types import Group
from agentflow.machine.controls import driven_blocks
from agentflow.machine.tree import Control

TYPES = tuple(kind for kind in library().core if kind != 0)


@st.composite
def machines(draw: st.DrawFn, most: int = 12) -> Machine:
    """File-valid machines of core types; often with overlaps and shared faces."""
    steps = [ROOT]
    for _ in range(draw(st.integers(0, most))):
        steps.append(draw_step(draw, steps))
    return Machine(tuple(steps))


@st.composite
def controlled_machines(draw: st.DrawFn) -> Machine:
    """File-valid machines of core types whose driven blocks have up to five controls."""
    machine = draw(machines())
    driven = driven_blocks(machine)
    count = draw(st.integers(0, 5)) if driven else 0
    return replace(machine, controls=tuple(draw(controls(driven)) for _ in range(count)))


@st.composite
def controls(draw: st.DrawFn, driven: Mapping[int, Group]) -> Control:
    """Controls of these driven blocks, in whole milliseconds and thousandths."""
    some = st.lists(st.sampled_from(sorted(driven)), min_size=1, max_size=4, unique=True)
    target = draw(some.map(tuple) | st.sampled_from(sorted(set(driven.values()))))
    at, lasts = draw(st.integers(0, 9000)), draw(st.integers(1, 9000))
    return Control(target, at / 1000, lasts / 1000, draw(st.integers(-1000, 1000)) / 1000)


@st.composite
def valid_machines(draw: st.DrawFn, most: int = 12) -> Machine:
    """File-valid and spatially valid machines of core types."""
    steps = [ROOT]
    for _ in range(draw(st.integers(0, most))):
        grown = [*steps, draw_step(draw, steps)]
        if not spatial_problems(place(Machine(tuple(grown)))):
            steps = grown
    return Machine(tuple(steps))


def draw_step(draw: st.DrawFn, steps: list[Step]) -> Step:
    """A file-valid next step."""
    kind = draw(st.sampled_from(TYPES))
    ends: list[int] = []
    for _ in range(2 if library()[kind].linear else 1):
        carriers = [step for step in steps if library()[step.type].faces]
        parent = draw(st.sampled_from(carriers))
        ends += [parent.id, draw(st.integers(0, len(library()[parent.type].faces) - 1))]
    return Step(len(steps), kind, *ends)


@st.composite
def mutations(
    draw: st.DrawFn,
    texts: st.SearchStrategy[str],
    junk: st.SearchStrategy[list[str]],
    least: int,
    most: int,
) -> str:
    """A text with so many random deletions and insertions of junk."""
    text = draw(texts)
    for _ in range(draw(st.integers(least, most))):
        at = draw(st.integers(0, len(text)))
        text = text[:at] + "".join(draw(junk)) + text[at + draw(st.integers(0, 9)) :]
    return text
