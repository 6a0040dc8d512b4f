"""What sensors read in a running world.

What is read most is written as lines of the function that flies a machine, as every call of another
function takes longer than the numbers themselves. They compute the same bits as `rotate_vector` and
`centre_of`: a factor of 0 adds nothing to a sum that begins with 0.0.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from math import atan2, degrees, hypot
from typing import Any

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
_AHEAD = {
    "x": (
        "v, t = -2 * {s} * y, 2 * {s} * z",
        ("{s} - z * t + y * v", "0.0 + w * v + x * t", "0.0 + w * t - x * v"),
    ),
    "y": (
        "u, t = 2 * {s} * y, -2 * {s} * x",
        ("0.0 + w * u - z * t", "{s} - y * u + x * t", "0.0 + w * t + z * u"),
    ),
    "z": (
        "u, v = -2 * {s} * z, 2 * {s} * x",
        ("0.0 + w * u + y * v", "0.0 + w * v - y * u", "{s} - x * v + z * u"),
    ),
}
"""Axis of a block -> lines that turn it, or its opposite, as `rotate_vector` does: `s` is 1 or -1,
and x, y, z and w are the rotation in the engine's frame."""
_VELOCITIES = {
    "x": "vx + (wy * (cy - pz) - wz * (cz - py))",
    "y": "vz + (wx * (cz - py) - wy * (cx - px))",
    "z": "vy + (wz * (cx - px) - wx * (cy - pz))",
}
_MOTION = """\
at = where[{number}]
if at:
    row, a, b, c = at
    px, py, pz, x, y, z, w, vx, vy, vz, wx, wy, wz = rows[row]
    cx, cy, cz = px, pz, py
    if a or b or c:
        u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
        cx += a + w * u + y * t - z * v
        cz += b + w * v + z * u - x * t
        cy += c + w * t + x * v - y * u"""
"""Lines that read the motion of a block that has not broken off, and its centre."""


class Senses:
    """Reads the sensors of one rollout."""

    def __init__(
        self,
        world: World,
        assembly: Assembly,
        scene: Scene,
        loads: Loads,
        pace: float,
        sensors: Sequence[Sensor],
    ) -> None:
        """Make what reads; `pace` is by how much the machine's own clock is slow."""
        self._world, self._assembly, self._scene = world, assembly, scene
        self._loads, self._pace, self._sensors = loads, pace, sensors
        own = {number: getattr(self, f"_{each.kind}", None) for number, each in enumerate(sensors)}
        self.reads: list[Read | None] = [
            make and make(sensors[number]) for number, make in own.items()
        ]
        """What reads each of the sensors that lines do not; None where one broke off."""
        plain = [each for each, make in zip(sensors, own.values(), strict=True) if not make]
        self._blocks = [*dict.fromkeys(each.block for each in plain)]
        self.where: list[tuple[int, float, float, float] | None] = [None for _ in self._blocks]
        """Where each block that senses is: the row of its cluster, and from there to its centre at
        rest, engine frame; None if it broke off."""
        self._lost = set[int]()

    def lines(self, disturbed: bool, name: Callable[[Any], str]) -> Iterator[str]:
        """Lines that read the sensors that work as `s0` and so on, each in the unit of its
        quantity, from `time`, `world`, `where`, `reads` and `first`, which is that of `Rays`."""
        yield "if world.now is not now:"
        yield "    now = locate()"
        numbered = [*enumerate(self._sensors)]
        if self._blocks:
            yield "rows = now.rows"
        for at, block in enumerate(self._blocks):
            yield from _MOTION.format(number=at).splitlines()
            for number, sensor in numbered:
                if sensor.block == block and self._is_plain(number):
                    *before, value = self._formula(sensor, name)
                    yield from (f"    {line}" for line in (*before, f"s{number} = {value}"))
        for number, _ in numbered:
            if not self._is_plain(number):
                yield f"if reads[{number}]:"
                yield f"    s{number} = reads[{number}](time)"
        for number, sensor in numbered if disturbed else ():
            plain = self._is_plain(number)
            place = f"where[{self._blocks.index(sensor.block)}]" if plain else f"reads[{number}]"
            yield f"if {place}:"
            yield f"    s{number} = disturb({number}, s{number})"

    def _is_plain(self, number: int) -> bool:
        return not hasattr(self, f"_{self._sensors[number].kind}")

    def _formula(self, sensor: Sensor, name: Callable[[Any], str]) -> tuple[str, ...]:
        """What reads a sensor, after lines before it."""
        axis = (sensor.axis or "z")[0]
        if sensor.kind == "height":
            return ("cy",)
        if sensor.kind == "target":
            return (f"{name(self._scene.target['xyz'.index(axis)])} - c{axis}",)
        if sensor.kind == "velocity":
            return (_VELOCITIES[axis],)
        turned = "y" if sensor.kind == "tilt" else axis
        before, found = _AHEAD[turned]
        sign = "-1.0" if sensor.axis and sensor.axis.endswith("-") else "1.0"
        ahead = [each.format(s=sign) for each in found]
        if sensor.kind == "distance":
            first = f"first(cx, cy, cz, {', '.join(ahead)})"
            return before.format(s=sign), f"e = {first}", f"e if e < {RANGE} else {RANGE}"
        side, along = ahead["xyz".index("x" if sensor.kind == "heading" else axis)], turned
        return before.format(s=sign), f"degrees(atan2({side}, {ahead['xyz'.index(along)]}))"

    def locate(self) -> object:
        """Find what senses, for as long as the machine does not split: what is valid so long."""
        now = self._world.now
        for number, block in enumerate(self._blocks):
            at = now.readings.row_of[block], *now.readings.centre_at[block]
            self.where[number] = None if block in self._lost else at
        return now

    def lose(self, blocks: Collection[int]) -> list[int]:
        """Let the sensors of these blocks keep their last reading; their numbers, unless they do
        already."""
        gone = [
            number
            for number, sensor in enumerate(self._sensors)
            if sensor.block in blocks and sensor.block not in self._lost and sensor.kind != "time"
        ]
        for number in gone:
            self.reads[number] = None
        self._lost.update(blocks)
        self.locate()
        return gone

    def _time(self, _: Sensor) -> Read:
        return lambda time: time / self._pace

    def _spin(self, sensor: Sensor) -> Read:
        row, block, axis = self._world.row, sensor.block, "xyz".index(sensor.axis or "x")
        return lambda _: degrees(swap_turn(row(block)[SPIN])[axis])

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
