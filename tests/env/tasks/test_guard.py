"""A task family from outside that fails is named with its method; nobody sees our traceback."""

from __future__ import annotations

import asyncio
import pickle
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from threading import Event
from typing import Any, ClassVar

import pytest

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout, Verdict
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks import guard
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.errors import PluginError
from agentflow.machine import Machine, library, read_machine

CAR = Path(__file__).parents[3] / "examples" / "car.json"


def car() -> Machine:
    machine = read_machine(CAR.read_text(), tuple(library())).machine
    assert machine is not None
    return machine


@dataclass(frozen=True)
class Own(Movement):
    """A family of one's own that is right."""

    family: ClassVar[str] = "own"

    def feedback(self, *args: Any) -> Any:
        return super().feedback(*args)


def task_of(kind: type[Movement]) -> Movement:
    task = get_task("movement", {"window": 1})
    return kind(**{item.name: getattr(task, item.name) for item in fields(task)})


def fails(*_: Any) -> Any:
    raise ZeroDivisionError("division by zero")


class Referee:
    """Has one method replaced."""

    def __init__(self, method: str, does: Callable[..., Any]) -> None:
        self.start = self.watch = self.verdict = lambda *_: Verdict(1.0, {})
        setattr(self, method, does)


def referee(method: str, does: Callable[..., Any]) -> Callable[..., Any]:
    return lambda _self, _machine: Referee(method, does)


DIVISION = "raised ZeroDivisionError: division by zero"
BROKEN: dict[str, tuple[str, Any, str]] = {
    # method, its replacement, what the error says
    "brief raises": ("brief", property(fails), f"brief {DIVISION}"),
    "brief is text": ("brief", property(lambda _: "go"), "brief returned 'go', not a Brief"),
    "scene raises": ("scene", fails, f"scene {DIVISION}"),
    "scene is nothing": ("scene", lambda *_: None, "scene returned None, not a Scene"),
    "trials raises": ("trials", fails, f"trials {DIVISION}"),
    "no trials": ("trials", lambda *_: (), "trials returned (), not a tuple of tasks"),
    "referee raises": ("referee", fails, f"referee {DIVISION}"),
    "no referee": ("referee", lambda *_: 7, "referee returned 7, not an object with start, watch"),
    "start": ("referee", referee("start", fails), f"referee.start {DIVISION}"),
    "watch": ("referee", referee("watch", fails), f"referee.watch {DIVISION}"),
    "verdict": ("referee", referee("verdict", fails), f"referee.verdict {DIVISION}"),
    "NaN": (
        "referee",
        referee("verdict", lambda *_: Verdict(float("nan"), {})),
        "referee.verdict returned Verdict(score=nan, terms={}, events=(), moment=None), not a "
        "Verdict with",
    ),
    "a string": (
        "referee",
        referee("verdict", lambda *_: "high"),
        "referee.verdict returned 'high', not a Verdict with finite numbers",
    ),
    "an infinite term": (
        "referee",
        referee("verdict", lambda *_: Verdict(1.0, {"speed": float("inf")})),
        "not a Verdict with finite numbers",
    ),
    "feedback raises": ("feedback", fails, f"feedback {DIVISION}"),
    "feedback is text": ("feedback", lambda *_: "good", "feedback returned 'good', not a Feedback"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_family_and_method_are_named(name: str) -> None:
    method, does, problem = BROKEN[name]
    kind = type("Broken", (Own,), {method: does, "__module__": __name__})
    with pytest.raises(PluginError) as caught:
        simulate(car(), task_of(kind))
    found = str(caught.value)
    assert found.startswith(f"the task family 'own' ({__name__}) failed: ")
    assert problem in found
    assert "\n" not in found


@pytest.mark.parametrize("method", ["brief", "scene", "trials"])
def test_a_method_that_does_not_return_is_named(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guard, "PATIENCE", 0.1)
    end = Event()

    def waits(*_: Any) -> bool:
        return end.wait()

    does = property(waits) if method == "brief" else waits
    kind = type("Hanging", (Own,), {method: does, "__module__": __name__})
    with pytest.raises(PluginError, match=rf"{method} has not returned within 0\.1 s$"):
        simulate(car(), task_of(kind))
    end.set()


def test_a_family_that_is_right_is_left_alone() -> None:
    own, ours = (simulate(car(), task_of(kind)) for kind in (Own, Movement))
    assert (own.score, own.digest, own.feedback) == (ours.score, ours.digest, ours.feedback)
    assert "__wrapped__" not in vars(Movement.feedback)
    assert pickle.loads(pickle.dumps(task_of(Own))) == task_of(Own)


@dataclass(frozen=True)
class Failing(Own):
    """Fails in workers."""

    def scene(self, machine: Machine | None = None) -> Any:
        return fails(machine)


@pytest.mark.slow
def test_the_error_comes_from_a_worker_as_it_is() -> None:
    async def run() -> Rollout:
        async with RolloutPool(1) as pool:
            return await pool.run(car(), task_of(Failing))

    with pytest.raises(PluginError, match=f"scene {DIVISION}$"):
        asyncio.run(run())
