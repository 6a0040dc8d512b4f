"""Read control programs and controllers from JSON data, and find what is wrong with controllers on
a machine."""

from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import Any, get_args

from pydantic import ValidationError

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import Group
from agentflow.machine.controllers.model import QUANTITIES, Controllers, Law
from agentflow.machine.controls import GROUPS, PRECISION, driven_types
from agentflow.machine.problems import Problem, block_label, comma_list, short_repr
from agentflow.machine.tree import Control, Step

FORM = (
    '{"sensors": {"h": {"kind": "height"}}, "laws": {"lift": {"kind": "pd", "sensor": "h", '
    '"target": 5, "p": 0.5}}, "outputs": [{"group": "thrusters", "law": "lift"}]}'
)
LONGER = FORM.replace('t"}}', 't"}, "ahead": {"kind": "distance", "block": 0, "axis": "z+"}}')
"""The example with a sensor that needs an axis, for designers."""
LAW_KINDS: tuple[str, ...] = tuple(
    get_args(kind.model_fields["kind"].annotation)[0] for kind in get_args(get_args(Law)[0])
)
_WORDS: Mapping[str, str] = {
    "missing": "is missing",
    "extra_forbidden": "is not known here: remove it",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "greater_than": "must be more than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "must be {expected}",
    "union_tag_not_found": f"has no kind: give one of {comma_list(LAW_KINDS)}",
    "union_tag_invalid": f"has the unknown kind {{tag}}: the kinds are {comma_list(LAW_KINDS)}",
    "too_long": "has {count} entries: at most {max_length} are allowed",
    "too_short": "must have at least {min_length}",
    "string_pattern_mismatch": "must begin with a small letter and have at most 32 small letters, "
    "digits and underscores",
}
"""Pydantic's type of an error -> what is wrong, after the path of the value."""
_SHOWN = 8
"""Most problems of a document that are listed."""


def read_controllers(data: object, problems: list[Problem]) -> Controllers | None:
    """The controllers in JSON data; adds problems, and returns None, if they cannot be read."""
    if not isinstance(data, dict):
        message = f"the controllers are {short_repr(data)}; write them like {FORM}"
        problems.append(Problem("not_a_controller", (), message))
        return None
    try:
        return Controllers.model_validate(data)
    except ValidationError as error:
        faults = error.errors(include_url=False)[:_SHOWN]
        problems += [Problem("controller_form", (), _tell(fault)) for fault in faults]
        return None


def _tell(fault: Any) -> str:
    """An error of pydantic as one sentence."""
    kinds, place = {*LAW_KINDS, "[key]"}, fault["loc"]
    # the place of an error in a law names its kind as well, right after the name of the law
    path = [
        str(part)
        for at, part in enumerate(place)
        if not (part == "[key]" or (at == 2 and place[0] == "laws" and part in kinds))
    ]
    shown = ".".join(part if len(part) <= 40 else f"{part[:40]}..." for part in path)
    where, kind = f"controllers: {shown or 'the whole'}", fault["type"]
    if kind == "value_error":
        return f"{where}: {fault['msg'].removeprefix('Value error, ')}"
    what, context = f"{where} is {short_repr(fault['input'])}", {**fault.get("ctx", {})}
    if kind not in _WORDS:
        return f"{what}; write the whole like {FORM}"
    if kind == "too_long":
        context["count"] = len(fault["input"])
    if "tag" in context:
        context["tag"] = short_repr(context["tag"])
    words = _WORDS[kind].format(**context)
    told = kind.startswith(("missing", "extra", "too_", "union"))
    return f"{where} {words}" if told else f"{what}; it {words}"


def controller_problems(controllers: Controllers | None, steps: Iterable[Step]) -> list[Problem]:
    """What is wrong with the controllers of a machine that has these steps, on any task."""
    if controllers is None:
        return []
    types = {step.id: step.type for step in steps}
    return [
        *_sensor_problems(controllers, types),
        *_law_problems(controllers),
        *_output_problems(controllers, types),
    ]


def _sensor_problems(controllers: Controllers, types: Mapping[int, int]) -> Iterator[Problem]:
    for name, sensor in controllers.sensors.items():
        block, kind = sensor.block, sensor.kind
        if block not in types:
            yield _missing_block(f"sensor {name}", block, types)
            continue
        joint, label = library()[types[block]].joint.kind, block_label(block, types[block])
        if kind in ("angle", "turning") and joint != "revolute":
            turning = [b for b, each in types.items() if library()[each].joint.kind == "revolute"]
            message = f"sensor {name}: {label} has no joint that turns; those that have: "
            yield Problem("sensor_block", (block,), message + comma_list(turning))
        if kind == "load" and (not block or joint == "loose"):
            message = f"sensor {name}: {label} hangs on nothing; name the block that is attached"
            yield Problem("sensor_block", (block,), message)


def _missing_block(named: str, block: int, types: Mapping[int, int]) -> Problem:
    known = f"the blocks are 0 to {max(types)}"
    return Problem("sensor_block", (), f"{named}: block {block} does not exist; {known}")


def _law_problems(controllers: Controllers) -> Iterator[Problem]:
    laws, sensors = controllers.laws, controllers.sensors
    named = [(f"law {name}", law.sensors, law.laws) for name, law in laws.items()]
    named += [(f"output {n}", (), (each.law,)) for n, each in enumerate(controllers.outputs)]
    whole = True
    for name, read, used in named:
        for kind, names, known in (("sensor", read, sensors), ("law", used, laws)):
            for missing in dict.fromkeys(each for each in names if each not in known):
                whole = False
                message = f"{name}: there is no {kind} {missing}; the {kind}s are: "
                yield Problem(f"no_{kind}", (), message + comma_list(known))
    if whole:
        try:
            TopologicalSorter({name: law.laws for name, law in laws.items()}).prepare()
        except CycleError as error:
            circle = " -> ".join(error.args[1])
            message = f"laws use each other in a circle ({circle}): remove one of these uses"
            yield Problem("law_circle", (), message)


def _output_problems(controllers: Controllers, types: Mapping[int, int]) -> Iterator[Problem]:
    driven, taken = driven_types(types), dict[int, int]()
    for number, output in enumerate(controllers.outputs):
        named = f"output {number}"
        blocks = output.blocks or tuple(b for b, group in driven.items() if group == output.group)
        if not blocks:
            message = f"{named}: the machine has no {str(output.group).replace('_', ' ')}"
            yield Problem("output_block", (), message)
        for block in dict.fromkeys(blocks):
            if block not in types:
                yield _missing_block(named, block, types)
            elif block not in driven:
                what, those = block_label(block, types[block]), comma_list(driven)
                message = f"{named}: nothing drives {what}; the driven blocks are {those}"
                yield Problem("output_block", (block,), message)
            elif block in taken:
                message = (
                    f"outputs {taken[block]} and {number} both drive block {block}: name it in "
                    "one of them, and add their laws in a sum"
                )
                yield Problem("output_block", (block,), message)
            taken.setdefault(block, number)


def told(kind: str) -> str:
    """Unit and meaning of a kind of sensors, for designers."""
    quantity = QUANTITIES[kind]
    axis = f" (axis {', '.join(quantity.axes)})" if quantity.axes else ""
    return f"{kind}{axis}: {quantity.text}{f', {quantity.unit}' * bool(quantity.unit)}"


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
