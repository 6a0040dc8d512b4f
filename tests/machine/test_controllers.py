"""Controllers in machine files: reading, refusals, edits."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest

from agentflow.machine import Brief, Machine, apply_script, check, describe, describe_text
from agentflow.machine.brief import Limits
from agentflow.machine.controllers.model import QUANTITIES
from agentflow.machine.controllers.reading import LAW_KINDS
from agentflow.machine.edits.difference import edit_commands
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates
from agentflow.machine.numbers import numbers_of, with_number
from agentflow.machine.problems import RefusedEdit
from agentflow.machine.tree import renumber
from tests.loops import for_each
from tests.machine.builders import CAR
from tests.machine.controllers import STOPPING, read_car, sensing_car, with_change
from tests.runs.fuzz import VALUES

SENSED, DESIGNED = (
    Brief("t", "o", (), (), (), tuple(range(64)), limits=Limits(controls=5.0, senses=senses))
    for senses in (True, False)
)


def test_controllers_survive_every_form_and_change_the_digest() -> None:
    machine = sensing_car()
    assert Machine.from_json(machine.to_text()) == machine
    assert read_coordinates(to_coordinates(machine)).machine == machine
    assert machine.digest != CAR.digest
    assert hash(machine) == hash(CAR), "hashes of machines without controllers stay as they were"
    assert machine != CAR
    assert repr(machine).endswith(f"{len(CAR)} blocks, 6 laws>")
    assert describe(machine)["controllers"] == STOPPING
    assert '"law": "drive"' in describe_text(machine)


def test_only_tasks_that_say_so_accept_controllers() -> None:
    assert check(sensing_car(), SENSED).task_valid
    found = check(sensing_car(), DESIGNED).problems
    assert [problem.code for problem in found] == ["controllers_not_allowed"]


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("sensors.ahead.block", 99, "sensor ahead: block 99 does not exist; the blocks are 0 to 6"),
        ("sensors.ahead.kind", "future", "sensors.ahead.kind is 'future'; it must be 'time'"),
        ("sensors.ahead.axis", ..., "sensors.ahead: distance needs an axis, one of x+, x-"),
        ("sensors.speed", {"kind": "time", "axis": "z"}, "time has no axis: remove it"),
        ("sensors.wheel.block", 0, "block 0 (Starting Block) has no joint that turns"),
        ("sensors.wheel", {"kind": "load"}, "block 0 (Starting Block) hangs on nothing"),
        ("laws.gap.p", float("nan"), "laws.gap.p is nan; it must be a finite number"),
        ("laws.gap.p", 10**400, "laws.gap.p is a very large number; it must be a number"),
        ("laws.gap.p", 2e6, "laws.gap.p is 2000000.0; it must be at most 1e+06"),
        ("laws.gap.kind", "divide", "laws.gap has the unknown kind 'divide': the kinds are"),
        ("laws.gap.kind", ..., "laws.gap has no kind: give one of constant, schedule, pd"),
        ("laws.gap.gain", 1, "laws.gap.gain is not known here: remove it"),
        ("laws.gap.limits", [1, 1], "limits must be [least, greatest] with least below greatest"),
        ("laws.full.rate", 0, "laws.full.rate is 0; it must be more than 0"),
        ("laws.full.points", [[1, 1], [1, 0]], "the times of points must rise"),
        ("laws.latch.under", 91, "under must be at most over"),
        ("laws.gap.sensor", "h", "law gap: there is no sensor h; the sensors are: ahead, speed"),
        ("laws.slow.terms.0.law", "x", "law slow: there is no law x; the laws are: gap, brake"),
        ("laws.slow.terms.0.law", "drive", "laws use each other in a circle"),
        ("laws.slow.terms", [{"law": "gap"}] * 5, "laws.slow.terms has 5 entries: at most 4"),
        ("laws.drive.states.0.leave", [], "there is no way out of state go: give it a leave"),
        ("laws.drive.states.0.leave.0.to", "x", "there is no state x: the states are go, s"),
        ("laws.drive.states.0.leave.0.to", "go", "no leave leads to state s: add one"),
        ("laws.drive.states.0.leave.0.below", ..., 'give either "above" or "below"'),
        ("outputs.0.law", "x", "output 0: there is no law x"),
        ("outputs.0.blocks", [0], "output 0: nothing drives block 0 (Starting Block)"),
        ("outputs.0.blocks", [5], "outputs 0 and 1 both drive block 5: name it in one of them"),
        ("outputs.0.scale", 3, "outputs.0.scale is 3; it must be at most 1"),
        ("outputs.1", {"group": "springs", "law": "gap"}, "output 1: the machine has no springs"),
        ("laws", {f"l{n}": {"kind": "constant", "level": 1} for n in range(1000)}, "1000 entries"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(path: str, value: object, said: str) -> None:
    problems = read_car(with_change(path, value)).problems
    assert said in problems[0].message
    assert "\n" not in problems[0].message
    assert len(problems[0].message) < 300


@for_each(range(300))
def test_damaged_controllers_are_refused_in_a_sentence(seed: int) -> None:
    rng = random.Random(seed)
    data: Any = json.loads(json.dumps(STOPPING))
    for _ in range(rng.randint(1, 3)):
        node: Any = data
        while isinstance(node, dict | list) and node:
            keys = list(node) if isinstance(node, dict) else list(range(len(node)))
            key = rng.choice(keys)
            if rng.random() < 0.4 or not isinstance(node[key], dict | list):
                node[rng.choice(keys)] = rng.choice((*VALUES, node[key]))
                break
            node = node[key]
    reading = read_car(data)
    if reading.machine is None:
        assert all(0 < len(problem.message) < 500 for problem in reading.problems)
        assert reading.problems
    else:
        assert Machine.from_json(reading.machine.to_text()) == reading.machine


def test_numbers_are_listed_with_bounds_and_changed_by_their_paths() -> None:
    controllers = sensing_car().controllers
    assert controllers is not None
    numbers = {number.path: number for number in numbers_of(controllers)}
    assert numbers["laws.gap.p"].value == -0.3
    assert numbers["laws.gap.d"].value == 0.0
    assert numbers["laws.full.points.1.0"][1:] == (4.5, 0.0, 3600.0)
    assert numbers["outputs.1.scale"][1:] == (-1.0, -1.0, 1.0)
    changed = with_number(controllers, "laws.full.points.1.0", 3.0)
    assert changed.to_json() == with_change("laws.full.points.1.0", 3)
    for path, value, said in (
        ("laws.gap.sensor", 1.0, "there is no number 'laws.gap.sensor'"),
        ("laws.gap.q", 1.0, "there is no number 'laws.gap.q'; the numbers are: laws.gap"),
        ("laws.full.points.1.0", 0.0, "the times of points must rise"),
        ("laws.gap.p", -0.3, "laws.gap.p is -0.3 already"),
    ):
        with pytest.raises(RefusedEdit, match=said.replace("[", r"\[")):
            with_number(controllers, path, value)


def test_scripts_write_and_change_controllers() -> None:
    machine = sensing_car()
    written = apply_script(CAR, f"1. Controllers {json.dumps(STOPPING)}", SENSED)
    assert written.machine == machine
    assert machine.controllers
    assert machine.controllers.to_json() == STOPPING
    assert edit_commands(CAR, machine) == (
        f"Controllers {json.dumps(machine.controllers.to_json())}",
    )
    tuned = apply_script(machine, "Set laws.gap.p -0.5", SENSED)
    assert tuned.changes == ["laws.gap.p -0.3 -> -0.5"]
    assert tuned.machine == sensing_car(with_change("laws.gap.p", -0.5))
    assert apply_script(machine, "Controllers none", SENSED).machine == CAR


def test_names_of_new_blocks_stand_for_their_ids() -> None:
    data = {
        "sensors": {"h": {"kind": "height", "block": "tip"}},
        "laws": {"on": {"kind": "switch", "sensor": "h", "over": 1, "under": 1}},
        "outputs": [{"blocks": ["tip"], "law": "on"}],
    }
    script = f"Add 22 to 0 in y+ as tip\nControllers {json.dumps(data)}"
    found = apply_script(CAR, script, SENSED)
    assert found.success, found.steps
    assert found.machine.controllers is not None
    assert found.machine.controllers.blocks == {len(CAR)}


@pytest.mark.parametrize(
    ("line", "brief", "said"),
    [
        ("Controllers none", DESIGNED, "this task accepts no controllers"),
        ("Controllers {x}", SENSED, "the controllers are no JSON"),
        ("Controllers {}", SENSED, "laws is missing"),
        ("Set laws.gap.x 1", SENSED, "there is no number 'laws.gap.x'"),
        ("Remove 5", SENSED, "output 1: block 5 does not exist"),
        ("nonsense", SENSED, "Set [path of a number, such as laws.NAME.p] [number]"),
    ],
)
def test_refused_lines_say_why(line: str, brief: Brief, said: str) -> None:
    found = apply_script(sensing_car(), line, brief)
    assert not found.success
    assert said in found.steps[0].reason


def test_blocks_that_go_leave_outputs_and_sensors_read_the_root() -> None:
    machine = sensing_car()
    kept = [step for step in machine if step.id != 3]
    found, ids = renumber(kept, controllers=machine.controllers)
    assert found.controllers is not None
    assert ids[4] == 3
    assert [output.blocks for output in found.controllers.outputs] == [(3,), (4,)]
    assert found.controllers.sensors["wheel"].block == 0
    assert renumber([machine[0]], controllers=machine.controllers)[0].controllers is None


def test_the_example_of_the_documentation_is_a_machine() -> None:
    page = Path("docs/reference/machine-language.md").read_text(encoding="utf-8")
    section = page.partition("## Controllers")[2].partition("## ")[0]
    example = section.partition("```json")[2].partition("```")[0]
    assert check(Machine.from_json(example), SENSED).task_valid
    assert {row for row in QUANTITIES if f"`{row}`" not in section} == set()
    assert {kind for kind in LAW_KINDS if f"| `{kind}` |" not in section} == set()
