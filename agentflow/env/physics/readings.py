"""Poses, states and momentum of a machine from the rows of its clusters, in the game frame."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from math import atan2
from operator import itemgetter
from typing import Any

import numpy as np

from agentflow.env.physics.frames import (
    swap,
    swap_all,
    swap_quaternion,
    swap_quaternions,
    swap_turn,
    swap_turns,
)
from agentflow.env.physics.model import Assembly, Joint, Part, State
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY, WIDTH, Row, move_rows
from agentflow.env.physics.structure.layout import RowLayout
from agentflow.env.rollout import Array
from agentflow.env.rotations import compose, conjugate, cross, matrices, turn, turn_back
from agentflow.machine.geometry.vectors import (
    Quat,
    Vec3,
    add,
    dot,
    product,
    rotate_vector,
    subtract,
)


class Readings:
    """Reads the rows of one layout."""

    def __init__(self, assembly: Assembly, layout: RowLayout) -> None:
        self._assembly, self._layout = assembly, layout
        carriers = [parts[0] for parts in assembly.blocks]
        self._row = layout.locations.row[carriers]
        self.row_of: list[int] = self._row.tolist()
        """Row of the cluster that each block belongs to."""
        leading = [assembly.parts[layout.leading[row]].centre for row in self.row_of]
        self.centre_at = _arms(assembly.centres, leading)
        """From the centre of each block's cluster to its own, at rest, engine frame, m."""
        self._origin_at = _arms(assembly.origins, leading)
        self._centre_arms = np.array(self.centre_at).reshape(-1, 3)
        self._origin_arms = np.array(self._origin_at).reshape(-1, 3)
        self._rest = np.array(assembly.rotations).reshape(-1, 4)
        self._spanning = [block for block, _, _ in assembly.spans]
        ends = np.array([(a, b) for _, a, b in assembly.spans], dtype=np.intp).ravel()
        self._end_row, self._end_arms = layout.locations.row[ends], layout.locations.offset[ends]

    def parts(self, rows: Array) -> Array:
        """(P, 13) one row per part, engine frame."""
        locations = self._layout.locations
        return move_rows(rows[locations.row], locations.offset)

    def state(self, rows: Array) -> State:
        """The state at one time, from (C, 13) rows."""
        one = self.states(rows[None])
        return State(**{name: values[0] for name, values in vars(one).items()})

    def states(self, tables: Array) -> State:
        """States at several times from (T, C, 13) rows, with a leading axis of times."""
        count = len(tables)
        blocks = tables[:, self._row].reshape(-1, WIDTH)
        clusters = matrices(tables.reshape(-1, WIDTH)[:, ROTATION]).reshape(count, -1, 3, 3)
        rotation = clusters[:, self._row].reshape(-1, 3, 3)
        arms = turn(rotation, np.tile(self._centre_arms, (count, 1)))
        to_origins = turn(rotation, np.tile(self._origin_arms, (count, 1)))

        def by_time(flat: Array) -> Array:
            return flat.reshape(count, -1, flat.shape[1])

        position = by_time(swap_all(blocks[:, POSITION] + to_origins))
        middle = by_time(swap_all(blocks[:, POSITION] + arms))
        velocity = by_time(swap_all(blocks[:, VELOCITY] + cross(blocks[:, SPIN], arms)))
        rest = np.tile(self._rest, (count, 1))
        ends = tables[:, self._end_row].reshape(-1, WIDTH)
        ends = move_rows(ends, np.tile(self._end_arms, (count, 1)))
        one, other = by_time(ends[0::2]), by_time(ends[1::2])
        halves = swap_all((one + other)[:, :, POSITION] * 0.5)
        position[:, self._spanning] = middle[:, self._spanning] = halves
        velocity[:, self._spanning] = swap_all((one + other)[:, :, VELOCITY] * 0.5)
        line = (one - other)[:, :, POSITION]
        square = line * line
        objects = self._objects(tables)
        return State(
            position=position,
            centre=middle,
            rotation=by_time(compose(swap_quaternions(blocks[:, ROTATION]), rest)),
            velocity=velocity,
            angular_velocity=by_time(swap_turns(blocks[:, SPIN])),
            length=np.sqrt(square[:, :, 0] + square[:, :, 1] + square[:, :, 2]),
            object_position=swap_all(objects[:, :, POSITION]),
            object_rotation=swap_quaternions(objects[:, :, ROTATION]),
            object_velocity=swap_all(objects[:, :, VELOCITY]),
        )

    def _objects(self, tables: Array) -> Array:
        """(T, M, 13) rows of the moving objects, at their centres."""
        rows = tables[:, self._layout.object_rows]
        arms = self._layout.object_arms
        if not arms.any():
            return rows
        moved = move_rows(rows.reshape(-1, WIDTH), np.tile(arms, (len(tables), 1)))
        return moved.reshape(rows.shape)

    def centres(self, rows: Array) -> Array:
        """(N, 3) block centres, m: faster than `state`."""
        blocks = rows[self._row]
        centres = blocks[:, POSITION] + turn(matrices(blocks[:, ROTATION]), self._centre_arms)
        if self._spanning:
            ends = move_rows(rows[self._end_row], self._end_arms)
            centres[self._spanning] = (ends[0::2] + ends[1::2])[:, POSITION] * 0.5
        return swap_all(centres)

    def origin(self, row: Row, block: int) -> Vec3:
        """Building point of a block, from the row of its cluster."""
        x, y, z, a, b, c, w, _, _, _, _, _, _ = row
        return swap(add((x, y, z), rotate_vector((a, b, c, w), self._origin_at[block])))

    def rotation(self, row: Row, block: int) -> Quat:
        """Orientation of a block, from the row of its cluster."""
        return product(swap_quaternion(row[ROTATION]), self._assembly.rotations[block])

    def energies(
        self, rows: Array, masses: Sequence[float], inertias: Sequence[Vec3], gravity: float
    ) -> Array:
        """As `engine.World.energies`.

        Args:
            rows: (C, 13) the state.
            masses: Of the moving objects, kg.
            inertias: Their principal moments, engine frame, kg m2.
            gravity: m/s2.
        """
        own = self._assembly.parts
        parts = np.concatenate([self.parts(rows), rows[self._layout.object_rows]])
        mass = np.array([*(part.mass for part in own), *masses])
        inertia = np.array([*(swap(part.inertia) for part in own), *inertias]).reshape(-1, 3)
        spin = turn_back(matrices(parts[:, ROTATION]), parts[:, SPIN])
        kinetic = mass * (parts[:, VELOCITY] ** 2).sum(axis=1) + (inertia * spin**2).sum(axis=1)
        each = np.stack([kinetic / 2, mass * gravity * parts[:, POSITION][:, 2]], axis=1)
        blocks = np.zeros((len(self._assembly.blocks), 2))
        np.add.at(blocks, [part.block for part in own], each[: len(own)])
        return np.concatenate([blocks, each[len(own) :]])

    def momentum(self, rows: Array) -> Mapping[str, Array]:
        """As `engine.World.momentum`."""
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


