"""What sensors read in a running world."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import atan2, degrees, hypot
from typing import NamedTuple

from agentflow.env.controllers.rays import Rays
from agentflow.env.physics.engine import World
from agentflow.env.physics.frames import swap_quaternion, swap_turn
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly, Joint
from agentflow.env.physics.rows import ROTATION, SPIN
from agentflow.env.scene import Scene
from agentflow.machine.controllers.model import RANGE, Sensor
from agentflow.machine.geometry.vectors import Vec3, dot, inverse, product, rotate_vector, subtract

Read = Callable[[float], float]
"""The reading at a time, s since t = 0."""
AHEAD: Mapping[str, Vec3] = {
    "x+": (1.0, 0.0, 0.0),
    "y+": (0.0, 1.0, 0.0),
    "z+": (0.0, 0.0, 1.0),
    "x-": (-1.0, 0.0, 0.0),
    "y-": (0.0, -1.0, 0.0),
    "z-": (0.0, 0.0, -1.0),
}


class Sensed(NamedTuple):
    """A sensor in a rollout."""

    number: int
    kind: str
    block: int
    axis: int
    """Of three."""
    way: Vec3
    """What is turned with the block."""
    read: Read | None
    """What reads it; None: `Senses` does."""


class Senses:
    """Reads the sensors of one rollout."""

    def __init__(
        self, world: World, assembly: Assembly, scene: Scene, loads: Loads, pace: float
    ) -> None:
        """Make nothing yet; `pace` is by how much the machine's own clock is slow."""
        self._world, self._assembly, self._scene = world, assembly, scene
        self._loads, self._pace = loads, pace
        self._first, self._motion = Rays(scene, world).first, world.motion

    def prepared(self, sensors: Iterable[Sensor]) -> list[Sensed]:
        """The sensors, in their order."""
        return [
            Sensed(
                number,
                sensor.kind,
                sensor.block,
                "xyz".index((sensor.axis or "y")[0]),
                AHEAD[{"tilt": "y+", "distance": sensor.axis or ""}.get(sensor.kind, "z+")],
                own(sensor) if (own := getattr(self, f"_{sensor.kind}", None)) else None,
            )
            for number, sensor in enumerate(sensors)
        ]

    def __call__(self, time: float, sensors: Iterable[Sensed], readings: list[float]) -> None:
        """Read sensors into the list, each in the unit of its quantity.

        What is read most is written out here, as every call of another function takes longer than
        the numbers themselves: `rotate_vector` and `centre_of`.
        """
        motion, target, known = self._motion, self._scene.target, -1
        for number, kind, block, axis, way, read in sensors:
            if read is not None:
                readings[number] = read(time)
                continue
            if block != known:
                row, arm = motion(block)
                known = block
                px, py, pz, x, y, z, w, vx, vy, vz, wx, wy, wz = row
                a, b, c = arm
                if a or b or c:
                    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
                    a, b, c = (
                        a + w * u + y * t - z * v,
                        b + w * v + z * u - x * t,
                        c + w * t + x * v - y * u,
                    )
                centre = px + a, pz + c, py + b
            if kind == "height":
                readings[number] = centre[1]
            elif kind == "target":
                readings[number] = target[axis] - centre[axis]
            elif kind == "velocity":
                a, b, c = centre[0] - px, centre[2] - py, centre[1] - pz
                if axis == 0:
                    readings[number] = vx + (wy * c - wz * b)
                elif axis == 1:
                    readings[number] = vz + (wx * b - wy * a)
                else:
                    readings[number] = vy + (wz * a - wx * c)
            else:
                a, b, c = way
                u, v, t = 2 * (y * b - z * c), 2 * (x * c - y * a), 2 * (z * a - x * b)
                ahead = (
                    a + w * u - z * t + y * v,
                    b + w * v - y * u + x * t,
                    c + w * t - x * v + z * u,
                )
                if kind == "tilt":
                    readings[number] = degrees(atan2(ahead[axis], ahead[1]))
                elif kind == "heading":
                    readings[number] = degrees(atan2(ahead[0], ahead[2]))
                else:
                    distance = self._first(centre, ahead)
                    readings[number] = distance if distance < RANGE else RANGE

    def _time(self, _: Sensor) -> Read:
        return lambda time: time / self._pace

    def _spin(self, sensor: Sensor) -> Read:
        motion, block, axis = self._motion, sensor.block, "xyz".index(sensor.axis or "x")
        return lambda _: degrees(swap_turn(motion(block)[0][SPIN])[axis])

    def _angle(self, sensor: Sensor) -> Read:
        world, joint = self._world, self._joint(sensor.block, turns=True)
        axis, (a, b) = _sense(joint), (joint.a, joint.b)

        def read(_: float) -> float:
            one, other = (swap_quaternion(world.part(each)[ROTATION]) for each in (a, b))
            x, y, z, w = product(inverse(one), other)
            return (degrees(2.0 * atan2(dot((x, y, z), axis), w)) + 180.0) % 360.0 - 180.0

        return read

    def _turning(self, sensor: Sensor) -> Read:
        world, joint = self._world, self._joint(sensor.block, turns=True)
        axis, (a, b) = _sense(joint), (joint.a, joint.b)

        def read(_: float) -> float:
            one, other = world.part(a), world.part(b)
            along = rotate_vector(swap_quaternion(one[ROTATION]), axis)
            return degrees(dot(subtract(swap_turn(other[SPIN]), swap_turn(one[SPIN])), along))

        return read

    def _contact(self, sensor: Sensor) -> Read:
        world, block, last = self._world, sensor.block, 0.0

        def read(time: float) -> float:
            nonlocal last
            if any(isinstance(body, str) for body in world.touching(block)):
                last = time
            return time - last

        return read

    def _load(self, sensor: Sensor) -> Read:
        joint = self._assembly.joints.index(self._joint(sensor.block, turns=False))
        loads = self._loads

        def read(_: float) -> float:
            x, y, z, p, q, r = loads.level[joint].tolist()
            return max(hypot(x, y, z), hypot(p, q, r))

        return read

    def _joint(self, block: int, *, turns: bool) -> Joint:
        """The joint by which a block hangs on its parent."""
        return next(
            joint
            for joint in self._assembly.joints
            if joint.block == block and (joint.kind == "revolute" or not turns)
        )


def _sense(joint: Joint) -> Vec3:
    """The axis about which level 1 turns its block; its own axis if nothing drives it."""
    x, y, z = joint.axis
    return (-x, -y, -z) if joint.drive.speed < 0 else (x, y, z)
