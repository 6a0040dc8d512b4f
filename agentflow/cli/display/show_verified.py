"""Verified scores as text for people; programs use --json."""

from __future__ import annotations

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show import Data, verified_line
from agentflow.cli.display.show_records import outcome
from agentflow.cli.display.text import number


def show_verified(found: Data) -> None:
    """Print a verified score and the score under each variation."""
    console = output()
    if found["problems"]:
        console.print(f"invalid, verified score {number(found['verified']['score'])}")
        for problem in found["problems"]:
            console.print(f"{problem['code']}: {problem['message']}")
        return
    console.print(f"score {number(found['score'])} ({found['task']}, {found['engine']})")
    console.print(verified_line(found["verified"]))
    table = columns("simulation", "score", "change")
    default, *varied = found["verified"]["scores"]
    table.add_row(default["variation"], outcome(default))
    for item in varied:
        table.add_row(item["variation"], outcome(item), _change(default["score"], item["score"]))
    console.print(table)
    for other in found["others"]:
        console.print(f"not part of the median: {outcome(other)} with {other['engine']}")


def _change(before: float | None, after: float | None) -> str:
    """The relative change of a score; "-" if it has none."""
    if not before or after is None:
        return "-"
    return f"{round(100 * (after / before - 1), 1) + 0.0:+.1f} %"  # no negative zero
