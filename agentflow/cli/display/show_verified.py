"""Verified scores as text for people; programs use --json."""

from __future__ import annotations

from agentflow.cli.display.output import Output, columns, output
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


SHOWN = 5
"""Number of blocks and of faces shown, the most sensitive first."""


def show_perturbed(found: Data) -> None:
    """Print how robust a design is."""
    console = output()
    if found["problems"]:
        console.print("invalid; not simulated")
        for problem in found["problems"]:
            console.print(f"{problem['code']}: {problem['message']}")
        return
    console.print(f"score {number(found['score'])} ({found['task']}, {found['engine']})")
    console.print(f"robust score {number(found['robust'])}, the 10 % quantile of all conditions")
    table = columns("condition", "score", "change")
    default, *varied = found["conditions"]
    table.add_row(default["variation"], outcome(default))
    for item in varied:
        table.add_row(item["variation"], outcome(item), _change(default["score"], item["score"]))
    for other in found["others"]:
        change = _change(default["score"], other["score"])
        table.add_row(f"{other['engine']} (not in the quantile)", outcome(other), change)
    console.print(table)
    _show_edits(console, found)


def _show_edits(console: Output, found: Data) -> None:
    spread = found["edits"]
    lost = f"; {spread['missing']} failed for technical reasons" if spread["missing"] else ""
    console.print(f"{spread['count']} neighbours, one edit away{lost}")
    if not spread["count"]:
        return
    if spread["kept"] is not None:
        console.print(f"{spread['kept']:.0%} keep at least half of the score")
    quantiles = (f"{share}: {number(at)}" for share, at in spread["quantiles"].items())
    console.print(f"quantiles of their scores: {', '.join(quantiles)}")
    table = columns("most sensitive", "mean score of its edits")
    for item in found["blocks"][:SHOWN]:
        table.add_row(f"block {item['block']} ({item['name']})", number(item["mean"]))
    for item in found["faces"][:SHOWN]:
        where = f"face {item['face']} of block {item['block']} ({item['name']})"
        table.add_row(where, number(item["mean"]))
    console.print(table)


def _change(before: float | None, after: float | None) -> str:
    """The relative change of a score; "-" if it has none."""
    if not before or after is None:
        return "-"
    return f"{round(100 * (after / before - 1), 1) + 0.0:+.1f} %"  # no negative zero
