"""The published throw: machines, measurements and misfit.

The data is in data/published_throw.json. Only the beginning can be compared: the motion after the
first impact and the first break is chaotic.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import Engine
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine

DATA = Path(__file__).parent / "data" / "published_throw.json"
BOULDER, ROTOR, ROOT, TOWER_TOP = 13, 10, 0, 8
LAST = 3
"""Index of the last boulder sample to compare: 0.6 s, just before it hits the wall."""
BEFORE_BREAK = 2
"""Index of the last sample of rotor and root to compare: 0.4 s, when the tower breaks."""
FIRST = 1
"""Index of the sample by which the only sample of the tower's top was taken: 0.2 s."""
PLACE, TURN, MOMENT, PACE = 0.3, 0.1, 0.03, 1.0
"""Differences of equal weight in a fit: m, rad, s, m/s."""
AFTER = 1.0
"""The same after the break, m; larger, because the break multiplies earlier differences."""


@cache
def facts() -> dict[str, Any]:
    """The data file."""
    loaded: dict[str, Any] = json.loads(DATA.read_text(encoding="utf-8"))
    return loaded


def machines() -> dict[str, Machine]:
    """The published machine without, with some, and with all of its guessed blocks."""
    printed, guessed = facts()["machine"], facts()["guessed"]
    return {
        "printed blocks": _read(printed),
        "with ballast": _read([*printed, *guessed[:1]]),
        "with ballast and springs": _read([*printed, *guessed]),
    }


def _read(steps: list[dict[str, int]]) -> Machine:
    machine = read_machine(steps).machine
    assert machine is not None
    return machine


def throw(
    machine: Machine, window: float, engine: Engine, physics: Constants | None = None
) -> Rollout:
    """Simulate one of the machines in the published arena and record every step.

    Args:
        machine: One of `machines`.
        window: s.
        engine: A started engine, with the same constants.
        physics: The constants; those of `constants.json` by default.
    """
    task, step = get_task("throwing", {"window": window}), 1 / constants()["step_rate"]
    return simulate(machine, task, engine=engine, physics=physics, interval=step)


def samples(states: Array) -> Array:
    """Select from (T, ...) states at every step those at the times of the published samples."""
    return states[:: round(facts()["interval"] * constants()["step_rate"])]


@dataclass(frozen=True)
class Misfit:
    """Differences between a rollout and the published one."""

    boulder: float
    """Root mean square per coordinate of the boulder from 0 to 0.6 s, m."""
    rotor: float
    """The same of the rotating block at 0.2 and 0.4 s, m."""
    after: float
    """The same at 0.6 and 0.8 s, m; after the break only the springs pull at the arm."""
    turn: float
    """Root mean square angle of rotating block and root at 0.2 and 0.4 s, rad."""
    top_place: float
    """Root mean square per coordinate of the tower's top, m, at the moment of the first 0.2 s that
    is closest to its only published sample, whose exact time is unknown."""
    top_speed: float
    """The same for its velocity at that moment, m/s."""
    first_break: float
    """Time of the first break minus the published one, s; nan if nothing breaks."""
    right_block: bool
    """Whether the first block that breaks off is the published one."""

    @property
    def cost(self) -> float:
        """The quantity that a fit minimises."""
        late = self.first_break if np.isfinite(self.first_break) else 1.0
        return float(
            (self.boulder / PLACE) ** 2
            + (self.rotor / PLACE) ** 2
            + (self.turn / TURN) ** 2
            + (self.after / AFTER) ** 2
            + (self.top_place / PLACE) ** 2
            + (self.top_speed / PACE) ** 2
            + (late / MOMENT) ** 2 / 4
        )


def misfit(rollout: Rollout) -> Misfit:
    """Compare a rollout of `throw`."""
    trace, data = rollout.trace, facts()
    assert trace is not None
    position, rotation = samples(trace.position), samples(trace.rotation)
    compared = slice(1, BEFORE_BREAK + 1)
    turns = np.concatenate(
        [
            _angles(rotation[compared, block], np.array(data[name][compared]))
            for block, name in ((ROTOR, "rotor_rotation"), (ROOT, "root_rotation"))
        ]
    )
    boulder = position[: LAST + 1, BOULDER] - np.array(data["boulder"][: LAST + 1])
    rotor = position[compared, ROTOR] - np.array(data["rotor_position"][compared])
    first = rollout.broken[0] if rollout.broken else None
    after = slice(BEFORE_BREAK + 1, len(data["rotor_position"]))
    late = position[after, ROTOR] - np.array(data["rotor_position"][after])
    place, speed = _top(trace)
    return Misfit(
        boulder=_rms(boulder),
        rotor=_rms(rotor),
        after=_rms(late),
        turn=_rms(turns),
        top_place=place,
        top_speed=speed,
        first_break=first.time - data["first_break"]["time"] if first else float("nan"),
        right_block=first is not None and first.block == data["first_break"]["block"],
    )


def _top(trace: Trace) -> tuple[float, float]:
    """Differences of the tower's top from its only sample in position (m) and velocity (m/s)."""
    only = facts()["tower_top_first"]
    soon = slice(0, FIRST * round(facts()["interval"] * constants()["step_rate"]) + 1)
    place = trace.position[soon, TOWER_TOP] - np.array(only["position"])
    speed = trace.velocity[soon, TOWER_TOP] - np.array(only["velocity"])
    off = np.square(place / PLACE).sum(axis=1) + np.square(speed / PACE).sum(axis=1)
    nearest = int(off.argmin())
    return _rms(place[nearest]), _rms(speed[nearest])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _angles(a: Array, b: Array) -> Array:
    """(T,) angles between (T, 4) quaternions, rad; the published ones are rounded."""
    overlap = np.abs((a * b).sum(axis=1)) / np.linalg.norm(b, axis=1)
    return np.asarray(2.0 * np.arccos(np.clip(overlap, 0.0, 1.0)))
