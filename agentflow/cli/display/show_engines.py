"""A comparison of physics engines as text for people; programs use --json."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show import Data
from agentflow.cli.display.show_records import outcome


def show_engines(found: Data) -> None:
    """Print the results of each machine, and the rank correlations of each family."""
    console, engines = output(), found["engines"]
    breaks = [f"first break ({engine})" for engine in engines]
    table = columns("machine", *engines, *["difference"] * (len(engines) - 1), *breaks)
    for item in found["machines"]:
        results = item["results"]
        broken = (_first_break(result) for result in results)
        table.add_row(item["machine"], *map(outcome, results), *_differences(results), *broken)
    console.print_wide(table)
    table = columns("family", "machines", *(f"{engine}, Spearman" for engine in engines[1:]))
    for family in found["families"]:
        told = ("-" if value is None else f"{value:.3f}" for value in family["correlations"])
        table.add_row(family["family"], str(family["machines"]), *told)
    console.print(table)
    console.print(f"correlations are with {engines[0]}")
    if found["note"]:
        console.print(found["note"])


def _differences(results: Sequence[Data]) -> list[str]:
    """What the machine scores more on the other engines, if all could simulate it."""
    first, *others = results
    if any(result["status"] != "ok" for result in results):
        return ["-"] * len(others)
    return [f"{other['score'] - first['score']:+.2f}" for other in others]


def _first_break(result: Data) -> str:
    broken = result["first_break"]
    return "none" if broken is None else f"block {broken['block']}, {broken['time']:.2f} s"
