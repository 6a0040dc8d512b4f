"""Workflows: what one is, which tasks it fits, and what it will probably cost."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

from agentflow.errors import UsageError
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.workflows.base import AskContexts, Laboratory, Record, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings


def designs_machines(brief: Brief) -> bool:
    """Whether a task asks for a whole machine."""
    return brief.given == LONE_ROOT


def completes_machines(brief: Brief) -> bool:
    """Whether a task gives a structure to complete."""
    return brief.given != LONE_ROOT


@dataclass(frozen=True)
class Workflow:
    """A way from a brief to a machine, to be registered in `workflows.registry.WORKFLOWS`."""

    name: str
    stages: Callable[[WorkflowContext], Awaitable[WorkflowResult]]
    """Runs its stages, one after the other, and returns `run.result()`."""
    calls: Callable[[WorkflowSettings], Mapping[str, int]]
    """Role -> calls of a run in which every first attempt is valid, for cost estimates."""
    rollouts: Callable[[WorkflowSettings], int]
    """Simulations of such a run if no two machines are equal."""
    fits: Callable[[Brief], bool] = designs_machines
    """Whether it is meant for a task."""
    adapt: Callable[[WorkflowSettings], WorkflowSettings] = lambda settings: settings
    """The settings that it uses, from those of the configuration."""
    asks_models: bool = True
    counts_passes: bool = False
    """Whether its attempts are independent, so that the result counts those that pass."""

    async def __call__(
        self,
        brief: Brief,
        contexts: AskContexts,
        laboratory: Laboratory,
        settings: WorkflowSettings,
        record: Record,
        seed: int = 0,
    ) -> WorkflowResult:
        """Run it.

        Args:
            brief: The task as designers see it.
            contexts: Client, prompts and sampling of each role.
            laboratory: Simulates machines at the task.
            settings: The switches.
            record: Receives every event.
            seed: Of the workflow's own random choices, each from a stream named after it.

        Raises:
            EndpointError: The endpoint cannot be used; the run can be resumed later.
            ReplayMissError: A request was not recorded, and the client only replays.
        """
        used = self.adapt(settings)
        run = WorkflowContext(self.name, brief, contexts, laboratory, used, record, seed)
        return await self.stages(run)


def check_fit(name: str, brief: Brief) -> None:
    """Refuse a workflow that is not meant for a task.

    Raises:
        UnknownNameError: There is no such workflow.
        UsageError: It does not fit; names those that do.
    """
    if WORKFLOWS[name].fits(brief):
        return
    fitting = [item for item, workflow in WORKFLOWS.items() if workflow.fits(brief)]
    if designs_machines(brief):
        raise UsageError(
            f"{brief.name} gives nothing to complete; use --workflow {', '.join(fitting)}"
        )
    raise UsageError(
        f"{brief.name} has no {name} workflow: nothing is refined there, cogs are placed again "
        f"and again; use --workflow {' or '.join(fitting)}"
    )
