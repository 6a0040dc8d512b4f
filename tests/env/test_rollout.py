"""Rollouts: scores of known machines, statuses, determinism, results outside memory."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agentflow.env.archive import load_npz, rollout_json, save_npz
from agentflow.env.constants import constants
from agentflow.env.physics.engines import default_engine
from agentflow.env.rollout import Rollout, RolloutEvent
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine.validity import check
from tests.env.fakes import AlteredEngine, AlteredWorld
from tests.env.machines import BALLASTED, CAR, PRINTED, machine, shipped

KEYS = [
    *("status", "score", "terms", "problems", "broken", "marginal", "events", "feedback"),
    *("digest", "sim_seconds", "wall_seconds", "constants", "engine"),
]
PUBLISHED = np.array(
    [[1.0, 7.01, -1.5], [0.84, 7.34, -2.44], [0.64, 5.69, -6.2], [0.61, 3.28, -9.97]]
)
"""The boulder's origin at 0, 0.2, 0.4, 0.6 s in the one printed rollout."""


@pytest.fixture(scope="module")
def thrown() -> Rollout:
    return simulate(PRINTED, get_task("throwing"))


def test_a_plain_car_drives_as_far_as_published() -> None:
    rollout = simulate(CAR, get_task("movement"))
    assert rollout.status == "ok"
    assert rollout.score is not None
    assert 40.0 < rollout.score < 50.0
    assert rollout.broken == ()
    assert rollout.sim_seconds == 5.0
    trace = rollout.trace
    assert trace is not None
    assert trace.times.tolist() == pytest.approx([0.2 * i for i in range(26)])
    assert trace.position.shape == (26, 7, 3)
    assert trace.position[-1, 0, 2] - trace.position[0, 0, 2] == pytest.approx(
        rollout.score, abs=0.2
    )
    assert trace.connections == ((1, 0), (2, 0), (3, 1), (4, 1), (5, 2), (6, 2))
    assert trace.alive.all()


def test_nothing_moves_with_power_off() -> None:
    rollout = simulate(CAR, get_task("movement"), power=False)
    assert rollout.trace is not None
    path = rollout.trace.position
    assert np.abs(path - path[0]).max() < 1e-3
    assert rollout.sim_seconds == 0.5


def test_the_published_machine_throws_backwards_and_breaks_at_its_tower_top(
    thrown: Rollout,
) -> None:
    assert thrown.broken[0].block == 8
    assert thrown.broken[0].partner == 7
    assert 0.3 < thrown.broken[0].time < 0.45
    assert thrown.trace is not None
    trace = thrown.trace.even
    assert trace.position[3, 13, 2] < -7.0
    assert trace.alive[1, 8]
    assert not trace.alive[3, 8]
    column = trace.connections.index((8, 7))
    assert trace.utilisation[1, column] < 1.0
    assert np.isnan(trace.utilisation[3, column])


@pytest.mark.pybullet
def test_with_its_ballast_it_follows_the_published_throw() -> None:
    rollout = simulate(BALLASTED, get_task("throwing"))
    assert rollout.trace is not None
    error = rollout.trace.even.position[:4, 13] - PUBLISHED
    assert np.sqrt(np.square(error).mean()) == pytest.approx(0.434, abs=0.005)
    assert rollout.broken[0].block == 8
    assert rollout.broken[0].time == pytest.approx(0.42, abs=0.03)


def test_another_rate_is_another_rollout_of_the_same_throw(thrown: Rollout) -> None:
    finer = simulate(PRINTED, get_task("throwing"), rate=240)
    assert finer.digest != thrown.digest
    assert finer.broken[0].block == 8
    assert finer.broken[0].time == pytest.approx(thrown.broken[0].time, abs=0.025)


def test_an_invalid_machine_is_not_simulated() -> None:
    overlapping = machine((0, -1, -1), (1, 0, 0), (1, 0, 0))
    rollout = simulate(overlapping, get_task("movement"))
    assert (rollout.status, rollout.score, rollout.trace) == ("invalid", 0.0, None)
    assert rollout.problems
    assert {"code", "blocks", "message"} == set(rollout.problems[0])


def test_a_machine_that_the_task_does_not_want_is_not_simulated() -> None:
    rollout = simulate(CAR, get_task("throwing"))
    assert rollout.status == "invalid"
    assert [problem["code"] for problem in rollout.problems] == ["required_count"]


def test_a_locked_joint_is_told() -> None:
    tree = machine((0, -1, -1), (5, 0, 0), (63, 1, 0), (7, 0, 4, 2, 9), (30, 0, 4), (36, 4, 0))
    rollout = simulate(tree, get_task("throwing"))
    told = [event for event in rollout.events if event.kind == "locked"]
    text = "the moving joint of block 1 cannot move: rigid parts bridge it"
    assert told == [RolloutEvent(0.0, "locked", (1,), text)]


