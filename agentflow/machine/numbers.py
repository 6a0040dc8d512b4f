"""The numbers of what controls a machine: listed with their bounds, and written back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

from agentflow.machine.controllers.numbers import NumberAt, numbers_of
from agentflow.machine.controllers.reading import read_controllers
from agentflow.machine.formats.control_json import to_precision
from agentflow.machine.tree import Control, Machine

_LEAST = 0.001
"""Shortest duration of a control, s."""


def machine_numbers(machine: Machine, window: float) -> tuple[NumberAt, ...]:
    """Begin, duration and level of each control, then the numbers of laws and outputs.

    Args:
        machine: The machine.
        window: Latest end of a control, in seconds since t = 0.
    """
    controls = (
        NumberAt(f"controls.{number}.{key}", value, low, high)
        for number, control in enumerate(machine.controls)
        for key, value, low, high in (
            ("at", control.at, 0.0, window - _LEAST),
            ("for", control.lasts, _LEAST, window),
            ("level", control.level, -1.0, 1.0),
        )
    )
    return (*controls, *(numbers_of(machine.controllers) if machine.controllers else ()))


def with_numbers(machine: Machine, values: Sequence[float], window: float) -> Machine | None:
    """The machine with other values of its `machine_numbers`; None if its laws cannot have them.

    Values are rounded, and a control that would go on after the window is made shorter.
    """
    count = 3 * len(machine.controls)
    controls = tuple(
        _control(control, values[3 * number : 3 * number + 3], window)
        for number, control in enumerate(machine.controls)
    )
    laws = machine.controllers
    if laws is not None:
        data: Any = laws.model_dump(mode="json")
        for item, value in zip(numbers_of(laws), values[count:], strict=True):
            *above, key = item.path.split(".")
            node = reduce(lambda found, part: found[_key(found, part)], above, data)
            node[_key(node, key)] = float(f"{value:.6g}")
        laws = read_controllers(data, [])
        if laws is None:
            return None
    return replace(machine, controls=controls, controllers=laws)


def _control(control: Control, values: Sequence[float], window: float) -> Control:
    at, lasts, level = map(to_precision, values)
    at = min(at, window - _LEAST)
    lasts = to_precision(max(_LEAST, min(lasts, window - at)))
    return replace(control, at=to_precision(at), lasts=lasts, level=level)


def _key(node: Any, part: str) -> int | str:
    return int(part) if isinstance(node, list) else part
