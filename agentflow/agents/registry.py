"""The registry of roles: ours by module, those of other distributions by entry point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from agentflow.registry import Registry, subclass_of

if TYPE_CHECKING:
    from agentflow.agents.base import Replies, Role
    from agentflow.llm.procedural.reading import Script

ROLES: Registry[type[Role[Any, Any]]] = Registry(
    "role",
    "agentflow.roles",
    {
        "meta_designer": "agentflow.agents.meta_designer:MetaDesigner",
        "designer": "agentflow.agents.designer:Designer",
        "drafter": "agentflow.agents.designer:Drafter",
        "inspector": "agentflow.agents.inspector:Inspector",
        "querier": "agentflow.agents.querier:Querier",
        "refiner": "agentflow.agents.refiner:Refiner",
        "analyst": "agentflow.agents.analyst:Analyst",
        "placer": "agentflow.agents.designer:Placer",
        "agent": "agentflow.agents.tool_agent:Agent",
    },
    subclass_of("agentflow.agents.base:Role", named_by="name"),
)


def model_roles() -> tuple[str, ...]:
    """Roles that can have their own model and sampling; the others share one of these."""
    return tuple(name for name, role in ROLES.items() if role.model_role in ("", name))


def replies_of(role: str) -> Replies:
    """What a role replies with; "answers" if it is not installed."""
    return ROLES[role].replies if role in ROLES else "answers"


def scripts() -> tuple[Script, ...]:
    """How the procedural model plays the roles that it can play."""
    return tuple(role.script for role in ROLES.values() if role.script)


def stage_of(role: str, purpose: str = "") -> str:
    """Stage of a run that a call belongs to; see `Role.stage_for`.

    "other" if the role is not installed, as in runs from another machine.
    """
    return ROLES[role].stage_for(purpose) if role in ROLES else "other"


def with_model(role: str, model: str = "") -> str:
    """The name under which a role is asked of a certain model; see `settings.models`."""
    return f"{role} ({model})" if model else role


def split_model(name: str) -> tuple[str, str]:
    """The role and the model in what `with_model` has named."""
    role, _, model = name.partition(" (")
    return role, model.removesuffix(")")
