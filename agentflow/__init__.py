"""Language models design machines; physics decides whether they work.

The functions `design`, `simulate`, `verify` and `check` match the commands of the same name and
share their defaults; `design_prompt` and `reward` are for training. Every name is imported on
first use.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from agentflow.version import __version__

if TYPE_CHECKING:
    from agentflow.api import (
        Design,
        build,
        check,
        design,
        design_async,
        design_prompt,
        resume,
        resume_async,
        simulate,
        simulate_async,
        sweep,
        sweep_async,
        verify,
        verify_async,
    )
    from agentflow.env.pool.pool import RolloutPool
    from agentflow.env.rollout import Rollout
    from agentflow.env.verification import Verification
    from agentflow.errors import AgentflowError
    from agentflow.llm.function import ModelFunction
    from agentflow.llm.messages import Message, Reply, Request, Usage
    from agentflow.machine import BlockType, Machine, Problem, Report
    from agentflow.machine.building import BuiltBlock, MachineBuilder
    from agentflow.notebook.catalogue import KnobInfo, TaskInfo, blocks, task, tasks
    from agentflow.notebook.figures.plot import plot
    from agentflow.notebook.loading import Card, Evaluation, Training, load
    from agentflow.notebook.machine_rows import CurvePoint
    from agentflow.notebook.recorded import Run, load_runs
    from agentflow.notebook.sweeps import Sweep
    from agentflow.rewards import Reward, reward, reward_async

_MODULES = {
    "agentflow.api": (
        *(
            "Design",
            "build",
            "check",
            "design",
            "design_async",
            "design_prompt",
            "resume",
            "resume_async",
        ),
        *("simulate", "simulate_async", "sweep", "sweep_async", "verify", "verify_async"),
    ),
    "agentflow.env.pool.pool": ("RolloutPool",),
    "agentflow.env.rollout": ("Rollout",),
    "agentflow.env.verification": ("Verification",),
    "agentflow.errors": ("AgentflowError",),
    "agentflow.llm.function": ("ModelFunction",),
    "agentflow.llm.messages": ("Message", "Reply", "Request", "Usage"),
    "agentflow.machine": ("BlockType", "Machine", "Problem", "Report"),
    "agentflow.machine.building": ("BuiltBlock", "MachineBuilder"),
    "agentflow.notebook.catalogue": ("KnobInfo", "TaskInfo", "blocks", "task", "tasks"),
    "agentflow.notebook.figures.plot": ("plot",),
    "agentflow.notebook.loading": ("Card", "Evaluation", "Training", "load"),
    "agentflow.notebook.machine_rows": ("CurvePoint",),
    "agentflow.notebook.recorded": ("Run", "load_runs"),
    "agentflow.notebook.sweeps": ("Sweep",),
    "agentflow.rewards": ("Reward", "reward", "reward_async"),
}
"""Module -> the names that this package offers from it."""
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "AgentflowError",
    "BlockType",
    "BuiltBlock",
    "Card",
    "CurvePoint",
    "Design",
    "Evaluation",
    "KnobInfo",
    "Machine",
    "MachineBuilder",
    "Message",
    "ModelFunction",
    "Problem",
    "Reply",
    "Report",
    "Request",
    "Reward",
    "Rollout",
    "RolloutPool",
    "Run",
    "Sweep",
    "TaskInfo",
    "Training",
    "Usage",
    "Verification",
    "__version__",
    "blocks",
    "build",
    "check",
    "design",
    "design_async",
    "design_prompt",
    "load",
    "load_runs",
    "plot",
    "resume",
    "resume_async",
    "reward",
    "reward_async",
    "simulate",
    "simulate_async",
    "sweep",
    "sweep_async",
    "task",
    "tasks",
    "verify",
    "verify_async",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'agentflow' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


if "IPython" in sys.modules:  # a notebook: tell it how to show machines, rollouts, runs ...
    import_module("agentflow.notebook.display.formatters").install()
