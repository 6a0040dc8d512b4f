"""Function tests of design objectives, each on a real rollout that passes and one that fails."""

from __future__ import annotations

import pickle

import pytest

from agentflow.app.prompts import render_prompt
from agentflow.env.rollout import Feedback, Rollout, Status
from agentflow.env.simulation.simulate import simulate
from agentflow.errors import NoScoreError
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.training.objectives.functions import FUNCTIONS
from agentflow.training.objectives.objective import Objective, ObjectiveVerdict, works
from tests.env.machines import CAR, FOLDER, machine

FLAT = machine((0, -1, -1), (63, 0, 0), (63, 0, 1), (1, 0, 4))
"""A decoration: a root with beams on three sides."""
LADEN = Machine((*CAR, *machine((0, -1, -1), *((0, -1, -1),) * 6, (35, 0, 4)).steps[7:]))
"""A car with a weight."""
TURNTABLE = machine((0, -1, -1), (22, 0, 4), (63, 1, 0), (1, 0, 0), (1, 0, 1))
SPINNER = machine(
    (0, -1, -1), (22, 0, 5), (63, 1, 1), (63, 1, 2), (63, 1, 3), (63, 1, 4), (1, 0, 0)
)
"""A cross on the ground whose motor turns the root above it."""
OBJECT = {"body": "object", "metres": 1, "seconds": 1}
CASES: dict[str, tuple[str, dict[str, object], Machine | str, Machine | str]] = {
    "moves": ("movement", {"metres": 20, "towards": "z+", "speed": 5}, CAR, FLAT),
    "reaches": ("movement", {"z": 15, "within": 1}, CAR, FLAT),
    "stays upright": ("movement/3", {"degrees": 10}, FLAT, CAR),
    "stays whole": ("throwing", {}, "throwing/spring_arm", "published_throw"),
    "turns": ("movement", {"revolutions": 2, "speed": 5}, TURNTABLE, CAR),
    "spins": ("movement", {"revolutions": 2}, SPINNER, TURNTABLE),
    "jumps": ("jumping", {"metres": 1}, "jumping/slingshot", CAR),
    "unfolds": ("lifting", {"metres": 1}, "lifting/thrower", FLAT),
    "throws": ("throwing", {"metres": 5, "high": 5}, "throwing/spring_arm", "published_throw"),
    "hits target": ("throwing", {"within": 6}, "throwing/spring_arm", "published_throw"),
    "passes rings": ("throwing/4", {"rings": 1}, "throwing/spring_arm", "published_throw"),
    "raises": ("lifting", OBJECT, "lifting/drawbridge", FLAT),
    "holds": (
        "lifting",
        {"body": "object", "above": 4, "seconds": 4.9},
        "lifting/high_table",
        "lifting/drawbridge",
    ),
    "shifts": ("delivery", {"thing": "cargo", "metres": 10}, CAR, FLAT),
    "strikes": ("delivery", {"thing": "cargo", "impulse": 5}, CAR, FLAT),
    "avoids": ("jumping", {"thing": "wall 1"}, "jumping/slingshot", CAR),
    "carries": ("movement", {"type": 35, "metres": 5}, LADEN, CAR),
}
"""Function test -> level, thresholds, a machine that passes, a machine that fails."""
KNOBS: dict[str, dict[str, object]] = {
    "hits target": {"score": "accuracy", "target.at": 20},
    "passes rings": {"ring.first": 14, "ring.height": 10, "ring.radius": 10, "wall.height": 0},
}
STATIC = {"stays upright", "stays whole", "holds", "avoids"}
"""Function tests that machines without power can pass; objectives combine them with others."""


def load(given: Machine | str) -> Machine:
    """A machine, or the one of this name from the tests' folder."""
    if isinstance(given, Machine):
        return given
    read = read_machine((FOLDER / f"{given}.json").read_text(encoding="utf-8")).machine
    assert read is not None
    return read


