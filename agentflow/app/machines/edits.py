"""Applies edit scripts to machines from files and JSON lines."""

from pathlib import Path
from typing import Any

from agentflow.app.machines.files import parse_line, read_source
from agentflow.errors import UsageError
from agentflow.files.atomic import write_file
from agentflow.machine import Brief, StepVerdict, apply_script, check
from agentflow.machine.formats.detect import read_for, read_text

FORM = '{"machine": [...], "script": "Remove 3"}'


def edit_file(
    source: str, script: str, brief: Brief | None, out: Path | None = None
) -> dict[str, Any]:
    """Apply a script to a machine file.

    Args:
        source: File, run directory (its best machine), or `-` for standard input.
        script: File, or `-` unless the machine comes from there.
        brief: The rules of a task that the machine must obey.
        out: File to write the edited machine to, as a construction tree; nothing is written if a
            command fails.
    """
    if out is not None and out.suffix != ".json":
        raise UsageError(
            f"{out} is not a .json file: write one, then change its format with agentflow convert"
        )
    if source == script == "-":
        raise UsageError(
            "machine and script cannot both come from standard input; use --script FILE"
        )
    report = check(read_source(source, brief), brief)
    if report.machine is None:
        raise UsageError(f"{source} cannot be edited: {report.problems[0].message}")
    outcome = apply_script(report.machine, read_text(script), brief)
    if out is not None and outcome.success:
        write_file(out, outcome.machine.to_text() + "\n")
    return outcome.to_json()


def edit_line(text: str, brief: Brief | None) -> dict[str, Any]:
    """The outcome of a line, even if it is not JSON or holds no machine."""
    line = parse_line(text)
    machine = line.get("machine") if isinstance(line, dict) else None
    script = line.get("script") if isinstance(line, dict) else None
    if machine is None or not isinstance(script, str):
        return _failure(machine, f"expected a JSON object like {FORM}")
    report = check(read_for(brief, machine), brief)
    if report.machine is None:
        return _failure(machine, f"the machine cannot be edited: {report.problems[0].message}")
    return apply_script(report.machine, script, brief).to_json()


def _failure(machine: object, reason: str) -> dict[str, Any]:
    """The outcome of a line whose script was not applied."""
    verdict = StepVerdict("", "Error", "bad_format", reason)
    steps = [verdict.to_json()]
    return {"outcome": "failure", "steps": steps, "machine": machine, "id_map": {}}
