"""The type of workflows: their stages, the tasks they fit, and their expected cost."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

from agentflow.agents.analyst import Analyst
from agentflow.agents.refiner import Refiner
from agentflow.errors import ConfigError
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.search.settings import INDEPENDENT, MAP_ELITES
from agentflow.search.strategies import deals_budget
from agentflow.tools.host import Evaluator
from agentflow.workflows.base import AskContexts, Record, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings

STRATEGY = "search.strategy"
POOLED: tuple[str, ...] = ("another_mechanism", "finalists", "models")
"""Settings of searches over the whole run."""
MACHINES: tuple[str, ...] = ("emitters", "novelty")
"""Settings of searches that `explore` has, too."""
SEARCHING: tuple[str, ...] = ("local_trials", "inspirations", "lessons", *POOLED, *MACHINES)
"""Settings of searches besides those of their strategies."""
SWITCHES: Mapping[str, tuple[str, object]] = {
    "inspector": ("inspector", True),
    "querier": ("querier", True),
    "meta_designer": ("meta_designer", "structures"),
    "drafts": ("drafter", True),
    "analyst": (Analyst.name, True),
}
"""Setting -> the role that it switches, and a value with which the role is asked."""


def designs_machines(brief: Brief) -> bool:
    """Whether a task asks for a whole machine."""
    return brief.given == LONE_ROOT


def completes_machines(brief: Brief) -> bool:
    """Whether a task gives a structure to complete."""
    return brief.given != LONE_ROOT


def refuse_program(settings: WorkflowSettings) -> None:
    """Raise ConfigError if the settings name a program, which most workflows do not run."""
    if settings.external.command:
        raise ConfigError(
            "external.command names a program, but only the workflow external runs one; add "
            "--workflow external, or remove external.command"
        )


@dataclass(frozen=True)
class Workflow:
    """A way to get from a brief to a machine, registered in `workflows.registry.WORKFLOWS`."""

    name: str
    stages: Callable[[WorkflowContext], Awaitable[WorkflowResult]]
    """Runs its stages one after the other and returns `run.result()`."""
    calls: Callable[[WorkflowSettings], Mapping[str, int]]
    """Role -> calls of a run in which every first attempt is valid, for cost estimates."""
    rollouts: Callable[[WorkflowSettings], int]
    """Simulations of such a run if no two of its machines are equal."""
    tried: Callable[[WorkflowSettings], int] = lambda _: 0
    """Machines of such a run that get all trials of the task; others get one."""
    fits: Callable[[Brief], bool] = designs_machines
    """Whether it can be used for a task."""
    adapt: Callable[[WorkflowSettings], WorkflowSettings] = lambda settings: settings
    """Turns the configured settings into those that it uses."""
    author: Callable[[WorkflowSettings], str] = lambda _: ""
    """Who designs in place of models, as results name it; "" if models do."""
    repeatable: bool = True
    """Whether its author can be asked again; otherwise run.yaml names the author, and a replay or a
    resumed run takes the author's work from the record."""
    require: Callable[[WorkflowSettings], None] = refuse_program
    """Raises ConfigError unless a run with these settings can begin here and now."""
    runs_program: bool = False
    """Whether it runs the program that settings name, so that nobody else's page may start it."""
    baseline: str = ""
    """Workflow without a model that benchmarks compare it with; "" if there is none."""
    counts_passes: bool = False
    """Whether its attempts are independent and the result counts those that pass."""

    stores: bool = False
    """Whether a run keeps every rollout until it has finished, so that resuming it repeats none."""
    searches: bool = False
    """Whether it refines machines in searches, with strategies, local trials and shared
    knowledge."""

    def unused(self, settings: WorkflowSettings) -> list[str]:
        """Dotted keys of settings of searches and roles that differ from the defaults and change
        nothing here."""
        usual, strategy = WorkflowSettings(), settings.search.strategy
        uses = self.adapt(settings if self.searches else usual).search.strategy
        used = set(SEARCHING if self.searches else MACHINES if uses == MAP_ELITES else ())
        if self.searches and not deals_budget(uses):
            used -= {*POOLED, "emitters"}
        if uses == INDEPENDENT:
            used -= {"emitters", "local_trials"}
        found = [
            key
            for key in SEARCHING
            if key not in used and getattr(settings, key) != getattr(usual, key)
        ]
        found += [STRATEGY] * (strategy not in (usual.search.strategy, uses))
        return found + [
            key
            for key, (role, value) in SWITCHES.items()
            if getattr(settings, key) != getattr(usual, key)
            and not self.calls(settings.model_copy(update={key: value})).get(role)
        ]

    def retries(self, settings: WorkflowSettings, brief: Brief) -> int:
        """Trials after the first ones; each is a call of a refiner and a simulation."""
        return (brief.limits.trials - 1) * self.tried(settings)

    def calls_on(self, settings: WorkflowSettings, brief: Brief) -> Mapping[str, int]:
        """`calls` with those between the trials of a task."""
        calls, retries = dict(self.calls(settings)), self.retries(settings, brief)
        return calls | {Refiner.name: calls.get(Refiner.name, 0) + retries} if retries else calls

    @property
    def asks_models(self) -> bool:
        """Whether models design."""
        return not self.author(WorkflowSettings())

    async def __call__(
        self,
        brief: Brief,
        contexts: AskContexts,
        evaluator: Evaluator,
        settings: WorkflowSettings,
        record: Record,
        seed: int = 0,
        most_calls: int | None = None,
    ) -> WorkflowResult:
        """Run it.

        Args:
            brief: The task as designers see it.
            contexts: Client, prompts and sampling of each role.
            evaluator: Simulates machines for the task.
            settings: As configured.
            record: Receives every event.
            seed: Random seed of the workflow's own choices.
            most_calls: The limit on calls, by which searches plan; clients keep to it.
        """
        used = self.adapt(settings)
        run = WorkflowContext(self.name, brief, contexts, evaluator, used, record, seed, most_calls)
        return await self.stages(run)
