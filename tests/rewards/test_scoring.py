"""Rewards of batches, from plain functions and from the functions that trainers call."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

from agentflow.errors import ConfigError, UnknownNameError, UsageError
from agentflow.integrations.trl import simulation_reward
from agentflow.integrations.verl import compute_score, compute_scores
from agentflow.rewards import Sample, Scorer, own_processors, read_knobs, reward, shared_scorer
from tests.integrations.foreign import CAR
from tests.processes import run_python

SHORT = {"window": 1}
REWARD = reward("movement", CAR, knobs=SHORT)
HOLD = f"""
import atexit
atexit.register(lambda: print(scorer.pool.pids))  # after what is registered later
from agentflow.rewards import Sample, shared_scorer
scorer = shared_scorer(2)
assert scorer.rewards([Sample("movement", "a car")])[0].value == 0
assert shared_scorer(2) is scorer
unfinished = [scorer.submit(Sample("movement", {CAR!r})) for _ in range(8)]
print(*scorer.pool.pids, flush=True)
"""


@pytest.fixture(scope="module")
def scorer() -> Iterator[Scorer]:
    scorer = Scorer(workers=2)
    yield scorer
    scorer.close()


@pytest.mark.slow
def test_a_batch_is_scored_in_its_order(scorer: Scorer) -> None:
    texts = [CAR, "no machine", CAR]
    rewards = scorer.rewards([Sample("movement", text, knobs=SHORT) for text in texts])
    assert [item.value for item in rewards] == [REWARD.value, 0.0, REWARD.value]
    assert REWARD.value is not None
    assert REWARD.value > 1
    assert [item.parsed for item in rewards] == [True, False, True]
    assert rewards[0].rollout.digest == REWARD.rollout.digest
    assert scorer.rewards([]) == []


@pytest.mark.slow
def test_threads_share_the_workers(scorer: Scorer) -> None:
    sample = Sample("movement", CAR, knobs=SHORT)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(scorer.rewards, [[sample]] * 4))
    assert [[item.value for item in rewards] for rewards in found] == [[REWARD.value]] * 4


def test_unknown_tasks_and_knobs_are_errors(scorer: Scorer) -> None:
    with pytest.raises(UnknownNameError, match="unknown task 'swimming'; known: "):
        scorer.rewards([Sample("swimming", CAR)])
    with pytest.raises(ConfigError, match="unknown knob 'wet' of movement"):
        scorer.rewards([Sample("movement", CAR, knobs={"wet": 1})])


def test_a_closed_scorer_leaves_no_process() -> None:
    scorer = Scorer(workers=1)
    [worker] = scorer.pool.pids
    scorer.close()
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_processes_of_a_launcher_share_the_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = own_processors()
    monkeypatch.setenv("LOCAL_WORLD_SIZE", "2")
    assert own_processors() == max(1, alone // 2)


@pytest.mark.slow
@pytest.mark.parametrize("killed", [False, True])
def test_workers_end_with_their_parent(killed: bool) -> None:
    wait = "import time; time.sleep(60)" if killed else ""
    command = [sys.executable, "-c", HOLD + wait]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        workers = [int(word) for word in parent.stdout.readline().split()]
        if killed:
            parent.send_signal(signal.SIGKILL)
        left, errors = parent.communicate(timeout=60)
    assert len(workers) == 2
    assert killed or (parent.returncode, left, errors) == (0, b"()\n", b"")
    deadline = time.monotonic() + 30
    while any(Path(f"/proc/{worker}").exists() for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("column", "knobs"),
    [
        (None, {}),
        ("", {}),
        ({}, {}),
        ({"wind.speed": 8}, {"wind.speed": 8}),
        ({"wind.speed": 8, "wall.height": None}, {"wind.speed": 8}),
        ('{"wind.speed": 8, "window": null}', {"wind.speed": 8}),
    ],
)
def test_knobs_are_read_from_columns(column: object, knobs: dict[str, object]) -> None:
    assert read_knobs(column) == knobs


@pytest.mark.parametrize("column", ["wind.speed=8", "[8]", 8, ["wind.speed"]])
def test_other_columns_are_not_knobs(column: object) -> None:
    with pytest.raises(ConfigError, match=r'^knobs must be a mapping such as \{"wind.speed": 8\}'):
        read_knobs(column)


@pytest.mark.slow
def test_trl_gets_one_score_for_each_completion() -> None:
    messages = [{"role": "assistant", "content": CAR}]
    parts = [{"role": "assistant", "content": [{"type": "text", "text": CAR}]}]
    turns = [*messages, {"role": "tool", "content": "done"}, {"role": "assistant"}]
    scores = simulation_reward(
        completions=[CAR, messages, parts, turns, []],
        task=["movement"] * 5,
        knobs=[SHORT, '{"window": 1}', {**SHORT, "wind.speed": None}, SHORT, None],
        seed=[0, None, 3, 0, 0],
        prompts=["-"] * 5,
        trainer_state=None,
        workers=2,
    )
    assert scores == [REWARD.value] * 3 + [0.0, 0.0]


@pytest.mark.slow
def test_one_value_may_hold_for_all_completions() -> None:
    function = partial(simulation_reward, task="movement", knobs=SHORT, workers=2)
    assert function(completions=[CAR, ""]) == [REWARD.value, 0.0]


def test_columns_as_long_as_the_batch() -> None:
    with pytest.raises(ValueError, match="shorter"):
        simulation_reward(completions=[CAR, CAR], task=["movement"], workers=2)


def test_verl_gets_the_score_and_its_conditions() -> None:
    passed = {"data_source": "machines", "ground_truth": "movement", "workers": 2}
    overlapping = CAR.replace('"face_id": 3', '"face_id": 2')
    texts = (CAR, overlapping, "no machine")
    extra = {"knobs": SHORT, "seed": 0, "num_turns": None}
    scores = [compute_score(solution_str=text, extra_info=extra, **passed) for text in texts]
    assert scores == [
        {"score": REWARD.value, "parsed": 1.0, "spatial": 1.0, "valid": 1.0},
        {"score": 0.0, "parsed": 1.0, "spatial": 0.0, "valid": 0.0},
        {"score": 0.0, "parsed": 0.0, "spatial": 0.0, "valid": 0.0},
    ]
    batch = compute_scores(["machines"] * 3, texts, ["movement"] * 3, [extra] * 3, workers=2)
    assert batch == scores


@pytest.mark.slow
def test_modules_need_no_foreign_library() -> None:
    names = ("gymnasium", "ray", "torch", "transformers", "trl", "verl")
    code = (
        "import sys, agentflow.integrations.trl, agentflow.integrations.verl\n"
        f"print(sorted(set({names}) & set(sys.modules)))"
    )
    assert run_python("-c", code).stdout == "[]\n"


def test_a_number_of_workers_is_at_least_one() -> None:
    with pytest.raises(UsageError, match="workers must be at least 1, not 0"):
        shared_scorer(0)