def objective_of(name: str) -> Objective:
    """An objective with a function test of `CASES`."""
    level, thresholds, passing, failing = CASES[name]
    types = {step.type for each in (passing, failing) for step in load(each)}
    return Objective.model_validate(
        {
            "name": "tried",
            "text": "A machine does something.",
            "kind": "function",
            "blocks": sorted(types),
            "scene": {"level": level, "knobs": KNOBS.get(name, {})},
            "test": {name: thresholds},
        }
    )


def judge(name: str, given: Machine | str) -> ObjectiveVerdict:
    """Simulate a machine and apply the function test of this name."""
    objective, tree = objective_of(name), load(given)
    rollout = simulate(tree, objective.task)
    assert rollout.status == "ok", rollout.problems
    return works(objective, rollout, tree)


def test_every_function_test_has_a_case() -> None:
    assert set(CASES) == set(FUNCTIONS)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_machine_that_does_it_passes(name: str) -> None:
    verdict = judge(name, CASES[name][2])
    assert verdict.passed, verdict.found


@pytest.mark.parametrize("name", CASES)
def test_a_machine_that_does_not_fails(name: str) -> None:
    verdict = judge(name, CASES[name][3])
    assert not verdict.passed
    assert any(not finding.passed for finding in verdict.found.values())


@pytest.mark.parametrize("name", sorted(set(CASES) - STATIC))
def test_a_machine_without_power_fails(name: str) -> None:
    objective, tree = objective_of(name), load(CASES[name][2])
    assert not works(objective, simulate(tree, objective.task, power=False), tree).passed


def test_what_holds_when_the_machine_comes_to_rest_holds_until_the_end_of_the_window() -> None:
    objective, table = objective_of("holds"), load("lifting/high_table")
    rollout = simulate(table, objective.task)
    assert rollout.trace is not None
    assert rollout.trace.times[-1] < 4  # a rollout ends once everything rests
    assert works(objective, rollout, table).found["holds.seconds"].value == 5


def test_measured_values_are_named_by_test_and_threshold_and_have_units() -> None:
    found = judge("moves", CAR).found
    assert list(found) == ["moves.metres", "moves.speed"]
    assert found["moves.metres"].limit == 20
    assert found["moves.metres"].unit == "m"
    assert 40 < found["moves.metres"].value < 50
    assert found["moves.speed"].value == pytest.approx(9.8, abs=0.1)  # a wheel's rim


def test_all_tests_of_an_objective_must_pass() -> None:
    objective = objective_of("moves")
    more = {name: objective_of(name).test[name] for name in ("moves", "jumps")}
    both = objective.model_copy(update={"test": more})
    verdict = works(both, simulate(CAR, both.task), CAR)
    assert [finding.passed for finding in verdict.found.values()] == [True, True, False]
    assert not verdict.passed


def test_an_invalid_machine_does_not_work() -> None:
    objective = objective_of("moves")
    overlapping = machine((0, -1, -1), (63, 0, 0), (63, 0, 0))
    assert works(objective, simulate(overlapping, objective.task), overlapping) == ObjectiveVerdict(
        False, {}
    )


@pytest.mark.parametrize("status", ["timeout", "crashed"])
def test_a_simulation_without_a_result_says_nothing_about_the_machine(status: Status) -> None:
    rollout = Rollout(status=status, score=None, feedback=Feedback("", {}))
    with pytest.raises(NoScoreError, match=f"the simulation for 'tried' ended as {status}"):
        works(objective_of("moves"), rollout, CAR)


def test_the_prompt_states_text_blocks_and_function_tests() -> None:
    task = objective_of("raises").task
    prompt = render_prompt("default", "designer", task.brief)
    asked = prompt["user"]
    assert "Task: tried\nA machine does something.\n" in asked
    assert (
        "- The machine works if the object is 1 m or more higher than at t = 0 for at least 1 s."
    ) in asked
    assert "Powered Wheel" not in asked  # the level allows it, the objective does not
    assert "trials" not in asked


def test_an_objective_is_simulated_once_even_where_its_level_has_trials() -> None:
    task = objective_of("raises").task
    assert task.trials(0) == (task,)
    assert pickle.loads(pickle.dumps(task)) == task
