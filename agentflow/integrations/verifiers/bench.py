"""The bench as a tool server of verifiers, in a process of its own for each rollout.

verifiers runs this module as a program.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import verifiers.v1 as vf
from mcp.types import CallToolResult
from pydantic import WithJsonSchema

from agentflow.integrations.mcp.content import tool_result
from agentflow.integrations.session import Benches, signature_of
from agentflow.rewards import shared_scorer
from agentflow.tools import ToolSpec


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
        scorer = partial(shared_scorer, 1)
        options = (given.rollouts, given.vision, task.engine, scorer, given.out)
        begin = Benches("verifiers", *options).begin
        self._session = await asyncio.to_thread(begin, task.level, task.seed)
        self._exit_stack.callback(self._session.close)

    def register(self, mcp: Any) -> None:
        """Offer the tools of the bench, with their own schemas."""
        for spec in self._session.bench.tools:
            mcp.add_tool(self._with_state(self._function(spec)), spec.name, None, spec.description)

    def _function(self, spec: ToolSpec) -> Callable[..., Awaitable[CallToolResult]]:
        async def call(**arguments: Any) -> CallToolResult:
            result = await asyncio.to_thread(self._session.call, spec.name, arguments)
            self.state.machine = self._session.submitted
            return tool_result(result)

        call.__signature__ = signature_of(spec, _annotation)  # type: ignore[attr-defined]
        return call


def _annotation(schema: Mapping[str, Any]) -> Any:
    """A type with this schema; the library would read JSON text as data for any type but str."""
    kind = str if schema.get("type") == "string" else Any
    return Annotated[kind, WithJsonSchema(dict(schema))]


if __name__ == "__main__":
    BenchTools.run()
