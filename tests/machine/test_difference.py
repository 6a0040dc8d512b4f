"""What an edit was: commands that repeat it exactly, or words that are no command."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from agentflow.env.tasks.registry import get_task
from agentflow.machine.edits.commands import read_command
from agentflow.machine.edits.difference import edit_commands, edit_text, edit_words
from agentflow.machine.edits.local import local_edit, local_edits
from agentflow.machine.edits.random import random_machine
from agentflow.machine.edits.script import apply_script
from agentflow.machine.tree import Control, Machine, Step
from agentflow.machine.twins import tree_key

BRIEF = get_task("throwing").brief
ROOT = Step(0, 0, -1, -1)
TREE = Machine((ROOT, Step(1, 15, 0, 0), Step(2, 15, 1, 0), Step(3, 63, 0, 1)))


@pytest.mark.parametrize("task", ["throwing", "picking/2"])
def test_commands_repeat_the_edit(task: str) -> None:
    brief, rng = get_task(task).brief, Random(3)
    machine, repeated = random_machine(rng, brief), 0
    for _ in range(25):
        edited = local_edit(machine, rng, brief)[1]
        commands = edit_commands(machine, edited, brief)
        text = edit_text(machine, edited, brief)
        if commands:
            assert apply_script(machine, "\n".join(commands), brief).machine == edited
            assert text == "; ".join(commands)
            repeated += 1
        else:
            assert read_command(text) is None
        machine = edited
    assert repeated > 12


def test_what_no_script_repeats_is_told_in_words() -> None:
    longer = Machine((ROOT, Step(1, 1, 0, 0), Step(2, 15, 1, 0), *shifted()))
    assert edit_text(TREE, longer) == "a new 1 (Wooden Block) between block 0 and block 1"
    shorter = Machine((ROOT, Step(1, 15, 0, 0), Step(2, 63, 0, 1)))
    assert edit_text(longer, shorter).endswith("its place taken by the block that it carries")


def shifted() -> tuple[Step, ...]:
    return Step(3, 15, 2, 0), Step(4, 63, 0, 1)


def test_controls_are_set_added_and_removed() -> None:
    wheel = (ROOT, Step(1, 2, 0, 2))
    one, other = Control("motors", 1.0, 2.0, 0.5), Control((1,), 0.0, 1.0, -1.0)
    before = Machine(wheel, (one,))
    assert edit_text(before, replace(before, controls=(replace(one, at=1.5),))) == "Set 0 at 1.5"
    assert edit_text(before, replace(before, controls=())) == "Uncontrol 0"
    more = replace(before, controls=(one, other))
    assert edit_text(before, more) == "Control 1 at 0 for 1 level -1"


def test_local_edits_are_new_and_of_many_kinds() -> None:
    machine = random_machine(Random(1), BRIEF)
    asked: list[Machine] = []

    def is_new(edited: Machine) -> bool:
        asked.append(edited)
        return len(asked) % 3 > 0

    found = local_edits(machine, Random(0), BRIEF, 12, is_new)
    assert len(found) == len(set(found)) == 12
    assert set(found) < set(asked)
    assert machine not in found
    verbs = {edit_text(machine, each, BRIEF).split()[0] for each in found}
    assert verbs >= {"Add", "Remove", "Replace", "Move"}
    assert local_edits(machine, Random(0), BRIEF, 12, lambda _: False) == []


def test_the_order_of_branches_changes_no_key() -> None:
    other = Machine((ROOT, Step(1, 63, 0, 1), Step(2, 15, 0, 0), Step(3, 15, 2, 0)))
    assert other != TREE
    assert tree_key(other) == tree_key(TREE)
    turned = Machine((*TREE.steps[:3], Step(3, 63, 0, 2)))
    assert tree_key(turned) != tree_key(TREE)
    program = (Control((3,), 0.0, 1.0, 1.0),), (Control((1,), 0.0, 1.0, 1.0),)
    with_controls = [replace(m, controls=p) for m, p in zip((TREE, other), program, strict=True)]
    assert len({tree_key(machine) for machine in (TREE, *with_controls)}) == 2


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("Add 63 to 3 in 6", "Add a Log to block 3 (Log), face 6"),
        ("Add 63 to 16 in y+ as a", "Add a Log to block 16, face y+, called a"),
        ("Add 9 to a in 1 to 2 in 0", "Add a Spring from new block a, face 1 to block 2 ("),
        ("Remove 3; Move 2 end b to 1 in 0", "Remove block 3 (Log)\nMove end b of block 2 ("),
        ("```\n1. Replace 3 with 15", "Replace block 3 (Log) with a Small Wooden Block"),
        ("Mirror x+\nMirror 3", "Mirror all blocks on the side x+\nMirror block 3 (Log) and what"),
        (
            "Control motors, 3 at 0 for 2 level 1",
            "Drive motors, block 3 (Log) from 0 s for 2 s at ",
        ),
        ("Add 999 to 0 in 1", "Add 999 to 0 in 1"),
        ("<b>no command 63</b>", "<b>no command 63</b>"),
        ("a new 63 (Log) between block 8 and block 11", "A new Log between block 8 and block 11"),
    ],
)
def test_commands_are_told_with_the_names_of_block_types(script: str, words: str) -> None:
    assert edit_words(script, TREE).startswith(words)
