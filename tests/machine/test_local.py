"""Local edits: each kind makes legal machines, and makes what it says."""

from __future__ import annotations

from collections import Counter
from random import Random

import pytest

from agentflow.env.tasks.registry import get_task
from agentflow.machine.edits.local import local_edit, local_moves
from agentflow.machine.edits.random import draw_legal, random_machine
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Control, Machine, Step
from agentflow.machine.validity import check

BRIEF = get_task("throwing").brief
TYPES = sorted(set(BRIEF.blocks) - {0})
ROOT = Step(0, 0, -1, -1)
ARM = Machine(
    (ROOT, Step(1, 1, 0, 4), Step(2, 63, 1, 0), Step(3, 15, 0, 0), Step(4, 9, 0, 1, 2, 1))
)


def made(kind: str, machine: Machine, seed: int = 0) -> Machine:
    kinds = {kind: local_moves(BRIEF)[kind]}
    return draw_legal(machine, Random(seed), None, kinds)[1]


@pytest.mark.parametrize("seed", range(6))
def test_random_machines_stay_legal(seed: int) -> None:
    rng = Random(seed)
    machine = random_machine(rng, BRIEF)
    seen = Counter[str]()
    for _ in range(25):
        kind, edited = local_edit(machine, rng, BRIEF)
        report = check(edited, BRIEF)
        assert report.machine == edited
        assert not report.problems
        assert edited != machine
        seen[kind] += 1
    assert len(seen) > 4


def test_every_kind_is_drawn() -> None:
    rng = Random(1)
    machine = random_machine(rng, BRIEF, (12, 16))
    kinds = {local_edit(machine, rng, BRIEF)[0] for _ in range(150)}
    assert kinds >= {"insert", "add a pair", "swap all", "add", "remove"}


def test_insert_and_leave_out_are_inverse() -> None:
    longer = made("insert", ARM)
    assert len(longer) == len(ARM) + 1
    shorter = made("leave out", ARM)
    assert len(shorter) == len(ARM) - 1
    assert {step.type for step in shorter} < {step.type for step in ARM}


def test_a_pair_is_symmetric() -> None:
    edited = made("add a pair", Machine((ROOT, Step(1, 1, 0, 0))))
    left, right = (place(edited)[step.id] for step in edited.steps[-2:])
    assert left.type == right.type
    assert (left.box_min[0], left.box_min[1:]) == (-right.box_max[0], right.box_min[1:])


def test_all_blocks_of_a_type_change_together() -> None:
    logs = Machine((ROOT, Step(1, 15, 0, 0), Step(2, 15, 0, 1)))
    edited = made("swap all", logs)
    assert edited.steps[1].type == edited.steps[2].type != 15


def test_a_two_ended_block_moves_one_end() -> None:
    edited = made("move an end", ARM)
    (before,), (after,) = ([s for s in m if s.two_ended] for m in (ARM, edited))
    assert sum(a != b for a, b in zip(before.attachments, after.attachments, strict=True)) == 1


def test_a_nudge_changes_one_number_of_one_control() -> None:
    machine = Machine((ROOT, Step(1, 22, 0, 0)), (Control("motors", 1.0, 2.0, 0.5),))
    for move in local_moves(BRIEF)["nudge"](machine, TYPES):
        edited = move(Random(0))
        assert edited is not None
        (old,), (new,) = machine.controls, edited.controls
        changed = [
            name for name in ("at", "lasts", "level") if getattr(old, name) != getattr(new, name)
        ]
        assert len(changed) == 1
