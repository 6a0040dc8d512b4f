"""The bench as a tool server of verifiers, in a process of its own for each rollout.

verifiers runs this module as a program.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from inspect import Parameter, Signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import verifiers.v1 as vf
from mcp.types import CallToolResult
from pydantic import WithJsonSchema

from agentflow.app.design.run import DesignRun, RunOptions
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import RolloutPool
from agentflow.integrations.mcp.content import tool_result
from agentflow.runs.locations import FEEDBACK, StageName
from agentflow.tools import Bench, ToolSpec
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.tools.workflow import TOOLS, workflow_of


class DesignData(vf.TaskData):
    """What to design a machine for."""

    level: str
    seed: int
    engine: str


class DesignState(vf.State):
    """What the reward learns from the tools."""

    machine: str = ""
    """The submitted machine as JSON text."""


class BenchConfig(vf.ToolsetConfig):
    """The bench of a rollout."""

    rollouts: int = 24
    """Simulations that the model may use."""
    vision: bool = False
    """Whether the tools include pictures."""
    out: Path | None = None
    """Parent folder of the runs; by default they are not kept."""


class BenchTools(vf.Toolset[BenchConfig, DesignState]):
    """The tools of a bench, where a rollout is a run."""

    TOOL_PREFIX = None

    async def setup_task(self, task: DesignData) -> None:
        """Begin the run."""
        given = self.config
        out = given.out or Path(self._exit_stack.enter_context(TemporaryDirectory()))
        pool = await self._exit_stack.enter_async_context(RolloutPool(1))
        settings = WorkflowSettings(
            candidates_per_stage=1, max_simulations=given.rollouts, vision=given.vision
        )
        config = DesignConfig(
            task=task.level,
            workflow=TOOLS.name,
            settings=settings,
            seed=task.seed,
            engine=task.engine,
            verify=False,
        )
        opened: asyncio.Future[Bench] = asyncio.get_running_loop().create_future()

        async def work(bench: Bench, _stage: StageName) -> None:
            opened.set_result(bench)
            await bench.wait_ended()

        options = RunOptions(pool=pool, workflow=workflow_of(work, "verifiers", (FEEDBACK,)))
        run = DesignRun.create(config, out, options, "")
        self._working = asyncio.create_task(run.carry_out())
        either: set[asyncio.Future[Any]] = {self._working, opened}
        await asyncio.wait(either, return_when="FIRST_COMPLETED")
        if not opened.done():
            self._working.result()
        self._bench = opened.result()

    def register(self, mcp: Any) -> None:
        """Offer the tools of the bench, with their own schemas."""
        for spec in self._bench.tools:
            mcp.add_tool(self._with_state(self._function(spec)), spec.name, None, spec.description)

    def _function(self, spec: ToolSpec) -> Callable[..., Awaitable[CallToolResult]]:
        async def call(**arguments: Any) -> CallToolResult:
            result = await self._bench.call(spec.name, arguments)
            if self._bench.ended:
                await self._working
                self.state.machine = self._bench.submitted[-1].to_text()
            return tool_result(result)

        call.__signature__ = _signature(spec)  # type: ignore[attr-defined]
        return call


def _signature(spec: ToolSpec) -> Signature:
    """Parameters from which the protocol's library makes the schema of a tool again."""
    required = spec.parameters.get("required", ())
    return Signature(
        [
            Parameter(
                name,
                Parameter.KEYWORD_ONLY,
                default=Parameter.empty if name in required else schema.get("default"),
                annotation=_annotation(schema),
            )
            for name, schema in spec.parameters["properties"].items()
        ]
    )


def _annotation(schema: Mapping[str, Any]) -> Any:
    """A type with this schema; the library would read JSON text as data for any type but str."""
    kind = str if schema.get("type") == "string" else Any
    return Annotated[kind, WithJsonSchema(dict(schema))]


if __name__ == "__main__":
    BenchTools.run()
