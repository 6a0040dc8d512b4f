"""A machine and its geometry as JSON data, and as text for models."""

import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import groupby, pairwise

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.controls import control_text
from agentflow.machine.description.rounding import GroundFrame, span_of
from agentflow.machine.geometry.balance import mass, on_ground, stands, support_polygon
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.geometry.pose import Placed, ShapeFace, to_metres
from agentflow.machine.geometry.vectors import Vec3, add
from agentflow.machine.tree import Machine

DRIVES = {"x+": "z+", "x-": "z+", "z+": "x-", "z-": "x+"}
"""Facing of a powered wheel -> direction it drives the machine in; facing y+ or y-, it does not."""


def describe(machine: Machine, brief: Brief | None = None) -> dict[str, object]:
    """The 3D information as JSON data; `brief` is that of the task, for what machines rest on.

    Metres with one decimal, halves rounded away from zero; y is measured from the lowest corner of
    the machine. What rests on a bank is on the ground as well. `drives` lists the powered wheels on
    the ground, with a null direction for those that face up or down. `pulls` lists springs and
    winches: each pulls `from_block` along `direction` and `to_block` the opposite way. `controls`
    and `controllers` are there if the machine has some.
    """
    geometry = _placed(machine, brief)
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
        **({"controls": [each.to_json() for each in machine.controls]} if machine.controls else {}),
        **({"controllers": machine.controllers.to_json()} if machine.controllers else {}),
    }


def _placed(machine: Machine, brief: Brief | None) -> Geometry:
    """The machine, on what it is set down on in a task."""
    return place(machine, brief.banks if brief else ())


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
    """The machine and its geometry as compact text, one line per block.

    The machine can be built again from it. Two-ended blocks come last; those of a type between the
    same two blocks share a line. Free faces that point at the ground and lie on it are left out.

    Args:
        machine: a file-valid machine.
        brief: the task, for its limit of blocks and what machines rest on.
        short: leave out building points, the support polygon and the positions of free faces.
    """
    geometry = _placed(machine, brief)
    frame = GroundFrame(geometry.lo[1])
    return "\n".join(
        [
            _legend(short=short),
            *_budget_lines(machine, brief),
            *(f"Required: {item}." for item in (brief.judge(geometry) if brief else ())),
            *_summary_lines(geometry, frame, short=short),
            *(_block_line(geometry, frame, placed, short=short) for placed in _boxed(geometry)),
            *(_span_line(frame, blocks, short=short) for blocks in _spans(geometry)),
            *control_lines(machine, brief),
        ]
    )


def list_text(machine: Machine) -> str:
    """What each block is attached to, without geometry: else like `describe_text`."""
    geometry = place(machine)
    frame = GroundFrame(geometry.lo[1])
    boxed = (
        f"{block.id} {block.name}: {_attachment(geometry, block)}" for block in _boxed(geometry)
    )
    spans = (_span_line(frame, blocks, short=True) for blocks in _spans(geometry))
    return "\n".join((ON, *boxed, *spans, *control_lines(machine)))


def control_lines(machine: Machine, brief: Brief | None = None) -> list[str]:
    """The control program as the commands that write it, numbered from 0, and the controllers; a
    machine without either
    gets a line only if the task lets machines bring controls."""
    laws = machine.controllers
    sensed = [f"Controllers: {json.dumps(laws.to_json())}"] if laws else []
    if not machine.controls:
        allowed = brief is not None and brief.limits.controls is not None
        return sensed or ["No controls."] * allowed
    lines = (f"{number}. {control_text(each)}" for number, each in enumerate(machine.controls))
    return [_CONTROLS, *lines, *sensed]


_CONTROLS = "Controls, by their numbers:"
ON = "'on 4.2 Left': on block 4, face 2, which is a Left face."
"""How lines say what a block is attached to."""


def _boxed(geometry: Geometry) -> Iterator[Placed]:
    return (placed for placed in geometry.blocks if not placed.two_ended)


def _spans(geometry: Geometry) -> Collection[Sequence[Placed]]:
    """Two-ended blocks by type and the two blocks that they join."""
    spans: dict[tuple[int, ...], list[Placed]] = {}
    for placed in geometry.blocks:
        if placed.two_ended:
            spans.setdefault((placed.type, *placed.step.parents), []).append(placed)
    return spans.values()


def _attachment(geometry: Geometry, placed: Placed) -> str:
    step = placed.step
    if step.parent < 0:
        return f"faces {placed.facing}"
    return f"on {step.parent}.{step.face_id} {_direction(geometry, step.parent, step.face_id)}"


def _legend(*, short: bool) -> str:
    free = (
        "ids. a/b: one value each."
        if short
        else "facing, ids (position). a/b: one value each; 1-4, a..b: in even steps."
    )
    return f"x, y, z in m, y from the lowest corner. {ON} Free faces, except on the ground: {free}"


def _budget_lines(machine: Machine, brief: Brief | None) -> list[str]:
    if brief is None or brief.limits.blocks is None:
        return []
    return [f"{brief.count_blocks(len(machine))} of {brief.limits.blocks} blocks."]