def states_of(snapshots: Sequence[tuple[Readings, Any]]) -> State:
    """At least one snapshot, each (C, 13) rows and what reads them, as states with a leading axis
    of times; those between two splits are computed at once."""
    stretches = []
    for readings, stretch in groupby(snapshots, key=itemgetter(0)):
        tables = np.array([rows for _, rows in stretch])
        stretches.append(vars(readings.states(tables)))
    return State(
        **{name: np.concatenate([each[name] for each in stretches]) for name in stretches[0]}
    )


def _arms(points: Sequence[Vec3], leading: Sequence[Vec3]) -> list[Vec3]:
    """Vectors from the leading centres to points, at rest, engine frame."""
    return [swap(subtract(point, lead)) for point, lead in zip(points, leading, strict=True)]


def relative_motion(parent: Array, child: Array) -> tuple[Quat, Vec3]:
    """Orientation and spin of a child row relative to its parent's, in the joint's frame."""
    rotation = compose(conjugate(parent[None, ROTATION]), child[None, ROTATION])
    spin = turn_back(matrices(child[None, ROTATION]), (child[SPIN] - parent[SPIN])[None])
    x, y, z, w = rotation[0].tolist()
    p, q, r = spin[0].tolist()
    return (x, y, z, w), (p, q, r)


def joint_motion(joint: Joint, parts: Sequence[Part], rows: Array) -> tuple[float, float]:
    """Position and velocity of a revolute or prismatic joint, from the motion of its parts.

    For joints that closed a loop; of joints in trees, engines know the positions.
    `rows` are (P, 13), one per part.
    """
    if joint.kind == "revolute":
        axis = swap_turn(joint.axis)
        (x, y, z, w), spin = relative_motion(rows[joint.a], rows[joint.b])
        return 2.0 * atan2(dot((x, y, z), axis), w), dot(spin, axis)
    ends = [
        move_rows(rows[None, i], np.array([swap(subtract(joint.pivot, parts[i].centre))]))
        for i in (joint.a, joint.b)
    ]
    base, apart = matrices(rows[None, joint.a, ROTATION]), ends[1] - ends[0]
    axis = swap(joint.axis)
    along = turn_back(base, apart[:, POSITION])[0].tolist()
    speed = turn_back(base, apart[:, VELOCITY])[0].tolist()
    return dot(along, axis), dot(speed, axis)
