"""The tasks and blocks that there are, as objects."""

from agentflow.app.tasks import TaskInfo, task_info
from agentflow.env.tasks.registry import knob_names, task_names
from agentflow.machine import BlockType, library


def tasks() -> tuple[TaskInfo, ...]:
    """Every task, as `agentflow tasks` lists them; see `task`."""
    return tuple(map(task, task_names()))


def task(name: str, **knobs: object) -> TaskInfo:
    """One task: scene, schedule, score, knobs with their ranges, record, a good score.

    Args:
        name: Level, such as "throwing" or "throwing/3", or path of a level's YAML file.
        **knobs: Knobs to change. Where their name has a dot, write an underscore:
            `task("throwing", wall_height=2)`.

    Raises:
        UsageError: The task or a knob does not exist, or a value is out of range.
    """
    return task_info(name, knob_names(name, knobs))


def blocks() -> tuple[BlockType, ...]:
    """Every block type, by number: size, mass, faces and behaviour in the block's own frame."""
    return tuple(library().values())
