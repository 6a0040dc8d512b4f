"""What the parts of `engines.py` share: measured figures, options, engines, machines."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from shelf import load

from agentflow.env.physics.engine import Engine
from agentflow.env.physics.engines import choose_engine
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.tree import Machine

ROOT = Path(__file__).parent.parent
MAIN = "import sys; from agentflow_command import main; sys.exit(main())"
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


def timed(engine: Engine, rollout: Callable[[], object], *, apart: bool) -> float:
    """CPU seconds of a rollout; `apart`: nothing is kept of its machine before and after."""
    kept = getattr(engine, "kept", [])
    if apart:
        simulate(Machine(), get_task("movement", {"window": 1}), engine=engine)
        kept.clear()
    began = time.process_time()
    rollout()
    if apart:
        kept.clear()
    return time.process_time() - began


def level_of(machine: Machine) -> str:
    """The level that a machine of tests/machines is for, if it is directly in the folder."""
    thrower = any(step.type == BOULDER for step in machine)
    return "throwing" if thrower else "movement"


def run(machine: Machine, engine: Engine, level: str = "", rate: float | None = None) -> Rollout:
    """Simulate a machine on its level, or on this one."""
    task = get_task(level or level_of(machine), engine=engine.identity.name)
    return simulate(machine, task, engine=engine, rate=rate)


def reach(rollout: Rollout) -> float:
    """The score, or how far a throw that scores nothing went, m."""
    return float(rollout.score or rollout.terms.get("reach") or 0.0)


def shipped(name: str) -> Machine:
    """A machine of tests/machines."""
    return load(f"{name}.json")


def cost_of(command: list[str], lines: Iterable[bytes] = ()) -> tuple[float, float]:
    """CPU seconds of an agentflow command that gets these lines, with its children, and the
    greatest memory of one process, MB."""
    arguments = [sys.executable, "-c", MAIN, *command]
    with subprocess.Popen(
        arguments, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, cwd=ROOT
    ) as process:
        assert process.stdin is not None
        for line in lines:
            process.stdin.write(line)
        process.stdin.close()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{command[0]} failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
