"""Crossover: a part of one machine in place of a part of another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random

from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine, Step, carried_by, rename_blocks, renumber
from agentflow.machine.validity import check

MAX_TRIES = 100
"""Maximum number of pairs of parts that are tried; a choice of ours."""


def cross(machine: Machine, donor: Machine, rng: Random, brief: Brief | None = None) -> Machine:
    """Replace a part of a machine by a part of another machine.

    A part is a block with everything attached to it. Pairs of parts are drawn uniformly until the
    result is another machine, valid and as the task demands. Two-ended blocks of the machine that
    hold on to the removed part are removed with it; of the donor's, those that end within the part
    come along. So do the donor's controls of blocks in the part.

    Args:
        machine: a valid machine.
        donor: another one; it is not changed.
        rng: random generator.
        brief: the task; the core types and the standard building volume if None.

    Raises:
        UsageError: None of `MAX_TRIES` pairs fits.
    """
    given = 1 if brief is None else len(brief.given)
    places, parts = list(_parts(machine, given)), list(_parts(donor, given))
    for _ in range(MAX_TRIES if places and parts else 0):
        crossed = _graft(machine, rng.choice(places), donor, rng.choice(parts))
        if crossed in (machine, donor):
            continue
        report = check(crossed, brief)
        if report.task_valid and report.machine is not None:
            return report.machine
    raise UsageError("no part of the donor fits in place of a part of this machine")


def _parts(machine: Machine, given: int) -> Iterator[Step]:
    """The blocks that parts begin with: standard blocks that are not given."""
    return (step for step in machine.steps[given:] if not step.two_ended)


def _graft(machine: Machine, place: Step, donor: Machine, part: Step) -> Machine:
    removed = {*carried_by(machine, place.id)}
    brought = {*carried_by(donor, part.id, alone=True)}
    moved = [_shifted(step, len(machine)) for step in donor if step.id in brought]
    moved[0] = replace(moved[0], parent=place.parent, face_id=place.face_id)
    driving = (each for each in donor.controls if isinstance(each.target, tuple))
    ids = {block: block + len(machine) for block in brought}
    controls = (*machine.controls, *rename_blocks(driving, ids))
    kept = (step for step in machine if step.id not in removed)
    return renumber([*kept, *moved], controls, machine.controllers)[0]


def _shifted(step: Step, by: int) -> Step:
    """The step with all ids increased."""
    far = None if step.parent_b is None else step.parent_b + by
    return replace(step, id=step.id + by, parent=step.parent + by, parent_b=far)
