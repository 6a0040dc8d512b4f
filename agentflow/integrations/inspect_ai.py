"""Inspect AI: one task per family, `agentflow/throwing` and so on, with all levels as samples.

Inspect finds this module by its entry point and tasks by their names in its registry, so families
from other distributions are there as well.
"""

import base64
from functools import partial
from pathlib import Path
from typing import Any

from inspect_ai import Task, task
from inspect_ai.dataset import MemoryDataset
from inspect_ai.dataset import Sample as LevelSample
from inspect_ai.model import (
    ChatMessage,
    ChatMessageSystem,
    ChatMessageUser,
    Content,
    ContentImage,
    ContentText,
)
from inspect_ai.scorer import Score, Scorer, Target, mean, scorer, stderr
from inspect_ai.solver import Generate, Solver, TaskState, generate, solver
from inspect_ai.tool import Tool, ToolDef, ToolParams
from inspect_ai.util import registry_info

from agentflow.agents.designer import Designer
from agentflow.agents.tool_agent import Agent
from agentflow.api import design_prompt
from agentflow.app.design.run import DesignRun, RunOptions
from agentflow.config.run import DesignConfig
from agentflow.env.archive import rollout_json
from agentflow.env.tasks.registry import FAMILIES, get_level, task_names
from agentflow.integrations.session import Benches
from agentflow.rewards import Reward, Sample, shared_scorer
from agentflow.runs.locations import FEEDBACK, StageName
from agentflow.tools import Bench, ToolSpec
from agentflow.version import __version__
from agentflow.workflows.tools import MOST_CALLS, workflow_of


@solver
def work_at_bench(config: DesignConfig, out: Path) -> Solver:
    """Let the model call tools in a run; the machine that it submits becomes its output.

    Args:
        config: Of the runs, but for the task, which is the sample's.
        out: Parent folder of the runs.
    """

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        async def work(bench: Bench, _stage: StageName) -> None:
            state.messages.append(ChatMessageUser(content=bench.budget_text))
            state.tools = [_tool(bench, spec, state) for spec in bench.tools]
            await generate(state)
            for machine in bench.submitted:
                state.output.completion = machine.to_text()

        workflow = workflow_of(work, f"Inspect AI {state.model}", (FEEDBACK,))
        level = config.model_copy(update={"task": str(state.sample_id)})
        run = DesignRun.create(level, out, RunOptions(workflow=workflow), "")
        state.metadata["run"] = str(run.directory.path)
        await run.carry_out()
        return state

    return solve


PREFIX = "" if registry_info(work_at_bench).name.startswith("agentflow/") else "agentflow/"
"""What Inspect does not put before names itself. It does where this package is in the folder of
installed packages; of editable installations, it knows only those with the package's name."""


def _register_task(family: str) -> None:
    """Register the task of a family with Inspect."""

    @task(name=PREFIX + family)
    def design(
        tools: bool = False,
        vision: bool = False,
        rollouts: int = 24,
        out: str = "runs",
        seed: int = 0,
        engine: str = "auto",
        prompts: str = "default",
    ) -> Task:
        """Design a machine for each level of the family.

        Args:
            tools: Whether the model works with tools, in a run of its own, instead of answering
                with a machine.
            vision: Whether the tools include pictures.
            rollouts: Simulations of a model with tools.
            out: Parent folder of the runs of models with tools.
            seed: Random seed of the levels' trials.
            engine: Physics engine.
            prompts: Prompt set.
        """
        levels = [name for name in task_names() if name.partition("/")[0] == family]
        ask = partial(
            design_prompt, engine=engine, prompts=prompts, role=(Agent if tools else Designer).name
        )
        benches = Benches("Inspect AI", rollouts, vision, engine)
        own = {"prompts": prompts, "workers": 1}
        config = benches.config(levels[0], seed).model_copy(update=own)
        return Task(
            dataset=MemoryDataset([_sample(name, ask(name)) for name in levels], family),
            solver=work_at_bench(config, Path(out).absolute()) if tools else generate(),
            scorer=simulation(seed, engine),
            message_limit=2 * MOST_CALLS if tools else None,
            version=__version__,
        )


def _sample(name: str, prompt: list[dict[str, str]]) -> LevelSample:
    """The sample of a level; its target is a good score."""
    system, user = prompt
    messages: list[ChatMessage] = [
        ChatMessageSystem(content=system["content"]),
        ChatMessageUser(content=user["content"]),
    ]
    return LevelSample(id=name, input=messages, target=str(get_level(name).file.good))


def _tool(bench: Bench, spec: ToolSpec, state: TaskState) -> Tool:
    """A tool of a bench; the one that ends the stage completes the sample."""

    async def call(**kwargs: Any) -> list[Content]:
        result = await bench.call(spec.name, kwargs)
        state.completed = bench.ended
        told: list[Content] = [ContentText(text=result.text)]
        if result.image:
            data = base64.b64encode(result.image).decode()
            told.append(ContentImage(image=f"data:image/png;base64,{data}"))
        return told

    parameters = ToolParams.model_validate(spec.parameters)
    return ToolDef(call, spec.name, spec.description, parameters, max_output=0).as_tool()


@scorer(metrics={"score": [mean(), stderr()], "valid": [mean()]}, name=PREFIX + "simulation")
def simulation(seed: int = 0, engine: str = "auto") -> Scorer:
    """Simulate the machine in a reply.

    The value has `score`, in the task's unit and 0 for an invalid machine, and `valid`. A reply
    whose simulation timed out or crashed is unscored: metrics leave it out and count it.

    Args:
        seed: Random seed of the level's trials.
        engine: Physics engine.
    """

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001
        level, reply = str(state.sample_id), state.output.completion
        return _score(await shared_scorer().reward(Sample(level, reply, seed, engine=engine)))

    return score


def _score(found: Reward) -> Score:
    rollout = found.rollout
    given: dict[str, Any] = {
        "answer": None if found.machine is None else found.machine.to_text(),
        "explanation": rollout.feedback.text,
        "metadata": rollout_json(rollout),
    }
    if found.value is None:
        return Score.unscored(reason="scoring_failed", **given)
    return Score(
        value={"score": found.value, "valid": found.valid},
        reason=None if found.parsed else "invalid_response_format",
        **given,
    )


for _family in FAMILIES:
    _register_task(_family)
