"""Control programs: which blocks they drive when, and what is wrong with them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import get_args

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import Group
from agentflow.machine.problems import Problem, block_label, comma_list
from agentflow.machine.tree import Control, Machine, Step, shorten

MAX_CONTROLS = 64
GROUPS: tuple[Group, ...] = get_args(Group)
REST_LEVELS: Mapping[Group, float] = {"grabbers": 1.0}
"""Level of a group while no control drives it, if it is not 0: grabbers grip by themselves."""
PRECISION = 3
"""Decimals of times (s) and levels: milliseconds are finer than the steps of physics."""
NOT_DESIGNED = (
    "this task switches all blocks by its own schedule, so a machine cannot bring controls: write "
    "it as a bare JSON list of blocks"
)
NOT_SENSED = "this task accepts no controllers: leave them out"


def driven_blocks(machine: Machine) -> dict[int, Group]:
    """The group of each block that controls may name."""
    return driven_types({step.id: step.type for step in machine})


def driven_types(types: Mapping[int, int]) -> dict[int, Group]:
    """The group of each block that something drives, of blocks with these types."""
    groups = ((block, library()[kind].group) for block, kind in types.items())
    return {block: group for block, group in groups if group is not None}


def control_text(control: Control) -> str:
    """A control as the command that adds it."""
    blocks = control.target if isinstance(control.target, str) else comma_list(control.target)
    at, lasts, level = map(shorten, (control.at, control.lasts, control.level))
    return f"Control {blocks} at {at} for {lasts} level {level}"


def target_text(control: Control) -> str:
    """What a control drives, in a sentence: "block 3, block 4" or "motors"."""
    if isinstance(control.target, str):
        return control.target.replace("_", " ")
    return comma_list(f"block {block}" for block in control.target)


def blocks_of(control: Control, driven: Mapping[int, Group]) -> tuple[int, ...]:
    """Ids of the blocks that a control drives, of these driven blocks."""
    if isinstance(control.target, tuple):
        return control.target
    return tuple(block for block, group in driven.items() if group == control.target)


def switches(machine: Machine) -> tuple[tuple[float, int, float], ...]:
    """When each block gets which level: (seconds, block, level), in order of time.

    If several controls of a block hold at a time, the one that started last counts, and if they
    started together, the last in the program. Blocks that follow a controller are left out.
    """
    driven, followers = driven_blocks(machine), following(machine)
    own: dict[int, list[Control]] = {}
    for control in machine.controls:
        for block in blocks_of(control, driven):
            if block not in followers:
                own.setdefault(block, []).append(control)
    found = (
        (time, block, level)
        for block, controls in own.items()
        for time, level in _levels(controls, REST_LEVELS.get(driven[block], 0.0))
    )
    return tuple(sorted(found))


def following(machine: Machine) -> dict[int, int]:
    """The output that each block follows, by its number among the controllers' outputs."""
    driven, outputs = driven_blocks(machine), getattr(machine.controllers, "outputs", ())
    return {
        block: number
        for number, output in enumerate(outputs)
        for block in output.blocks or (b for b, group in driven.items() if group == output.group)
    }


@dataclass(frozen=True)
class Lane:
    """Blocks that a program drives alike."""

    blocks: tuple[int, ...]
    """Ascending."""
    rest: float
    """Their level at all other times."""
    spans: tuple[tuple[float, float, float], ...]
    """Begin, end (seconds since t = 0) and level, in order of time."""


def lanes(machine: Machine) -> tuple[Lane, ...]:
    """What a program does to which blocks, in order of the first one."""
    driven = driven_blocks(machine)
    changes: dict[int, list[tuple[float, float]]] = {}
    for time, block, level in switches(machine):
        changes.setdefault(block, []).append((time, level))
    alike: dict[tuple[float, tuple[tuple[float, float, float], ...]], list[int]] = {}
    for block, own in sorted(changes.items()):
        rest = REST_LEVELS.get(driven[block], 0.0)
        spans = ((begin, end, level) for (begin, level), (end, _) in pairwise(own))
        kept = tuple(span for span in spans if span[2] != rest)
        alike.setdefault((rest, kept), []).append(block)
    return tuple(Lane(tuple(blocks), rest, spans) for (rest, spans), blocks in alike.items())


