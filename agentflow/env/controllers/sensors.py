"""What sensors read in a running world, as functions that are made once for a rollout."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import atan2, degrees, hypot

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


class Senses:
    """Makes the functions that read the sensors of one rollout."""

    def __init__(
        self, world: World, assembly: Assembly, scene: Scene, loads: Loads, pace: float
    ) -> None:
        """Make nothing yet; `pace` is by how much the machine's own clock is slow."""
        self._world, self._assembly, self._scene = world, assembly, scene
        self._loads, self._pace = loads, pace
        self._rays = Rays(scene, world)

    def read(self, sensor: Sensor) -> Read:
        """The function that reads a sensor, in the unit of its quantity."""
        made: Read = getattr(self, f"_{sensor.kind}")(sensor)
        return made

    def _time(self, _: Sensor) -> Read:
        return lambda time: time / self._pace

    def _height(self, sensor: Sensor) -> Read:
        world, block = self._world, sensor.block
        return lambda _: world.centre(block)[1]

    def _tilt(self, sensor: Sensor) -> Read:
        world, block, axis = self._world, sensor.block, "x z".index(sensor.axis or "z")

        def read(_: float) -> float:
            up = rotate_vector(world.turn(block), (0.0, 1.0, 0.0))
            return degrees(atan2(up[axis], up[1]))

        return read

    def _heading(self, sensor: Sensor) -> Read:
        world, block = self._world, sensor.block

        def read(_: float) -> float:
            x, _, z = rotate_vector(world.turn(block), (0.0, 0.0, 1.0))
            return degrees(atan2(x, z))

        return read

    def _velocity(self, sensor: Sensor) -> Read:
        world, block, axis = self._world, sensor.block, "xyz".index(sensor.axis or "x")
        return lambda _: world.velocity(block)[axis]

    def _spin(self, sensor: Sensor) -> Read:
        world, block, axis = self._world, sensor.block, "xyz".index(sensor.axis or "x")
        return lambda _: degrees(world.spin(block)[axis])

    def _target(self, sensor: Sensor) -> Read:
        world, block, axis = self._world, sensor.block, "xyz".index(sensor.axis or "x")
        place = self._scene.target[axis]
        return lambda _: place - world.centre(block)[axis]

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

    def _distance(self, sensor: Sensor) -> Read:
        world, block, ahead = self._world, sensor.block, AHEAD[sensor.axis or "z+"]
        rays = self._rays

        def read(_: float) -> float:
            way = rotate_vector(world.turn(block), ahead)
            return min(RANGE, rays.first(world.centre(block), way))

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
