"""The controllers of a machine in one rollout."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Collection, Iterable
from math import nan

from agentflow.env.controllers.laws import Laws
from agentflow.env.controllers.sensors import Sensed, Senses
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Assembly
from agentflow.machine.controls import PRECISION, driven_blocks, following
from agentflow.machine.tree import Machine

SUDDEN = 0.25
"""Change of a level that counts as a switch, which steps must be fine for."""
SCALE = 10.0**PRECISION
"""Steps of a level that make 1."""
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
        self._senses, self._working = senses, senses.prepared(sensors.values())
        """What reads, and the sensors that have not broken off."""
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
                number,
                [block for block, at in followed.items() if at == number],
                names.index(output.law),
                output.scale,
            )
            for number, output in enumerate(controllers.outputs)
        ]
        self._followed, self._levels = [nan] * len(self._groups), [nan] * len(self._groups)
        """Output of the law of each group in the last call, and its level."""
        self._changes: dict[Entry, float] = {}
        noise, delay = sensing
        self._disturb = _disturbance(len(sensors), noise, delay) if noise or delay else None
        self.lost: dict[str, tuple[float, float]] = {}
        """Time at which each sensor broke, s, and the last reading, which it keeps."""
        self.samples: list[tuple[float, list[float], list[float]]] = []
        """Times, readings and outputs of laws."""
        self._due = 0.0
        """When the next sample is, s."""
        self.sudden = False
        """Whether a level changed so much in the last call that it counts as a switch."""

    def __call__(self, time: float) -> dict[Entry, float]:
        """Blocks whose level changes now, and their new levels; the same object in every call."""
        readings, levels, followed = self.readings, self._levels, self._followed
        self._senses(time, self._working, readings)
        if self._disturb:
            self._disturb(readings, self._working)
        self.laws(time)
        outputs, changes = self.laws.outputs, self._changes
        changes.clear()
        self.sudden = not self.samples
        for at, blocks, law, scale in self._groups:
            output = outputs[law]
            if output == followed[at]:
                continue
            followed[at], level = output, scale * output
            level = level if level < 1.0 else 1.0
            level = rounded(level if level > -1.0 else -1.0)
            if level != levels[at]:
                self.sudden = self.sudden or abs(level - levels[at]) >= SUDDEN
                levels[at] = level
                for block in blocks:
                    changes[block] = level
        if time >= self._due:
            self._due = time + SAMPLE - 1e-6
            self.samples.append((time, [*readings], [*outputs]))
        return changes

    def lose(self, time: float, gone: Collection[int]) -> None:
        """Let the sensors of blocks that are no longer connected to the Starting Block keep their
        last reading; `gone` are the joints that broke or let go."""
        attached = _attached(self._assembly, gone)
        names = [*self.controllers.sensors]
        for sensor in [*self._working]:
            if sensor.block in self._whole - attached and sensor.kind != "time":
                self._working.remove(sensor)
                self.lost[names[sensor.number]] = time, self.readings[sensor.number]


def rounded(level: float) -> float:
    """As `round` does, in half of its time."""
    scaled = level * SCALE
    near = int(scaled + 0.5) if level > 0.0 else int(scaled - 0.5)
    plain = near and -0.499 < scaled - near < 0.499
    return near / SCALE if plain else round(level, PRECISION)


def _disturbance(
    count: int, noise: float, delay: int
) -> Callable[[list[float], Iterable[Sensed]], None]:
    """What adds noise to readings, as a share of each, and delays them by some evaluations."""
    rng = random.Random("sensing")
    past = [deque[float](maxlen=delay + 1) for _ in range(count)]

    def disturb(readings: list[float], working: Iterable[Sensed]) -> None:
        for sensor in working:
            line, reading = past[sensor.number], readings[sensor.number]
            line.append(reading * (1.0 + noise * rng.gauss(0.0, 1.0)))
            readings[sensor.number] = line[0]

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
