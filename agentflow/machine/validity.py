"""Validity of machines: file, space and task, with a problem for everything that is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import plate_of
from agentflow.machine.brief import SIZE_LIMIT, Brief, Limits
from agentflow.machine.controls import window_problems
from agentflow.machine.formats.parse import Reading, driving_problems, file_problems, read_machine
from agentflow.machine.geometry.pieces import largest_piece, locked_joints
from agentflow.machine.geometry.placement import Geometry, bounds, overlap_of, place
from agentflow.machine.geometry.pose import Placed, to_metres
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.problems import REQUIRED_COUNT, Problem, comma_list, size_of_piece
from agentflow.machine.requirements import Judged, unmet
from agentflow.machine.tree import Machine

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


@dataclass(frozen=True, eq=False, repr=False)
class ValidMachine(Machine):
    """A machine that `check` has found valid for a task; equal to the same machine without proof.

    It keeps its proof on the way to a worker process. A copy with other steps or controls has none.
    """

    _demands: tuple[object, ...] = field(default=(), init=False)

    @classmethod
    def proven(cls, machine: Machine, brief: Brief) -> ValidMachine:
        """The machine with the proof that it is valid for a task; only `check` gives it."""
        found = cls(machine.steps, machine.controls, machine.controllers)
        object.__setattr__(found, "_demands", brief.demands)
        return found

    def is_valid_for(self, brief: Brief) -> bool:
        """Whether the proof holds for this task, by its demands alone: its sentences may differ."""
        return self._demands == brief.demands


@dataclass(frozen=True, repr=False)
class Report:
    """The validity of one machine."""

    file_valid: bool
    """Whether the machine can be read: format, ids, faces."""
    spatial_valid: bool | None
    """None if not file-valid."""
    machine_valid: bool
    """File-valid and spatially valid."""
    repaired: bool
    """Whether the JSON had to be repaired."""
    problems: tuple[Problem, ...]
    """All problems: of the file, of space, and of the task (`task_problems`, and controls that it
    does not allow)."""
    overlaps: tuple[tuple[int, int], ...] = ()
    """Sorted id pairs of blocks whose boxes intersect."""
    size: Vec3 | None = None
    """Extent along x, y, z in metres; None if not file-valid."""
    task_valid: bool = False
    """Machine-valid and meets the task's demands; equals `machine_valid` without a task."""
    rules_met: bool | None = None
    """Whether it meets the task's own demands, whatever is wrong in space; None if not file-valid
    or without a task."""
    machine: Machine | None = None
    """The machine that was checked, a `ValidMachine` if it is valid for a task; None if not
    file-valid."""
    notes: tuple[str, ...] = ()
    """Harmless irregularities that the reader tolerated."""
    requirements: tuple[Judged, ...] = ()
    """Those of the task that need no simulation; () if not file-valid."""

    def __repr__(self) -> str:
        many = "problem" if len(self.problems) == 1 else "problems"
        how = "valid" if self.task_valid else f"{len(self.problems)} {many}"
        first = f": {self.problems[0].message}" if self.problems else ""
        return f"<Report {how}{first}>"

    @property
    def lasting_problems(self) -> tuple[Problem, ...]:
        """The problems that adding blocks cannot solve: all but a wrong required count."""
        return tuple(item for item in self.problems if item.code != REQUIRED_COUNT)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Requirements that are not met, joints that cannot move and blocks without length: legal,
        but rarely intended."""
        missed = tuple(unmet(self.requirements))
        if self.machine is None:
            return missed
        geometry = place(self.machine)
        return *missed, *locked_joints(geometry), *_points(geometry)

    def to_json(self) -> dict[str, object]:
        """The report as JSON data; notes, warnings and the machine are left out, and requirements
        where there are none."""
        judged = [item.to_json() for item in self.requirements]
        return {
            "file_valid": self.file_valid,
            "spatial_valid": self.spatial_valid,
            "machine_valid": self.machine_valid,
            "repaired": self.repaired,
            "problems": [problem.to_json() for problem in self.problems],
            "overlaps": [list(pair) for pair in self.overlaps],
            "size": None if self.size is None else list(self.size),
            **({"requirements": judged} if judged else {}),
        }


def check(
    source: Machine | Reading | str | Sequence[object] | Mapping[str, object],
    brief: Brief | None = None,
    limits: Limits | None = None,
) -> Report:
    """Check a machine, a reading, text, or JSON data. Never raises.

    Args:
        source: what to check. Text and JSON data are read as a construction tree; a reading must
            have been made with the task's block list.
        brief: the task, for its block list, limits and required blocks; the core types if None.
        limits: how large the machine may be; the brief's limits, or else the standard building
            volume, if None.
    """
    blocks, given = (None, None) if brief is None else (brief.blocks, brief.given)
    if isinstance(source, Machine):
        problems = file_problems(source.steps, blocks, given) or driving_problems(source)
        reading = Reading(source, problems=tuple(problems))
    else:
        reading = source if isinstance(source, Reading) else read_machine(source, blocks, given)
    if reading.machine is None or reading.problems:
        found = (*reading.problems, *reading.loose)
        return Report(False, None, False, reading.repaired, found, notes=reading.notes)
    geometry = Geometry(reading.blocks) if reading.blocks else place(reading.machine)
    limits = limits or (ANYWHERE if brief is None else brief.limits)
    spatial = (*reading.loose, *spatial_problems(geometry, limits))
    demanded: tuple[Problem, ...] = ()
    if brief is not None:
        window, senses = brief.limits.controls, brief.limits.senses
        unfit = window_problems(reading.machine, window, senses=senses)
        demanded = (*task_problems(geometry, brief), *unfit)
    task_valid = not spatial and not demanded
    machine = None if reading.loose else reading.machine
    if brief is not None and machine is not None and task_valid and limits == brief.limits:
        machine = _proven(machine, reading, brief)
    return Report(
        file_valid=True,
        spatial_valid=not spatial,
        machine_valid=not spatial,
        repaired=reading.repaired,
        problems=spatial + demanded,
        overlaps=geometry.overlaps,
        size=geometry.size,
        task_valid=task_valid,
        rules_met=None if brief is None else not demanded,
        machine=machine,
        notes=reading.notes,
        requirements=() if brief is None else brief.judge(geometry),
    )


def _proven(machine: Machine, reading: Reading, brief: Brief) -> Machine:
    """A valid machine with its proof, unless it was read from positions and begins wrongly."""
    # positions do not tell whether a machine begins with the given blocks
    wrong = reading.blocks and file_problems(machine.steps, brief.blocks, brief.given)
    return machine if wrong else ValidMachine.proven(machine, brief)


def problems_of(machine: Machine, brief: Brief) -> tuple[Problem, ...]:
    """Why a machine is not valid for a task; a proven one is not checked again."""
    if isinstance(machine, ValidMachine) and machine.is_valid_for(brief):
        return ()
    return check(machine, brief).problems


def task_problems(geometry: Geometry, brief: Brief) -> list[Problem]:
    """Too many blocks (`too_many_blocks`), and types with more or fewer blocks than the task
    requires (`required_count`)."""
    problems = budget_problems(len(geometry.blocks), brief)
    for kind, count in brief.required.items():
        found = tuple(placed.id for placed in geometry.blocks if placed.type == kind)
        if len(found) != count:
            need = f"exactly {count} block{'' if count == 1 else 's'} of type"
            message = f"the task requires {need} {library()[kind].label}; there are {len(found)}"
            problems.append(Problem(REQUIRED_COUNT, found, message))
    return problems


def budget_problems(total: int, brief: Brief) -> list[Problem]:
    """The problem of a machine of `total` blocks that has more than the task allows, if so."""
    count, most = brief.count_blocks(total), brief.limits.blocks
    if most is None or count <= most:
        return []
    besides = f" besides the {brief.uncounted} given" if brief.uncounted else ""
    message = (
        f"the machine has {count} blocks{besides}; this task allows at most {most}: "
        f"remove at least {count - most}"
    )
    return [Problem("too_many_blocks", (), message)]


def _points(geometry: Geometry) -> list[Problem]:
    """One warning (`no_length`) for each two-ended block whose ends are at the same point."""
    return [
        Problem(
            "no_length",
            (placed.id,),
            f"{placed.label} has no length: both its ends are at {to_metres(placed.at)}; attach "
            "it to faces at different places",
        )
        for placed in geometry.blocks
        if placed.two_ended and placed.at == placed.far
    ]
