"""The tools that cost nothing: read the task, write, edit, describe and list machines."""

import json
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from agentflow.machine.blocks.library import library
from agentflow.machine.description.geometry_info import describe as geometry_of
from agentflow.machine.description.geometry_info import describe_text, joined_lines
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.edits.script import MAX_WIDTH, EditOutcome, apply_script
from agentflow.machine.formats.detect import read_for
from agentflow.machine.geometry.placement import place
from agentflow.machine.problems import Problem
from agentflow.machine.tree import Machine
from agentflow.machine.validity import Report
from agentflow.machine.validity import check as check_machine
from agentflow.tools.results import RefusedCall, ToolResult
from agentflow.tools.workspace import Call, KnownMachine, Workspace

MAX_PROBLEMS = 12
"""Most problems and verdicts in a text; the data has all."""

JsonText = Annotated[
    str, BeforeValidator(lambda value: value if isinstance(value, str) else json.dumps(value))
]
"""JSON text; some models send the value itself, which is the same."""
Note = Annotated[str, Field(max_length=MAX_WIDTH)]


async def brief(call: Call) -> ToolResult:
    """Read the task (scene, schedule, score, blocks, rules) and what is left of your budget."""
    host = call.workspace.host
    return ToolResult(
        call.workspace.brief_text, {"text": host.brief_text, **call.workspace.budget_data}
    )


async def check(call: Call, machine: JsonText, note: Note = "", parent: str = "") -> ToolResult:
    """Check a whole machine: returns its name, which the other tools take, or all its problems.

    Args:
        machine: JSON text of a construction tree, such as [{"type": 0, "id": 0, "parent": -1,
            "face_id": -1}, {"type": 1, "id": 1, "parent": 0, "face_id": 4}], or of coordinates.
        note: What you try with it, which `history` shows.
        parent: Name of the machine that it is a variant of, if there is one.
    """
    workspace = call.workspace
    report = check_machine(read_for(workspace.host.brief, machine), workspace.host.brief)
    if report.machine is None or report.lasting_problems:
        raise _invalid("The machine is not valid", report)
    origin = workspace.machines.find(parent).name if parent else ""
    return _named(workspace, report.machine, report, origin, note=note)


async def describe(call: Call, machine: str, short: bool = False) -> ToolResult:
    """Describe a machine: what each block is attached to, positions, balance, joints, collisions.

    Args:
        machine: Name of the machine.
        short: Leave out building points, positions of free faces, and what joints carry and hit.
    """
    known = call.workspace.machines.find(machine)
    text = describe_text(known.machine, call.workspace.host.brief, short=short)
    statics = "" if short else statics_text(known.machine, call.workspace.host.brief)
    data = {
        "machine": known.name,
        "tree": known.machine.to_json(),
        **geometry_of(known.machine, call.workspace.host.brief),
        "statics": statics,
    }
    whole = f"Machine {known.name}, in the machine frame\n{text}\n{statics}"
    return ToolResult(whole.rstrip(), data)


async def edit(call: Call, machine: str, script: str) -> ToolResult:
    """Edit a machine by commands, all or nothing; the result is a new one.

    Args:
        machine: Name of the machine to edit, which stays as it is.
        script: One command per line: `Add TYPE to ID in FACE`, `Remove ID`, `Move ID to ID in
            FACE`, `Replace ID with TYPE`, `Mirror ID` (or a side: x+, x-); for two-ended blocks
            `Add TYPE to ID in FACE to ID in FACE` and `Move ID end a to ID in FACE` (or b). FACE
            is a number or where the face looks in the machine frame, such as x+.
    """
    workspace = call.workspace
    known = workspace.machines.find(machine)
    outcome = apply_script(known.machine, script, workspace.host.brief)
    if not outcome.success:
        verdicts = _shorten(outcome.steps)
        text = f"The script failed, and machine {known.name} is unchanged:\n{verdicts}"
        code = next(step.code for step in outcome.steps if step.verdict == "Error")
        raise RefusedCall(text, code, verdicts=[step.to_json() for step in outcome.steps])
    if outcome.machine == known.machine:
        raise RefusedCall(f"the script changes nothing about machine {known.name}; send commands")
    report = check_machine(outcome.machine, workspace.host.brief)
    if report.lasting_problems:
        raise _invalid("The edited machine is not valid, so it was not made", report)
    made = _named(workspace, report.machine or outcome.machine, report, known.name, script)
    data = {
        **made.data,
        "parent": known.name,
        "id_map": {str(old): new for old, new in outcome.id_map.items()},
        "names": outcome.names,
        "changes": outcome.changes,
    }
    return ToolResult(f"{made.text}\nChanges from {known.name}: {_difference(outcome)}", data)


