"""What a run depends on besides its configuration: what differs, and what plug-ins it uses."""

import subprocess
from collections.abc import Mapping
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from agentflow.agents.registry import ROLES
from agentflow.config.run import DesignConfig
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.registry import FAMILIES
from agentflow.llm.procedural.mechanisms import MECHANISMS
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.registry import Registry
from agentflow.search.registry import STRATEGIES
from agentflow.version import __version__
from agentflow.workflows.registry import WORKFLOWS

PLUGINS = "plugins"
"""Key of run.yaml: the identities of the parts from other distributions."""
PACKAGE = Path(__file__).parents[2]


def plugins_of(config: DesignConfig, family: str) -> dict[str, str]:
    """The parts from other distributions that a run uses: kind and name -> identity.

    Args:
        config: The configuration of the run, with the name of its engine.
        family: The family of its task.
    """
    workflow = WORKFLOWS[config.workflow]
    used: list[tuple[Registry[Any], str]] = [
        (FAMILIES, family),
        (MECHANISMS, family),
        (ENGINES, config.engine),
        (WORKFLOWS, config.workflow),
        (STRATEGIES, config.settings.search.strategy),
        (PROMPT_SETS, config.prompts),
        *((ROLES, role) for role in workflow.calls(config.settings)),
    ]
    found = {f"{kind.kind} {name}": kind.identity(name) for kind, name in used}
    return {part: identity for part, identity in found.items() if identity}


def describe_changes(recorded: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Which recorded conditions differ now, in words; "" if none does."""
    before, after = _flat(recorded), _flat(now)
    return " and ".join(
        f"{name} ({_version_change(str(before[name]), value)})" if " " in value else name
        for name, value in after.items()
        if before.get(name, value) != value
    )


def recorded_plugins(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """What `plugins_of` found when a run with this run.yaml began."""
    found = document.get(PLUGINS)
    return found if isinstance(found, Mapping) else {}


def code_change(document: Mapping[str, Any]) -> str:
    """How the code differs from that which began the run with this run.yaml; "" if it does not."""
    for key, now in (("agentflow", __version__), ("commit", commit())):
        if document.get(key, now) != now:
            return f"{key} {str(document[key])[:10]}, now {str(now)[:10]}"
    began = document.get("began")
    files = PACKAGE.rglob("*.py")
    if began and max(f.stat().st_mtime for f in files) > datetime.fromisoformat(began).timestamp():
        return "its files are newer than the run"
    return ""


@cache
def commit() -> str | None:
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


def _flat(conditions: Mapping[str, Any]) -> dict[str, Any]:
    """Conditions with each plug-in beside the others."""
    return {**conditions, **recorded_plugins(conditions), PLUGINS: ""}


def _version_change(before: str, now: str) -> str:
    """Two names with versions in words: "pybullet 3.2.7, now 3.2.8"."""
    name, _, version = now.rpartition(" ")
    return f"{before}, now {version if before.rpartition(' ')[0] == name else now}"
