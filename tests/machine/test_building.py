"""Machines built in Python equal those of the same JSON."""

from __future__ import annotations

from pathlib import Path

import pytest

import agentflow
from agentflow.errors import UnknownNameError, UsageError
from agentflow.machine import Machine, library
from agentflow.machine.building import MachineBuilder
from agentflow.machine.problems import RefusedEdit
from agentflow.machine.tree import Control

CAR = Path(__file__).parents[2] / "examples" / "car.json"


def test_a_built_car_equals_its_file() -> None:
    wheels = Machine.from_file(CAR)
    built = MachineBuilder()
    for step in list(wheels)[1:]:
        name = library()[step.type].name.upper()
        built.add(name, to=built[step.parent], face=step.face_id)
    assert built.machine == wheels
    assert built.machine.digest == wheels.digest
    assert built.machine.to_text() == wheels.to_text()


def test_faces_have_names_in_the_machine_frame() -> None:
    m = MachineBuilder()
    assert {word: m.root.face(word)[1] for word in ("up", "down", "left", "right")} == {
        word: m.root.face(axis)[1]
        for word, axis in (("up", "y+"), ("down", "y-"), ("left", "x-"), ("right", "x+"))
    }
    beam = m.add("Log", to=m.root, face="up")
    assert (beam.id, beam.type, len(m)) == (1, 63, 2)
    with pytest.raises(RefusedEdit, match=r"faces .* of block 1 .* look along x+"):
        beam.face("right")
    assert beam.face("x+y+") != beam.face("x+y-")
    with pytest.raises(UnknownNameError, match="unknown direction 'upp'; known: up"):
        beam.face("upp")
    with pytest.raises(RefusedEdit, match="no face 77"):
        m.add("Log", to=beam, face=77)


def test_two_ended_blocks_join_faces() -> None:
    m = MachineBuilder()
    beam = m.add("Log", to=m.root, face="up")
    brace = m.join("Brace", beam.face(3), m.root.face("front"))
    wanted = [
        {"type": 0, "id": 0, "parent": -1, "face_id": -1},
        {"type": 63, "id": 1, "parent": 0, "face_id": m.root.face("up")[1]},
        {"type": 7, "id": 2, "parent_a": 1, "face_id_a": 3, "parent_b": 0, "face_id_b": 0},
    ]
    assert m.machine == Machine.from_json(wanted)
    assert brace.id == 2
    with pytest.raises(RefusedEdit, match="two-ended; give two parents"):
        m.add("Brace", to=beam, face=0)


def test_a_refused_step_changes_nothing() -> None:
    m = MachineBuilder()
    m.add("Log", to=m.root, face="up")
    before = m.machine
    with pytest.raises(RefusedEdit, match="already taken"):
        m.add("Log", to=m.root, face="up")
    wheel = m.add("Powered Wheel", to=m.root, face="right")
    with pytest.raises(RefusedEdit, match=r"with Powered Wheel as block 3: .* overlap by"):
        m.add("Powered Wheel", to=m.root, face="front")
    with pytest.raises(UnknownNameError, match="unknown block type 'Lig'; known: "):
        m.add("Lig", to=m.root, face=0)
    assert m.machine.steps[:-1] == before.steps
    assert m.add("Log", to=m.root, face="left").id == wheel.id + 1
    with pytest.raises(IndexError, match="no block 9"):
        _ = m[9]


def test_a_task_brings_its_rules() -> None:
    lacks = pytest.raises(UsageError, match="the task requires exactly 1 block of type 36")
    with lacks, agentflow.build("throwing") as m:
        m.add("Log", to=m.root, face="up")
    with pytest.raises(ZeroDivisionError), agentflow.build("throwing", wall_height=2):
        _ = 1 / 0
    throwing = agentflow.build("throwing")
    with pytest.raises(RefusedEdit, match="is not allowed here"):
        throwing.add("Propeller", to=throwing.root, face=0)
    with pytest.raises(RefusedEdit, match="block 0 is of another machine"):
        throwing.add("Log", to=MachineBuilder().root, face="up")
    for ask in (lambda: agentflow.build(wall_height=2), lambda: Machine().edit("", knobs={"x": 1})):
        with pytest.raises(UsageError, match="knobs change a task; name it with task="):
            ask()
    given = agentflow.build("gearing").machine
    assert given == agentflow.task("gearing").given


def test_controls_replace_the_schedule() -> None:
    m = MachineBuilder()
    wheel = m.add("Powered Wheel", to=m.root, face="right")
    m.control([wheel], at=0, lasts=2, level=-0.5)
    m.control("motors", at=2, lasts=1, level=1)
    assert m.machine.controls == (Control((1,), 0, 2, -0.5), Control("motors", 2, 1, 1))
    with pytest.raises(RefusedEdit, match="this task switches all blocks by its own schedule"):
        agentflow.build("throwing").control("motors", at=0, lasts=1, level=1)
    with pytest.raises(UnknownNameError, match="unknown group of blocks 'motor'; known: motors"):
        m.control("motor", at=0, lasts=1, level=1)  # type: ignore[arg-type]


def test_machines_come_from_text_data_and_files() -> None:
    car = Machine.from_file(str(CAR))
    assert Machine.from_json(CAR.read_text()) == Machine.from_json(car.to_json()) == car
    assert Machine() == MachineBuilder().machine
    with pytest.raises(UsageError, match=r"'car.json' is the name of a file"):
        Machine.from_json("car.json")
    with pytest.raises(UsageError, match="no JSON list found"):
        Machine.from_json("nothing")
    with pytest.raises(UsageError, match=r"cannot read none.json"):
        Machine.from_file("none.json")


def test_machines_have_the_functions_as_methods() -> None:
    car = Machine.from_file(CAR)
    assert car.check("movement") == agentflow.check(car, "movement")
    assert car.edit("Remove 6") == Machine(car.steps[:-1])
    with pytest.raises(UsageError, match=r"'Remove 0' is refused: block 0, the Starting Block"):
        car.edit("Remove 0")
    with pytest.raises(UsageError, match=r"is refused: .*not allowed here"):
        car.edit("Add 26 to 0 in y+", "movement")


@pytest.mark.slow
def test_a_machine_simulates_itself() -> None:
    car = Machine.from_file(CAR)
    knobs = {"window": 1}
    alone = agentflow.simulate(car, "movement", knobs=knobs)
    assert car.simulate("movement", knobs=knobs).digest == alone.digest
