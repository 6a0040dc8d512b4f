"""Machines, blocks, tasks and model endpoints as text for people; programs use --json."""

import json
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from rich.text import Text

from agentflow.cli.display.output import (
    Data,
    Field,
    answer,
    columns,
    field,
    print_lines,
    print_problems,
    table,
    tell,
)
from agentflow.cli.display.show_scores import record_text, show_requirements, verified_text
from agentflow.metrics.tables import block_count, counted, extents, number

MARGINAL = 3
"""Most marginal connections that are printed; the data holds all."""


def _size(block: Data) -> str:
    return "two-ended" if block["size"] is None else extents(block["size"])


CHECKED = (
    answer("file valid", "file_valid", "not checked"),
    answer("spatially valid", "spatial_valid", "not checked"),
    answer("machine valid", "machine_valid", "not checked"),
    field("size", show=lambda size: f"{extents(size)} m"),
)
BLOCK = (
    *map(field, ("type", "name", "category")),
    Field("size", _size),
    field("mass", show="{:g}".format),
    Field("faces", lambda block: str(len(block["faces"]))),
    Field("set", lambda block: "extended" if block["extended"] else "core"),
)
FACE = (
    field("face", "face_id"),
    field("position", show=lambda position: ", ".join(f"{value:g}" for value in position)),
    field("direction"),
)


PART = (
    field("type"),
    field("name"),
    field("size", show="{} m".format),
    field("number"),
    field("mass", show="{:g} kg".format),
    field("all", "total_mass", "{:g} kg".format),
)


def show_report(report: Data) -> None:
    """Print a validity report and its warnings."""
    print_lines(CHECKED, report)
    if "task" in report:
        met = {True: "met", False: "not met"}.get(report["rules_met"], "not checked")
        tell(f"rules of {report['task']}: {met}")
    print_problems(report["problems"])
    show_requirements(report)
    for warning in report["warnings"]:
        tell(f"warning: {warning['message']}")
    for block in report.get("blocks", ()):
        if "end_a" in block:
            tell(f"block {block['id']}: from {block['end_a']} to {block['end_b']}")
        else:
            tell(f"block {block['id']}: at {block['position']} facing {block['orientation']}")


def show_edit(outcome: Data, out: Path | None = None) -> None:
    """Print the verdict of each step and, if all succeeded, the new machine or its file."""
    for step in outcome["steps"]:
        tell(f"{step['verdict']}: {step['text']}")
        if step["reason"]:
            code = f"{step['code']}: " if step["code"] else ""
            tell(f"  {code}{step['reason']}")
    tell(outcome["outcome"])
    if outcome["outcome"] == "success":
        tell(json.dumps(outcome["machine"]) if out is None else f"machine: {out}")


def show_conversion(result: Data) -> None:
    """Print what was written and which blocks were skipped; warnings."""
    for problem in result["left_out"]:
        tell(f"skipped: {problem['message']}")
    for note in result["notes"]:
        tell(f"note: {note}")
    for warning in result["warnings"]:
        tell(f"warning: {warning}")
    tell(f"{result['out']}: {result['blocks']} blocks")


def show_parts(result: Data) -> None:
    """Print a parts list, and what all parts are together."""
    tell(table(PART, result["rows"]))
    tell(f"{counted(result['blocks'], 'block')}, {result['mass']:g} kg")


def show_guide(result: Data) -> None:
    """Print where instructions are, and how long they are."""
    steps = counted(len(result["steps"]), "step")
    tell(f"{result['out']}: {counted(result['blocks'], 'block')}, {steps}")


def show_rollout(result: Data) -> None:
    """Print a rollout: status, score, feedback and query answers."""
    told = [result["status"], f"score {number(result['score'])}"]
    if result["blocks"] is not None:
        told.append(block_count(result["blocks"], result["most_blocks"]))
    if result["engine"] is not None:
        told.append(result["engine"])
    tell(", ".join(told))
    print_problems(result["problems"])
    if result["feedback"]:
        tell(result["feedback"])
    if result["marginal"]:
        tell(marginal_line(result["marginal"]))
    for answered in result.get("answers", ()):
        tell(str(answered))


