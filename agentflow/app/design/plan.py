"""Run plans: a configuration with every name looked up, and the conditions of the run."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from agentflow import __version__
from agentflow.app.design.config import config_json
from agentflow.app.design.models import choose_models
from agentflow.config.run import DesignConfig, suggest_key
from agentflow.env.constants import constants
from agentflow.env.physics.engines import default_engine
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError, UsageError
from agentflow.llm.procedural.mechanisms import STAND, purpose
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.validity import check
from agentflow.prompts.render import PromptSet
from agentflow.search.registry import STRATEGIES
from agentflow.workflows.registry import WORKFLOWS, check_fit


@dataclass(frozen=True)
class RunPlan:
    """A configuration whose names have all been looked up."""

    config: DesignConfig
    task: Task
    prompts: PromptSet
    engine: str
    """Name and version of the physics engine, e.g. "pybullet 3.2.7"."""

    @classmethod
    def of(cls, config: DesignConfig) -> RunPlan:
        """Look up task, knobs, workflow, prompt set and engine.

        Raises:
            UnknownNameError: One of them does not exist.
            ConfigError: A knob is unknown or out of range, a price is missing, or no physics
                engine is installed.
            UsageError: The workflow does not support the task.
        """
        STRATEGIES[config.settings.search.strategy], WORKFLOWS[config.workflow]  # known names
        choose_models(config.model)
        try:
            task = get_task(config.task, config.knobs)
        except ConfigError as error:
            raise ConfigError(f"{error}{suggest_key(config.knobs)}") from None
        check_fit(config.workflow, task.brief)
        _check_start(config.settings.start, task.brief)
        return cls(config, task, PromptSet(config.prompts), str(default_engine().identity))

    @property
    def conditions(self) -> dict[str, str]:
        """Everything besides configuration and replies that decides results, for run.yaml.

        Hashes have 16 hex digits; `demands` is that of the task's brief.
        """
        return {
            "prompts": self.prompts.digest,
            "demands": hashlib.sha256(repr(self.task.brief).encode()).hexdigest()[:16],
            **physics_conditions(),
            "engine": self.engine,
        }

    def changes_since(self, document: Mapping[str, Any]) -> str:
        """Which conditions differ from those in a run.yaml; see `describe_changes`."""
        return describe_changes(document, self.conditions)

    def engine_note(self, document: Mapping[str, Any]) -> str:
        """A message about a run.yaml that names no engine; "" if it names one."""
        if "engine" in document:
            return ""
        return f"the run does not record its physics engine; now it is {self.engine}"

    @property
    def model_note(self) -> str:
        """A message if the procedural model does not know the purpose of the task; "" if it does.

        It then builds machines that stand or drive.
        """
        calls = WORKFLOWS[self.config.workflow].calls(self.config.settings)
        choices = choose_models(self.config.model)
        asked = any(count and choices[role].procedural for role, count in calls.items())
        if not asked or purpose(self.task.brief) != STAND:
            return ""
        return (
            f"the procedural model has no mechanism for {self.task.name}, so expect low scores; "
            "use a language model (--model), or add mechanisms for the family (CONTRIBUTING.md)"
        )

    @property
    def run_name(self) -> str:
        """Default name of the run directory: date, task, workflow and seed."""
        stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
        task = self.task.name.replace("/", "-")
        return f"{stamp}-{task}-{self.config.workflow}-seed{self.config.seed}"

    @property
    def run_document(self) -> dict[str, Any]:
        """Content of run.yaml: the resolved configuration, the conditions, and provenance."""
        return {
            "agentflow": __version__,
            "commit": _commit(),
            **self.conditions,
            "python": platform.python_version(),
            "platform": platform.platform(),
            "config": config_json(self.config),
        }


def _check_start(start: Sequence[object], brief: Brief) -> None:
    """Raise UsageError if there is a start machine that is not valid for the task."""
    if start and not (report := check(list(start), brief)).task_valid:
        raise UsageError(
            f"the start machine is not valid for {brief.name}: {report.problems[0].message}"
        )


def physics_conditions() -> dict[str, str]:
    """The conditions that decide the result of a simulation: constants, blocks and engine."""
    return {
        "constants": constants().digest,
        "blocks": library().digest,
        "engine": str(default_engine().identity),
    }


def describe_changes(recorded: Mapping[str, Any], now: Mapping[str, str]) -> str:
    """Which recorded conditions differ now, in words; "" if none does."""
    return " and ".join(
        f"engine ({_engine_change(recorded[name], value)})" if name == "engine" else name
        for name, value in now.items()
        if recorded.get(name, value) != value
    )


def _engine_change(before: str, now: str) -> str:
    """Two engine identities in words: "pybullet 3.2.7, now 3.2.8"."""
    name, _, version = now.rpartition(" ")
    return f"{before}, now {version if before.rpartition(' ')[0] == name else now}"


@cache
def _commit() -> str | None:
    """The git commit of the code, if it runs from a checkout."""
    try:
        done = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"],
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError:
        return None
    return done.stdout.strip() or None
