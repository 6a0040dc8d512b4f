"""The controllers of a machine in one rollout."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Collection, Iterable
from math import nan

from agentflow.env.controllers.laws import Laws
from agentflow.env.controllers.sensors import Senses
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Assembly
from agentflow.machine.controls import PRECISION, driven_blocks, following
from agentflow.machine.tree import Machine

SUDDEN = 0.25
"""Change of a level that counts as a switch, which steps must be fine for."""
SAMPLE = 0.1
"""Time between samples of readings and outputs, s."""


class Pilot:
    """Reads the sensors of a machine, and says which of its blocks get which level."""

    def __init__(
        self,
        machine: Machine,
        assembly: Assembly,
        senses: Senses,
        interval: float,
        pace: float,
        sensing: tuple[float, int],
    ) -> None:
        """Make all functions.

        Args:
            machine: One with controllers.
            assembly: The same in parts.
            senses: Makes what reads.
            interval: Time between calls, s.
            pace: By how much the machine's own clock is slow.
            sensing: Noise, as a share of each reading, and delay, in readings.
        """
        controllers = machine.controllers
        assert controllers is not None
        self.controllers, self._assembly = controllers, assembly
        sensors = controllers.sensors
        self._reads = [*map(senses.read, sensors.values())]
        self._working = [*range(len(sensors))]
        self._whole = _attached(assembly, ())
        self.readings = [0.0] * len(sensors)
        """Of each sensor, in their order."""
        self.laws = Laws(controllers.laws, sensors, self.readings, interval, pace)
        names, driven = [*controllers.laws], driven_blocks(machine)
        followed = following(machine)
        self.decouplers = frozenset[Entry](b for b in followed if driven[b] == "decouplers")
        """Those among the blocks."""
        self._groups = [
            (
                [block for block, at in followed.items() if at == number],
                names.index(output.law),
                output.scale,
            )
            for number, output in enumerate(controllers.outputs)
        ]
        self._levels = [nan] * len(self._groups)
        self._changes: dict[Entry, float] = {}
        noise, delay = sensing
        self._disturb = _disturbance(len(sensors), noise, delay) if noise or delay else None
        self.lost: dict[str, tuple[float, float]] = {}
        """Time at which each sensor broke, s, and the last reading, which it keeps."""
        self.samples: list[tuple[float, list[float], list[float]]] = []
        """Times, readings and outputs of laws."""
        self.sudden = False
        """Whether a level changed so much in the last call that it counts as a switch."""

    def __call__(self, time: float) -> dict[Entry, float]:
        """Blocks whose level changes now, and their new levels; the same object in every call."""
        readings, reads, changes, levels = self.readings, self._reads, self._changes, self._levels
        for sensor in self._working:
            readings[sensor] = reads[sensor](time)
        if self._disturb:
            self._disturb(readings, self._working)
        self.laws(time)
        outputs = self.laws.outputs
        changes.clear()
        self.sudden = not self.samples
        for at, (blocks, law, scale) in enumerate(self._groups):
            level = scale * outputs[law]
            level = level if level < 1.0 else 1.0
            level = round(level if level > -1.0 else -1.0, PRECISION)
            if level != levels[at]:
                self.sudden = self.sudden or abs(level - levels[at]) >= SUDDEN
                levels[at] = level
                for block in blocks:
                    changes[block] = level
        if not self.samples or time >= self.samples[-1][0] + SAMPLE - 1e-6:
            self.samples.append((time, [*readings], [*outputs]))
        return changes

    def lose(self, time: float, gone: Collection[int]) -> None:
        """Let the sensors of blocks that are no longer connected to the Starting Block keep their
        last reading; `gone` are the joints that broke or let go."""
        attached = _attached(self._assembly, gone)
        for number, (name, sensor) in enumerate(self.controllers.sensors.items()):
            broken = sensor.block in self._whole - attached and sensor.kind != "time"
            if broken and number in self._working:
                self._working.remove(number)
                self.lost[name] = time, self.readings[number]


def _disturbance(
    count: int, noise: float, delay: int
) -> Callable[[list[float], Iterable[int]], None]:
    """What adds noise to readings, as a share of each, and delays them by some evaluations."""
    rng = random.Random("sensing")
    past = [deque[float](maxlen=delay + 1) for _ in range(count)]

    def disturb(readings: list[float], working: Iterable[int]) -> None:
        for sensor in working:
            line = past[sensor]
            line.append(readings[sensor] * (1.0 + noise * rng.gauss(0.0, 1.0)))
            readings[sensor] = line[0]

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
