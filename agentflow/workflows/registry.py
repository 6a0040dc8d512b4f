"""The registry of workflows. Importing it loads none of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agentflow.errors import UsageError
from agentflow.registry import Registry, instance_of

if TYPE_CHECKING:
    from agentflow.machine.brief import Brief
    from agentflow.workflows.workflow import Workflow

WORKFLOWS: Registry[Workflow] = Registry(
    "workflow",
    "agentflow.workflows",
    {
        "single": "agentflow.workflows.single:SINGLE",
        "iterative": "agentflow.workflows.iterative:ITERATIVE",
        "hierarchical": "agentflow.workflows.hierarchical:HIERARCHICAL",
        "tools": "agentflow.workflows.tools:TOOLS",
        "random-dsl": "agentflow.workflows.random_dsl:RANDOM_DSL",
        "explore": "agentflow.workflows.explore:EXPLORE",
        "external": "agentflow.integrations.external.workflow:EXTERNAL",
        "tune": "agentflow.workflows.stages.tuning:TUNE",
        "placement": "agentflow.workflows.placement:PLACEMENT",
        "random-placement": "agentflow.workflows.placement:RANDOM_PLACEMENT",
    },
    instance_of("agentflow.workflows.workflow:Workflow"),
)


def check_fit(name: str, brief: Brief) -> None:
    """Raise UnknownNameError or UsageError unless a workflow exists and fits a task."""
    if not WORKFLOWS[name].fits(brief):
        fitting = [item for item, workflow in WORKFLOWS.items() if workflow.fits(brief)]
        raise UsageError(
            f"the workflow {name} does not fit {brief.name}; choose from: {', '.join(fitting)}"
        )
