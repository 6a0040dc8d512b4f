"""Loads on connections: filtering, utilisation and breakage."""

from collections.abc import Iterable, Mapping, Sequence
from math import exp, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from agentflow.env.physics.frames import WRENCH_ORDER
from agentflow.env.physics.model import Joint
from agentflow.env.physics.structure.load_sharing import LoadLoop, load_loops
from agentflow.env.physics.structure.spanning_tree import Link, Skeleton, skeleton
from agentflow.env.rollout import Array
from agentflow.machine.geometry.mobility import JAMMED

NEAR = 0.05
"""How near to its strength, as a share of it, the load of a marginal connection comes."""
SAFE = (1.0 - NEAR) ** 2 * (1.0 - 1e-9)
"""Sums of three squares of at most this are not a marginal load, however they are rounded."""


class _Plan(NamedTuple):
    """Load paths until the next breakage.

    `up` has the link of each part that hangs on another, `group` for each joint the first of those
    that share load with it.
    """

    loops: tuple[LoadLoop, ...]
    up: Mapping[int, Link]
    group: Sequence[int]
    skeleton: Skeleton


class Loads:
    """Low-pass filtered load of every joint, from 0 at the start.

    Impacts last one step, so their unfiltered forces grow with the step rate; a filter window of
    some hundredths of a second makes them comparable. Steps are not short compared with the window:
    of an impact in one step the filter passes 1 - exp(-step / window) over step / window, 68 % at
    60 Hz, 82 % at 120 Hz, 95 % at 480 Hz. Steps finer than the default are therefore weighted as
    parts of a default step; otherwise they would break connections that default steps do not.
    E connections: the breakable joints.
    """

    def __init__(
        self, joints: Sequence[Joint], window: float, step: float, usual: float = 0, count: int = 0
    ) -> None:
        """Start with nothing loaded.

        Args:
            joints: All joints of the assembly.
            window: Time constant of the filter, s; not 0.
            step: Time between readings, s.
            usual: The same at the default rate; longer steps keep their own weight.
            count: Of parts, if more than these joints connect.
        """
        self._joints = joints
        strength = [
            (joint.strength.force, joint.strength.torque) if joint.strength else (np.inf, np.inf)
            for joint in joints
        ]
        self._window, self._step, self._usual = window, step, usual
        self._per_strength = np.repeat(1.0 / np.array(strength).reshape(-1, 2), 3, axis=1)
        self._weights: dict[int, tuple[Array, Array]] = {}
        """By number of divisions: the weight of earlier loads, and of this step's over strength."""
        self.level, self._before, self._spare = np.zeros((3, len(joints), 6))
        """Filtered force and moment over strength (0 where it broke), a new array in each step; the
        same one step earlier; and scratch space."""
        self._foreseen = self.level[None]
        """(S, J, 6) loads after each of several parts of steps that were foreseen."""
        self._greatest: list[tuple[float, float]] = []
        """Of those to come, the last one first: the greatest square of a component and of a force
        or moment."""
        self._source = self.level
        """The array of their reactions: others are of steps that were not foreseen."""
        self.near: Mapping[int, float] = {}
        """The joints that nearly broke in the last step, and their load over strength."""
        self.peak = 0.0
        """Greatest component of a load over strength in the last step."""
        self.finite = True
        """Whether the last step's loads were finite; otherwise the simulation diverged."""
        self.failed: Mapping[int, Array] = {}
        """(6,) load over strength of each joint that broke in the last step, as it broke."""
        self._broken = np.zeros(len(joints), dtype=bool)
        self.connections = [i for i, joint in enumerate(joints) if joint.strength]
        """Joint index of each connection."""
        self._parts = max(count, *(1 + max(joint.a, joint.b) for joint in joints), 1)
        self._plan = self._make_plan()

    def _make_plan(self) -> _Plan:
        plan = skeleton(self._parts, self._joints, set(np.flatnonzero(self._broken).tolist()))
        loops = load_loops(self._joints, plan)
        group = list(range(len(self._joints)))
        for loop in loops:
            for joint in loop.joints.tolist():
                group[joint] = int(loop.joints[0])
        up = {link.part: link for link in plan.links}
        return _Plan(loops, up, group, plan)

    @property
    def locked(self) -> dict[int, str]:
        """Moving joints that cannot move, and why."""
        plan = self._plan.skeleton
        return {
            **dict.fromkeys(plan.locked, "rigid parts bridge it"),
            **dict.fromkeys(plan.jammed, JAMMED),
        }

    def _weigh(self, divisions: int) -> tuple[Array, Array]:
        if divisions not in self._weights:
            step = self._step / divisions
            whole = max(step, self._usual)
            share = round(1.0 - exp(-whole / self._window), 12)  # the last digits are the libm's
            blend = step / whole * share
            # NumPy converts a float in every operation, which takes longer than the operation
            self._weights[divisions] = np.array(1.0 - blend), blend * self._per_strength
        return self._weights[divisions]

    def filter(self, divisions: int) -> tuple[Array, float, Array] | None:
        """What filters the loads of parts of steps: the `level` before, the weight of earlier
        loads, and (J, 6) those of a part's; None where joints share load or there are none."""
        if self._plan.loops or not self._joints:
            return None
        keep, take = self._weigh(divisions)
        return self.level, float(keep), take

    def foresee(self, reactions: Array, levels: Array, squares: Array) -> None:
        """Keep what was filtered already, for `update` to find.

        Args:
            reactions: (S, J, 6) those that `update` will get.
            levels: (S, J, 6) after each.
            squares: (2, S) the greatest square of a component, and of a force or moment.
        """
        self._greatest = list(zip(*squares[:, ::-1].tolist(), strict=True))
        self._foreseen, self._source = levels, reactions

    def pass_over(self, steps: int) -> Array:
        """Go on by so many calm steps that were foreseen, at least one; (S, J, 6) `level` after
        each."""
        first = len(self._foreseen) - len(self._greatest)
        passed = self._foreseen[first : first + steps]
        self.level, self.peak, self.near = passed[-1], sqrt(self._greatest[-steps][0]), {}
        del self._greatest[-steps:]
        return passed

    def update(self, reactions: Array, divisions: int = 1) -> dict[int, float]:
        """Filter one step's loads and find the joints that break.

        Where an impact overloads several joints along one load path, only the one furthest from the
        root breaks. It relieves those between it and the root, so this step is not counted for
        them. Among joints that share load, the most loaded breaks; from the next step on the others
        share its load.

        Args:
            reactions: (J, 6) force and torque through each joint of the spanning trees.
            divisions: How many of these readings make a step.

        Returns:
            The joints that break and their load over strength, the most loaded first; none if a
            load is not finite (see `finite`).
        """
        if not self._joints:
            return {}
        if self._greatest and reactions.base is self._source:
            self._before, self.level = self.level, self._foreseen[-len(self._greatest)]
            square, most = self._greatest.pop()
            if not square <= most <= SAFE:  # as with NaN
                return self._judge(square, most)
            self.peak, self.near = sqrt(square), {}
            return {}
        self._greatest = []
        if self._plan.loops:
            reactions = reactions.copy()
            for loop in self._plan.loops:
                reactions[loop.joints] = loop.share(reactions)
        keep, take = self._weigh(divisions)
        level, before, spare = np.multiply(reactions, take), self.level, self._spare
        self.level, self._before = level, before
        np.multiply(before, keep, spare)
        np.add(level, spare, level)
        np.multiply(level, level, spare)
        square = spare.item(spare.argmax())  # max takes three times that
        return self._judge(square, 3 * square)

    def _judge(self, square: float, most: float) -> dict[int, float]:
        """As `update`, once loads are filtered: the greatest square of a component, and what that
        of a force or moment is at most, but for rounding."""
        level, before = self.level, self._before
        self.peak = sqrt(square)
        self.finite, self.near = isfinite(square), {}
        if most <= SAFE or not self.finite:
            return {}
        share = np.sqrt(self._squares().max(axis=1))
        most = np.maximum.reduce(share)
        if most >= 1.0 - NEAR:
            near = np.flatnonzero((share >= 1.0 - NEAR) & (share < 1.0)).tolist()
            self.near = {joint: float(share[joint]) for joint in near}
        if not most >= 1.0:
            return {}
        breaking = self._breaking_now(share)
        self.failed = {joint: level[joint].copy() for joint in breaking}
        relieved = self._relieved(breaking)
        level[relieved] = before[relieved]
        self.release(breaking)
        return {joint: float(share[joint]) for joint in breaking}

    def release(self, joints: Sequence[int]) -> None:
        """Drop joints that broke or were released; they no longer carry load."""
        self._greatest, self.level = [], self.level.copy()
        self.level[list(joints)] = 0.0
        self._broken[list(joints)] = True
        self._plan = self._make_plan()

    def _breaking_now(self, share: Array) -> list[int]:
        """The overloaded joints that break in this step."""
        over = sorted(np.flatnonzero(share >= 1.0).tolist(), key=lambda i: (-share[i], i))
        first: dict[int, int] = {}
        for joint in over:
            first.setdefault(self._plan.group[joint], joint)
        spared = {group for joint in first.values() for group in self._carriers(joint)}
        return [joint for group, joint in first.items() if group not in spared]

    def _carriers(self, joint: int) -> set[int]:
        """The groups on the paths from a joint to the root, without its own."""
        groups = set()
        for part in (self._joints[joint].a, self._joints[joint].b):
            while part in self._plan.up:
                link = self._plan.up[part]
                groups.add(self._plan.group[link.joint])
                part = link.parent
        return groups - {self._plan.group[joint]}

    def _relieved(self, gone: Iterable[int]) -> list[int]:
        """The joints for which this step is not counted, as others broke."""
        groups = {self._plan.group[joint] for joint in gone}
        for joint in gone:
            groups |= self._carriers(joint)
        return [joint for joint, group in enumerate(self._plan.group) if group in groups]

    def _squares(self) -> Array:
        """(J, 2) squares of force and of torque over strength."""
        level = self.level.take(WRENCH_ORDER, axis=1)  # recorded loads were summed in this order
        return np.asarray(np.add.reduce((level * level).reshape(-1, 2, 3), axis=2))

    def wrench(self, levels: Array, joint: int) -> Array:
        """(..., 6) force (N) and moment (N m) of a joint from its rows of `level`."""
        return np.asarray(levels / self._per_strength[joint])

    def utilisation(self) -> Array:
        """(E,) load over strength of each connection; nan where it broke."""
        share: Array = np.sqrt(self._squares()[self.connections].max(axis=1))
        share[self._broken[self.connections]] = np.nan
        return share
