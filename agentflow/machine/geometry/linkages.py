"""Mobility of loops of joints: which of their joints some finite motion of them all uses.

Joint rates that keep all loops closed at rest need not belong to a motion (three hinges in line
yield a little, then hold), and a joint may rest only at first (the slider of a crank at its dead
centre). So the joints are moved a little along such rates, then until all loops are closed again;
what then has not moved cannot move. Numbers that differ only in rounding give the same result: all
that is compared with a threshold is smaller or larger by orders of magnitude.
"""

from collections.abc import Iterator, Sequence
from random import Random

import numpy as np
from numpy.typing import NDArray

from agentflow.machine.geometry.joints import Loop, MovingJoint
from agentflow.machine.geometry.vectors import Vec3, cross, subtract

Array = NDArray[np.float64]
REACH = 0.05
"""rad or m, how far joints are moved: over 10 m, loops then open by centimetres."""
TRIES = 4
"""Random directions of motion; more than one, as several motions may branch off at rest."""
PASSES = 40
"""Of Newton's method. It halves what is not a motion in each, and closes other loops in about
five."""
MOVED = 1e-5
"""rad or m: joints that move do so by at least the square of `REACH`."""
CLOSED = 1e-9
"""rad or m: closed except for rounding."""
RANK = 1e-9
"""Singular values at rest are 0 except for rounding, or not less than about 1e-3."""


class _Screw:
    """One degree of freedom of a joint."""

    def __init__(self, kind: str, axis: Vec3, pivot: Vec3) -> None:
        self.axis, self.pivot = np.array(axis), np.array(pivot)
        self.turns = kind != "prismatic"
        x, y, z = axis
        self.across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        moment = self.across @ -self.pivot if self.turns else self.axis
        self.moment = moment
        """Velocity of the origin at rate 1."""

    def displacement(self, amount: float) -> tuple[Array, Array]:
        """Rotation and translation."""
        if not self.turns:
            return np.eye(3), amount * self.axis
        turn = np.eye(3) + np.sin(amount) * self.across
        turn += (1.0 - np.cos(amount)) * self.across @ self.across
        return turn, self.pivot - turn @ self.pivot


def used_joints(joints: Sequence[MovingJoint], loops: Sequence[Loop]) -> set[int]:
    """The joints that some motion that keeps all loops closed uses; in doubt, too many.

    Args:
        joints: All joints.
        loops: Independent loops that share joints.
    """
    involved = sorted({i for loop in loops for i, _ in loop})
    origin = joints[involved[0]].pivot
    owner: list[int] = []
    screws: list[_Screw] = []
    columns: dict[int, list[int]] = {}
    for i in involved:
        own = list(_screws(joints[i], origin))
        columns[i] = list(range(len(screws), len(screws) + len(own)))
        screws += own
        owner += [i] * len(own)
    steps = [
        [(k, sign) for i, sign in loop for k in (columns[i] if sign > 0 else columns[i][::-1])]
        for loop in loops
    ]
    moved = _moved(screws, steps)
    return {i for i, used in zip(owner, moved, strict=True) if used}


def _screws(joint: MovingJoint, origin: Vec3) -> Iterator[_Screw]:
    pivot = subtract(joint.pivot, origin)
    if joint.kind == "spherical":
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
            yield _Screw("revolute", axis, pivot)
    else:
        yield _Screw(joint.kind, joint.axis, pivot)


def _moved(screws: Sequence[_Screw], loops: Sequence[Loop]) -> NDArray[np.bool_]:
    """Whether each degree of freedom moves in some motion."""
    rest = np.zeros(len(screws))
    _, values, ways = np.linalg.svd(_closure(screws, loops, rest)[1])
    ways = ways[int((values > RANK * values[0]).sum()) :]
    moved = np.zeros(len(screws), dtype=bool)
    random = Random(1)
    for _ in range(TRIES if len(ways) else 0):
        way = np.array([random.gauss(0.0, 1.0) for _ in ways]) @ ways
        place = _close(screws, loops, REACH / np.abs(way).max() * way)
        if place is None:
            return np.ones(len(screws), dtype=bool)
        moved |= np.abs(place) > MOVED
        if moved.all():
            break
    return moved


def _close(screws: Sequence[_Screw], loops: Sequence[Loop], place: Array) -> Array | None:
    """The nearest joint positions that close the loops; None if none are found."""
    for _ in range(PASSES):
        gap, rates = _closure(screws, loops, place)
        change = np.linalg.lstsq(rates, -gap, rcond=RANK)[0]
        place = place + change
        if np.abs(change).max() < CLOSED * REACH:
            break
    gap, _ = _closure(screws, loops, place)
    return place if np.abs(gap).max() < CLOSED else None


def _closure(screws: Sequence[_Screw], loops: Sequence[Loop], place: Array) -> tuple[Array, Array]:
    """(6 L,) by how far loops are open, small angles; (6 L, n) its rates."""
    gap, rates = np.zeros(6 * len(loops)), np.zeros((6 * len(loops), len(screws)))
    moves = [screw.displacement(at) for screw, at in zip(screws, place, strict=True)]
    for row, loop in zip(range(0, len(gap), 6), loops, strict=True):
        turn, shift = np.eye(3), np.zeros(3)
        for k, sign in loop:
            own_turn, own_shift = moves[k]
            if sign < 0:
                own_turn, own_shift = own_turn.T, -own_turn.T @ own_shift
            if screws[k].turns:
                axis = turn @ screws[k].axis
                rates[row : row + 3, k] += sign * axis
                rates[row + 3 : row + 6, k] += sign * np.array(
                    cross(tuple(shift.tolist()), tuple(axis.tolist()))
                )
            rates[row + 3 : row + 6, k] += sign * (turn @ screws[k].moment)
            shift = turn @ own_shift + shift
            turn = turn @ own_turn
        # The skew part of a rotation by a small angle is that angle's vector: (R21 - R12) / 2, and
        # so on.
        gap[row : row + 3] = (turn[[2, 0, 1], [1, 2, 0]] - turn[[1, 2, 0], [2, 0, 1]]) / 2.0
        gap[row + 3 : row + 6] = shift
    return gap, rates
