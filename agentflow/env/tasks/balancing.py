"""A machine on two wheels that must not fall over when a gust pushes it."""

import random

from agentflow.env.feedback.text import number, object_label
from agentflow.env.rollout import Trace, Verdict
from agentflow.env.scene import blocks_among
from agentflow.env.tasks.base import ROUNDING, Parameters, WorldView
from agentflow.env.tasks.knobs import knob
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

WHEEL = 2
FIRST, LASTS = 1.0, 0.5
"""Earliest time of a gust, and how long it lasts, s."""
EVERY = 0.1
"""Time between looks at the machine's centre of mass, s."""


class Balance(Parameters):
    """How high a machine on two wheels must stay, and what pushes it."""

    height: float = knob(
        0, 0, 9, "m", "least height of the machine's centre of mass, on two wheels; 0: any"
    )
    gust: float = knob(3, 0.5, 20, "m/s", "greatest wind that pushes such a machine")
    until: float = knob(6, 1, 50, "s", "latest time of the gust")

    def draw(self, rng: random.Random) -> tuple[float, float]:
        """Time (s) and wind towards z- (m/s) of the gust in a trial."""
        speed = rng.uniform(0.5, 1.0) * self.gust * rng.choice((-1, 1))
        return round(rng.uniform(FIRST, self.until), 2), round(speed, 2)

    def switches(self, at: float) -> tuple[tuple[float, str, float], ...]:
        """What lets the machine go, and the gust at this time."""
        return (0.0, "holds", 1.0), (0.0, "wind", 0.0), (at, "wind", 1.0), (at + LASTS, "wind", 0.0)


def axle_problem(machine: Machine) -> str:
    """What is wrong with the wheels, which must have one axis, along x; "" if they do."""
    placed = place(machine)
    wheels = [placed[step.id] for step in machine if step.type == WHEEL]
    axles = {(wheel.facing[0], *(round(v, 3) for v in wheel.center[1:])) for wheel in wheels}
    rolls = len(axles) == 1 and axles.pop()[0] == "x"
    return "" if rolls else "its wheels do not turn about one axis along x"


class BalanceReferee:
    """Watches the centre of mass, and what touches the ground or an object of the scene."""

    def __init__(self, machine: Machine, balance: Balance, around: tuple[str, ...]) -> None:
        self._least, self._around = balance.height, ("ground", *around)
        self._masses = [(step.id, library()[step.type].mass) for step in machine]
        self._wheels = [step.id for step in machine if step.type == WHEEL]
        self._fault = axle_problem(machine)
        self._due = 0.0
        self._fallen: tuple[float, str] | None = None
        """When it failed, s, and how."""

    def start(self, world: WorldView) -> None:
        """Look whether it stands as it must."""
        if self._fault:
            self._fallen = 0.0, self._fault
        self.watch(world)

    def watch(self, world: WorldView) -> bool:
        """Look for the first failure, which ends the trial."""
        for name in self._around:
            others = {*blocks_among(world.touching(name))}.difference(self._wheels)
            if self._fallen is None and others:
                where = "the ground" if name == "ground" else object_label(name)
                self._fallen = world.time, f"block {min(others)} touched {where}"
        if self._fallen is None and world.time >= self._due - ROUNDING:
            self._due = world.time + EVERY
            total = sum(mass for _, mass in self._masses)
            high = sum(mass * world.centre(block)[1] for block, mass in self._masses) / total
            if high < self._least:
                self._fallen = (
                    world.time,
                    f"its centre of mass was {number(high)} m above the ground",
                )
        return self._fallen is not None

    def verdict(self, trace: Trace) -> Verdict:
        """Score 1 or 0 and terms: success, outcome, and when it failed, s."""
        fallen = self._fallen
        if fallen is None and not trace.alive[-1].all():
            fallen = float(trace.times[-1]), "something had broken"
        told = fallen and f"{fallen[1]} at {number(fallen[0])} s"
        terms: dict[str, float | bool | str | None] = {
            "success": fallen is None,
            "outcome": told or "upright to the end",
            "miss": None,
            "time": fallen and fallen[0],
        }
        return Verdict(float(fallen is None), terms)
