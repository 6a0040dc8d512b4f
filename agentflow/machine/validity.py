"""Owns the verdict on a machine: file, space and task validity, with every problem named.

Reading is parse.py's, placing geometry.py's; this module judges and words.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.plates import plate_of
from agentflow.machine.blocks.types import Vec3
from agentflow.machine.brief import SIZE_LIMIT, Brief
from agentflow.machine.formats.connect import LocatedMachine
from agentflow.machine.formats.parse import Reading, file_problems, read_machine
from agentflow.machine.geometry.locks import locked_joints
from agentflow.machine.geometry.placement import Geometry, bounds, overlap_of, place
from agentflow.machine.geometry.pose import to_metres
from agentflow.machine.problems import Problem, block_label, comma_list
from agentflow.machine.tree import Machine

__all__ = [
    "Problem",
    "Report",
    "check",
    "overlap_message",
    "size_problems",
    "spatial_problems",
    "task_problems",
]

MAX_FACES = 24
"""Most free faces that are listed; plates have hundreds."""
MAX_OVERLAP_SENTENCES = 200
"""Most overlaps that get a problem of their own; all of them are in `Report.overlaps`."""


@dataclass(frozen=True)
class Report:
    """The verdict on one machine."""

    file_valid: bool
    spatial_valid: bool | None
    """None when not file-valid."""
    machine_valid: bool
    """File-valid and spatially valid."""
    repaired: bool
    """Whether the JSON had to be repaired."""
    problems: tuple[Problem, ...]
    """Every problem: of the file, of space, and of the task (`required_count`)."""
    overlaps: tuple[tuple[int, int], ...] = ()
    """Sorted id pairs whose boxes intersect."""
    size: Vec3 | None = None
    """Extent along x, y, z in metres; None when not file-valid."""
    task_valid: bool = False
    """Machine-valid and as the task demands; the same as `machine_valid` without a task."""
    machine: Machine | None = None
    """The machine that was judged; None when not file-valid."""
    notes: tuple[str, ...] = ()
    """What the reader passed over without harm."""

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What makes no machine invalid, but hardly anybody wants: joints that cannot move."""
        return () if self.machine is None else tuple(locked_joints(place(self.machine)))

    def to_json(self) -> dict[str, object]:
        """The report as JSON data with exactly the keys of spec 1.12."""
        return {
            "file_valid": self.file_valid,
            "spatial_valid": self.spatial_valid,
            "machine_valid": self.machine_valid,
            "repaired": self.repaired,
            "problems": [problem.to_json() for problem in self.problems],
            "overlaps": [list(pair) for pair in self.overlaps],
            "size": None if self.size is None else list(self.size),
        }


def check(
    source: Machine | Reading | LocatedMachine | str | Sequence[object], brief: Brief | None = None
) -> Report:
    """Judge a machine, a reading, any text, or JSON data. Never raises (spec 1.5).

    Args:
        source: what to judge. What was read was read under the task's block list already; text
            and data are read as a construction tree.
        brief: the task, for its block list, size limit and required blocks; without one the core
            types and the standard building volume.
    """
    if isinstance(source, LocatedMachine):
        return _check_located(source, brief)
    blocks, given = (None, None) if brief is None else (brief.blocks, brief.given)
    if isinstance(source, Machine):
        faults = tuple(file_problems(source.steps, blocks, given))
        reading = Reading(None if faults else source, problems=faults)
    else:
        reading = source if isinstance(source, Reading) else read_machine(source, blocks, given)
    machine = reading.machine
    if machine is None:
        problems = reading.problems
        return Report(False, None, False, reading.repaired, problems, notes=reading.notes)
    report = _check_space(place(machine), (), brief)
    return replace(report, repaired=reading.repaired, machine=machine, notes=reading.notes)


def _check_located(located: LocatedMachine, brief: Brief | None) -> Report:
    """Judge what was read from positions; blocks that hang on nothing are spatially invalid."""
    if located.problems:
        problems = (*located.problems, *located.loose)
        return Report(False, None, False, located.repaired, problems, notes=located.notes)
    report = _check_space(Geometry(located.blocks), located.loose, brief)
    machine = None if located.loose else located.machine
    return replace(report, repaired=located.repaired, machine=machine, notes=located.notes)


