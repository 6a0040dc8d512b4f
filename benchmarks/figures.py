"""What the parts of `engines.py` share: measured figures, options, engines, machines."""

from __future__ import annotations

from dataclasses import dataclass

from shelf import load

from agentflow.env.physics.engine import Engine
from agentflow.env.physics.engines import choose_engine
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.tree import Machine

PYBULLET, MUJOCO = "pybullet", "mujoco"


@dataclass(frozen=True)
class Options:
    """How much is measured."""

    rollouts: int
    machines: int
    repeats: int
    workers: int


@dataclass(frozen=True)
class Figure:
    """One measured value and its limit, as text."""

    what: str
    value: str
    limit: str = ""
    met: bool = True

    @property
    def row(self) -> str:
        """The figure as a row of a Markdown table."""
        return f"| {self.what} | {self.value} | {self.limit} | {'yes' if self.met else 'no'} |"


def engines() -> dict[str, Engine]:
    """Both engines, started."""
    return {name: choose_engine(name).start() for name in (PYBULLET, MUJOCO)}


def level_of(machine: Machine) -> str:
    """The level that a machine of tests/machines is for, if it is directly in the folder."""
    thrower = any(step.type == BOULDER for step in machine)
    return "throwing" if thrower else "movement"


def run(machine: Machine, engine: Engine, level: str = "", rate: float | None = None) -> Rollout:
    """Simulate a machine on its level, or on this one."""
    return simulate(machine, get_task(level or level_of(machine)), engine=engine, rate=rate)


def reach(rollout: Rollout) -> float:
    """The score, or how far a throw that scores nothing went, m."""
    return float(rollout.score or rollout.terms.get("reach") or 0.0)


def shipped(name: str) -> Machine:
    """A machine of tests/machines."""
    return load(f"{name}.json")
