"""Springs and winches, and the forces with which they pull two parts together.

On plain floats, written out: machines have few of them, arrays only pay for many, and calls would
take longer than what they compute.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, part_motion
from agentflow.env.physics.rows import Row
from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import Vec3, scale

RowPoint = tuple[int, Vec3]
"""Row of a cluster and offset from its leading part's centre, as `PartLocations.locate` gives."""


@dataclass(frozen=True)
class Spring:
    """Pulls the parts `a` and `b` together along the line between their centres, while its entry
    `starts` is on.

    The pull is gone at the length `natural` and grows to `force` over the length `ramp` beyond it;
    m, N and N s/m.
    """

    a: int
    b: int
    natural: float
    ramp: float
    force: float
    damping: float
    starts: Entry = "springs"


@dataclass(frozen=True)
class Winch:
    """A rope between the centres of the parts `a` and `b` that is reeled in while its entry
    `starts` is on, at `speed` and until it has its `shortest` length.

    It is strung, taut, when it is first switched on, and never pushes. It pulls with at most
    `force`: a greater load draws rope out. m, s and N.
    """

    a: int
    b: int
    speed: float
    shortest: float
    stiffness: float
    damping: float
    force: float
    starts: Entry = "winches"


class PullForce(ABC):
    """Pulls along lines between parts, and the work that they do.

    Engines change velocities, then move by the new ones. So in a step, a pull works over what its
    line gets shorter, less half a step of the change of its rate; the mean of the rates before and
    after would leave out that lines turn.

    It outlives splits of the machine: set up once per world, then call `locate_parts`.
    """

    def __init__(
        self, ends: Sequence[tuple[int, int]], levels: Mapping[Entry, float], step: float
    ) -> None:
        """Start with no pull; `ends` are the parts of each line, `levels` are read in every
        step."""
        self.parts, self._levels = ends, levels
        self.step = step
        """Time between calls, s."""
        self.ends: list[tuple[RowPoint, RowPoint]] = []
        self.pulled = [(0.0, 0.0)] * len(ends)
        """Of each line in the last step: its pull, N, and its length as the step began less `half`
        times the rate at which it grew then, m."""
        self.half = 0.0
        """Half the length of the last step, s."""
        self._noted: list[tuple[list[float], list[float]]] = []
        """Of each step, the work of each line in the step before, J, and the pull of each, N."""
        self._blocks: list[Array] = []
        """(S, 2, P) the same of steps before these."""

    def __bool__(self) -> bool:
        return bool(self.parts)

    def locate_parts(self, locations: PartLocations) -> None:
        """Locate the ends of the lines, after each split of the machine."""
        self.ends = [(locations.locate(a), locations.locate(b)) for a, b in self.parts]

    def works(self, rows: Sequence[Row]) -> Array:
        """(S + 1, P) work of each line until the end of each step, J; `rows` are those after the
        last step."""
        lines = [_line(rows, *ends) for ends in self.ends]
        last = [
            pull * (before - distance + self.half * rate) if pull else 0.0
            for (pull, before), (*_, distance, rate) in zip(self.pulled, lines, strict=True)
        ]
        works: Array = np.concatenate([self._gather()[:, 0], [last]]).cumsum(axis=0)
        return works

    @property
    def pulls(self) -> Array:
        """(S + 1, P) pull of each line in each step, N, after a row without any."""
        return np.concatenate([np.zeros((1, len(self.parts))), self._gather()[:, 1]])

    def _gather(self) -> Array:
        """(S, 2, P) all that was noted, which is kept as one array."""
        last = np.array(self._noted).reshape(-1, 2, len(self.parts))
        self._noted, self._blocks = [], [np.concatenate([*self._blocks, last])]
        return self._blocks[0]

    def catch_up(self, steps: Array, pulled: list[tuple[float, float]], half: float) -> None:
        """Note several steps: (S, 2, P) works and pulls, and `pulled` and `half` after the last."""
        if self._noted:
            self._gather()  # in order
        self._blocks.append(steps)
        self.pulled[:], self.half = pulled, half

    def _note(self, works: list[float], pulls: list[float]) -> None:
        """Keep the work of the step before and the pulls of this one."""
        self._noted.append((works, pulls))

    @abstractmethod
    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step."""


class SpringForce(PullForce):
    """Pull of all springs of a machine."""

    def __init__(
        self, springs: Sequence[Spring], levels: Mapping[Entry, float], step: float
    ) -> None:
        super().__init__([(each.a, each.b) for each in springs], levels, step)
        self._springs = springs

    @property
    def tuned(self) -> list[tuple[float, float, float, float, float]]:
        """Level, natural length, ramp, force and damping of each."""
        return [
            (self._level(each), each.natural, each.ramp, each.force, each.damping)
            for each in self._springs
        ]

    def _level(self, spring: Spring) -> float:
        return max(self._levels.get(spring.starts, 0.0), 0.0)  # springs cannot push

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step."""
        pulls, half, self.half = [], self.half, self.step / 2
        works, forces = ([0.0] * len(self._springs) for _ in range(2))
        for i, spring in enumerate(self._springs):
            level = self._level(spring)
            pull, before = self.pulled[i]
            if not (level or pull):
                continue
            at_a, at_b, along, distance, rate = _line(rows, *self.ends[i])
            works[i] = pull * (before - distance + half * rate)
            pull = 0.0
            stretch = min((distance - spring.natural) / spring.ramp, 1.0)
            if level and stretch > 0.0:
                pull = level * max(spring.force * stretch + spring.damping * rate, 0.0)
                pulls += opposite_forces(spring.a, at_a, spring.b, at_b, scale(along, pull))
            self.pulled[i], forces[i] = (pull, distance - self.half * rate), pull
        self._note(works, forces)
        return pulls