def test_joints_that_hold_each_other_are_told_in_the_words_of_the_check() -> None:
    joints = (5, 0, 3), (22, 0, 1), (7, 1, 0, 2, 0)
    tree = machine((0, -1, -1), *joints, (30, 0, 4), (36, 4, 0))
    rollout = simulate(tree, get_task("throwing", {"window": 1}))
    told = {event.blocks[0]: event.text for event in rollout.events if event.kind == "locked"}
    reason = "cannot move: other moving joints hold the same parts"
    assert told == {block: f"the moving joint of block {block} {reason}" for block in (1, 2)}
    assert [warning.message.endswith(reason) for warning in check(tree).warnings] == [True, True]


class FailingWorld(AlteredWorld):
    """Fails after 1/3 s with the motors on."""

    started = False
    frames = 0.0

    def switch(self, entry: str, level: float) -> None:
        self.world.switch(entry, level)
        self.started |= entry == "motors" and level > 0.0

    def step(self, divisions: int = 1, *_ahead: object) -> None:
        self.world.step(divisions)
        self.frames += self.started / divisions

    @property
    def has_failed(self) -> bool:
        return self.frames > 40.0


class ExplodingWorld(FailingWorld):
    """Its speeds are no numbers."""

    def speeds(self, thorough: bool = True) -> tuple[float, float]:
        return (nan, 0.0) if self.has_failed else self.world.speeds(thorough)


def test_a_rollout_that_diverges_scores_nothing() -> None:
    rollout = simulate(CAR, get_task("movement"), engine=AlteredEngine(ExplodingWorld))
    assert (rollout.status, rollout.score) == ("diverged", 0.0)
    assert rollout.trace is not None
    assert np.isfinite(rollout.trace.position).all()
    assert rollout.sim_seconds == pytest.approx(40 / 120)
    assert rollout.feedback.text == (
        "The simulation diverged after 0.33 s; this counts as score 0.\nBroken: none"
    )


class UnreadableWorld(FailingWorld):
    """Its joints' loads are no numbers, though nothing is fast."""

    def step(self, divisions: int = 1, *_ahead: object) -> None:
        super().step(divisions)
        if self.has_failed:
            self.world.reactions[0] = nan


def test_a_load_that_is_no_number_is_a_divergence() -> None:
    rollout = simulate(CAR, get_task("movement"), engine=AlteredEngine(UnreadableWorld))
    assert (rollout.status, rollout.score, rollout.broken) == ("diverged", 0.0, ())
    assert rollout.sim_seconds == pytest.approx(40 / 120)


@pytest.mark.parametrize("rate", [0.0, -120.0, nan, 29.0, 1001.0])
def test_a_rate_out_of_range_is_refused(rate: float) -> None:
    with pytest.raises(UsageError) as caught:
        simulate(CAR, get_task("movement"), rate=rate)
    assert str(caught.value) == f"the rate is {rate:g} Hz; it must be from 30 to 1000 Hz"


@pytest.mark.parametrize("interval", [0.0, -0.2, nan])
def test_an_interval_that_is_not_above_zero_is_refused(interval: float) -> None:
    with pytest.raises(UsageError) as caught:
        simulate(CAR, get_task("movement"), interval=interval)
    assert str(caught.value) == f"the interval is {interval:g} s; it must be above 0 s"


def test_motors_that_are_never_switched_on_do_not_stall() -> None:
    told = {}
    for start, power in ((0.0, False), (3.0, True)):
        task = get_task("movement", {"schedule.motors": start})
        rollout = simulate(CAR, task, power=power)
        told[power] = [event.kind for event in rollout.events], rollout.feedback.text
    for kinds, text in told.values():
        assert "motor_stalled" not in kinds
        assert "Motor stalled" not in text


def test_a_rollout_ends_when_everything_rests() -> None:
    rollout = simulate(machine((0, -1, -1)), get_task("movement"))
    assert rollout.sim_seconds == 0.5
    assert rollout.score == pytest.approx(0.0, abs=1e-3)


def test_what_is_switched_on_late_gets_the_time_to_move_what_rests() -> None:
    """Springs that have to break a connection first do not move anything in their first step."""
    task = get_task("jumping", {"walls.first": 50, "window": 1.5})
    rollout = simulate(shipped("jumping/slingshot"), replace(task, trial=1), recorded=True)
    assert rollout.sim_seconds == pytest.approx(1.5)
    assert 1.0 < rollout.broken[0].time < 1.1


