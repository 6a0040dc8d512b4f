"""The numbers of what controls a machine: those of controllers by their paths, listed with their
bounds, and written back."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any, NamedTuple

from agentflow.machine.controllers.model import LARGEST, Controllers
from agentflow.machine.controllers.reading import read_controllers, to_precision
from agentflow.machine.problems import Problem, RefusedEdit, comma_list, short_repr
from agentflow.machine.tree import Control, Machine, shorten

_SHOWN = 40
"""Most paths that a message lists."""


class NumberAt(NamedTuple):
    """One number of controllers, and between which bounds it may be."""

    path: str
    """Keys and indices, joined by dots: `laws.steer.p`, `laws.climb.points.0.1`."""
    value: float
    low: float
    high: float


def numbers_of(controllers: Controllers) -> tuple[NumberAt, ...]:
    """Every number of laws and outputs, in order, those that are as by default included."""
    data = controllers.model_dump(mode="json", exclude={"sensors"})
    return tuple(
        NumberAt(".".join(map(str, path)), value, *_bounds(path)) for path, value in _walk(data, ())
    )


def _walk(data: Any, path: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], float]]:
    if isinstance(data, float):
        yield path, data
    elif isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from _walk(value, (*path, key))


def _bounds(path: tuple[str | int, ...]) -> tuple[float, float]:
    """What the parser accepts there, as far as it does not depend on other numbers."""
    if path[-1] == "scale":
        return -1.0, 1.0
    if path[-1] == "rate":
        return 1.0 / LARGEST, LARGEST
    return (0.0, 3600.0) if path[2:3] == ("points",) and path[-1] == 0 else (-LARGEST, LARGEST)


def with_number(controllers: Controllers, path: str, value: float) -> Controllers:
    """The controllers with another number.

    Raises:
        RefusedEdit: There is no number at this path, it has this value already, or may not have it.
    """
    data: Any = controllers.model_dump(mode="json")
    node, found, keys = data, data, path.split(".")
    try:
        for key in keys:
            node = found
            found = node[int(key) if isinstance(node, list) else key]
    except (LookupError, ValueError, TypeError):
        found = ""
    if not (isinstance(found, float) or (found is None and keys[-1] == "rate")):
        known = [number.path for number in numbers_of(controllers)]
        listed = comma_list([*known[:_SHOWN], *["..."] * (len(known) > _SHOWN)])
        reason = f"there is no number {short_repr(path)}; the numbers are: {listed}"
        raise RefusedEdit("number_not_found", reason)
    if found == value:
        raise RefusedEdit("no_change", f"{path} is {shorten(value)} already: remove the line")
    node[int(keys[-1]) if isinstance(node, list) else keys[-1]] = value
    problems: list[Problem] = []
    changed = read_controllers(data, problems)
    if changed is None:
        raise RefusedEdit(problems[0].code, problems[0].message)
    return changed


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
