"""How robust a design is, as text for people; programs use --json."""

from __future__ import annotations

from agentflow.cli.display.output import Output, columns, output
from agentflow.cli.display.show import Data
from agentflow.cli.display.show_records import outcome
from agentflow.cli.display.show_verified import change_text, variation_table
from agentflow.cli.display.text import number

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
    table = variation_table("condition", found["conditions"])
    for other in found["others"]:
        change = change_text(found["score"], other["score"])
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
