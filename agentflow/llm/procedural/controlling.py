"""Control programs: everything on at first, then random changes; and first controllers."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from agentflow.files.ranges import draw_numbers
from agentflow.machine import Machine
from agentflow.machine.controllers.model import Controllers
from agentflow.machine.controls import control_text, driven_blocks
from agentflow.machine.edits.moves import random_control, with_random_program
from agentflow.machine.numbers import numbers_of
from agentflow.machine.tree import Control

BY_THEMSELVES = ("grabbers", "decouplers")
"""Groups that need no control: grabbers grip by themselves, and decouplers should hold at first."""
TUNED = 0.8
"""Share of changes that change a number of the controllers, where there are some."""
MORE = 2
"""Most random entries of a first program."""


def add_program(
    machine: Machine,
    window: float | None,
    rng: random.Random,
    ranges: Sequence[Mapping[str, Any]] = (),
) -> Machine:
    """The machine with a program that switches all groups on; nothing where none is allowed.

    Args:
        machine: With or without controls.
        window: Latest end of a control, s; None if machines may not bring any.
        rng: Random generator.
        ranges: For groups that a mechanism controls in its own way: `group`, and least and most of
            `at` (s), `for` (s) and `level`; one entry each, or several in order, such as full
            thrust and then less.
    """
    if window is None:
        return machine
    named = {control.target for control in machine.controls}
    sensed = machine.controllers.outputs if machine.controllers else ()
    driven = {*driven_blocks(machine).values()}.difference(output.group for output in sensed)
    drawn = [_draw_control(item, window, rng) for item in ranges if item["group"] in driven - named]
    groups = sorted(driven.difference(named, BY_THEMSELVES, (each.target for each in drawn)))
    on = (Control(group, 0.0, window, 1.0) for group in groups)
    switched = replace(machine, controls=(*machine.controls, *drawn, *on))
    more = bool(groups) and rng.random() < 0.5
    return with_random_program(switched, window, rng, MORE) if more else switched


def _draw_control(item: Mapping[str, Any], window: float, rng: random.Random) -> Control:
    """A control with numbers from the ranges, within the window."""
    at, lasts, level = (round(rng.uniform(*item[key]), 2) for key in ("at", "for", "level"))
    at = min(at, window / 2)
    return Control(item["group"], at, min(lasts, window - at), level)


def add_controllers(
    machine: Machine, templates: Sequence[Mapping[str, Any]], rng: random.Random
) -> Machine:
    """The machine with the controllers of its mechanisms, besides those that it has, with numbers
    drawn from the ranges; without those that drive nothing or name a type that it has not."""
    driven = {*driven_blocks(machine).values()}
    data: dict[str, Any] = {"sensors": {}, "laws": {}, "outputs": []}
    if machine.controllers:
        data = machine.controllers.to_json()
    for template in templates:
        own = draw_numbers(template, rng)
        groups = {output["group"] for output in own["outputs"]}
        taken = {output.get("group") for output in data["outputs"]}
        for sensor in own["sensors"].values():
            if kind := sensor.pop("type", 0):
                sensor["block"] = next((step.id for step in machine if step.type == kind), None)
        lacks = any(sensor.get("block", 0) is None for sensor in own["sensors"].values())
        if groups & taken or not groups <= driven or lacks:
            continue
        data["sensors"].update(own["sensors"])
        data["laws"].update(own["laws"])
        data["outputs"] += own["outputs"]
    if not data["laws"]:
        return machine
    return replace(machine, controllers=Controllers.model_validate(data))


def change_program(machine: Machine, window: float, rng: random.Random) -> list[str]:
    """Commands that add a random entry, or put one in place of another, or change a number of the
    controllers; [] if nothing is driven."""
    numbers = numbers_of(machine.controllers) if machine.controllers else ()
    tunable = [number for number in numbers if number.value]
    if tunable and rng.random() < TUNED:
        path, value, *_ = rng.choice(tunable)
        return [f"Set {path} {value * rng.uniform(0.6, 1.6):.3g}"]
    new = random_control(machine, window, rng)
    if new is None:
        return []
    old = rng.randrange(len(machine.controls) + 1)
    replaced = [f"Uncontrol {old}"] if old < len(machine.controls) else []
    return [*replaced, control_text(new)]
