"""Properties that hold for every machine, every legal edit and every text."""

from __future__ import annotations

import json
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.machine import (
    Machine,
    Step,
    apply_script,
    check,
    describe,
    describe_text,
    extract_json,
    library,
    place,
    read_machine,
)
from agentflow.machine.geometry.placement import overlap_of
from tests.machine.builders import CATAPULT
from tests.machine.strategies import draw_step, machines, mutations, valid_machines


@given(machines())
def test_written_machines_are_read_back(machine: Machine) -> None:
    assert read_machine(machine.to_text()).machine == machine
    assert read_machine(json.dumps(machine.to_json())).machine == machine


@given(machines())
def test_placing_then_reading_back(machine: Machine) -> None:
    geometry = place(machine)
    for placed in geometry.blocks[1:]:
        faces = [
            (parent.id, face.face_id, face.facing)
            for parent in geometry.blocks[: placed.id]
            for face in parent.faces
            if face.position in (placed.origin, placed.end_b)
        ]
        step = placed.step
        if placed.two_ended:
            assert {(parent, face) for parent, face, _ in faces} >= {
                (step.parent, step.face_id),
                (step.parent_b, step.face_id_b),
            }
        else:
            assert (step.parent, step.face_id, placed.facing) in faces


@given(machines())
def test_overlaps_agree_with_a_check_of_all_pairs(machine: Machine) -> None:
    geometry = place(machine)
    boxed = [placed for placed in geometry.blocks if not placed.two_ended]
    expected = []
    for a in boxed:
        for b in boxed:
            depth = overlap_of(a, b)
            assert depth == overlap_of(b, a)
            inside = {(a.type, b.step.parent), (b.type, a.step.parent)} & {(30, a.id), (30, b.id)}
            if a.id < b.id and min(depth) > 0.001 and not inside:
                expected.append((a.id, b.id))
    assert list(geometry.overlaps) == expected


@given(machines(), st.randoms(use_true_random=False))
def test_relabelling_that_respects_order_changes_nothing(
    machine: Machine, rng: random.Random
) -> None:
    order = [0]
    while len(order) < len(machine):
        ready = [
            step.id
            for step in machine
            if step.id not in order and all(parent in order for parent in step.parents)
        ]
        order.append(rng.choice(ready))
    new = {old: index for index, old in enumerate(order)}
    steps = []
    for old in order:
        step = machine[old]
        parent_b = None if step.parent_b is None else new[step.parent_b]
        parent = new.get(step.parent, -1)
        steps.append(Step(new[old], step.type, parent, step.face_id, parent_b, step.face_id_b))
    geometry, other = place(machine), place(Machine(tuple(steps)))
    for old in order:
        before, after = geometry[old], other[new[old]]
        assert (before.at, before.far, before.lo, before.hi) == (
            after.at,
            after.far,
            after.lo,
            after.hi,
        )
        assert before.facing == after.facing
    renamed = sorted(tuple(sorted((new[a], new[b]))) for a, b in geometry.overlaps)
    assert list(other.overlaps) == renamed


@given(st.data())
def test_an_addition_and_its_removal_restore_the_machine(data: st.DataObject) -> None:
    machine = data.draw(valid_machines())
    step = draw_step(data.draw, list(machine.steps))
    ends = f"to {step.parent} in {step.face_id}"
    if step.parent_b is not None:
        ends += f" to {step.parent_b} in {step.face_id_b}"
    added = apply_script(machine, f"Add {step.type} {ends}")
    assert added.success == check(Machine((*machine.steps, step))).machine_valid
    if added.success:
        removed = apply_script(added.machine, f"Remove {len(machine)}")
        assert (removed.success, removed.machine) == (True, machine)
        assert removed.id_map == {**{old: old for old in range(len(machine))}, step.id: None}


@given(st.data())
def test_a_move_and_its_inverse_restore_the_machine(data: st.DataObject) -> None:
    machine = data.draw(valid_machines())
    movable = [step for step in machine.steps[1:] if not step.two_ended]
    if not movable:
        return
    step = data.draw(st.sampled_from(movable))
    parents = [other for other in machine.steps[: step.id] if library()[other.type].faces]
    parent = data.draw(st.sampled_from(parents))
    face = data.draw(st.integers(0, len(library()[parent.type].faces) - 1))
    moved = apply_script(machine, f"Move {step.id} to {parent.id} in {face}")
    if moved.success:
        assert check(moved.machine).machine_valid
        back = apply_script(moved.machine, f"Move {step.id} to {step.parent} in {step.face_id}")
        assert (back.success, back.machine) == (True, machine)
    else:
        assert moved.machine is machine


@given(machines())
def test_everything_can_be_described(machine: Machine) -> None:
    assert len(describe_text(machine)) > len(describe_text(machine, short=True))
    json.dumps(describe(machine), allow_nan=False)
    json.dumps(check(machine).to_json(), allow_nan=False)


PIECES = (*"[]{}\"',:\n", "```json\n", "```", "//", "-1", "0", "1e999")
WORDS = ("type", "id", "parent", "face_id", "parent_a", "Add", "Remove", "Move", " to ", " in ")
junk = st.lists(st.sampled_from((*PIECES, *WORDS, "\\", "NaN", "\ud800")) | st.text(max_size=5))
replies = st.sampled_from(
    (
        CATAPULT.to_text(),
        f"Here:\n```json\n{CATAPULT.to_text()}\n```",
        "1. Add [15] to [0] in [4]\n2. Move 9 to 8 in 2\n3. Remove 3\n4. Add 9 to 1 in 0 to 3 in 0",
    )
)


mutated = mutations(replies, junk, least=0, most=6)
"""A valid reply with random deletions and insertions."""


def never_raises(text: str) -> None:
    reading = read_machine(text)
    assert (reading.machine is None) == bool(reading.problems)
    assert all(problem.message for problem in reading.problems)
    extract_json(text, dict)
    json.dumps(check(reading).to_json(), allow_nan=False)
    outcome = apply_script(CATAPULT, text)
    assert outcome.success == all(step.verdict == "Success" for step in outcome.steps)


any_text = st.text() | junk.map("".join) | mutated


@given(any_text)
def test_random_text_never_raises(text: str) -> None:
    never_raises(text)


@pytest.mark.slow
@settings(max_examples=1_000, deadline=None)
@given(any_text)
def test_lots_of_random_text_never_raises(text: str) -> None:
    never_raises(text)


json_data = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner) | st.dictionaries(st.sampled_from(WORDS) | st.text(), inner),
    max_leaves=6,
)


@pytest.mark.slow
@given(json_data | st.lists(st.dictionaries(st.sampled_from(WORDS[:5]), json_data)))
def test_random_data_never_raises(data: object) -> None:
    reading = read_machine(data)
    assert (reading.machine is None) == bool(reading.problems)
