"""verifiers: environments over the levels of a family, for training and evaluation.

The package `agentflow_verifiers`, where verifiers looks for the task set, exports what is here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import verifiers.v1 as vf
from openai import AsyncOpenAI
from verifiers.v1.dialects.chat import message_to_wire

import agentflow
from agentflow.env.archive import rollout_json
from agentflow.env.tasks.registry import FAMILIES, get_level, task_names
from agentflow.errors import NoScoreError
from agentflow.integrations.scoring import Sample, shared_scorer

ID = "agentflow-verifiers"
"""Name of the task set, which verifiers imports as a top-level module."""


class DesignData(vf.TaskData):
    """What to design a machine for."""

    level: str
    seed: int
    engine: str


class DesignTask(vf.Task[DesignData]):
    """A level with one seed of its trials; the model answers with a whole machine."""

    @vf.reward
    async def simulated_score(self, trace: vf.Trace) -> float:
        """The score of the machine, in the task's unit; 0 without a valid machine.

        Raises:
            NoScoreError: The simulation timed out or crashed, so that the rollout has no reward.
        """
        sample = Sample(self.data.level, trace.last_reply, self.data.seed, engine=self.data.engine)
        found = await shared_scorer().reward(sample)
        trace.info["simulation"] = rollout_json(found.rollout)
        if found.value is None:
            raise NoScoreError(f"{self.data.level} has no score: the simulation {found.status}")
        trace.record_metrics(
            {
                "parsed": float(found.parsed),
                "spatial": float(bool(found.spatial)),
                "valid": float(found.valid),
            }
        )
        return found.value


class ReplyHarness(vf.Harness[vf.HarnessConfig]):
    """Asks the model once, in this process: a reply needs no program and no sandbox."""

    APPENDS_SYSTEM_PROMPT = True
    EXECUTES_CODE = False
    NEEDS_CONTAINER = False

    async def launch(
        self,
        ctx: vf.ModelContext,
        trace: vf.Trace,  # noqa: ARG002
        runtime: vf.Runtime,  # noqa: ARG002
        endpoint: str,
        secret: str,
        mcp_urls: dict[str, str],  # noqa: ARG002
        data: vf.TaskData,
    ) -> vf.ProgramResult:
        """Send the prompt to verifiers' endpoint, which records and forwards it."""
        system, prompt = self.resolve_text_prompt(data)
        told = [vf.SystemMessage(content=system or ""), vf.UserMessage(content=prompt or "")]
        messages: Any = [message_to_wire(message) for message in told]
        async with AsyncOpenAI(base_url=endpoint, api_key=secret, max_retries=0) as client:
            await client.chat.completions.create(model=ctx.model, messages=messages)
        return vf.ProgramResult(0, "", "")


class DesignTasksetConfig(vf.TasksetConfig):
    """Which tasks to load."""

    tasks: str = "throwing"
    """A family, for all its levels, or one level such as throwing/1."""
    seeds: int = 1
    """Seeds of each level's trials: 0, 1, ..."""
    engine: str = "auto"
    """Physics engine."""
    prompts: str = "default"
    """Prompt set."""


class DesignTaskset(vf.Taskset[DesignTask, DesignTasksetConfig]):
    """Every level with every seed."""

    def load(self) -> Iterator[DesignTask]:
        """Build the tasks, level by level."""
        config = self.config
        for level in _levels(config.tasks):
            system, user = agentflow.design_prompt(
                level, engine=config.engine, prompts=config.prompts
            )
            for seed in range(config.seeds):
                data = DesignData(
                    name=f"{level}, seed {seed}",
                    description=get_level(level).file.title,
                    system_prompt=system["content"],
                    prompt=user["content"],
                    level=level,
                    seed=seed,
                    engine=config.engine,
                )
                yield DesignTask(data, config.task)


def load_environment(
    task: str = "throwing", *, seeds: int = 1, engine: str = "auto", prompts: str = "default"
) -> vf.Env:
    """An environment on this computer in which the model answers with a whole machine.

    Args:
        task: A family, for all its levels, or one level such as throwing/1.
        seeds: Seeds of each level's trials: 0, 1, ...
        engine: Physics engine.
        prompts: Prompt set.
    """
    taskset = {"id": ID, "tasks": task, "seeds": seeds, "engine": engine, "prompts": prompts}
    agent = {"runtime": {"type": "subprocess"}}
    return vf.load_environment(vf.resolve_env_config({"taskset": taskset, "agent": agent}))


def _levels(task: str) -> list[str]:
    """The levels that a name stands for: a family's, or one."""
    if task in FAMILIES:
        return [name for name in task_names() if name.partition("/")[0] == task]
    return [get_level(task).name]
