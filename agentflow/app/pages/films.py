"""Owns how a machine and its rollout become what a report's page shows: solids, motion, events.

Which machines a page shows is its own module's; the packing of motion is report/film.py's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from agentflow.env.drawing.film import frame_interval, tracked_block
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.physics.model import Color
from agentflow.env.rollout import Broken, Rollout, RolloutEvent, Trace
from agentflow.env.scene import IDENTITY, Scene, Thing
from agentflow.env.simulation.trials import SHOWN_TRIAL
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.tree import Machine
from agentflow.report.film import Motion, pack_motion

GIVEN: tuple[tuple[str, Color], tuple[str, Color]] = (
    ("source", (0.80, 0.33, 0.20, 1.0)),
    ("target", (0.13, 0.50, 0.66, 1.0)),
)
"""What given blocks are called and how they are coloured: those with a motor, and the others."""
STALLED = "motor_stalled"
THINNED = 3
"""One of so many samples is kept of the trials that are not shown first."""
MOST_TRACES = 4
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
    machine: Machine,
    rollout: Rollout | None,
    shapes: Shapes,
    remark: str = "",
    *,
    given: Machine = LONE_ROOT,
    played: Sequence[Rollout] = (),
) -> dict[str, Any]:
    """A machine as the page shows it: at work where there is a trace, else as built.

    Args:
        machine: File-valid.
        rollout: What came of it; None when it was not simulated.
        shapes: Takes in the machine's solids.
        remark: Shown below the film.
        given: What its task gave it to begin with, which is told apart by colours.
        played: All its trials in order, where each has a film of its own.
    """
    figures, marked = MachineSolids(machine), _marked(given)
    solids = [
        [
            shapes.number(replace(solid, color=marked.get(block, ("", solid.color))[1]))
            for solid in s
        ]
        for block, s in enumerate(figures.solids)
    ]
    return {
        "solids": solids,
        "rods": [_rod(step.id, machine, figures) for step in machine if step.two_ended],
        "hero": tracked_block(machine),
        "given": [[name, list(color[:3])] for name, color in dict(marked.values()).items()],
        "feedback": rollout.feedback.text if rollout is not None else "",
        "remark": remark,
        "trials": _trials(machine, figures, rollout, played),
        **_filmed(machine, figures, rollout),
    }


def _filmed(
    machine: Machine, figures: MachineSolids, rollout: Rollout | None, every: int = 1
) -> dict[str, Any]:
    """What one rollout shows: what stood around, what moved how, what happened."""
    trace = rollout.trace if rollout is not None else None
    scene = rollout.scene if rollout is not None and rollout.scene is not None else Scene()
    moving = trace.things if trace is not None else ()
    columns = {name: len(machine) + index for index, name in enumerate(moving)}
    return {
        "things": [
            [*_row(_local(thing, columns)), columns.get(thing.name)] for thing in scene.things
        ],
        "wind": _wind(scene),
        "traces": _traces(machine, columns),
        "connections": [block for block, _ in trace.connections] if trace is not None else [],
        "gone": _gone(trace, machine) if trace is not None else {},
        "breaks": {item.block: item.time for item in reversed(rollout.broken)} if rollout else {},
        "events": _events(rollout, machine) if rollout is not None else [],
        "film": pack_motion(_motion(figures, trace, machine, every)),
    }


def _trials(
    machine: Machine, figures: MachineSolids, whole: Rollout | None, played: Sequence[Rollout]
) -> list[dict[str, Any]]:
    """Every trial for the page to choose from; the one that the whole shows has no second film.

    None where a trial was not played to its end, so that the whole has no outcomes.
    """
    if whole is None or SHOWN_TRIAL not in whole.terms:
        return []
    found = []
    for number, rollout in enumerate(played, start=1):
        shown = number == whole.terms[SHOWN_TRIAL]
        own = not shown and rollout.trace is not None
        told = {
            "number": number,
            "success": whole.terms[f"trial_{number}"],
            "outcome": whole.terms[f"outcome_{number}"],
            "shown": shown,
        }
        found.append(told | (_filmed(machine, figures, rollout, THINNED) if own else {}))
    return found


def _marked(given: Machine) -> dict[int, tuple[str, Color]]:
    """Given block -> what it is and its colour; the root is no such block."""
    return {
        step.id: GIVEN[0] if library()[step.type].non_static else GIVEN[1]
        for step in given
        if step.parent >= 0
    }


def _wind(scene: Scene) -> str:
    """The wind in words; "" where the air is still."""
    parts = [
        f"{abs(speed):g} m/s towards {axis}{'+' if speed > 0 else '-'}"
        for axis, speed in zip("xyz", scene.wind, strict=True)
        if speed
    ]
    return " and ".join(parts) + (", in gusts" if parts and scene.gusts else "")


def _traces(machine: Machine, columns: Mapping[str, int]) -> list[dict[str, Any]]:
    """Bodies that leave a trace: the root, the boulder, what moves in the scene."""
    hero = tracked_block(machine)
    boulder = {"boulder": hero} if hero else {}
    named = {"root block": 0, **boulder, **columns}
    return [{"body": body, "name": name} for name, body in named.items()][:MOST_TRACES]


def _motion(figures: MachineSolids, trace: Trace | None, machine: Machine, every: int) -> Motion:
    """Blocks, then moving things, in one of so many samples.

    Two-ended blocks stretch between others and are left at rest.
    """
    if trace is None:
        rest = figures.rest
        return Motion(0.0, rest.centre[None], rest.rotation[None], np.zeros((1, 0)))
    position = np.concatenate([trace.centre, trace.thing_position], axis=1)
    rotation = np.concatenate([trace.rotation, trace.thing_rotation], axis=1)
    for step in machine:
        if step.two_ended:
            position[:, step.id] = position[:, 0]
            rotation[:, step.id] = IDENTITY
    load = trace.utilisation
    return Motion(
        every * frame_interval(trace), *(part[::every] for part in (position, rotation, load))
    )


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


def _rod(block: int, machine: Machine, figures: MachineSolids) -> dict[str, Any]:
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
    found += [{"time": item.time, "kind": "told", "text": _told(item)} for item in rollout.events]
    return sorted(found, key=lambda item: float(str(item["time"])))[:MOST_EVENTS]


def _told(event: RolloutEvent) -> str:
    """An event in words; of a stalled motor the record says only which one, and when."""
    text = event.text or event.kind.replace("_", " ")
    return f"motor stands still: {text}" if event.kind == STALLED else text


def _broke(item: Broken, machine: Machine) -> str:
    name, partner = _named(item.block, machine), _named(item.partner, machine)
    return f"{name} broke off {partner} at load {item.load:.2f}"


def _named(block: int, machine: Machine) -> str:
    return f"block {block} ({library()[machine[block].type].name})"