async def history(call: Call) -> ToolResult:
    """List all machines so far: parent, edit or note, score, and where each was submitted."""
    rows = [_history_row(call.workspace, known) for known in call.workspace.machines]
    if not rows:
        return ToolResult("No machines so far; `check` makes the first.", {"machines": []})
    lines = ["machine | blocks | parent | edit or note | score | submitted in"]
    for row in rows:
        edit = "; ".join(str(row["edit"] or row["note"] or "-").split("\n"))[:MAX_WIDTH]
        cells = row["machine"], row["blocks"], row["parent"] or "-", edit, row["score_text"]
        lines.append(" | ".join(map(str, (*cells, row["submitted"] or "-"))))
    return ToolResult("\n".join(lines), {"machines": rows})


def _named(
    workspace: Workspace,
    machine: Machine,
    report: Report,
    parent: str = "",
    script: str = "",
    note: str = "",
) -> ToolResult:
    """Name a machine whose only problems are missing blocks."""
    known = workspace.name(machine, parent, script, note)
    blocks = len(machine)
    state = "valid" if report.task_valid else "valid so far, but not complete"
    lines = [f"Machine {known.name}: {state}, {blocks} block{'' if blocks == 1 else 's'}."]
    lines += [f"- {problem.message}" for problem in (*report.problems, *report.warnings)]
    lines += [f"- {note}" for note in report.notes[:MAX_PROBLEMS]]
    lines += joined_lines(place(machine))
    data = {
        "machine": known.name,
        "complete": report.task_valid,
        **workspace.host.brief.budget_json(machine),
        "size": report.size,
        "problems": _problem_data(report.problems),
        "warnings": _problem_data(report.warnings),
        "notes": list(report.notes),
    }
    return ToolResult("\n".join(lines), data)


def _invalid(text: str, report: Report) -> RefusedCall:
    problems = _shorten(problem.message for problem in report.problems)
    code = report.problems[0].code
    return RefusedCall(f"{text}:\n{problems}", code, problems=_problem_data(report.problems))


def _problem_data(problems: Sequence[Problem]) -> list[dict[str, object]]:
    return [problem.to_json() for problem in problems]


def _shorten(items: Any) -> str:
    """A list with one item per line, cut to a sane length."""
    lines = [f"- {item}" for item in items]
    more = len(lines) - MAX_PROBLEMS
    return "\n".join([*lines[:MAX_PROBLEMS], *([f"- and {more} more"] if more > 0 else [])])


def _difference(outcome: EditOutcome) -> str:
    """Which blocks an edit added, removed and renumbered, and what else it changed."""
    names = {block: name for name, block in outcome.names.items()}
    kept = {new for new in outcome.id_map.values() if new is not None}
    added = [step for step in outcome.machine if step.id not in kept]
    gone = [str(old) for old, new in outcome.id_map.items() if new is None]
    moved = _renumbered(outcome.id_map)
    parts = [f"{len(kept)} of {len(outcome.id_map)} blocks kept"]
    if added:
        told = (f"{step.id} {names.get(step.id, library()[step.type].name)}" for step in added)
        parts.append(f"added {', '.join(told)}")
    parts += [f"removed {', '.join(gone)}"] if gone else []
    parts += [f"renumbered: {', '.join(moved)}"] if moved else []
    parts += outcome.changes
    return "; ".join(parts) + "."


def _renumbered(ids: Mapping[int, int | None]) -> list[str]:
    """Old and new ids; rows that moved alike as ranges."""
    moved = sorted((old, new) for old, new in ids.items() if new is not None and new != old)
    runs = groupby(enumerate(moved), key=lambda item: (item[1][0] - item[0], item[1][1] - item[0]))
    rows = [[pair for _, pair in run] for _, run in runs]
    return [
        f"{row[0][0]}-{row[-1][0]} are now {row[0][1]}-{row[-1][1]}"
        if len(row) > 1
        else f"{row[0][0]} is now {row[0][1]}"
        for row in rows
    ]


def _history_row(workspace: Workspace, known: KnownMachine) -> dict[str, object]:
    result = workspace.result_of(known.machine)
    score = result.score if result else None
    unscored = result.status if result else "not simulated"
    return {
        "machine": known.name,
        "blocks": len(known.machine),
        "parent": known.parent or None,
        "edit": known.script or None,
        "note": known.note or None,
        "score": score,
        "score_text": unscored if score is None else f"{score:.2f}",
        "submitted": known.submitted,
    }