class WinchForce(PullForce):
    """Pull of all winches of a machine, and the length of each rope."""

    def __init__(
        self, winches: Sequence[Winch], levels: Mapping[Entry, float], step: float
    ) -> None:
        """Start with no rope strung; a level of -1 lets rope out."""
        super().__init__([(each.a, each.b) for each in winches], levels, step)
        self._winches = winches
        self._left: list[float | None] = [None] * len(winches)
        """Length of each rope, m; None until it is strung."""

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Reel in or out, then the forces in this step."""
        pulls, half, self.half = [], self.half, self.step / 2
        works, forces = ([0.0] * len(self._winches) for _ in range(2))
        for i, (winch, ends) in enumerate(zip(self._winches, self.ends, strict=True)):
            level, left = self._levels.get(winch.starts, 0.0), self._left[i]
            if left is None and not level:
                continue
            at_a, at_b, along, distance, rate = _line(rows, *ends)
            pull, before = self.pulled[i]
            works[i] = pull * (before - distance + half * rate)
            left = distance if left is None else left
            left = max(left - level * winch.speed * self.step, min(left, winch.shortest))
            left = self._left[i] = max(left, distance - winch.force / winch.stiffness)
            pull = 0.0
            if distance > left:
                pull = winch.stiffness * (distance - left) + winch.damping * rate
                pull = min(max(pull, 0.0), winch.force)
                pulls += opposite_forces(winch.a, at_a, winch.b, at_b, scale(along, pull))
            self.pulled[i], forces[i] = (pull, distance - self.half * rate), pull
        self._note(works, forces)
        return pulls


def _line(
    rows: Sequence[Row], one: RowPoint, other: RowPoint
) -> tuple[Vec3, Vec3, Vec3, float, float]:
    """Two points, the unit vector from one to the other, their distance and its rate of change."""
    at_a, (ux, uy, uz) = part_motion(rows[one[0]], one[1])
    at_b, (vx, vy, vz) = part_motion(rows[other[0]], other[1])
    x, y, z = at_b[0] - at_a[0], at_b[1] - at_a[1], at_b[2] - at_a[2]
    distance = max(sqrt(x * x + y * y + z * z), 1e-9)
    per = 1.0 / distance
    x, y, z = x * per, y * per, z * per
    return at_a, at_b, (x, y, z), distance, (vx - ux) * x + (vy - uy) * y + (vz - uz) * z


def opposite_forces(a: int, at_a: Vec3, b: int, at_b: Vec3, force: Vec3) -> list[PartForce]:
    """`force` on part `a` and its reaction on part `b`."""
    return [(a, force, at_a), (b, scale(force, -1.0), at_b)]
