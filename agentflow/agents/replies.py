"""Owns how a whole machine is written in prompts and read from replies, in either representation.

What the two representations are is agentflow.machine's.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Literal

from agentflow.machine.brief import Brief
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.machine.validity import Report, check

Representation = Literal["tree", "coordinates"]
"""Construction tree (spec 1.2), or absolute positions and rotations (1.3)."""


def machine_items(machine: Machine, representation: Representation) -> Sequence[object]:
    """A machine as JSON data, one item per block."""
    return machine.to_json() if representation == "tree" else to_coordinates(machine)


def machine_text(machine: Machine, representation: Representation) -> str:
    """A machine as JSON text, one block per line."""
    lines = (json.dumps(item) for item in machine_items(machine, representation))
    return "[\n  " + ",\n  ".join(lines) + "\n]"


def read_reply(
    text: str, brief: Brief, representation: Representation, given: Machine | None = None
) -> Report:
    """Judge the last machine of a reply; never raises, whatever the text.

    Args:
        text: the reply or a section of it.
        brief: the task.
        representation: how the machine is written.
        given: a machine that the reply may begin with. In coordinates what hangs on what is
            inferred, and may be inferred differently where faces meet; blocks that are where the
            given ones are keep the given connections.
    """
    if representation == "tree":
        return check(read_machine(text, brief.blocks, brief.given), brief)
    report = check(read_coordinates(text, brief.blocks), brief)
    if report.machine is None or given is None or not _begins_with(report.machine, given):
        return report
    whole = Machine((*given.steps, *report.machine.steps[len(given) :]))
    judged = check(whole, brief)
    return report if judged.machine is None else _with(judged, report)


def _begins_with(machine: Machine, given: Machine) -> bool:
    start = to_coordinates(machine)[: len(given)]
    return start == to_coordinates(given)


def _with(judged: Report, read: Report) -> Report:
    return Report(**{**vars(judged), "repaired": read.repaired, "notes": read.notes})
