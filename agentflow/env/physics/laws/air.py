"""Air drag and wind, in any right-handed frame.

Drag is computed with plain floats: a machine has few clusters, and arrays only pay for many.
"""

from collections.abc import Mapping, Sequence
from operator import mul

import numpy as np

from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, Wrench
from agentflow.env.physics.model import Part
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY, Row
from agentflow.env.rollout import Array
from agentflow.env.rotations import cross, matrices, turn, turn_back
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import Vec3, rotate_vector

_NONE = (0.0, 0.0, 0.0)


class DragForce:
    """Air drag, as one force and torque per cluster.

    Drag on a part is -m k v at its centre and -I c w, with its linear drag k and angular drag c.
    Over a rigid cluster this sums to a linear function of the velocity and spin of its leading
    part, with constant coefficients in the cluster's own axes.
    """

    def __init__(self, parts: Sequence[Part], locations: PartLocations, inertia: Array) -> None:
        """Sum the drag of `parts` over each cluster.

        Args:
            parts: All parts, in order.
            locations: Where their drag acts (`layout.drag_locations`).
            inertia: (P, 3) principal moments, engine frame.
        """
        laws: dict[int, list[float]] = {}
        for i, (part, moments) in enumerate(zip(parts, inertia.tolist(), strict=True)):
            row, (x, y, z) = locations.locate(i)
            law = laws.setdefault(row, [0.0] * 10)
            loss = part.mass * part.linear_drag
            spin = [moment * part.angular_drag for moment in moments]
            terms = (
                loss,
                loss * x,
                loss * y,
                loss * z,
                loss * (y * y + z * z) + spin[0],
                loss * (x * x + z * z) + spin[1],
                loss * (x * x + y * y) + spin[2],
                -loss * x * y,
                -loss * x * z,
                -loss * y * z,
            )
            for k, term in enumerate(terms):
                law[k] += term
        acting = [(row, law) for row, law in laws.items() if any(law)]
        self.isotropic = [(row, law[0], law[4]) for row, law in acting if _is_isotropic(law)]
        """Of clusters whose axes do not matter: row, loss per velocity and per spin."""
        self.general = [(row, law) for row, law in acting if not _is_isotropic(law)]
        """Of the others: row and coefficients."""
        self.rows = [row for row, _, _ in self.isotropic] + [row for row, _ in self.general]
        """Rows of the clusters that it acts on."""

    def power(self, rows: Sequence[Row]) -> float:
        """Rate at which it does work on the clusters, W; not above 0."""
        wrenches = zip(self.rows, self.turned(rows), strict=True)
        return sum(sum(map(mul, wrench, rows[row][VELOCITY.start :])) for row, wrench in wrenches)

    def turned(self, rows: Sequence[Row]) -> list[tuple[float, ...]]:
        """Force and torque on each cluster of `rows` in the engine's axes, as six numbers."""
        found: list[tuple[float, ...]] = []
        for row, local, force, torque in self(rows):
            moment = torque or _NONE
            if local:
                _, _, _, x, y, z, w, *_ = rows[row]
                turned = x, y, z, w
                force, moment = rotate_vector(turned, force), rotate_vector(turned, moment)
            found.append((*force, *moment))
        return found

    def __call__(self, rows: Sequence[Row]) -> list[Wrench]:
        """Force and torque on each cluster that has drag."""
        wrenches: list[Wrench] = []
        for row, loss, spin in self.isotropic:
            _, _, _, _, _, _, _, vx, vy, vz, wx, wy, wz = rows[row]
            force = (-loss * vx, -loss * vy, -loss * vz)
            torque = (-spin * wx, -spin * wy, -spin * wz) if spin else None
            wrenches.append((row, False, force, torque))
        for row, law in self.general:
            wrenches.append((row, True, *_local_drag(rows[row], law)))
        return wrenches


def _is_isotropic(law: Sequence[float]) -> bool:
    """Whether the axes of the cluster do not matter."""
    return law[4] == law[5] == law[6] and not any(law[1:4]) and not any(law[7:])


