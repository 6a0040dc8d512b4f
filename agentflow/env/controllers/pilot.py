"""The controllers of a machine in one rollout."""

from __future__ import annotations

import random
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Collection
from functools import lru_cache
from math import atan2, degrees, nan
from typing import Any

from agentflow.env.controllers.laws import law_lines
from agentflow.env.controllers.rays import Rays
from agentflow.env.controllers.sensors import Senses
from agentflow.env.physics.engine import World
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly
from agentflow.env.scene import Scene
from agentflow.machine.blocks.library import library
from agentflow.machine.controls import PRECISION, following
from agentflow.machine.tree import Machine

SUDDEN = 0.25
"""Change of a level that counts as a switch, which steps must be fine for."""
SCALE = 10.0**PRECISION
"""Steps of a level that make 1."""
SAMPLE = 0.1
"""Time between samples of readings and outputs, s."""
_FLY = """\
def make({names}):
    def fly(time):
        nonlocal {kept}
{lines}
        return sudden

    def readings():
        return ({readings})

    return fly, readings
"""
"""What makes the function that flies a machine, and one that tells all readings."""
_FOLLOW = """\
if o{law} != follows{at}:
    follows{at} = o{law}
    v = {scale} * o{law}
    v = v if v < 1.0 else 1.0
    v = rounded(v if v > -1.0 else -1.0)
    if v != level{at}:
        if abs(v - level{at}) >= {sudden}:
            sudden = True
        level{at} = v
        for block in {blocks}:
            changes[block] = v"""
"""Lines that let blocks follow a law."""


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
        self._senses = Senses(world, assembly, scene, loads, pace, [*sensors.values()])
        self.edges: dict[str, list[float]] = {law: [] for law in laws}
        """Times at which each law came to a limit and left it again, in turns."""
        self.entered: dict[str, list[tuple[float, str]]] = {
            name: [(0.0, law.states[0].name)] for name, law in laws.items() if law.kind == "states"
        }
        """When each state machine entered which state."""
        followed, types = following(machine), library()
        self.decouplers = frozenset[Entry](
            block for block in followed if types[machine[block].type].group == "decouplers"
        )
        """Those among the blocks."""
        self.changes: dict[Entry, float] = {}
        """Blocks whose level changed in the last call of `fly`, and their new levels."""
        self.lost: dict[str, tuple[float, float]] = {}
        """Time at which each sensor broke, s, and the last reading, which it keeps."""
        self.samples: list[float] = []
        """Of each, its time, all readings, and the outputs of all laws."""
        noise, delay = sensing
        names: dict[str, Any] = {
            "world": world,
            "where": self._senses.where,
            "reads": self._senses.reads,
            "locate": self._senses.locate,
            "changes": self.changes,
            "samples": self.samples,
        }

        if any(sensor.kind == "distance" for sensor in sensors.values()):
            names["first"] = Rays(scene, world).first
        if noise or delay:
            names["disturb"] = _disturbance(len(sensors), noise, delay)

        def name(value: Any) -> str:
            names[f"n{len(names)}"] = value
            return f"n{len(names) - 1}"

        logs = {law: (self.edges[law], self.entered.get(law, [])) for law in laws}
        lines, kept = law_lines(laws, sensors, logs, interval, pace, name)
        readings = "".join(f"s{number}, " for number in range(len(sensors)))
        outputs = "".join(f"o{number}, " for number in range(len(laws)))
        kept |= {f"s{number}": 0.0 for number in range(len(sensors))}
        kept |= {"now": None, "due": 0.0}
        for at, output in enumerate(controllers.outputs):
            kept |= {f"follows{at}": nan, f"level{at}": nan}
            blocks = [block for block, group in followed.items() if group == at]
            lines += _FOLLOW.format(
                at=at,
                law=[*laws].index(output.law),
                scale=name(output.scale),
                sudden=SUDDEN,
                blocks=name(blocks),
            ).splitlines()
        whole = [
            *self._senses.lines(bool(noise or delay), name),
            "changes.clear()",
            "sudden = not samples",
            *lines,
            "if time >= due:",
            f"    due = time + {SAMPLE} - 1e-6",
            f"    samples.extend((time, {readings}{outputs}))",
        ]
        text = _FLY.format(
            names=", ".join([*names, *kept]),
            kept=", ".join(kept),
            lines="\n".join(f"        {line}" for line in whole),
            readings=readings,
        )
        self.fly: Callable[[float], bool]
        """Reads all sensors and evaluates all laws at a time, s since t = 0. Whether a level
        changed so much that it counts as a switch."""
        self.fly, self._readings = _compiled(text)(**names, **kept)

    def lose(self, time: float, gone: Collection[int]) -> None:
        """Let the sensors of blocks that are no longer connected to the Starting Block keep their
        last reading; `gone` are the joints that broke or let go."""
        apart = _attached(self._assembly, ()) - _attached(self._assembly, gone)
        names, readings = [*self.controllers.sensors], self._readings()
        for number in self._senses.lose(apart):
            self.lost[names[number]] = time, readings[number]


@lru_cache(256)
def _compiled(text: str) -> Callable[..., Any]:
    """The function that makes the functions of all machines with these lines."""
    used = atan2, degrees, bisect_right, rounded
    made: dict[str, Any] = {each.__name__: each for each in used}
    exec(text, made)  # lines of this package, with numbers that it gave names
    found: Callable[..., Any] = made["make"]
    return found


def rounded(level: float) -> float:
    """As `round` does, in half of its time."""
    scaled = level * SCALE
    near = int(scaled + 0.5) if level > 0.0 else int(scaled - 0.5)
    plain = near and -0.499 < scaled - near < 0.499
    return near / SCALE if plain else round(level, PRECISION)


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