def _levels(controls: list[Control], rest: float) -> Iterator[tuple[float, float]]:
    """When the level of one block changes, and to what."""
    level = rest
    for time in sorted({time for each in controls for time in (each.at, end_of(each))}):
        holding = [each for each in controls if each.at <= time < end_of(each)]
        new = max(reversed(holding), key=lambda each: each.at).level if holding else rest
        if new != level:
            yield time, new
        level = new


def end_of(control: Control) -> float:
    """When a control ends, in seconds since t = 0."""
    return round(control.at + control.lasts, PRECISION)


def control_problems(machine: Machine) -> list[Problem]:
    """What is wrong with the controls of a machine on any task: their blocks, times, levels."""
    count = len(machine.controls)
    if count > MAX_CONTROLS:
        message = (
            f"the machine has {count} controls; at most {MAX_CONTROLS} are allowed: remove at "
            f"least {count - MAX_CONTROLS}"
        )
        return [Problem("too_many_controls", (), message)]
    return [
        problem
        for number, control in enumerate(machine.controls)
        for problem in entry_problems(number, control, machine.steps)
    ]


def entry_problems(number: int, control: Control, steps: Iterable[Step]) -> Iterator[Problem]:
    """What is wrong with one control of a machine that has these steps, on any task."""
    named, types = f"control {number}", {step.id: step.type for step in steps}
    driven = driven_types(types)
    if isinstance(control.target, tuple):
        yield from _block_problems(named, control.target, types, driven)
    elif control.target not in driven.values():
        message = f"{named}: the machine has no {control.target.replace('_', ' ')}"
        there = comma_list(group for group in GROUPS if group in driven.values())
        yield Problem("control_group", (), f"{message}; its groups: {there}")
    if control.at < 0 or control.lasts <= 0:
        message = (
            f"{named} begins at {shorten(control.at)} s and lasts {shorten(control.lasts)} s; it "
            "must begin at 0 or later and last longer than 0"
        )
        yield Problem("control_time", (), message)
    if not -1 <= control.level <= 1:
        message = f"{named}: level {shorten(control.level)} is not from -1 to 1"
        yield Problem("control_level", (), message)


def _block_problems(
    named: str, blocks: tuple[int, ...], types: Mapping[int, int], driven: Mapping[int, Group]
) -> Iterator[Problem]:
    for block in blocks:
        if block not in types:
            known = f"the blocks are 0 to {max(types)}"
            message = f"{named}: block {block} does not exist; {known}"
            yield Problem("control_block", (), message)
        elif block not in driven:
            what = block_label(block, types[block])
            message = f"{named}: nothing drives {what}; the driven blocks are {comma_list(driven)}"
            yield Problem("control_block", (block,), message)


def window_problems(
    machine: Machine, window: float | None, *, senses: bool = False
) -> list[Problem]:
    """What is wrong with the controls of a machine on a task: that it allows none (`window` is
    None), that they go on after its window, s, or that it accepts no controllers."""
    if machine.controllers and not senses:
        return [Problem("controllers_not_allowed", (), NOT_SENSED)]
    if window is None:
        return [Problem("controls_not_allowed", (), NOT_DESIGNED)] if machine.controls else []
    return [
        problem
        for number, control in enumerate(machine.controls)
        for problem in window_problem(number, control, window)
    ]


def window_problem(number: int, control: Control, window: float | None) -> list[Problem]:
    """The problem of a control that goes on after the window, s; any time is fine for None."""
    if window is None or end_of(control) <= window:
        return []
    message = (
        f"control {number} ends at {shorten(end_of(control))} s, after the window of "
        f"{window:g} s: begin it earlier or make it shorter"
    )
    return [Problem("control_time", (), message)]
