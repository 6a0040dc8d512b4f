"""Recorded runs as text for people; programs use --json."""

from __future__ import annotations

from collections.abc import Iterable

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show import (
    VALID,
    Data,
    marginal_line,
    record_line,
    show_objectives,
    show_tools,
    verified_line,
)
from agentflow.cli.display.text import block_count, number


def show_runs(runs: Iterable[Data]) -> None:
    """Print a list of runs; a column names the engines if there are several."""
    console, runs = output(), tuple(runs)
    engines = {item["engine"] for item in runs if item["engine"]}
    keys = ["run", "state", "task", "workflow", "model", "seed", *["engine"] * (len(engines) > 1)]
    table = columns(*keys, "score", "verified", "cost")
    for item in runs:
        cells = [item[key] for key in keys]
        shown = ["-" if cell is None else str(cell) for cell in cells]
        verified = (item["verified"] or {}).get("score")
        table.add_row(*shown, number(item["score"]), number(verified), _money(item["cost"]))
        if item["problem"]:
            console.print(item["problem"])
    if table.row_count:
        console.print_wide(table)
        if len(engines) == 1:
            console.print(f"engine: {engines.pop()}")
    else:
        console.print("no runs")


def show_run(run: Data) -> None:
    """Print one run."""
    console = output()
    console.print(f"{run['run']}: {run['state']}")
    made = (run["task"], run["workflow"], run["model"], f"seed {run['seed']}", run["engine"])
    console.print(", ".join(filter(None, made)))
    if start := run["config"]["settings"].get("start"):
        blocks = start["blocks"] if isinstance(start, dict) else start
        console.print(f"started from a machine with {len(blocks)} blocks")
    found = [f"best score {number(run['score'])}"]
    if run["blocks"] is not None:
        found.append(block_count(run["blocks"], run["most_blocks"]))
        found.append(f"found in stage {run['best_stage']}")
    console.print(", ".join(found))
    if run["verified"]:
        console.print(verified_line(run["verified"]))
    show_objectives(run)
    if (record := run["record"]) and record["share"] is not None:
        console.print(record_line(record))
    if run["marginal"]:
        console.print(marginal_line(run["marginal"]))
    if run["stopped"] or run["reason"]:
        limit = "limit " * (run["stopped"] == "budget")
        why = " ".join((run["reason"] or f"stopped: {run['stopped']} {limit}reached").split())
        console.print(why)
    table = columns("stage", *VALID, "mean", "best", "calls", "rollouts")
    for row in run["stages"]:
        counts = (f"{row[key]}/{row['trajectories']}" for key in ("valid_first", "valid"))
        scores = (number(row["mean"]), number(row["max"]))
        table.add_row(row["name"], *counts, *scores, str(row["calls"]), str(row["rollouts"]))
    console.print(table)
    show_tools(run["stages"])
    table = columns("role", "calls", "tokens", "reasoning", "seconds", "cost")
    for role, spent in run["spent"].items():
        whole = (str(spent[key]) for key in ("calls", "tokens", "reasoning"))
        table.add_row(role, *whole, f"{spent['seconds']:.1f}", _money(spent["money"]))
    console.print(table)
    _print_failures(run["failures"], every=False)
    for remark in run["remarks"]:
        console.print(f"notice: {remark}")


def show_rescored(found: Data) -> None:
    """Print the machines whose rollouts differ from the record."""
    console = output()
    other = [item for item in found["machines"] if not item["identical"]]
    if other:
        engines = found["engine"]
        same = engines["recorded"] in (None, engines["now"])
        times = [name if same else f"{name} ({engines[name]})" for name in ("recorded", "now")]
        table = columns("machine", "first simulated as", *times, "difference")
        for item in other:
            then, now = (outcome(item[key]) for key in ("recorded", "now"))
            change = item["difference"]
            shown = "-" if change is None else f"{change:+.3f}"
            table.add_row(item["machine"], item["place"], then, now, shown)
        console.print_wide(table)
    if found["note"]:
        console.print(found["note"])
    for item in found["machines"]:
        if item["note"]:
            console.print(f"notice: {item['machine']} {item['note']}")
    for name in ("constants", "engine"):
        condition = found[name]
        if condition["recorded"] != condition["now"]:
            recorded = condition["recorded"] or "unknown"
            console.print(f"{name}: recorded {recorded}, now {condition['now']}")
    total = len(found["machines"])
    console.print(f"{found['identical']} of {total} machines have the same rollout as recorded")


def show_failures(found: Data) -> None:
    """Print the count of each kind of failure."""
    _print_failures(found, every=True)


def _print_failures(found: Data, *, every: bool) -> None:
    """Print the count of each kind; with `every`, also of kinds that did not occur."""
    console = output()
    console.print(
        f"{found['refused']} of {found['replies']} replies rejected; "
        f"{found['machines']} machines simulated"
    )
    kinds = [kind for kind in found["kinds"] if every or kind["count"]]
    if kinds:
        table = columns("category", "failure", "count", "out of")
        for kind in kinds:
            total = found["replies"] if kind["unit"] == "reply" else found["machines"]
            of = f"{total} {'replies' if kind['unit'] == 'reply' else 'machines'}"
            table.add_row(kind["level"], kind["name"], str(kind["count"]), of)
        console.print(table)


def _money(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def outcome(item: Data) -> str:
    """A score, with the status of its simulation unless that is ok."""
    status = "" if item["status"] == "ok" else f" ({item['status']})"
    return f"{number(item['score'])}{status}"