@pytest.mark.pybullet
def test_a_machine_too_large_for_the_engine_is_invalid() -> None:
    rows: list[tuple[int, ...]] = [(0, -1, -1)]
    for side in (2, 3):
        rows.append((15, 0, side))
        rows += [(15, len(rows) - 1 + i, 0) for i in range(7)]
    beams = list(range(1, len(rows)))
    for beam in beams:
        for face in (3, 4):
            rows.append((15, beam, face))
            rows += [(15, len(rows) - 1 + i, 0) for i in range(3)]
    rollout = simulate(machine(*rows), get_task("movement", {"blocks.max": 0}))
    assert [problem["code"] for problem in rollout.problems] == ["too_many_parts"]
    assert rollout.problems[0]["message"] == (
        "the machine has 145 parts in one piece; pybullet holds at most 128: "
        "remove blocks (a two-ended block has 2 parts, a moving joint in a loop counts as one more)"
    )


def test_a_rollout_over_its_wall_time_has_no_score() -> None:
    rollout = simulate(CAR, get_task("movement"), cpu_limit=0.0)
    assert (rollout.status, rollout.score, rollout.digest) == ("timeout", None, None)


def test_the_result_has_the_keys_of_the_command_line(thrown: Rollout) -> None:
    data = rollout_json(thrown)
    assert list(data) == KEYS
    assert data["constants"] == constants().digest
    assert data["engine"] == str(default_engine().identity)
    keys = {"block", "type", "partner", "time", "load", "force", "moment"}
    assert set(data["broken"][0]) == keys
    assert json.loads(json.dumps(data)) == data
    assert (
        list(
            rollout_json(simulate(machine((0, -1, -1), (1, 0, 0), (1, 0, 0)), get_task("movement")))
        )
        == KEYS
    )


def test_a_rollout_survives_its_file(thrown: Rollout, tmp_path: Path) -> None:
    path = tmp_path / "throw.npz"
    save_npz(thrown, path)
    back = load_npz(path)
    assert rollout_json(back) == rollout_json(thrown)
    assert back.trace is not None
    assert thrown.trace is not None
    for name, value in vars(thrown.trace).items():
        same = getattr(back.trace, name)
        if isinstance(value, np.ndarray):
            assert np.array_equal(same, value, equal_nan=value.dtype.kind == "f")
        else:
            assert same == value
    states = np.load(path)["states"]
    assert np.array_equal(states["position"][:, 0], thrown.trace.position[:, 0])
    bare = replace(thrown, trace=None)
    save_npz(bare, path)
    assert load_npz(path).trace is None


def edited(rollout: Rollout, path: Path, edit: Callable[[dict[str, Any]], object]) -> Path:
    """A file with a rollout whose JSON is edited."""
    save_npz(replace(rollout, trace=None), path)
    result = json.loads(np.load(path)["result"].item())
    edit(result)
    np.savez(path, result=np.array(json.dumps(result).encode()))
    return path


def test_a_file_from_before_engines_were_recorded_is_read(thrown: Rollout, tmp_path: Path) -> None:
    path = edited(thrown, tmp_path / "throw.npz", lambda result: result.pop("engine"))
    assert load_npz(path) == replace(load_npz(path), engine=None)


def test_a_foreign_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.npz"
    path.write_text("no archive")
    with pytest.raises(UsageError, match="is not a saved rollout"):
        load_npz(path)
    for result in ("{}", "[]", '{"feedback": "", "feedback_data": {}, "events": 1, "broken": []}'):
        np.savez(path, result=np.array(result))
        with pytest.raises(UsageError, match="is not a saved rollout"):
            load_npz(path)


def test_a_file_that_lacks_a_field_or_has_an_unknown_one_is_refused(
    thrown: Rollout, tmp_path: Path
) -> None:
    for field in ("digest", "broken", "events"):
        path = edited(thrown, tmp_path / "throw.npz", lambda result, field=field: result.pop(field))
        with pytest.raises(UsageError, match=f"is not a saved rollout: '{field}'"):
            load_npz(path)
    event = {"time": 0.1, "kind": "locked", "blocks": [1], "colour": "red"}
    path = edited(thrown, tmp_path / "throw.npz", lambda result: result.update(events=[event]))
    with pytest.raises(UsageError, match="is not a saved rollout"):
        load_npz(path)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_damaged_file_is_refused_or_read_as_it_was(thrown: Rollout, tmp_path: Path) -> None:
    """One byte changed at a time, in the head of an array and in the directory at the end."""
    path = tmp_path / "damaged.npz"
    save_npz(replace(thrown, trace=None), path)
    whole = path.read_bytes()
    for place in (*range(150), *range(len(whole) - 150, len(whole))):
        for value in (40, 255):
            path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
            with suppress(UsageError):
                assert rollout_json(load_npz(path)) == rollout_json(thrown)


def test_a_rollout_without_its_states_is_refused(thrown: Rollout, tmp_path: Path) -> None:
    path = tmp_path / "throw.npz"
    save_npz(thrown, path)
    result = np.load(path)["result"]
    for other in (None, np.zeros(3), np.zeros(3, [("times", float)]), np.array([{}], object)):
        arrays = {} if other is None else {"states": other}
        np.savez(path, result=result, **arrays)
        with pytest.raises(UsageError, match="is not a saved rollout"):
            load_npz(path)
