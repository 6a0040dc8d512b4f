"""Prompts for reinforcement learning: a parquet file with the columns that verl and TRL read."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.files.atomic import write_output
from agentflow.models.local.libraries import require_libraries

DATA_SOURCE = "agentflow"
"""By it, verl groups its metrics and chooses its reward function."""


def prompt_rows(tasks: Sequence[str], count: int, engine: str) -> list[dict[str, Any]]:
    """Rows for the rewards in `integrations`, alternating between tasks, each with its own seed.

    `task` and `seed` are for TRL, the rest but `prompt` is for verl.

    Raises:
        UsageError: A task or the engine does not exist, or there is no task.
    """
    if not tasks:
        raise UsageError("name at least one task, as in --tasks throwing,movement/3")
    prompts = {task: chat_prompt(Designer, get_task(task, engine=engine).brief) for task in tasks}
    return [
        {
            "data_source": DATA_SOURCE,
            "prompt": prompts[task],
            "ability": "design",
            "reward_model": {"style": "rule", "ground_truth": task},
            "extra_info": {"index": index, "seed": index, "knobs": "{}"},
            "task": task,
            "seed": index,
        }
        for index, task in enumerate(islice(cycle(tasks), count))
    ]


def write_prompts(out: Path, tasks: Sequence[str], count: int, engine: str) -> dict[str, Any]:
    """Write the rows to a parquet file; `out` and the number of `rows`.

    Raises:
        UsageError: As `prompt_rows` does, or the file cannot be written.
        ConfigError: The library datasets is not installed.
    """
    rows = prompt_rows(tasks, count, engine)
    require_libraries("datasets")
    from datasets import Dataset

    with write_output(out) as part:
        Dataset.from_list(rows).to_parquet(part)
    return {"out": str(out), "rows": len(rows)}
