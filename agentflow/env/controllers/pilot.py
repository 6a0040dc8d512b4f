"""The controllers of a machine in one rollout."""

from __future__ import annotations

import random
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Collection, Generator, Mapping
from functools import lru_cache
from math import atan2, degrees, nan
from typing import Any, NamedTuple

from agentflow.env.controllers.laws import law_lines
from agentflow.env.controllers.rays import Rays, meet_box
from agentflow.env.controllers.sensors import Senses, sensor_lines
from agentflow.env.physics.engine import World
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly
from agentflow.env.scene import Scene
from agentflow.machine.blocks.library import library
from agentflow.machine.controllers.model import FULL
from agentflow.machine.controls import PRECISION, following
from agentflow.machine.tree import Machine

SUDDEN = 0.25
"""Change of a level that counts as a switch, which steps must be fine for."""
SCALE = 10.0**PRECISION
"""Steps of a level that make 1."""
SAMPLE = 0.1
"""Time between samples of readings and outputs, s."""
_GIVEN = """\
world, reads, locate, goal, look, disturb, edges, entered, changes, samples"""
"""What belongs to one rollout."""
_FLY = """\
def fly({names}):
    sudden, time = True, None
    while True:
        while time is None:
            now, time = None, (yield ({readings}))
{lines}
        time = yield sudden
        sudden = False
"""
"""What flies a machine: a generator, as its own variables are faster than those that a function
keeps. Sent a time, it answers whether a level changed suddenly; sent None, with all readings, and
looks again at where everything is."""
_FOLLOW = """\
if o{law} != follows{at}:
    follows{at} = v = o{law}
{bounding}
{rounding}
    if v != level{at}:
        c = v - level{at}
        if c >= {sudden} or c <= -{sudden}:
            sudden = True
        level{at} = v
        for block in {blocks}:
            changes[block] = v"""
"""Lines that let blocks follow a law."""
_BOUNDING = """\
    v *= {scale}
    v = v if v < 1.0 else 1.0
    v = v if v > -1.0 else -1.0"""
"""Lines that make a level of an output; one within the limits of levels needs none."""
ROUNDING = f"""\
    c = v * {SCALE}
    e = c + {1.5 * 2.0**52} - {1.5 * 2.0**52}
    v = e / {SCALE} if e and -0.499 < c - e < 0.499 else round(v, {PRECISION})"""
"""Lines that round a level `v` as `round` does, in a third of its time: after such a sum, no float
has decimals."""


class Pilot:
    """Reads the sensors of a machine, and says which of its blocks get which level.

    One function does all of it, written for the machine: any call would take longer than what it
    computes. Its lines are of this package, and what a machine states are values that they use.
    """

    def __init__(
        self,
        machine: Machine,
        assembly: Assembly,
        world: World,
        scene: Scene,
        loads: Loads,
        interval: float,
        pace: float,
        sensing: tuple[float, int],
    ) -> None:
        """Make the function.

        Args:
            machine: One with controllers.
            assembly: The same in parts.
            world: Where it is.
            scene: The same as it is at the start.
            loads: On its joints.
            interval: Time between calls, s.
            pace: By how much the machine's own clock is slow.
            sensing: Noise, as a share of each reading, and delay, in readings.
        """
        controllers = machine.controllers
        assert controllers is not None
        self.controllers, self._assembly = controllers, assembly
        sensors, laws = controllers.sensors, controllers.laws
        self._senses = Senses(world, assembly, loads, pace, [*sensors.values()])
        self.edges: dict[str, list[float]] = {law: [] for law in laws}
        """Times at which each law came to a limit and left it again, in turns."""
        self.entered: dict[str, list[tuple[float, str]]] = {
            name: [(0.0, law.states[0].name)] if law.kind == "states" else []
            for name, law in laws.items()
        }
        """When each state machine entered which state."""
        self.changes: dict[Entry, float] = {}
        """Blocks whose level changed in the last call of `fly`, and their new levels."""
        self.lost: dict[str, tuple[float, float]] = {}
        """Time at which each sensor broke, s, and the last reading, which it keeps."""
        self.samples: list[float] = []
        """Of each, its time, all readings, and the outputs of all laws."""
        order, disturbed = ((*sensors,), (*laws,)), any(sensing)
        make, values, self.decouplers = _plan(machine, order, interval, pace, disturbed)
        rays = any(sensor.kind == "distance" for sensor in sensors.values())
        generator = make(
            world=world,
            reads=self._senses.reads,
            locate=self._senses.locate,
            goal=scene.target,
            look=Rays(scene, world).look if rays else None,
            disturb=_disturbance(len(sensors), *sensing) if disturbed else None,
            edges=[*self.edges.values()],
            entered=[*self.entered.values()],
            changes=self.changes,
            samples=self.samples,
            **values,
        )
        next(generator)
        self.fly: Callable[[float | None], Any] = generator.send
        """Reads all sensors and evaluates all laws at a time, s since t = 0. Whether a level
        changed so much that it counts as a switch; for None, all last readings instead."""

    def lose(self, time: float, gone: Collection[int]) -> None:
        """Let the sensors of blocks that are no longer connected to the Starting Block keep their
        last reading; `gone` are the joints that broke or let go."""
        apart = _attached(self._assembly, ()) - _attached(self._assembly, gone)
        names, readings = [*self.controllers.sensors], self.fly(None)
        for number in self._senses.lose(apart):
            self.lost[names[number]] = time, readings[number]


