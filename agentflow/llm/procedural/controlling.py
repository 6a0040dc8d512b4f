"""Control programs: everything on at first, then random changes."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.machine import Machine
from agentflow.machine.controls import control_text, driven_blocks
from agentflow.machine.edits.moves import random_control, with_random_program
from agentflow.machine.tree import Control

BY_THEMSELVES = ("grabbers", "decouplers")
"""Groups that need no control: grabbers grip by themselves, and decouplers should hold at first."""
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
    driven = {*driven_blocks(machine).values()}
    named = {control.target for control in machine.controls}
    drawn = [_draw_control(item, window, rng) for item in ranges if item["group"] in driven - named]
    groups = sorted(driven.difference(named, BY_THEMSELVES, (each.target for each in drawn)))
    on = (Control(group, 0.0, window, 1.0) for group in groups)
    switched = Machine(machine.steps, (*machine.controls, *drawn, *on))
    more = bool(groups) and rng.random() < 0.5
    return with_random_program(switched, window, rng, MORE) if more else switched


def _draw_control(item: Mapping[str, Any], window: float, rng: random.Random) -> Control:
    """A control with numbers from the ranges, within the window."""
    at, lasts, level = (round(rng.uniform(*item[key]), 2) for key in ("at", "for", "level"))
    at = min(at, window / 2)
    return Control(item["group"], at, min(lasts, window - at), level)


def change_program(machine: Machine, window: float, rng: random.Random) -> list[str]:
    """Commands that add a random entry, or put one in place of another; [] if nothing is driven."""
    new = random_control(machine, window, rng)
    if new is None:
        return []
    old = rng.randrange(len(machine.controls) + 1)
    replaced = [f"Uncontrol {old}"] if old < len(machine.controls) else []
    return [*replaced, control_text(new)]
