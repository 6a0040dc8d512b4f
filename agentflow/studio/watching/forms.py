"""The form of a new design, and whether a design with it can begin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field

from agentflow.app.design.config import PATH_STARTS, load_config, urls_with_credentials
from agentflow.app.design.plan import RunPlan
from agentflow.env.tasks.registry import task_names
from agentflow.errors import UnknownNameError, UsageError
from agentflow.studio.answers import Arguments
from agentflow.study.session import Written

WORKFLOWS = ("hierarchical", "iterative", "single", "tools", "random-dsl", "placement")
"""Those that a page may start: none that runs other programs."""


class NewDesign(Arguments):
    """The form of a design."""

    task: str = Field(max_length=80)
    workflow: str = Field("hierarchical", max_length=40)
    model: str = Field("", max_length=200)
    """"" is the default: AGENTFLOW_MODEL, else procedural."""
    base_url: str = Field("", max_length=400, pattern=r"^(https?://\S+)?$")
    seed: int = Field(0, ge=0, lt=2**31)
    trajectories: int | None = Field(None, ge=1, le=64)
    rounds: int | None = Field(None, ge=0, le=200)
    calls: int | None = Field(None, ge=1)
    """Most model calls."""
    tokens: int | None = Field(None, ge=1)
    """Most tokens."""
    machine: Written | None = None
    """Improve this machine instead of designing one."""

    @property
    def options(self) -> dict[str, Any]:
        """The configuration keys that are given."""
        given = {
            "task": self.task,
            "workflow": self.workflow,
            "seed": self.seed,
            "model.name": self.model or None,
            "model.base_url": self.base_url or None,
            "trajectories": self.trajectories,
            "search.rounds": self.rounds,
            "model.budget.calls": self.calls,
            "model.budget.tokens": self.tokens,
        }
        return {key: value for key, value in given.items() if value is not None}


def require_possible(form: NewDesign) -> None:
    """Raise UsageError unless a design with this form can begin, without a path on this machine."""
    if form.task not in task_names():
        raise UnknownNameError("task", form.task, task_names())
    if form.workflow not in WORKFLOWS:
        raise UnknownNameError("workflow", form.workflow, WORKFLOWS)
    name = form.model
    if (
        name.startswith(PATH_STARTS)
        or Path(name or "-").is_absolute()
        or Path(name or "-").is_dir()
    ):
        raise UsageError("the studio starts no models in folders; use agentflow design --model")
    start = {} if form.machine is None else {"settings.start": form.machine}
    config = load_config(None, (), {**form.options, **start})
    if urls_with_credentials(config):
        raise UsageError("the base URL has a user or a query; the key comes from the environment")
    RunPlan.of(config).require_workflow()
