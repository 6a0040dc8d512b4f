"""What controls a machine, as the page edits it: what it offers, and what is wrong with a text."""

from __future__ import annotations

import inspect
import json
from typing import Any, get_args

from agentflow.machine import Brief, Machine, check
from agentflow.machine.controllers.model import QUANTITIES, Law
from agentflow.machine.controllers.reading import LAW_KINDS
from agentflow.machine.formats.detect import read_for

OWN = ("controls", "controllers")


def control_parts(brief: Brief) -> dict[str, Any]:
    """Whether machines of a task bring controls of their own, also those that sense, and what
    there is to sense and which laws there are."""
    limits = brief.limits
    return {
        "designed": limits.controls is not None,
        "senses": limits.senses,
        "sensors": {
            kind: {"axes": quantity.axes, "text": quantity.text, "unit": quantity.unit}
            for kind, quantity in QUANTITIES.items()
        },
        "laws": {
            kind: inspect.getdoc(law)
            for kind, law in zip(LAW_KINDS, get_args(get_args(Law)[0]), strict=True)
        },
    }


def controlled(machine: Machine, text: str, brief: Brief) -> Machine | list[str]:
    """The machine with the controls of a JSON text, or why it cannot have them."""
    try:
        data = json.loads(text or "{}")
    except ValueError as error:
        return [f"this is not JSON: {error}"]
    except RecursionError:
        return ["this is not JSON: it is nested too deeply"]
    if not isinstance(data, dict) or set(data) - {*OWN}:
        return [f"write one object with {' and '.join(OWN)}, both optional"]
    steps = [step.to_json() for step in machine]
    report = check(read_for(brief, {"blocks": steps, **data}, "tree"), brief)
    before = {problem.message for problem in check(machine, brief).problems}
    found = [each.message for each in report.problems if each.message not in before]
    if report.machine is None or found:
        return found or [each.message for each in report.problems]
    return report.machine
