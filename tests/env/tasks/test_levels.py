"""The contract of every level: it builds, settles, stays finite, is told in full, pays nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.knobs import Knob
from agentflow.env.tasks.registry import FAMILIES, get_level, get_task, knob_table, task_names
from agentflow.errors import ConfigError
from agentflow.machine.brief import LONE_ROOT
from tests.loops import for_each

NAMES = task_names()
UNTOLD = ("seed", "road.wall_thickness")
"""Ends of names of knobs that are not told: which of many alike scenes it is, and how thick walls
are whose places and friction are told."""
SPRINGS, WINCHES, STEERING_HINGES = 9, 45, 28
RESTLESS = ("lifting/3",)
"""Where a ball rolls off a lone root and away; wind blows one away as well."""
ALMOST_NOTHING = 0.01
"""In the unit of the score: what contacts move while something rests."""
BOUND = 1e3
"""m and m/s that nothing passes that only stands there."""


def told(task: Task) -> str:
    brief = task.brief
    return " ".join((brief.objective, *brief.scene, *brief.schedule, *brief.score))


def effect(task: Task) -> tuple[object, ...]:
    """All that a knob can change about what happens with the blocks of the task."""
    brief, scene, times = task.brief, task.scene(), task.schedule
    kinds = set(brief.blocks)
    return (
        replace(scene, gusts=scene.gusts if any(scene.wind) else ()),
        times.motors,
        times.springs if kinds & {SPRINGS, WINCHES} else None,
        times.steering_hinges if STEERING_HINGES in kinds else None,
        task.window,
        brief.given.steps,
        dict(brief.required),
        brief.blocks,
        brief.limits.size,
    )


def others(knob: Knob, value: Any) -> Iterator[Any]:
    """Other legal values of a knob."""
    if knob.low is None or knob.high is None:
        return
    whole = isinstance(value, int) and isinstance(knob.default, int)
    for share in (0.5, 0.25, 0.75, 0.1, 0.9):
        found = knob.low + share * (knob.high - knob.low)
        if (found := round(found) if whole else found) != value:
            yield found


def changed(name: str, knob: Knob, value: Any) -> Task | None:
    """The level with another value of one knob; None where no other value goes with the rest."""
    for other in others(knob, value):
        try:
            return get_task(name, {knob.name: other})
        except ConfigError:
            continue
    return None


@for_each(NAMES)
def test_what_a_number_changes_is_told(name: str) -> None:
    task = get_task(name)
    silent = []
    for knob, value in knob_table(task):
        other = changed(name, knob, value)
        if other is None or knob.name.endswith(UNTOLD):
            continue
        if effect(other) != effect(task) and told(other) == told(task):
            silent.append(knob.name)
    assert silent == []


@for_each(NAMES)
def test_window_wind_and_start_times_are_told(name: str) -> None:
    task = get_task(name)
    text = told(task)
    assert f"{task.window:g} s" in text
    assert all(f"{abs(speed):g} m/s" in text for speed in task.scene().wind if speed)
    switches = {time for time, entry, _ in task.schedule.switches() if time and entry != "loads"}
    assert all(f"{time:g} s" in text for time in switches)


@for_each(NAMES)
def test_knobs_out_of_range_and_unknown_ones_are_refused(name: str) -> None:
    for knob, _ in knob_table(get_task(name)):
        if knob.low is None:
            continue
        with pytest.raises(ConfigError) as caught:
            get_task(name, {knob.name: knob.low - 1})
        assert str(caught.value) == (
            f"{knob.name} of {name} must be {knob.range}, not {knob.low - 1!r}"
        )
    with pytest.raises(ConfigError, match=rf"^unknown knob 'wind.speeed' of {name}; known: "):
        get_task(name, {"wind.speeed": 1})


def test_every_family_has_its_five_levels_and_some_more_for_machines_that_sense() -> None:
    for family in FAMILIES:
        last = {"movement": 7, "rocket": 6, "transport": 6}.get(family, 5)
        assert [name for name in NAMES if get_task(name).family == family] == [
            family,
            *(f"{family}/{number}" for number in range(2, last + 1)),
        ]
    assert [name for name in NAMES if get_task(name).brief.limits.senses] == [
        "movement/6",
        "movement/7",
        "rocket/6",
        "transport/6",
    ]


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if "/" in n else ()) for n in NAMES]
)
def test_every_level_builds_settles_and_pays_nothing(name: str) -> None:
    """With what every machine of the level begins with, which is as a rule a lone root."""
    rollout = simulate(get_task(name).brief.given, get_task(name))
    assert rollout.score is not None
    assert rollout.score <= ALMOST_NOTHING
    if get_task(name).brief.required:
        assert rollout.status == "invalid"
        return
    assert rollout.status == "ok"
    if name not in RESTLESS and not any(get_task(name).scene().wind):
        assert [event for event in rollout.events if event.kind == "unsettled"] == []
    assert rollout.trace is not None
    for key, values in vars(rollout.trace).items():
        if isinstance(values, np.ndarray) and values.dtype == np.float64 and key != "utilisation":
            assert np.isfinite(values).all(), key
            assert np.abs(values).max(initial=0.0) < BOUND, key


@for_each(NAMES)
def test_a_lone_root_is_worth_nothing_where_something_is_given(name: str) -> None:
    task = get_task(name)
    if task.brief.given == LONE_ROOT:
        assert get_level(name).file.good > ALMOST_NOTHING
        return
    rollout = simulate(LONE_ROOT, task)
    assert (rollout.status, rollout.score) == ("invalid", 0.0)
    assert rollout.problems[0]["code"] == "given_altered"


def test_greatest_possible_scores() -> None:
    """Where there is one, it follows the knobs; no good score lies above it."""
    greatest = {name: get_task(name).brief.greatest for name in NAMES}
    assert {name: score for name, score in greatest.items() if score is not None} == {
        **{name: 10.0 for name in NAMES if name.startswith(("jumping", "lifting"))},
        **{name: 1.0 for name in NAMES if name.startswith("gearing")},
        **{name: 20.0 for name in NAMES if name.startswith("transport")},
        **dict.fromkeys(("movement/6", "movement/7", "rocket/6", "transport/6"), 10.0),
        "bridge": 6000.0,
        "bridge/2": 6000.0,
        "bridge/3": 6000.0,
        "bridge/4": 6000.0,
        "bridge/5": 3000.0,
        "flying/4": 30.0,
        "flying/5": 30.0,
        "throwing/4": 10.0,
        "throwing/5": 20.0,
    }
    for name, most in greatest.items():
        assert most is None or get_level(name).file.good <= most
    assert get_task("throwing/5", {"ring.count": 4}).brief.greatest == 40.0
    assert get_task("throwing/5", {"score": "accuracy"}).brief.greatest == 10.0
    assert get_task("throwing/5", {"score": "distance"}).brief.greatest is None
