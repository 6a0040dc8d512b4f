"""Language models design machines; physics decides whether they work.

The functions `design`, `simulate`, `verify` and `check` match the commands of the same name and
share their defaults; `design_prompt`, `reward` and `evaluator` are for training and for programs
that evolve texts. Every name is imported on first use.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from agentflow.version import __version__ as __version__

if TYPE_CHECKING:
    from agentflow.api import Design as Design
    from agentflow.api import build as build
    from agentflow.api import check as check
    from agentflow.api import design as design
    from agentflow.api import design_async as design_async
    from agentflow.api import design_prompt as design_prompt
    from agentflow.api import resume as resume
    from agentflow.api import resume_async as resume_async
    from agentflow.api import simulate as simulate
    from agentflow.api import simulate_async as simulate_async
    from agentflow.api import sweep as sweep
    from agentflow.api import sweep_async as sweep_async
    from agentflow.api import tune as tune
    from agentflow.api import verify as verify
    from agentflow.api import verify_async as verify_async
    from agentflow.app.tasks import KnobInfo as KnobInfo
    from agentflow.app.tasks import TaskInfo as TaskInfo
    from agentflow.env.pool.pool import RolloutPool as RolloutPool
    from agentflow.env.rollout import Rollout as Rollout
    from agentflow.env.verification import Verification as Verification
    from agentflow.errors import AgentflowError as AgentflowError
    from agentflow.integrations.evolution import evaluator as evaluator
    from agentflow.llm.function import ModelFunction as ModelFunction
    from agentflow.llm.messages import Message as Message
    from agentflow.llm.messages import Reply as Reply
    from agentflow.llm.messages import Request as Request
    from agentflow.llm.messages import Usage as Usage
    from agentflow.machine import BlockType as BlockType
    from agentflow.machine import Machine as Machine
    from agentflow.machine import Problem as Problem
    from agentflow.machine import Report as Report
    from agentflow.machine.building import BuiltBlock as BuiltBlock
    from agentflow.machine.building import MachineBuilder as MachineBuilder
    from agentflow.notebook.catalogue import blocks as blocks
    from agentflow.notebook.catalogue import task as task
    from agentflow.notebook.catalogue import tasks as tasks
    from agentflow.notebook.figures.plot import plot as plot
    from agentflow.notebook.loading import Card as Card
    from agentflow.notebook.loading import Evaluation as Evaluation
    from agentflow.notebook.loading import Training as Training
    from agentflow.notebook.loading import load as load
    from agentflow.notebook.machine_rows import CurvePoint as CurvePoint
    from agentflow.notebook.recorded import Run as Run
    from agentflow.notebook.recorded import Sweep as Sweep
    from agentflow.notebook.recorded import load_runs as load_runs
    from agentflow.rewards import Reward as Reward
    from agentflow.rewards import reward as reward
    from agentflow.rewards import reward_async as reward_async

_MODULES = {
    "agentflow.api": (
        "Design build check design design_async design_prompt resume resume_async "
        "simulate simulate_async sweep sweep_async tune verify verify_async"
    ),
    "agentflow.app.tasks": "KnobInfo TaskInfo",
    "agentflow.env.pool.pool": "RolloutPool",
    "agentflow.env.rollout": "Rollout",
    "agentflow.env.verification": "Verification",
    "agentflow.errors": "AgentflowError",
    "agentflow.integrations.evolution": "evaluator",
    "agentflow.llm.function": "ModelFunction",
    "agentflow.llm.messages": "Message Reply Request Usage",
    "agentflow.machine": "BlockType Machine Problem Report",
    "agentflow.machine.building": "BuiltBlock MachineBuilder",
    "agentflow.notebook.catalogue": "blocks task tasks",
    "agentflow.notebook.figures.plot": "plot",
    "agentflow.notebook.loading": "Card Evaluation Training load",
    "agentflow.notebook.machine_rows": "CurvePoint",
    "agentflow.notebook.recorded": "Run Sweep load_runs",
    "agentflow.rewards": "Reward reward reward_async",
}
"""Module -> the names that this package offers from it, as above for type checkers."""
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(["__version__", *_MODULE_OF])


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'agentflow' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return __all__


if "IPython" in sys.modules:  # a notebook: tell it how to show machines, rollouts, runs ...
    import_module("agentflow.notebook.display.formatters").install()
