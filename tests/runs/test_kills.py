"""A run killed at any moment resumes to the result of an uninterrupted one."""

from __future__ import annotations

import multiprocessing
import random
import time
from pathlib import Path

import pytest

from agentflow.errors import RunError
from agentflow.runs import read_events, read_result, state_of
from tests.runs.small import begin, begin_to_be_killed, contents, go_on

KILLS = 15
"""`benchmarks/kills.py` kills at forty moments."""
LATE = 5
"""Calls that a run may make after the moment of its kill, however late the kill comes."""


def killed(folder: Path, log: Path, chance: random.Random, moment: int) -> Path:
    """A run whose process was killed after so many calls: at once, or a moment later."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.runs.small"])
    arguments = (folder, log, chance.randrange(1000), moment + LATE)
    process = context.Process(target=begin_to_be_killed, args=arguments)
    process.start()
    while not (folder / "started").exists() or lines(log) < moment:
        time.sleep(0.0005)
    time.sleep(chance.uniform(0.0, 0.005))
    process.kill()
    process.join()
    return folder / "run"


def lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def torn(path: Path, chance: random.Random) -> bytes:
    """Truncate the last line of a file, like a kill during a write; return what is left."""
    data = path.read_bytes()
    end = data.rstrip(b"\n").rfind(b"\n") + 1
    if end < len(data):
        data = data[: chance.randrange(end, len(data))]
        path.write_bytes(data)
    return data


def whole(data: bytes) -> bytes:
    return data[: data.rfind(b"\n") + 1]


@pytest.mark.slow
def test_a_run_killed_at_any_moment_gives_the_same_result(tmp_path: Path) -> None:
    kill_at_moments(tmp_path, KILLS)


def kill_at_moments(tmp_path: Path, kills: int) -> None:
    undisturbed = begin(tmp_path / "undisturbed", tmp_path / "log", 0)
    expected, labels = contents(undisturbed), (tmp_path / "log").read_text().split()
    assert len(labels) == len(set(labels)) > 40
    chance = random.Random(11)
    in_the_middle = 0
    for number in range(kills):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = killed(folder, folder / "asked", chance, chance.randrange(-3, len(labels) + 1))
        if not (path / "run.yaml").exists():
            continue  # killed before there was a run
        assert state_of(path) in ("stopped", "done")
        kept = {}
        for name in ("calls.jsonl", "events.jsonl"):
            file = path / name
            file.touch()
            kept[name] = torn(file, chance) if chance.random() < 0.5 else file.read_bytes()
        recorded = whole(kept["calls.jsonl"]).count(b"\n")
        in_the_middle += 0 < recorded < len(labels)
        (path / "result.json").unlink(missing_ok=True)  # as if killed just before
        with pytest.raises(RunError, match="the run is unfinished"):
            read_result(path)
        go_on(path, folder / "asked again", chance.randrange(1000))
        assert contents(path) == expected
        again = (folder / "asked again").read_text().split() if recorded < len(labels) else []
        assert len(again) == len(set(again)) == len(labels) - recorded
        for name, data in kept.items():
            assert (path / name).read_bytes().startswith(whole(data)), "a recorded line is lost"
        assert sum(1 for _ in read_events(path)) == len(expected["events.jsonl"])
    assert in_the_middle >= kills * 0.6


@pytest.mark.slow
def test_a_run_killed_twice_gives_the_same_result(tmp_path: Path) -> None:
    """A run is killed at any moment, and so is its continuation."""
    expected = contents(begin(tmp_path / "undisturbed", tmp_path / "log", 0))
    path = begin(tmp_path / "cut", tmp_path / "asked", 1)
    for share in (0.3, 0.6):
        (path / "result.json").unlink()
        for name in ("calls.jsonl", "events.jsonl"):
            data = (path / name).read_bytes()
            (path / name).write_bytes(data[: int(len(data) * share)])
        for file in sorted((path / "machines").iterdir())[::2]:
            file.unlink()
        go_on(path, tmp_path / "again", 2)
        assert contents(path) == expected
