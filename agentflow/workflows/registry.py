"""Owns the names of the workflows, and makes the run that each of them works at."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from types import MappingProxyType

from agentflow.errors import UnknownNameError, UsageError
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.workflows.base import AskContexts, Laboratory, Record, Workflow, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.hierarchical import hierarchical
from agentflow.workflows.iterative import iterative
from agentflow.workflows.placement import one_each, placement, random_placement
from agentflow.workflows.random_dsl import random_dsl
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.single import chained, single

WORKFLOWS: Mapping[str, Callable[[WorkflowContext], Awaitable[WorkflowResult]]] = MappingProxyType(
    {
        "single": single,
        "iterative": iterative,
        "hierarchical": hierarchical,
        "random-dsl": random_dsl,
        "placement": placement,
        "random-placement": random_placement,
    }
)
OWN_SETTINGS: Mapping[str, Callable[[WorkflowSettings], WorkflowSettings]] = MappingProxyType(
    {"single": chained, "placement": one_each, "random-placement": one_each}
)
"""What a workflow makes of the settings before it begins; the others take them as they are."""
WITHOUT_MODEL = frozenset({"random-dsl", "random-placement"})
"""Workflows that ask no model."""
PLACEMENT = ("placement", "random-placement")
"""Workflows that complete what a task gives, and the only ones that do."""


def workflow(name: str) -> Workflow:
    """The workflow of that name.

    Raises:
        UnknownNameError: There is none.
    """
    if name not in WORKFLOWS:
        raise UnknownNameError("workflow", name, WORKFLOWS)

    async def carry_out(
        brief: Brief,
        contexts: AskContexts,
        laboratory: Laboratory,
        settings: WorkflowSettings,
        record: Record,
        seed: int = 0,
    ) -> WorkflowResult:
        if name in OWN_SETTINGS:
            settings = OWN_SETTINGS[name](settings)
        run = WorkflowContext(name, brief, contexts, laboratory, settings, record, seed)
        return await WORKFLOWS[name](run)

    return carry_out


def demand_fit(name: str, brief: Brief) -> None:
    """Refuse a workflow that is not meant for such a task.

    Raises:
        UsageError: The task gives a structure to complete and the workflow is for whole machines,
            or the reverse; names the workflows that fit.
    """
    if brief.given == LONE_ROOT:
        if name in PLACEMENT:
            others = ", ".join(item for item in WORKFLOWS if item not in PLACEMENT)
            raise UsageError(f"{brief.name} gives nothing to complete; use --workflow {others}")
    elif name not in PLACEMENT:
        raise UsageError(
            f"{brief.name} has no {name} workflow: nothing is refined there, cogs are placed again "
            f"and again; use --workflow {' or '.join(PLACEMENT)}"
        )
