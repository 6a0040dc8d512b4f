"""What the page shows of a machine that is being built, and where further blocks could go."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from agentflow.app.pages.films import Shapes, machine_data, solid_row
from agentflow.env.constants import constants
from agentflow.env.drawing.cameras import to_vec3
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.physics.assembly import assemble
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, check, library, place
from agentflow.machine.edits.changes import Change, Mending, add
from agentflow.machine.edits.draft import Draft, End
from agentflow.machine.geometry.balance import centre_of_mass, mass, stands, support_polygon
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.problems import RefusedEdit, type_problem


def describe_state(machine: Machine, task: Task, chosen: int = 0) -> dict[str, Any]:
    """Everything about a machine: picture, tree, problems, balance. Places are in the world, m."""
    brief, shapes = task.brief, Shapes()
    report = check(machine, brief)
    fault = "" if report.problems else task.fault(machine)
    geometry = place(machine, brief.banks)
    shift = _lift_of(machine, geometry)
    return {
        "machine": machine.to_json(),
        "digest": machine.digest,
        "chosen": chosen,
        "picture": machine_data(machine, None, shapes, given=brief.given),
        **shapes.data,
        "blocks": [
            {
                "id": placed.id,
                "type": placed.type,
                "name": placed.name,
                "group": library()[placed.type].group,
                "parents": list(placed.step.attachments),
                "facing": "" if placed.two_ended else placed.facing,
                "position": _moved(placed.center, shift),
                "given": placed.id < len(brief.given),
            }
            for placed in geometry.blocks
        ],
        "problems": [problem.to_json() for problem in report.problems],
        "warnings": [
            *(warning.to_json() for warning in report.warnings),
            *[{"message": f"Every test fails: {fault}.", "blocks": []}] * bool(fault),
        ],
        "valid": report.task_valid,
        "size": list(geometry.size),
        "mass": mass(geometry),
        "centre": _moved(centre_of_mass(geometry), shift),
        "support": [[x + shift[0], z + shift[2]] for x, z in support_polygon(geometry)],
        "stands": stands(geometry),
        "middle": _moved(geometry.middle, shift),
        "count": brief.count_blocks(len(machine)),
        "most": brief.limits.blocks,
    }


def describe_block(machine: Machine, brief: Brief, kind: int, ends: list[End]) -> dict[str, Any]:
    """A further block as it would be between or on these faces: its solids, and where its motor
    turns, as centre and axis (m), about which it turns clockwise as seen from the axis' tip."""
    draft = Draft(machine, brief)
    block = draft.attach(kind, ends).id
    larger = Machine(tuple(draft.steps.values()))
    figures, geometry = MachineSolids(larger), place(larger)
    down = np.subtract(_lift_of(machine, place(machine)), _lift_of(larger, geometry))
    drive = next(
        (
            joint
            for joint in assemble(larger, geometry, constants()).joints
            if joint.block == block and joint.drive.speed
        ),
        None,
    )
    return {
        "solids": [
            solid_row(replace(solid, position=to_vec3(np.add(solid.position, down))))
            for solid in figures.objects(figures.rest)
            if solid.name == f"block {block}"
        ],
        "turn": drive
        and {
            "at": _moved(figures.rest.centre[block], down),
            "axis": [part * np.sign(drive.drive.speed) for part in drive.axis],
        },
    }


def spots_to_add(rules: Mending, kind: int, first: End | None = None) -> Iterator[dict[str, Any]]:
    """Where a new block can go; `first` is the first end of a two-ended one."""
    linear = kind in library() and library()[kind].linear
    fault = type_problem(kind, rules.brief.blocks, two_ended=linear)
    if fault:
        raise UsageError(fault[1])
    if not linear:
        yield from find_spots(rules, lambda end: partial(add, kind=kind, ends=[end]))
    elif first is None:
        yield from find_spots(rules, None)
    else:
        yield from find_spots(rules, lambda end: partial(add, kind=kind, ends=[first, end]), first)


def find_spots(
    rules: Mending, change: Callable[[End], Change] | None, first: End | None = None
) -> Iterator[dict[str, Any]]:
    """Every face that is free, or every face at all for two-ended blocks.

    Each change is tried before it is made: `why_not` is what forbids it, or "".
    """
    geometry = place(rules.machine)
    shift = _lift_of(rules.machine, geometry)
    shared = change is None or first is not None
    for placed in geometry.blocks:
        faces = library()[placed.type].open_faces
        for face in faces if shared else geometry.free_faces(placed.id):
            if (placed.id, face) != first:
                yield {
                    "block": placed.id,
                    "face": face,
                    "name": placed.name,
                    "position": _moved(placed.faces[face].position, shift),
                    "facing": placed.faces[face].facing,
                    "why_not": "" if change is None else _why_not(rules, change((placed.id, face))),
                }


def _why_not(rules: Mending, change: Change) -> str:
    """What forbids a change; "" if it is legal."""
    try:
        rules.make(change)
    except RefusedEdit as refused:
        return refused.reason
    return ""


def _lift_of(machine: Machine, geometry: Geometry) -> list[float]:
    """What moves the machine frame to the world, where the machine stands on the ground."""
    rest = MachineSolids(machine).rest
    return [float(v) for v in np.subtract(rest.centre[0], geometry.blocks[0].center)]


def _moved(point: Iterable[float], shift: Iterable[float]) -> list[float]:
    return [round(a + b, 4) for a, b in zip(point, shift, strict=True)]
