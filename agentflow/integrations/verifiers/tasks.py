"""The task set: every level of a family with every seed, and the score as reward."""

from collections.abc import Iterator

import verifiers.v1 as vf

from agentflow.agents.designer import Designer
from agentflow.agents.tool_agent import Agent
from agentflow.api import design_prompt
from agentflow.env.archive import rollout_json
from agentflow.env.tasks.registry import FAMILIES, get_level, task_names
from agentflow.errors import NoScoreError
from agentflow.integrations.verifiers.bench import BenchConfig, BenchTools, DesignData, DesignState
from agentflow.rewards import Sample, shared_scorer
from agentflow.workflows.tools import MOST_CALLS

ID = "agentflow-verifiers"
"""Name of the task set, which verifiers imports as a top-level module."""


class DesignTaskConfig(vf.TaskConfig):
    """How models design."""

    tools: bool = False
    """Whether they work with tools, and submit a machine, instead of answering with one."""
    bench: BenchConfig = BenchConfig()


class DesignTask(vf.Task[DesignData, DesignState, DesignTaskConfig]):
    """A level with one seed of its trials."""

    @classmethod
    def toolsets(cls, config: DesignTaskConfig) -> list[vf.Toolset]:
        """The bench, if there are tools."""
        return [BenchTools(config.bench)] if config.tools else []

    @vf.stop
    async def submitted(self, trace: vf.Trace) -> bool:
        """Whether a machine is submitted, which ends the rollout."""
        return bool(trace.state.machine)

    @vf.reward
    async def simulated_score(self, trace: vf.Trace) -> float:
        """The score of the machine, in the task's unit; 0 without a valid machine.

        Raises:
            NoScoreError: The simulation timed out or crashed, so that the rollout has no reward.
        """
        data, reply = self.data, trace.state.machine or trace.last_reply
        sample = Sample(data.level, reply, data.seed, engine=data.engine)
        found = await shared_scorer().reward(sample)
        trace.info["simulation"] = rollout_json(found.rollout)
        if found.value is None:
            raise NoScoreError(f"{data.level} has no score: the simulation {found.status}")
        trace.record_metrics(
            {
                "parsed": float(found.parsed),
                "spatial": float(bool(found.spatial)),
                "valid": float(found.valid),
            }
        )
        return found.value


class DesignTasksetConfig(vf.TasksetConfig):
    """Which tasks to load."""

    task: DesignTaskConfig = DesignTaskConfig()
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
        config, tools = self.config, self.config.task.tools
        for level in _levels(config.tasks):
            system, user = design_prompt(
                level,
                engine=config.engine,
                prompts=config.prompts,
                role=(Agent if tools else Designer).name,
            )
            budget = f"\nSubmit one machine. You have {config.task.bench.rollouts} simulations.\n"
            for seed in range(config.seeds):
                data = DesignData(
                    name=f"{level}, seed {seed}",
                    description=get_level(level).file.title,
                    system_prompt=system["content"],
                    prompt=user["content"] + budget * tools,
                    level=level,
                    seed=seed,
                    engine=config.engine,
                )
                yield DesignTask(data, config.task)


def load_environment(
    task: str = "throwing",
    tools: bool = False,
    *,
    seeds: int = 1,
    engine: str = "auto",
    prompts: str = "default",
    bench: BenchConfig | None = None,
) -> vf.Env:
    """An environment on this computer.

    Args:
        task: A family, for all its levels, or one level such as throwing/1.
        tools: Whether models work with tools, in verifiers' chat program, instead of answering
            with a machine.
        seeds: Seeds of each level's trials: 0, 1, ...
        engine: Physics engine.
        prompts: Prompt set.
        bench: Budget of models with tools.
    """
    design = DesignTaskConfig(tools=tools, bench=bench or BenchConfig())
    taskset = DesignTasksetConfig(
        id=ID, task=design, tasks=task, seeds=seeds, engine=engine, prompts=prompts
    )
    chat = {"harness": {"id": "null"}, "max_turns": MOST_CALLS} if tools else {}
    agent = {"runtime": {"type": "subprocess"}, **chat}
    return vf.load_environment(vf.resolve_env_config({"taskset": taskset, "agent": agent}))


def _levels(task: str) -> list[str]:
    """The levels that a name stands for: a family's, or one."""
    if task in FAMILIES:
        return [name for name in task_names() if name.partition("/")[0] == task]
    return [get_level(task).name]
