"""Tasks as text for people; programs use --json."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show import Data


def show_tasks(tasks: Sequence[Data]) -> None:
    """Print the list of tasks, with a blank line between families."""
    table = columns("task", "level", "window", "good score", "blocks", "objective")
    for index, task in enumerate(tasks):
        if index and task["family"] != tasks[index - 1]["family"]:
            table.add_row()
        table.add_row(
            task["name"],
            task["title"],
            f"{task['window']:g} s",
            f"{task['good']:g}",
            str(len(task["blocks"])),
            task["objective"],
        )
    output().print(table)


def show_task(task: Data) -> None:
    """Print one level in full."""
    console = output()
    console.print(Text(f"{task['name']} ({task['title']}): {task['objective']}", style="bold"))
    for part in ("scene", "schedule", "score"):
        console.print(f"\n{part}")
        for sentence in task[part]:
            console.print(f"  {sentence}")
    console.print(f"\nblocks: {', '.join(task['block_names'])}")
    for kind, count in task["required"].items():
        console.print(f"required: exactly {count} of type {kind}")
    console.print(f"good score: {task['good']:g}")
    if task["note"]:
        console.print(f"note: {task['note']}")
    console.print()
    table = columns("knob", "value", "range", "description")
    for knob in task["knobs"]:
        table.add_row(knob["name"], str(knob["value"]), knob["range"], knob["help"])
    console.print(table)
