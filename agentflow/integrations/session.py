"""One design at a bench, for libraries in which an environment is such a session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import Parameter, Signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from agentflow.app.design.run import DesignRun, RunOptions
from agentflow.app.sessions.clients import RunSession
from agentflow.config.run import DesignConfig
from agentflow.env.physics.engine import AUTO
from agentflow.env.tasks.registry import get_task
from agentflow.rewards import Sample, Scorer, read_knobs, shared_scorer
from agentflow.runs.locations import FEEDBACK
from agentflow.tools import Bench, ToolResult, ToolSpec
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.tools import TOOLS, Worker, workflow_of

FAULTS = ("timeout", "crashed")
"""Statuses of simulations that say nothing about their machine."""


@dataclass(frozen=True)
class Benches:
    """How the designs of one library begin, which share worker processes."""

    author: str
    """Who designs, as results name it."""
    rollouts: int = 24
    """Simulations of a design."""
    vision: bool = False
    """Whether the tools include pictures."""
    engine: str = AUTO
    scorer: Callable[[], Scorer] = shared_scorer
    """Where machines are simulated."""
    out: Path | None = None
    """Parent folder of the runs; None keeps none."""

    def config(self, task: str, seed: int | None, knobs: object = None) -> DesignConfig:
        """The configuration of a run whose worker simulates at once and submits one machine."""
        return DesignConfig(
            task=task,
            knobs=read_knobs(knobs),
            workflow=TOOLS.name,
            settings=WorkflowSettings(
                candidates_per_stage=1, max_simulations=self.rollouts, vision=self.vision
            ),
            seed=seed or 0,
            engine=self.engine,
            verify=False,
        )

    def begin(self, task: str, seed: int | None, knobs: object = None) -> BenchSession:
        """Begin a design at a level, with the random seed of its trials and changed knobs.

        Raises:
            UsageError: The task, a knob or the engine does not exist.
        """
        return BenchSession(self, self.config(task, seed, knobs))


class BenchSession:
    """A run at a bench, without an event loop of the caller's; it ends with the submission."""

    def __init__(self, benches: Benches, config: DesignConfig) -> None:
        """Begin the run."""
        get_task(config.task, config.knobs, config.engine)
        self._scorer, self._config, self._author = benches.scorer(), config, benches.author
        self._temporary = TemporaryDirectory() if benches.out is None else None
        self._out = benches.out or Path(self._temporary.name if self._temporary else "")
        self._faulty = False
        self.bench = self._scorer.wait_for(self._open())

    async def _open(self) -> Bench:
        async def leave_unverified(_path: Path) -> bool:
            return False

        self._session = RunSession(self._begin, leave_unverified, lambda _line: None)
        bench = await self._session.bench()
        assert bench is not None  # there is one stage
        return bench

    def _begin(self, worker: Worker) -> DesignRun:
        workflow = workflow_of(worker, self._author, (FEEDBACK,))
        options = RunOptions(pool=self._scorer.pool, workflow=workflow)
        return DesignRun.create(self._config, self._out, options, "")

    @property
    def submitted(self) -> str:
        """The submitted machine as JSON text; "" before that."""
        return self.bench.submitted[-1].to_text() if self.bench.submitted else ""

    @property
    def lost(self) -> bool:
        """Whether a simulation or the run failed and nothing is submitted: no sample."""
        return self._faulty and not self.bench.submitted

    def call(self, tool: str, arguments: object) -> ToolResult:
        """Call a tool; what does not fit is refused. After the submission, those that only read
        still answer.

        Raises:
            AgentflowError: The run cannot go on.
        """
        ended, faulty = self.bench.ended, self._faulty
        answer = self.bench.review if ended else self.bench.call
        self._faulty = True  # unless there is an answer
        result = self._scorer.wait_for(answer(tool, arguments))
        if self.bench.ended and not ended:
            self._scorer.wait_for(self._session.finish())
        self._faulty = faulty or result.data.get("status") in FAULTS
        return result

    def score(self) -> float | None:
        """The reward of the submitted machine, simulated again; 0 if there is none.

        None after a time-out or crash, which says nothing about the design.
        """
        if not self.submitted:
            return None if self.lost else 0.0
        config = self._config
        sample = Sample(config.task, self.submitted, config.seed, config.knobs, config.engine)
        return self._scorer.rewards([sample])[0].value

    def close(self) -> None:
        """End the run with what is submitted."""
        self._scorer.wait_for(self._session.finish())
        if self._temporary is not None:
            self._temporary.cleanup()


def signature_of(
    spec: ToolSpec, annotate: Callable[[Mapping[str, Any]], Any], *first: Parameter
) -> Signature:
    """The signature of a function that calls a tool, from which libraries make a schema again.

    Args:
        spec: The tool.
        annotate: The annotation of a parameter, from its schema.
        first: Parameters before those of the tool.
    """
    required = spec.parameters.get("required", ())
    parameters = (
        Parameter(
            name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if name in required else schema.get("default"),
            annotation=annotate(schema),
        )
        for name, schema in spec.parameters["properties"].items()
    )
    return Signature([*first, *parameters])
