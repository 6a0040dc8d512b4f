"""Language models design machines; physics decides whether they work.

The four things that the command line does, with the same defaults: `design`, `simulate`, `check`
and `reward`, and what goes with them. Each is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agentflow.app.python.functions import ModelFunction
    from agentflow.app.python.machines import check, simulate, simulate_async
    from agentflow.app.python.runs import Design, design, design_async, resume, resume_async
    from agentflow.env.pool.pool import RolloutPool
    from agentflow.env.rollout import Rollout
    from agentflow.errors import AgentflowError
    from agentflow.llm.messages import Message, Reply, Request, Usage
    from agentflow.machine import Machine, Problem, Report
    from agentflow.rewards import Reward, reward, reward_async

__version__ = "0.1.0"

_HOMES = {
    "agentflow.app.python.functions": ("ModelFunction",),
    "agentflow.app.python.runs": ("Design", "design", "design_async", "resume", "resume_async"),
    "agentflow.app.python.machines": ("check", "simulate", "simulate_async"),
    "agentflow.env.pool.pool": ("RolloutPool",),
    "agentflow.env.rollout": ("Rollout",),
    "agentflow.errors": ("AgentflowError",),
    "agentflow.llm.messages": ("Message", "Reply", "Request", "Usage"),
    "agentflow.machine": ("Machine", "Problem", "Report"),
    "agentflow.rewards": ("Reward", "reward", "reward_async"),
}
"""Module -> names of it that can be had from here."""
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "AgentflowError",
    "Design",
    "Machine",
    "Message",
    "ModelFunction",
    "Problem",
    "Reply",
    "Report",
    "Request",
    "Reward",
    "Rollout",
    "RolloutPool",
    "Usage",
    "__version__",
    "check",
    "design",
    "design_async",
    "resume",
    "resume_async",
    "reward",
    "reward_async",
    "simulate",
    "simulate_async",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'agentflow' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