def _local_drag(row: Row, law: Sequence[float]) -> tuple[Vec3, Vec3]:
    """Force and torque in the cluster's own axes."""
    loss, sx, sy, sz, mxx, myy, mzz, mxy, mxz, myz = law
    _, _, _, x, y, z, w, vx, vy, vz, wx, wy, wz = row
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz, xw, yw, zw = x * y, x * z, y * z, x * w, y * w, z * w
    a, b, c = 1 - 2 * (yy + zz), 2 * (xy + zw), 2 * (xz - yw)
    d, e, f = 2 * (xy - zw), 1 - 2 * (xx + zz), 2 * (yz + xw)
    g, h, i = 2 * (xz + yw), 2 * (yz - xw), 1 - 2 * (xx + yy)
    ux, uy, uz = a * vx + b * vy + c * vz, d * vx + e * vy + f * vz, g * vx + h * vy + i * vz
    px, py, pz = a * wx + b * wy + c * wz, d * wx + e * wy + f * wz, g * wx + h * wy + i * wz
    force = (
        py * -sz + pz * sy - loss * ux,
        pz * -sx + px * sz - loss * uy,
        px * -sy + py * sx - loss * uz,
    )
    torque = (
        sz * uy - sy * uz - mxx * px - mxy * py - mxz * pz,
        sx * uz - sz * ux - mxy * px - myy * py - myz * pz,
        sy * ux - sx * uy - mxz * px - myz * py - mzz * pz,
    )
    return force, torque


class WindForce:
    """Wind on every part and object: 0.6 * area facing it * wind * (wind - velocity).

    At rest this is 0.6 * area * wind squared. In motion it is linear in the speed through the air,
    so a light breeze does little, and still air, which drag covers, nothing. If it grew with the
    square of that speed, the faintest breeze would brake all motion: 1 m/s would stop a 47 m throw.
    """

    def __init__(
        self,
        locations: PartLocations,
        extents: Array,
        wind: Array,
        drag: float,
        blocks: int | None = None,
    ) -> None:
        """Compute the areas of the boxes' sides.

        Args:
            locations: Of all parts and objects.
            extents: (P, 3) boxes that the wind sees, engine frame, m.
            wind: (3,) mean velocity of the air, engine frame, m/s.
            drag: Force over area times squared speed, kg/m3.
            blocks: How many of the first parts `power` counts; None for all.
        """
        self._locations, self._wind, self._drag, self._blocks = locations, wind, drag, blocks
        self._force: Array = np.zeros((1, 3))
        """On the parts that count, in the last step, N."""
        self.power = 0.0
        """Rate at which the wind does work between the last step and this one, W."""
        self._areas = extents[:, [1, 0, 0]] * extents[:, [2, 2, 1]]

    def __call__(self, rows: Array, strength: float = 1.0) -> list[PartForce]:
        """Forces on all parts, then on all objects, at `strength` times the mean wind."""
        row, rotation = self._locations.row, matrices(rows[:, ROTATION])
        arms, motion = turn(rotation.take(row, 0), self._locations.offset), rows.take(row, 0)
        velocity = motion[:, VELOCITY] + cross(motion[:, SPIN], arms)
        air = self._wind * strength
        facing = self._areas * np.abs(turn_back(rotation, air[None])).take(row, 0)
        push = self._drag * (facing[:, 0] + facing[:, 1] + facing[:, 2])
        force = push[:, None] * (air - velocity)
        own = force[: self._blocks]
        self.power = float(np.vdot(self._force + own, velocity[: self._blocks])) / 2
        self._force = own
        places = motion[:, POSITION] + arms
        return [
            (i, (x, y, z), (p, q, r))
            for i, ((x, y, z), (p, q, r)) in enumerate(
                zip(force.tolist(), places.tolist(), strict=True)
            )
        ]


class GustClock:
    """The strength of the wind from step to step; gusts count the time for which it has been on."""

    def __init__(self, scene: Scene, levels: Mapping[Entry, float], step: float) -> None:
        """Start the clock; `levels` of entries are read in every step."""
        self._scene, self._levels, self._time = scene, levels, 0.0
        self.step = step
        """Time between calls, s."""
        self.work = 0.0
        """What the wind did on the blocks, J."""

    def __call__(self) -> float:
        """Wind in this step as a share of the mean wind."""
        level = self._levels["wind"]
        if not level:
            return 0.0
        self._time += self.step
        return level * self._scene.strength(self._time - self.step)