def _summary_lines(geometry: Geometry, frame: GroundFrame, *, short: bool) -> list[str]:
    corners = " ".join(f"({x:g},{z:g})" for x, z in support_polygon(geometry))
    over = "over" if stands(geometry) else "NOT over"
    lines = [
        f"Size {_vector(geometry.size)}, mass {mass(geometry):g} kg, "
        f"centre of mass {_vector(frame.centre_of_mass(geometry))}, "
        f"{over} the support polygon{'' if short else f' (x,z) {corners}'}."
    ]
    drives = [f"{wheel} to {to}" if to else f"{wheel} not" for wheel, to in _drives(geometry)]
    if drives:
        lines.append(f"Powered wheels on the ground drive the machine: {', '.join(drives)}.")
    return [*lines, *joined_lines(geometry)]


def joined_lines(geometry: Geometry) -> list[str]:
    """The faces that are joined because they touch, in one line; [] without any."""
    loops = [
        f"{loop.block}.{loop.face_id} with {loop.partner}.{loop.partner_face}"
        for loop in geometry.auto_connections
    ]
    return [f"Faces joined by touching: {', '.join(loops)}."] if loops else []


def _span_line(frame: GroundFrame, blocks: Sequence[Placed], *, short: bool) -> str:
    """Two-ended blocks of one type between the same two blocks."""
    steps = [placed.step for placed in blocks]
    near, far = steps[0].parents
    faces = [
        _listed(numbers) for numbers in zip(*((s.face_id, s.face_id_b) for s in steps), strict=True)
    ]
    ends = f"{near}.{faces[0]} to {far}.{faces[1]}"
    starts = _points([frame.point(placed.at) for placed in blocks])
    stops = _points([frame.point(placed.far) for placed in blocks if placed.far is not None])
    points = "" if short else f", {starts} to {stops}"
    length = _listed([span_of(placed)[0] for placed in blocks])
    ids = _listed([placed.id for placed in blocks])
    return f"{ids} {blocks[0].name}: from {ends}{points}, length {length}"


def _block_line(geometry: Geometry, frame: GroundFrame, placed: Placed, *, short: bool) -> str:
    parts = [_attachment(geometry, placed)]
    if placed.step.parent >= 0:
        parts.append(f"faces {placed.facing}")
    parts.append(f"centre {_vector(frame.center(placed))}")
    if library()[placed.type].joint.moves and not short:
        parts.append(f"building point {_vector(frame.point(placed.at))}")
    if on_ground(geometry, placed):
        names = " and ".join(bank.name for bank in geometry.banks_under(placed.id))
        parts.append(f"on {names or 'ground'}")
    free = [f for f in _free_faces(geometry, placed) if not _is_grounded(f, geometry, placed)]
    if free:
        ids = ranges(face.id for face in free)
        parts.append(f"free {ids if short else _face_positions(placed, frame, free)}")
    return f"{placed.id} {placed.name}: {', '.join(parts)}"


def _is_grounded(face: ShapeFace, geometry: Geometry, placed: Placed) -> bool:
    """Whether a face points at the ground or a bank and lies on it."""
    place = add(placed.at, face.offset)
    if face.facing.name != "y-" or place[1] != placed.lo[1] or not on_ground(geometry, placed):
        return False
    under, point = geometry.banks_under(placed.id), to_metres(place)
    return not under or any(bank.reaches(point, geometry.middle) for bank in under)


def _face_positions(placed: Placed, frame: GroundFrame, free: Sequence[ShapeFace]) -> str:
    """Free faces by facing: facing, ids and positions."""
    groups = []
    for facing, group in groupby(free, key=lambda face: face.facing.name):
        faces = list(group)
        points = _points([frame.point(add(placed.at, face.offset)) for face in faces])
        groups.append(f"{facing} {ranges(face.id for face in faces)} {points}")
    return "; ".join(groups)


def _points(points: Sequence[Vec3]) -> str:
    """Points with coordinates that differ between them listed one per point."""
    return f"({','.join(_in_row(axis) for axis in zip(*points, strict=True))})"


def _listed(values: Sequence[float | None]) -> str:
    """One value if all are equal, else all."""
    texts = [f"{value:g}" for value in values if value is not None]
    return texts[0] if len(set(texts)) == 1 else "/".join(texts)


def _in_row(values: Sequence[float]) -> str:
    """The ends of an even row of three or more, else what `_listed` gives."""
    steps = {f"{b - a:.6g}" for a, b in pairwise(values)}
    if len(values) < 3 or len(steps) > 1 or steps == {"0"}:
        return _listed(values)
    return f"{values[0]:g}..{values[-1]:g}"


def ranges(ids: Iterable[int]) -> str:
    """Ids, rows of them as ranges: "0 2-5"."""
    runs = groupby(enumerate(ids), key=lambda item: item[1] - item[0])
    rows = [[number for _, number in run] for _, run in runs]
    return " ".join(f"{row[0]}-{row[-1]}" if len(row) > 1 else str(row[0]) for row in rows)


def _vector(values: Sequence[float]) -> str:
    return f"({','.join(f'{value:g}' for value in values)})"
