"""Owns how a machine and its rollout become what a report's page shows: solids, motion, events.

Which machines a page shows is its own module's; the packing of motion is report/film.py's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from agentflow.env.figures import Figures
from agentflow.env.film import hero_of, interval_of
from agentflow.env.scene import IDENTITY, Scene, Thing
from agentflow.env.trace import Broken, Rollout, Trace
from agentflow.machine.blocks import library
from agentflow.machine.tree import Machine
from agentflow.report.film import Motion, packed

NO_PLACE = (0.0, 0.0, 0.0)
MOST_EVENTS = 40
"""Events of one film that are listed."""
Row = list[Any]


class Shapes:
    """The solids of all machines of a page, each kept once: block types share theirs."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], int] = {}

    @property
    def rows(self) -> list[Row]:
        """Every solid as the page reads it, in the order of its numbers."""
        return [list(row) for row in self._known]

    def number(self, solid: Thing) -> int:
        """The number of a solid of a block's own frame."""
        return self._known.setdefault(tuple(_row(solid)), len(self._known))


def exhibit(
    machine: Machine, rollout: Rollout | None, shapes: Shapes, remark: str = ""
) -> dict[str, Any]:
    """A machine as the page shows it: at work where there is a trace, else as built.

    Args:
        machine: File-valid.
        rollout: What came of it; None when it was not simulated.
        shapes: Takes in the machine's solids.
        remark: Shown below the film.
    """
    figures = Figures(machine)
    trace = rollout.trace if rollout is not None else None
    scene = rollout.scene if rollout is not None and rollout.scene is not None else Scene()
    moving = trace.things if trace is not None else ()
    columns = {name: len(machine) + index for index, name in enumerate(moving)}
    hero = hero_of(machine)
    return {
        "solids": [[shapes.number(solid) for solid in solids] for solids in figures.solids],
        "rods": [_rod(step.id, machine, figures) for step in machine if step.two_ended],
        "things": [
            [*_row(_local(thing, columns)), columns.get(thing.name)] for thing in scene.things
        ],
        "hero": hero,
        "traces": sorted({0, hero, *columns.values()})[:4],
        "connections": [block for block, _ in trace.connections] if trace is not None else [],
        "gone": _gone(trace, machine) if trace is not None else {},
        "breaks": {item.block: item.time for item in reversed(rollout.broken)} if rollout else {},
        "events": _events(rollout, machine) if rollout is not None else [],
        "feedback": rollout.feedback.text if rollout is not None else "",
        "remark": remark,
        "film": packed(_motion(figures, trace, machine)),
    }


def _motion(figures: Figures, trace: Trace | None, machine: Machine) -> Motion:
    """Blocks, then moving things; two-ended blocks stretch between others and are left at rest."""
    if trace is None:
        rest = figures.rest
        return Motion(0.0, rest.centre[None], rest.rotation[None], np.zeros((1, 0)))
    position = np.concatenate([trace.centre, trace.thing_position], axis=1)
    rotation = np.concatenate([trace.rotation, trace.thing_rotation], axis=1)
    for step in machine:
        if step.two_ended:
            position[:, step.id] = position[:, 0]
            rotation[:, step.id] = IDENTITY
    return Motion(interval_of(trace), position, rotation, trace.utilisation)


def _row(solid: Thing) -> Row:
    """Kind, size, position, rotation, colour: what the page makes a solid from."""
    size = (solid.size[0],) * 3 if solid.shape == "sphere" else solid.size
    numbers = (*size, *solid.position, *solid.rotation, *solid.color[:3])
    return [solid.shape, *(round(float(value), 4) + 0.0 for value in numbers)]


def _local(thing: Thing, columns: dict[str, int]) -> Thing:
    """A thing where it stands; one that moves, in its own frame."""
    if thing.name not in columns:
        return thing
    return Thing(thing.name, thing.shape, thing.size, NO_PLACE, color=thing.color)


def _rod(block: int, machine: Machine, figures: Figures) -> dict[str, Any]:
    ends = zip(machine[block].parents, figures.ends[block], strict=True)
    return {
        "block": block,
        "color": list(figures.rod(block, figures.rest).color[:3]),
        "ends": [[parent, *(round(float(value), 4) for value in end)] for parent, end in ends],
    }


def _gone(trace: Trace, machine: Machine) -> dict[int, float]:
    """When two-ended blocks let go."""
    lost = {step.id: np.flatnonzero(~trace.alive[:, step.id]) for step in machine if step.two_ended}
    return {block: float(trace.times[at[0]]) for block, at in lost.items() if len(at)}


def _events(rollout: Rollout, machine: Machine) -> list[dict[str, Any]]:
    """What broke and what else happened, in order."""
    found = [
        {"time": item.time, "kind": "broke", "text": _broke(item, machine)}
        for item in rollout.broken
    ]
    found += [
        {"time": item.time, "kind": "told", "text": item.text or item.kind}
        for item in rollout.events
    ]
    return sorted(found, key=lambda item: float(str(item["time"])))[:MOST_EVENTS]


def _broke(item: Broken, machine: Machine) -> str:
    name, partner = _named(item.block, machine), _named(item.partner, machine)
    return f"{name} broke off {partner} at load {item.load:.2f}"


def _named(block: int, machine: Machine) -> str:
    return f"block {block} ({library()[machine[block].type].name})"
