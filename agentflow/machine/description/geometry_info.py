"""3D information: a machine's geometry as JSON data, and as text for models."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.description.rounding import GroundFrame, span_of
from agentflow.machine.geometry.balance import mass, on_ground, stands, support_polygon
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.geometry.pose import Placed, ShapeFace
from agentflow.machine.geometry.vectors import add
from agentflow.machine.tree import Machine

DRIVES = {"x+": "z+", "x-": "z+", "z+": "x-", "z-": "x+"}
"""Facing of a powered wheel -> direction it drives the machine in; facing y+ or y-, it does not."""


def describe(machine: Machine) -> dict[str, object]:
    """The 3D information as JSON data.

    Metres with one decimal, halves rounded away from zero; y is measured from the lowest corner of
    the machine. `drives` lists the powered wheels on the ground, with a null direction for those
    that face up or down. `pulls` lists springs and winches: each pulls `from_block` along
    `direction` and `to_block` the opposite way.
    """
    geometry = place(machine)
    frame = GroundFrame(geometry.lo[1])
    return {
        "blocks": [_block(geometry, frame, placed) for placed in geometry.blocks],
        "size": list(geometry.size),
        "mass": mass(geometry),
        "centre_of_mass": list(frame.centre_of_mass(geometry)),
        "support_polygon": [list(corner) for corner in support_polygon(geometry)],
        "stands": stands(geometry),
        "drives": [{"id": wheel, "direction": to} for wheel, to in _drives(geometry)],
        "pulls": [_pull(placed) for placed in filter(_pulls, geometry.blocks)],
        "auto_connections": [loop._asdict() for loop in geometry.auto_connections],
    }


def _block(geometry: Geometry, frame: GroundFrame, placed: Placed) -> dict[str, object]:
    data: dict[str, object] = {"id": placed.id, "name": placed.name, "type": placed.type}
    parents = [
        {"id": parent, "face_id": face, "direction": _direction(geometry, parent, face)}
        for parent, face in placed.step.attachments
    ]
    if placed.far is not None:
        return data | {
            "parents": parents,
            "end_a": list(frame.point(placed.at)),
            "end_b": list(frame.point(placed.far)),
            "length": span_of(placed)[0],
        }
    return data | {
        "parent": parents[0] if parents else None,
        "children": [
            {"face_id": face, "id": child} for face, child in geometry.children_by_face(placed.id)
        ],
        "center": list(frame.center(placed)),
        "position": list(frame.point(placed.at)),
        "facing": placed.facing,
        "on_ground": on_ground(geometry, placed),
        "free_faces": [
            {
                "face_id": face.id,
                "position": list(frame.point(add(placed.at, face.offset))),
                "facing": face.facing.name,
            }
            for face in _free_faces(geometry, placed)
        ],
    }


def _direction(geometry: Geometry, parent: int, face: int) -> str:
    return library()[geometry[parent].type].faces[face].direction


def _free_faces(geometry: Geometry, placed: Placed) -> list[ShapeFace]:
    faces = placed.shape.faces if placed.shape else ()
    return [faces[face] for face in geometry.free_faces(placed.id)]


def _drives(geometry: Geometry) -> list[tuple[int, str | None]]:
    return [
        (placed.id, DRIVES.get(placed.facing))
        for placed in geometry.blocks
        if library()[placed.type].powered_wheel and on_ground(geometry, placed)
    ]


def _pulls(placed: Placed) -> bool:
    return placed.two_ended and library()[placed.type].non_static


def _pull(placed: Placed) -> dict[str, object]:
    length, direction = span_of(placed)
    return {
        "id": placed.id,
        "from_block": placed.step.parent,
        "to_block": placed.step.parent_b,
        "direction": None if direction is None else list(direction),
        "length": length,
    }


def describe_text(machine: Machine, brief: Brief | None = None, *, short: bool = False) -> str:
    """The 3D information as compact text, one line per block.

    Args:
        machine: a file-valid machine.
        brief: the task, for its limit of blocks.
        short: leave out building points, children, and the positions of free faces.
    """
    geometry = place(machine)
    frame = GroundFrame(geometry.lo[1])
    lines = [_legend(short=short), *_budget_lines(machine, brief)]
    lines += _summary_lines(geometry, frame)
    lines += [_block_line(geometry, frame, placed, short=short) for placed in geometry.blocks]
    return "\n".join(lines)


def _legend(*, short: bool) -> str:
    free = "ids" if short else "facing, ids, position; a/b: one coordinate per id"
    return (
        "x, y, z in m, y from the lowest corner. 'on 4.2 Left': on block 4, face 2, which is a "
        f"Left face. Free faces: {free}."
    )


def _budget_lines(machine: Machine, brief: Brief | None) -> list[str]:
    if brief is None or brief.limits.blocks is None:
        return []
    return [f"{brief.count_blocks(len(machine))} of {brief.limits.blocks} blocks."]


def _summary_lines(geometry: Geometry, frame: GroundFrame) -> list[str]:
    corners = " ".join(f"({x:g},{z:g})" for x, z in support_polygon(geometry))
    over = "over" if stands(geometry) else "NOT over"
    lines = [
        f"Size {_vector(geometry.size)}, mass {mass(geometry):g} kg, "
        f"centre of mass {_vector(frame.centre_of_mass(geometry))}, "
        f"{over} the support polygon (x,z) {corners}."
    ]
    drives = [f"{wheel} to {to}" if to else f"{wheel} not" for wheel, to in _drives(geometry)]
    if drives:
        lines.append(f"Powered wheels on the ground drive the machine: {', '.join(drives)}.")
    for placed in filter(_pulls, geometry.blocks):
        if direction := span_of(placed)[1]:
            near, far = placed.step.parents
            to = _vector(direction)
            lines.append(f"{placed.name} {placed.id} pulls {near} along {to}, {far} back.")
    loops = [
        f"{loop.block}.{loop.face_id} with {loop.partner}.{loop.partner_face}"
        for loop in geometry.auto_connections
    ]
    if loops:
        lines.append(f"Faces joined by touching: {', '.join(loops)}.")
    return lines


def _block_line(geometry: Geometry, frame: GroundFrame, placed: Placed, *, short: bool) -> str:
    step = placed.step
    name = f"{placed.id} {placed.name}"
    if placed.far is not None and step.parent_b is not None:
        ends = f"{step.parent}.{step.face_id} to {step.parent_b}.{step.face_id_b}"
        points = f" {_vector(frame.point(placed.at))} to {_vector(frame.point(placed.far))}"
        length = f"length {span_of(placed)[0]:g}"
        return f"{name}: from {ends}{'' if short else points}, {length}"
    parts = []
    if step.parent >= 0:
        where = _direction(geometry, step.parent, step.face_id)
        parts.append(f"on {step.parent}.{step.face_id} {where}")
    parts.append(f"faces {placed.facing}")
    parts.append(f"centre {_vector(frame.center(placed))}")
    if not short:
        parts.append(f"building point {_vector(frame.point(placed.at))}")
    if on_ground(geometry, placed):
        parts.append("on ground")
    carried = " ".join(map(str, geometry.children(placed.id)))
    if carried and not short:
        parts.append(f"carries {carried}")
    free = _free_faces(geometry, placed)
    if free:
        faces = _face_ranges(free) if short else _face_positions(placed, frame, free)
        parts.append(f"free {faces}")
    return f"{name}: {', '.join(parts)}"


def _face_positions(placed: Placed, frame: GroundFrame, free: Sequence[ShapeFace]) -> str:
    """Free faces by facing, with coordinates that differ between them listed one per id."""
    groups = []
    for facing, group in groupby(free, key=lambda face: face.facing.name):
        faces = list(group)
        points = [frame.point(add(placed.at, face.offset)) for face in faces]
        axes = ([f"{value:g}" for value in axis] for axis in zip(*points, strict=True))
        where = ",".join(axis[0] if len(set(axis)) == 1 else "/".join(axis) for axis in axes)
        groups.append(f"{facing} {' '.join(str(face.id) for face in faces)} ({where})")
    return "; ".join(groups)


def _face_ranges(free: Sequence[ShapeFace]) -> str:
    """Face ids as ranges: "0 2-5"."""
    runs: list[list[int]] = []
    for face in free:
        if runs and runs[-1][-1] == face.id - 1:
            runs[-1].append(face.id)
        else:
            runs.append([face.id])
    return " ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs)


def _vector(values: Sequence[float]) -> str:
    return f"({','.join(f'{value:g}' for value in values)})"
