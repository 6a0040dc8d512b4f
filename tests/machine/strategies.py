"""Hypothesis strategies for machines."""

from __future__ import annotations

from hypothesis import strategies as st

from agentflow.machine import ROOT, Machine, Step, library, place, spatial_problems

TYPES = tuple(kind for kind in library().core if kind != 0)


@st.composite
def machines(draw: st.DrawFn, most: int = 12) -> Machine:
    """File-valid machines of core types; often with overlaps and shared faces."""
    steps = [ROOT]
    for _ in range(draw(st.integers(0, most))):
        steps.append(draw_step(draw, steps))
    return Machine(tuple(steps))


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
