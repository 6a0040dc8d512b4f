"""Tasks and model endpoints as text for people; programs use --json."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from rich.text import Text

from agentflow.cli.display.output import Data, Field, answer, field, output, print_lines, table
from agentflow.cli.display.show_scores import record_text, verified_text


def _good_score(task: Data) -> str:
    """A good score, and the greatest possible one where there is one."""
    greatest = "" if task["greatest"] is None else f" of at most {task['greatest']:g}"
    return f"{task['good']:g}{greatest}"


TASK = (
    field("task", "name"),
    field("level", "title"),
    field("window", show=lambda seconds: f"{seconds:g} s"),
    Field("good score", _good_score),
    field("record", show=lambda record: verified_text(record["verified"], record["fragile"])),
    Field("block types", lambda task: str(len(task["blocks"]))),
    field("objective"),
)
LIMITS = (
    field("most blocks", "most_blocks"),
    Field("good score", _good_score),
    field("record", show=record_text),
    Field("note", lambda task: task["note"] or None),
)
KNOB = (
    field("knob", "name"),
    field("value"),
    Field("meaning and range", lambda knob: f"{knob['help']} ({knob['range']})"),
)
DIAGNOSIS = (
    field("endpoint", "base_url"),
    Field(
        "model",
        lambda found: (
            found["model"]
            + (f" (answers as {found['answered_as']})" if found["answered_as"] else "")
        ),
    ),
    answer("reachable", "reachable", "unknown"),
    answer("authorised", "authorised", "unknown"),
    answer("model exists", "model_exists", "unknown"),
    answer("streaming", "streaming", "unknown"),
    answer("reports tokens", "usage", "unknown"),
    answer("returns reasoning", "reasoning", "unknown"),
    Field("machine", lambda found: found["machine"] or None),
)


def show_tasks(tasks: Sequence[Data]) -> None:
    """Print the list of tasks, with a blank line between families."""
    console = output()
    rows = [
        row for _, family in groupby(tasks, lambda task: task["family"]) for row in (None, *family)
    ]
    console.print_wide(table(TASK, rows[1:]))
    if engines := {task["record"]["engine"] for task in tasks if task["record"]}:
        console.print(f"records: {' and '.join(sorted(engines))}")


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
    print_lines(console, LIMITS, task)
    console.print()
    console.print_wide(table(KNOB, task["knobs"]))


def show_diagnosis(found: Data) -> None:
    """Print what `agentflow doctor` found; the command prints the problem to stderr."""
    console = output()
    print_lines(console, DIAGNOSIS, found)
    for parameter, action in found["refused"].items():
        console.print(f"rejects {parameter}: {action}")
    latency = field("latency", "latency_s", lambda seconds: f"{seconds:.2f} s")
    print_lines(console, (latency,), found)
