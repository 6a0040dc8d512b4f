"""Verified scores as text for people; programs use --json."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.cli.display.output import Cells, columns, output
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
    console.print(variation_table("simulation", found["verified"]["scores"]))
    for other in found["others"]:
        console.print(f"not part of the median: {outcome(other)} with {other['engine']}")


def variation_table(heading: str, scores: Sequence[Data]) -> Cells:
    """The score under each variation, and its change against the first, the default one."""
    table = columns(heading, "score", "change")
    default, *varied = scores
    table.add_row(default["variation"], outcome(default))
    for item in varied:
        change = change_text(default["score"], item["score"])
        table.add_row(item["variation"], outcome(item), change)
    return table


def change_text(before: float | None, after: float | None) -> str:
    """The relative change of a score; "-" if it has none."""
    if not before or after is None:
        return "-"
    return f"{round(100 * (after / before - 1), 1) + 0.0:+.1f} %"  # no negative zero