def marginal_line(found: Sequence[Data]) -> str:
    """The connections nearest to their strength, in one line; `found` is not empty.

    Each is named once, as it was nearest: it may be there once for each trial, or for each of the
    joints between two blocks.
    """
    ranked = sorted(found, key=lambda item: -abs(item["load"] - 1))
    each = {(item["block"], item["partner"]): item for item in ranked}
    nearest = sorted(each.values(), key=lambda item: abs(item["load"] - 1))
    told = [
        f"block {item['block']} off block {item['partner']} "
        f"{'nearly' if item['load'] < 1 else 'only just'} broke "
        f"({100 * item['load']:.0f} % of its strength, {item['time']:.2f} s)"
        for item in nearest[:MARGINAL]
    ]
    more = len(nearest) - MARGINAL
    return f"marginal: {'; '.join([*told, f'and {more} more'] if more > 0 else told)}"


def show_comparison(found: Data) -> None:
    """Print both machines, and the blocks that only one of them has."""
    both = columns("", "A", "B")
    for name, key in (("machine", "source"), ("blocks", "blocks"), ("mass, kg", "mass")):
        both.add_row(name, *(_plain(machine[key]) for machine in found["machines"]))
    both.add_row("size, m", *(_size(machine) for machine in found["machines"]))
    if found["task"]:
        status = (machine["status"] for machine in found["machines"])
        score = (number(machine["score"]) for machine in found["machines"])
        both.add_row(f"{found['task']}, seed {found['seed']}", *status)
        both.add_row("score", *score)
    if found["engine"]:
        tell(f"engine: {found['engine']}")
    for note in found["notes"]:
        tell(note)
    for kind in found["types"]:
        both.add_row(f"{kind['type']} {kind['name']}", *map(str, kind["counts"]))
    tell(both, wide=True)
    for name, machine in zip("AB", found["machines"], strict=True):
        for problem in machine["problems"]:
            tell(f"{name} is not valid for {found['task']}: {problem}")
    tell(f"{found['same']} blocks are in both machines")
    for name, blocks in zip("AB", found["only"], strict=True):
        for block in blocks:
            ends = " to ".join(str(end) for end in block["positions"])
            where = f"{ends} facing {block['direction']}" if block["direction"] else ends
            tell(f"only in {name}: block {block['id']} ({block['name']}) at {where}")
    for name, controls in zip("AB", found.get("controls", ()), strict=False):
        for control in controls:
            tell(f"only in {name}: {control}")


def _plain(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def show_blocks(blocks: Sequence[Data]) -> None:
    """Print the block library as a table."""
    tell(table(BLOCK, blocks))


def show_block(block: Data) -> None:
    """Print one block and its faces."""
    facts = (block["category"], _size(block), f"{block['mass']:g} kg")
    tell(f"{block['type']} {block['name']}: {', '.join(facts)}")
    tell(table(FACE, block["faces"]))


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
    rows = [
        row for _, family in groupby(tasks, lambda task: task["family"]) for row in (None, *family)
    ]
    tell(table(TASK, rows[1:]), wide=True)
    if engines := {task["record"]["engine"] for task in tasks if task["record"]}:
        tell(f"records: {' and '.join(sorted(engines))}")


def show_task(task: Data) -> None:
    """Print one level in full."""
    tell(Text(f"{task['name']} ({task['title']}): {task['objective']}", style="bold"))
    for part in ("scene", "schedule", "score"):
        tell(f"\n{part}")
        for sentence in task[part]:
            tell(f"  {sentence}")
    tell(f"\nblocks: {', '.join(task['block_names'])}")
    for kind, count in task["required"].items():
        tell(f"required: exactly {count} of type {kind}")
    print_lines(LIMITS, task)
    tell()
    tell(table(KNOB, task["knobs"]), wide=True)


def show_diagnosis(found: Data) -> None:
    """Print what `agentflow doctor` found; the command prints the problem to stderr."""
    print_lines(DIAGNOSIS, found)
    for parameter, action in found["refused"].items():
        tell(f"rejects {parameter}: {action}")
    latency = field("latency", "latency_s", lambda seconds: f"{seconds:.2f} s")
    print_lines((latency,), found)
