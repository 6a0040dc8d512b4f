"""Read control programs from JSON data."""

from __future__ import annotations

from agentflow.machine.blocks.types import Group
from agentflow.machine.controls import GROUPS, PRECISION
from agentflow.machine.problems import Problem, comma_list, short_repr
from agentflow.machine.tree import Control

CONTROL_FORM = '{"blocks": [1, 2], "at": 0, "for": 2.5, "level": 1}'
"""An example of an entry, for messages; `group` may stand in place of `blocks`."""
_KEYS = frozenset({"blocks", "group", "at", "for", "level"})


def read_controls(data: object, notes: list[str], problems: list[Problem]) -> tuple[Control, ...]:
    """The entries of a control program; adds a problem for each that cannot be read."""
    if data is None:
        return ()
    if not isinstance(data, list):
        what = f"the controls are {short_repr(data)}"
        message = f"{what}; write them as a JSON list of objects like {CONTROL_FORM}"
        problems.append(Problem("not_a_control", (), message))
        return ()
    read = (_read_entry(item, number, notes, problems) for number, item in enumerate(data))
    return tuple(control for control in read if control is not None)


def _read_entry(
    item: object, number: int, notes: list[str], problems: list[Problem]
) -> Control | None:
    if not isinstance(item, dict):
        message = f"control {number} is {short_repr(item)}; expected an object like {CONTROL_FORM}"
        problems.append(Problem("not_a_control", (), message))
        return None
    target = _read_target(item, number, problems)
    numbers = [_read_number(item, key, number, problems) for key in ("at", "for", "level")]
    if extra := [short_repr(key) for key in item if key not in _KEYS]:
        notes.append(f"control {number}: ignored {comma_list(extra[:8])}")
    at, lasts, level = numbers
    if target is None or at is None or lasts is None or level is None:
        return None
    return Control(target, at, lasts, level)


def _read_target(
    item: dict[str, object], number: int, problems: list[Problem]
) -> tuple[int, ...] | Group | None:
    group, blocks = item.get("group"), item.get("blocks")
    if blocks is None and group in GROUPS:
        return group
    if group is None and isinstance(blocks, list) and blocks:
        ids = tuple(block for block in blocks if type(block) is int)
        if len(ids) == len(blocks):
            return tuple(dict.fromkeys(ids))
    what = {key: item[key] for key in ("blocks", "group") if key in item}
    message = (
        f"control {number} has {short_repr(what) if what else 'neither blocks nor group'}; give "
        f'either "blocks", a list of ids, or "group", one of {comma_list(GROUPS)}'
    )
    problems.append(Problem("control_block", (), message))
    return None


def _read_number(
    item: dict[str, object], key: str, number: int, problems: list[Problem]
) -> float | None:
    value = item.get(key)
    if isinstance(value, int | float) and type(value) is not bool and abs(value) < 1e9:
        return to_precision(value)
    what = f"{key!r} {short_repr(value)}, expected a number" if key in item else f"no {key!r}"
    message = f"control {number} has {what}; write it like {CONTROL_FORM}"
    problems.append(Problem("control_number", (), message))
    return None


def to_precision(number: float) -> float:
    """A time or level as controls hold it, so that equal programs have equal digests."""
    return round(float(number), PRECISION) + 0.0  # no -0.0