_Order = tuple[tuple[str, ...], tuple[str, ...]]
"""Names of sensors and of laws."""


class _Plan(NamedTuple):
    """What depends on the machine and how it is called alone."""

    make: Callable[..., Generator[Any, float | None, None]]
    """Makes what flies it."""
    values: Mapping[str, Any]
    """Some of what that is given, by name."""
    decouplers: frozenset[Entry]
    """Those among the blocks that follow laws."""


@lru_cache(4)
def _plan(machine: Machine, order: _Order, interval: float, pace: float, disturbed: bool) -> _Plan:
    """The plan of a machine with its sensors and laws in this order, in which equal machines may
    differ; kept, as rollouts of a machine follow one another."""
    assert machine.controllers is not None
    sensors = {name: machine.controllers.sensors[name] for name in order[0]}
    laws = {name: machine.controllers.laws[name] for name in order[1]}
    values: dict[str, Any] = {}

    def name(value: Any) -> str:
        values[f"n{len(values)}"] = value
        return f"n{len(values) - 1}"

    kept: dict[str, Any] = {f"s{number}": 0.0 for number in range(len(sensors))}
    lines = [*sensor_lines([*sensors.values()], disturbed, kept), "changes.clear()"]
    lines += law_lines(laws, sensors, interval, pace, name, kept)
    readings = "".join(f"s{number}, " for number in range(len(sensors)))
    outputs = "".join(f"o{number}, " for number in range(len(laws)))
    kept["due"] = 0.0
    followed, types = following(machine), library()
    for at, output in enumerate(machine.controllers.outputs):
        kept |= {f"follows{at}": nan, f"level{at}": nan}
        blocks = [block for block, group in followed.items() if group == at]
        low, high = laws[output.law].limits
        plain = output.scale == 1.0 and FULL[0] <= low and high <= FULL[1]
        lines += _FOLLOW.format(
            at=at,
            law=[*laws].index(output.law),
            bounding="" if plain else _BOUNDING.format(scale=name(output.scale)),
            rounding=ROUNDING,
            sudden=SUDDEN,
            blocks=name(blocks),
        ).splitlines()
    lines += [
        "if time >= due:",
        f"    due = time + {SAMPLE} - 1e-6",
        f"    samples.extend((time, {readings}{outputs}))",
    ]
    values |= kept
    text = _FLY.format(
        names=f"{_GIVEN}, {', '.join(values)}",
        lines="\n".join(f"        {line}" for line in lines),
        readings=readings,
    )
    decouplers = (block for block in followed if types[machine[block].type].group == "decouplers")
    return _Plan(_compiled(text), values, frozenset(decouplers))


@lru_cache(256)
def _compiled(text: str) -> Callable[..., Any]:
    """The generator of all machines with these lines."""
    made: dict[str, Any] = {
        each.__name__: each for each in (atan2, degrees, bisect_right, meet_box)
    }
    exec(text, made)  # lines of this package, with numbers that it gave names
    found: Callable[..., Any] = made["fly"]
    return found


def _disturbance(count: int, noise: float, delay: int) -> Callable[[int, float], float]:
    """What adds noise to the reading of a sensor, as a share of it, and delays it by some
    evaluations."""
    rng = random.Random("sensing")
    past = [deque[float](maxlen=delay + 1) for _ in range(count)]

    def disturb(number: int, reading: float) -> float:
        line = past[number]
        line.append(reading * (1.0 + noise * rng.gauss(0.0, 1.0)))
        return line[0]

    return disturb


def _attached(assembly: Assembly, gone: Collection[int]) -> set[int]:
    """Ids of the blocks that joints still connect to the Starting Block."""
    links: dict[int, list[int]] = {}
    for index, joint in enumerate(assembly.joints):
        if index not in gone:
            links.setdefault(joint.a, []).append(joint.b)
            links.setdefault(joint.b, []).append(joint.a)
    found, ahead = set[int](), [assembly.blocks[0][0]]
    while ahead:
        part = ahead.pop()
        if part not in found:
            found.add(part)
            ahead += links.get(part, ())
    return {block for block, parts in enumerate(assembly.blocks) if parts[0] in found}