def _check_space(geometry: Geometry, loose: tuple[Problem, ...], brief: Brief | None) -> Report:
    """The verdict on file-valid blocks, whose ids may have gaps where some are loose."""
    limit = SIZE_LIMIT if brief is None else brief.size_limit
    spatial = (*loose, *spatial_problems(geometry, limit))
    demanded = () if brief is None else tuple(task_problems(geometry, brief))
    return Report(
        file_valid=True,
        spatial_valid=not spatial,
        machine_valid=not spatial,
        repaired=False,
        problems=spatial + demanded,
        overlaps=geometry.overlaps,
        size=geometry.size,
        task_valid=not spatial and not demanded,
    )


def task_problems(geometry: Geometry, brief: Brief) -> list[Problem]:
    """What a complete machine lacks or has too much of for the task (`required_count`)."""
    problems = []
    for kind, count in brief.required.items():
        found = tuple(placed.id for placed in geometry.blocks if placed.type == kind)
        if len(found) != count:
            need = f"exactly {count} block{'' if count == 1 else 's'} of type"
            message = f"the task demands {need} {library()[kind].label}; this has {len(found)}"
            problems.append(Problem("required_count", found, message))
    return problems


def spatial_problems(
    geometry: Geometry, size_limit: tuple[float, float, float] = SIZE_LIMIT
) -> list[Problem]:
    """Everything that keeps a file-valid machine from being spatially valid (spec 1.5)."""
    problems = _shared_faces(geometry)
    for a, b in geometry.overlaps[:MAX_OVERLAP_SENTENCES]:
        problems.append(Problem("overlap", (a, b), overlap_message(geometry, a, b)))
    left = len(geometry.overlaps) - MAX_OVERLAP_SENTENCES
    if left > 0:
        problems.append(Problem("overlap", (), f"{left} more pairs of blocks overlap"))
    return problems + size_problems(geometry, size_limit)


def _shared_faces(geometry: Geometry) -> list[Problem]:
    on_face = Counter(
        (placed.step.parent, placed.step.face_id)
        for placed in geometry.blocks
        if not placed.two_ended
    )
    problems = []
    for (parent, face), count in on_face.items():
        if count > 1:
            sharing = tuple(child for at, child in geometry.children_by_face(parent) if at == face)
            message = (
                f"blocks {comma_list(sharing)} hang on the same face {face} of "
                f"{block_label(parent, geometry[parent].type)}; a face carries one; "
                f"{_free(geometry, parent)}"
            )
            problems.append(Problem("face_occupied", sharing, message))
    return problems


def overlap_message(geometry: Geometry, a: int, b: int) -> str:
    """By how much two blocks overlap, and which faces the later one's parent still has free."""
    first, second = geometry[a], geometry[b]
    depth = " x ".join(str(extent) for extent in overlap_of(first, second))
    later, other = (second, first) if b > a else (first, second)
    return (
        f"{block_label(later.id, later.type)} and {block_label(other.id, other.type)} "
        f"overlap by {depth} m; {_free(geometry, later.step.parent)}"
    )


def _free(geometry: Geometry, block_id: int) -> str:
    free = geometry.free_faces(block_id)
    more = f" and {len(free) - MAX_FACES} more" if len(free) > MAX_FACES else ""
    return f"free faces of block {block_id}: {comma_list(free[:MAX_FACES])}{more}"


def size_problems(
    geometry: Geometry, size_limit: tuple[float, float, float] = SIZE_LIMIT
) -> list[Problem]:
    """One problem per axis along which the machine is larger than the building volume.

    A plate does not count.
    """
    boxed = [
        placed
        for placed in geometry.blocks
        if not placed.two_ended and plate_of(placed.type) is None
    ]
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
            f"of {limit} m; {block_label(last.id, last.type)} reaches furthest to {name}- and "
            f"{block_label(first.id, first.type)} to {name}+"
        )
        problems.append(Problem("size_limit", tuple(sorted({last.id, first.id})), message))
    return problems
