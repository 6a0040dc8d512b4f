"""Spatial validity: faces, connections, overlaps, size, and parts in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.plates import plate_of
from agentflow.machine.brief import SIZE_LIMIT, Limits
from agentflow.machine.geometry.pieces import largest_piece
from agentflow.machine.geometry.placement import Geometry, bounds, overlap_of
from agentflow.machine.geometry.pose import Placed, to_metres
from agentflow.machine.problems import Problem, comma_list, size_of_piece

MAX_FACES = 24
"""Maximum number of free faces to list; plates have hundreds."""
ANYWHERE = Limits()
"""Limits without a task or an engine: the standard building volume."""
ANY_SIZE = Limits(size=(inf, inf, inf))
"""Limits of what is made or converted: how large a machine may be is a rule of its task."""
MAX_OVERLAP_PROBLEMS = 200
"""Maximum number of overlaps reported as problems; `Report.overlaps` has them all."""


def spatial_problems(
    geometry: Geometry, limits: Limits = ANYWHERE, moved: Sequence[int] = ()
) -> list[Problem]:
    """Everything that makes a file-valid machine invalid without regard to the task.

    Args:
        geometry: Of the machine.
        limits: How large it may be.
        moved: A block that was just moved, then those that it carries: overlaps tell where else it
            could be, rather than the later block.
    """
    problems = _shared_faces(geometry) + _duplicate_connections(geometry)
    for a, b in geometry.overlaps[:MAX_OVERLAP_PROBLEMS]:
        problems.append(Problem("overlap", (a, b), overlap_message(geometry, a, b, moved)))
    left = len(geometry.overlaps) - MAX_OVERLAP_PROBLEMS
    if left > 0:
        problems.append(Problem("overlap", (), f"{left} more pairs of blocks overlap"))
    return problems + size_problems(geometry, limits.size) + _piece_problems(geometry, limits)


def _shared_faces(geometry: Geometry) -> list[Problem]:
    on_face: dict[tuple[int, int], list[int]] = {}
    for placed in geometry.blocks:
        if not placed.two_ended:
            on_face.setdefault((placed.step.parent, placed.step.face_id), []).append(placed.id)
    problems = []
    for (parent, face), sharing in on_face.items():
        if len(sharing) > 1:
            message = (
                f"blocks {comma_list(sharing)} share face {face} of {geometry[parent].label}; "
                f"a face holds only one; {_free(geometry, parent)}"
            )
            problems.append(Problem("face_occupied", tuple(sharing), message))
    return problems


def _duplicate_connections(geometry: Geometry) -> list[Problem]:
    """Two-ended blocks of one type that join the same two faces, in either order."""
    joining: dict[tuple[int, frozenset[tuple[int, int]]], list[Placed]] = {}
    for placed in geometry.blocks:
        if placed.two_ended:
            joined = placed.type, frozenset(placed.step.attachments)
            joining.setdefault(joined, []).append(placed)
    problems = []
    for same in joining.values():
        if len(same) > 1:
            ids = tuple(placed.id for placed in same)
            faces = " and ".join(
                f"face {face} of {geometry[parent].label}"
                for parent, face in same[0].step.attachments
            )
            message = (
                f"blocks {comma_list(ids)} ({same[0].name}) join the same two faces, {faces}; "
                "only one block of a type may do so: attach the others elsewhere"
            )
            problems.append(Problem("duplicate_connection", ids, message))
    return problems


def _piece_problems(geometry: Geometry, limits: Limits) -> list[Problem]:
    most = limits.parts
    types = [library()[placed.type] for placed in geometry.blocks]
    if most is None or sum(each.parts + each.joint.moves for each in types) <= most:
        return []
    parts = largest_piece(geometry)
    return [size_of_piece(parts, most, limits.engine)] if parts > most else []


def overlap_message(geometry: Geometry, a: int, b: int, moved: Sequence[int] = ()) -> str:
    """How far two blocks overlap, and which faces are free of the parent of the later one, or of
    the first of those that were moved."""
    first, second = geometry[a], geometry[b]
    depth = " x ".join(str(extent) for extent in overlap_of(first, second))
    other, later = sorted((first, second), key=lambda each: (each.id in moved, each.id))
    chosen = geometry[moved[0]] if later.id in moved else later
    free = _free(geometry, chosen.step.parent)
    return f"{later.label} and {other.label} overlap by {depth} m; {free}"


def _free(geometry: Geometry, block_id: int) -> str:
    free = geometry.free_faces(block_id)
    more = f" and {len(free) - MAX_FACES} more" if len(free) > MAX_FACES else ""
    return f"free faces of block {block_id}: {comma_list(free[:MAX_FACES])}{more}"


def size_problems(
    geometry: Geometry, size_limit: tuple[float, float, float] = SIZE_LIMIT
) -> list[Problem]:
    """One problem per axis along which the machine, without plates, exceeds the size limit."""
    boxed = [block for block in geometry.blocks if block.shape and plate_of(block.type) is None]
    if not boxed:
        return []
    lo, hi = bounds(boxed)
    size = to_metres((hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]))
    problems = []
    for axis, (extent, limit) in enumerate(zip(size, size_limit, strict=True)):
        if extent <= limit:
            continue
        last = min(boxed, key=lambda placed: placed.lo[axis])
        first = max(boxed, key=lambda placed: placed.hi[axis])
        name = "xyz"[axis]
        message = (
            f"the machine is {extent} m along {name}, {round(extent - limit, 3)} m over the limit "
            f"of {limit} m; {last.label} extends furthest to {name}- and {first.label} to {name}+"
        )
        problems.append(Problem("size_limit", tuple(sorted({last.id, first.id})), message))
    return problems
