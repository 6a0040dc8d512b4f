"""Owns what is read off the rows, in the game frame: poses, states, momentum.

Serves any engine whose frame is right-handed with z up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from agentflow.env.engines.base import Assembly, State
from agentflow.env.engines.frames import (
    swap,
    swap_all,
    swap_quaternion,
    swap_quaternions,
    swap_turns,
)
from agentflow.env.engines.kinematics import (
    POSITION,
    ROTATION,
    SPIN,
    VELOCITY,
    WIDTH,
    Row,
    carried,
    compose,
    cross,
    matrices,
    turn,
    turn_back,
)
from agentflow.env.engines.layout import Layout
from agentflow.env.engines.vectors import add, product, subtract, turned
from agentflow.env.scene import Quat, Vec3
from agentflow.env.trace import Array


class Readings:
    """Reads one layout's rows."""

    def __init__(self, assembly: Assembly, layout: Layout) -> None:
        self._assembly, self._layout = assembly, layout
        carriers = [parts[0] for parts in assembly.blocks]
        self._row = layout.members.row[carriers]
        leading = [assembly.parts[part].centre for part in layout.leading]
        self._leading: list[Vec3] = [leading[row] for row in self._row]
        self._centre_arms = self._arms(assembly.centres)
        self._origin_arms = self._arms(assembly.origins)
        self._rest = np.array(assembly.rotations).reshape(-1, 4)
        self._spanning = [block for block, _, _ in assembly.spans]
        ends = np.array([(a, b) for _, a, b in assembly.spans], dtype=np.intp).ravel()
        self._end_row, self._end_arms = layout.members.row[ends], layout.members.offset[ends]

    def _arms(self, points: Sequence[Vec3]) -> Array:
        """(N, 3) from the leading centres to points at rest, engine frame."""
        pairs = zip(points, self._leading, strict=True)
        return np.array([swap(subtract(point, lead)) for point, lead in pairs]).reshape(-1, 3)

    def parts(self, rows: Array) -> Array:
        """(P, 13) one row per part, engine frame."""
        members = self._layout.members
        return carried(rows[members.row], members.offset)

    def state(self, rows: Array) -> State:
        """Everything that a record holds."""
        blocks = rows[self._row]
        rotation = matrices(rows[:, ROTATION])[self._row]
        arms = turn(rotation, self._centre_arms)
        position = swap_all(blocks[:, POSITION] + turn(rotation, self._origin_arms))
        middle = swap_all(blocks[:, POSITION] + arms)
        velocity = swap_all(blocks[:, VELOCITY] + cross(blocks[:, SPIN], arms))
        length = np.zeros(0)
        if self._spanning:
            ends = carried(rows[self._end_row], self._end_arms).reshape(-1, 2, WIDTH)
            both = ends[:, 0] + ends[:, 1]
            position[self._spanning] = middle[self._spanning] = swap_all(both[:, POSITION] * 0.5)
            velocity[self._spanning] = swap_all(both[:, VELOCITY] * 0.5)
            line = ends[:, 0, POSITION] - ends[:, 1, POSITION]
            square = line * line
            length = np.sqrt(square[:, 0] + square[:, 1] + square[:, 2])
        things = rows[self._layout.thing_rows]
        return State(
            position=position,
            centre=middle,
            rotation=compose(swap_quaternions(blocks[:, ROTATION]), self._rest),
            velocity=velocity,
            angular_velocity=swap_turns(blocks[:, SPIN]),
            length=length,
            thing_position=swap_all(things[:, POSITION]),
            thing_rotation=swap_quaternions(things[:, ROTATION]),
            thing_velocity=swap_all(things[:, VELOCITY]),
        )

    def pose(self, rows: Sequence[Row], block: int) -> tuple[Vec3, Quat]:
        """Centre and orientation of a block."""
        place, rotation = self._point(rows, block, self._assembly.centres[block])
        return place, product(swap_quaternion(rotation), self._assembly.rotations[block])

    def origin(self, rows: Sequence[Row], block: int) -> Vec3:
        """Building point of a block."""
        return self._point(rows, block, self._assembly.origins[block])[0]

    def _point(self, rows: Sequence[Row], block: int, rest: Vec3) -> tuple[Vec3, Quat]:
        """Where a point of a block at rest is now, and the engine's turn since then."""
        x, y, z, a, b, c, w = rows[self._row[block]][:7]
        arm = swap(subtract(rest, self._leading[block]))
        return swap(add((x, y, z), turned((a, b, c, w), arm))), (a, b, c, w)

    def momentum(self, rows: Array) -> Mapping[str, Array]:
        """Total momentum (about the world's origin) and kinetic energy of the machine."""
        parts = self.parts(rows)
        mass = np.array([[part.mass] for part in self._assembly.parts])
        inertia = swap_all(np.array([part.inertia for part in self._assembly.parts]))
        rotation = matrices(parts[:, ROTATION])
        linear = mass * parts[:, VELOCITY]
        spin = turn_back(rotation, parts[:, SPIN])
        angular = cross(parts[:, POSITION], linear) + turn(rotation, inertia * spin)
        energy = linear * parts[:, VELOCITY] + inertia * spin * spin
        return {
            "linear": swap_all(linear.sum(axis=0)),
            "angular": swap_turns(angular.sum(axis=0)),
            "energy": np.array([energy.sum() / 2]),
        }
