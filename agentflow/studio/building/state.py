"""What the page shows of a machine that is being built."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from agentflow.app.pages.films import Shapes, machine_data
from agentflow.env.drawing.solids import MachineSolids
from agentflow.machine import Brief, Machine, check, library, place
from agentflow.machine.geometry.balance import centre_of_mass, mass, stands, support_polygon
from agentflow.machine.geometry.placement import Geometry
from agentflow.studio.building.rules import Spot


def describe_state(machine: Machine, brief: Brief, chosen: int = 0) -> dict[str, Any]:
    """Everything about a machine: picture, tree, problems, balance. Places are in the world, m."""
    report, geometry, shapes = check(machine, brief), place(machine), Shapes()
    shift = lift_of(machine, geometry)
    data = machine_data(machine, None, shapes, given=brief.given)
    return {
        "machine": machine.to_json(),
        "digest": machine.digest,
        "chosen": chosen,
        "picture": data,
        "shapes": shapes.rows,
        "files": shapes.files,
        "blocks": [
            {
                "id": placed.id,
                "type": placed.type,
                "name": placed.name,
                "parents": list(placed.step.attachments),
                "facing": "" if placed.two_ended else placed.facing,
                "position": _moved(placed.center, shift),
                "given": placed.id < len(brief.given),
            }
            for placed in geometry.blocks
        ],
        "problems": [problem.to_json() for problem in report.problems],
        "warnings": [warning.to_json() for warning in report.warnings],
        "valid": report.task_valid,
        "size": list(geometry.size),
        "mass": mass(geometry),
        "centre": _moved(centre_of_mass(geometry), shift),
        "support": [[x + shift[0], z + shift[2]] for x, z in support_polygon(geometry)],
        "stands": stands(geometry),
        "count": brief.count_blocks(len(machine)),
        "most": brief.limits.blocks,
    }


def spots_json(machine: Machine, spots: Iterable[Spot]) -> list[dict[str, Any]]:
    """Spots as data, with their places in the world."""
    shift = lift_of(machine, place(machine))
    return [
        {
            "block": spot.block,
            "face": spot.face,
            "name": library()[machine[spot.block].type].name,
            "position": _moved(spot.position, shift),
            "facing": spot.facing,
            "why_not": spot.why_not,
        }
        for spot in spots
    ]


def lift_of(machine: Machine, geometry: Geometry) -> list[float]:
    """What moves the machine frame to the world, where the machine stands on the ground."""
    rest = MachineSolids(machine).rest
    return [float(v) for v in np.subtract(rest.centre[0], geometry.blocks[0].center)]


def _moved(point: Iterable[float], shift: Iterable[float]) -> list[float]:
    return [round(a + b, 4) for a, b in zip(point, shift, strict=True)]
