"""What sensors read in a running world.

What is read most is written as lines of the function that flies a machine, as every call of another
function takes longer than the numbers themselves. They compute the same bits as `rotate_vector` and
`centre_of`: a factor of 0 adds nothing to a sum that begins with 0.0.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from math import atan2, degrees, hypot
from typing import Any

from agentflow.env.controllers.rays import ray_lines
from agentflow.env.physics.engine import World
from agentflow.env.physics.frames import swap_quaternion, swap_turn
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly, Joint
from agentflow.env.physics.rows import ROTATION, SPIN
from agentflow.machine.controllers.model import Sensor
from agentflow.machine.geometry.vectors import Vec3, dot, inverse, product, rotate_vector, subtract

Read = Callable[[float], float]
"""The reading at a time, s since t = 0."""
_AHEAD = {
    "x": (
        ("v = -2.0 * {s} * y", "t = 2.0 * {s} * z"),
        ("{s} - z * t + y * v", "0.0 + w * v + x * t", "0.0 + w * t - x * v"),
    ),
    "y": (
        ("u = 2.0 * {s} * y", "t = -2.0 * {s} * x"),
        ("0.0 + w * u - z * t", "{s} - y * u + x * t", "0.0 + w * t + z * u"),
    ),
    "z": (
        ("u = -2.0 * {s} * z", "v = 2.0 * {s} * x"),
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
if row# is not None:
    px, py, pz, x, y, z, w, vx, vy, vz, wx, wy, wz = rows[row#]
    if b# and not (a# or c#):
        u = -2.0 * (z * b#)
        t = 2.0 * (x * b#)
        cx = px + (w * u + y * t)
        cz = py + (b# + z * u - x * t)
        cy = pz + (w * t - y * u)
    elif a# or b# or c#:
        u = 2.0 * (y * c# - z * b#)
        v = 2.0 * (z * a# - x * c#)
        t = 2.0 * (x * b# - y * a#)
        cx = px + (a# + w * u + y * t - z * v)
        cz = py + (b# + w * v + z * u - x * t)
        cy = pz + (c# + w * t + x * v - y * u)
    else:
        cx, cy, cz = px, pz, py"""
"""Lines that read the motion of a block that has not broken off, and its centre; those straight
ahead of the middle of their cluster, as sensors often are, need half of the products."""


def sensor_lines(sensors: Sequence[Sensor], disturbed: bool, kept: dict[str, Any]) -> Iterator[str]:
    """Lines that read the sensors that work as `s0` and so on, each in the unit of its quantity.

    They use `time`, `world`, `goal`, the target of the scene, `reads` and `locate` of `Senses`,
    `disturb`, which adds noise and delay, and what `ray_lines` use. What they keep is added to
    `kept`, by name; once `now` of that is None, they locate the blocks again.
    """
    numbered, blocks = [*enumerate(sensors)], _blocks(sensors)
    if blocks:
        numbers = range(len(blocks))
        kept |= {"now": None, **{f"{each}{at}": None for each in ("row", *"abc") for at in numbers}}
        places = (f"(row{at}, a{at}, b{at}, c{at})" for at in numbers)
        yield "if world.now is not now:"
        yield f"    now, {', '.join(places)} = locate()"
        yield "rows = now.rows"
    for at, block in enumerate(blocks):
        yield from _MOTION.replace("#", str(at)).splitlines()
        for number, sensor in numbered:
            if sensor.block == block and _is_plain(sensor):
                *before, value = _formula(number, sensor, kept)
                yield from (f"    {line}" for line in (*before, f"s{number} = {value}"))
    for number, sensor in numbered:
        if not _is_plain(sensor):
            yield f"if reads[{number}]:"
            yield f"    s{number} = reads[{number}](time)"
    for number, sensor in numbered if disturbed else ():
        plain = _is_plain(sensor)
        place = f"row{blocks.index(sensor.block)}" if plain else f"reads[{number}]"
        yield f"if {place} is not None:"
        yield f"    s{number} = disturb({number}, s{number})"


def _blocks(sensors: Sequence[Sensor]) -> list[int]:
    """The blocks whose motion lines read."""
    return [*dict.fromkeys(each.block for each in sensors if _is_plain(each))]


def _is_plain(sensor: Sensor) -> bool:
    """Whether lines read it."""
    return not hasattr(Senses, f"_{sensor.kind}")


def _formula(number: int, sensor: Sensor, kept: dict[str, Any]) -> tuple[str, ...]:
    """What reads the sensor with this number, after lines before it."""
    axis = (sensor.axis or "z")[0]
    if sensor.kind == "height":
        return ("cy",)
    if sensor.kind == "target":
        return (f"goal[{'xyz'.index(axis)}] - c{axis}",)
    if sensor.kind == "velocity":
        return (_VELOCITIES[axis],)
    turned = "y" if sensor.kind == "tilt" else axis
    lines, found = _AHEAD[turned]
    sign = "-1.0" if sensor.axis and sensor.axis.endswith("-") else "1.0"
    before, ahead = ([each.format(s=sign) for each in some] for some in (lines, found))
    if sensor.kind == "distance":
        return *before, *map("{} = {}".format, "ijk", ahead), *ray_lines(number, kept), "e"
    side, along = ahead["xyz".index("x" if sensor.kind == "heading" else axis)], turned
    return *before, f"degrees(atan2({side}, {ahead['xyz'.index(along)]}))"


class Senses:
    """Reads the sensors of one rollout."""

    def __init__(
        self,
        world: World,
        assembly: Assembly,
        loads: Loads,
        pace: float,
        sensors: Sequence[Sensor],
    ) -> None:
        """Make what reads; `pace` is by how much the machine's own clock is slow."""
        self._world, self._assembly = world, assembly
        self._loads, self._pace, self._sensors = loads, pace, sensors
        self.reads: list[Read | None] = [
            None if _is_plain(each) else getattr(self, f"_{each.kind}")(each) for each in sensors
        ]
        """What reads each of the sensors that lines do not; None where one broke off."""
        self._blocks = _blocks(sensors)
        self._lost = set[int]()

    def locate(self) -> tuple[Any, ...]:
        """What is valid for as long as the machine does not split, and for each block that senses
        the row of its cluster, None if it broke off, and from there to its centre at rest, engine
        frame, m."""
        now = self._world.now
        rows = (None if each in self._lost else now.readings.row_of[each] for each in self._blocks)
        arms = (now.readings.centre_at[each] for each in self._blocks)
        return now, *((row, *arm) for row, arm in zip(rows, arms, strict=True))

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
