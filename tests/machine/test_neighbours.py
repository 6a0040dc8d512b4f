"""The machines one edit away from a machine, and where each edit is."""

from __future__ import annotations

from random import Random

from agentflow.env.tasks.registry import get_task
from agentflow.machine import check
from agentflow.machine.edits.random import Neighbour, all_neighbours, sample_neighbours
from tests.machine.builders import CAR, build

BRIEF = get_task("movement").brief


def found() -> list[Neighbour]:
    return list(all_neighbours(CAR, BRIEF, Random(0)))


def test_every_neighbour_is_legal_and_another_machine() -> None:
    every = found()
    assert len({one.machine for one in every}) == len(every) > 100
    assert CAR not in {one.machine for one in every}
    assert not any(check(one.machine, BRIEF).problems for one in every)


def test_an_edit_is_where_the_step_differs() -> None:
    for one in found():
        grown = len(one.machine) - len(CAR)
        assert grown in (-1, 0, 1)
        if grown == 1:
            assert one.block is None
            assert one.faces == one.machine.steps[-1].attachments
        else:
            assert one.block is not None
            assert one.faces == CAR[one.block].attachments


def test_each_block_that_carries_nothing_is_removed_once() -> None:
    removed = [one.block for one in found() if len(one.machine) < len(CAR)]
    carrying = {parent for step in CAR for parent in step.parents}
    assert sorted(map(int, filter(None, removed))) == sorted(
        step.id for step in CAR.steps[1:] if step.id not in carrying
    )


def test_a_removed_twin_is_told_from_the_other() -> None:
    machine = build((1, 0, 2), (1, 0, 3), (1, 0, 4))
    removed = {
        one.block: one.machine
        for one in all_neighbours(machine, BRIEF, Random(0))
        if len(one.machine) < len(machine)
    }
    assert removed == {
        1: build((1, 0, 3), (1, 0, 4)),
        2: build((1, 0, 2), (1, 0, 4)),
        3: build((1, 0, 2), (1, 0, 3)),
    }


def test_a_sample_is_legal_without_repeats_and_follows_its_seed() -> None:
    sample = sample_neighbours(CAR, BRIEF, Random(1), 30)
    assert len({one.machine for one in sample}) == 30
    assert sample == sample_neighbours(CAR, BRIEF, Random(1), 30)
    assert sample != sample_neighbours(CAR, BRIEF, Random(2), 30)
    assert not any(check(one.machine, BRIEF).problems for one in sample)
