"""Tuning: what it costs, what it finds, that a stopped run repeats nothing, what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.cli import main
from agentflow.config.run import DesignConfig, build_config
from agentflow.env.pool.pool import Pool
from agentflow.env.rollout import Feedback, Rollout
from agentflow.errors import ConfigError, UsageError
from agentflow.machine.tree import Control, Machine
from agentflow.runs import read_events
from tests.app.design.test_controls import LEVEL
from tests.tools.benches import CAR

BLOCKS = agentflow.check(CAR).machine
assert BLOCKS is not None
START = replace(BLOCKS, controls=(Control("motors", 0.1, 0.2, 0.5),))
NOTHING = "this machine has no numbers to tune, because it brings no controls"


@pytest.fixture
def level(tmp_path: Path) -> str:
    path = tmp_path / "designed.yaml"
    path.write_text(LEVEL, encoding="utf-8")
    return str(path)


class Judged(Pool):
    """Simulates nothing: a machine that drives fast and long scores high."""

    count = 0
    most = 1000

    async def _start(self) -> None:
        """Nothing to start."""

    async def _stop(self) -> None:
        """Nothing to stop."""

    async def _run_trial(self, job: dict[str, Any]) -> Rollout:
        Judged.count += 1
        if Judged.count > Judged.most:
            raise RuntimeError("stopped")
        (control,) = job["machine"].controls
        return Rollout("ok", control.lasts * control.level, Feedback("Score: 1", {}))


def config(level: str, start: Machine = START, **settings: object) -> DesignConfig:
    given = {"start": start.to_json(), "max_simulations": 30, **settings}
    return build_config(
        {"task": level, "workflow": "tune", "workers": 1, "verify": False, "settings": given}
    )


def test_a_stopped_run_repeats_no_simulation(level: str, tmp_path: Path) -> None:
    pytest.importorskip("cma")
    options = RunOptions(open_pool=Judged)
    Judged.count, Judged.most = 0, 1000
    whole = design(config(level), tmp_path, options, "whole")
    assert (Judged.count, whole.rollouts) == (30, 30)
    assert whole.score is not None
    assert whole.score > 0.3 > 0.2 * 0.5
    assert not (tmp_path / "whole" / "unfinished").exists()
    Judged.count, Judged.most = 0, 17
    with pytest.raises(RuntimeError):
        design(config(level), tmp_path, options, "stopped")
    Judged.count, Judged.most = 0, 1000
    again = resume(tmp_path / "stopped", options)
    assert Judged.count == 30 - 17
    assert again.machine == whole.machine
    one, two = (
        {(e.kind, e.label): e.data for e in read_events(tmp_path / name)}
        for name in ("whole", "stopped")
    )
    assert one == two


@pytest.mark.slow
def test_a_machine_is_tuned_on_real_physics(
    level: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cma")
    monkeypatch.chdir(tmp_path)
    Path("m.json").write_text(START.to_text(), encoding="utf-8")
    given = ["m.json", "--task", level, "--simulations", "4", "--seed", "1", "--workers", "1"]
    assert main(["tune", *given, "--name", "a", "--quiet", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [stage["rollouts"] for stage in told["stages"]] == [1, 3]
    tuned = agentflow.tune(START, level, simulations=4, seed=1, out=tmp_path, workers=1, say=str)
    assert tuned.machine is not None
    assert tuned.machine.steps == START.steps
    assert tuned.machine.to_json() == told["machine"]
    assert replay(tuned.run, str) is None


def test_what_cannot_be_tuned_is_refused(
    level: str, tmp_path: Path, without: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "m.json"
    file.write_text(START.to_text(), encoding="utf-8")
    assert main(["tune", str(file), "--task", level, "--simulations", "0"]) == 2
    assert "--simulations" in capsys.readouterr().err
    with pytest.raises(UsageError, match="unknown task"):
        agentflow.tune(START, "nowhere", out=tmp_path)
    with pytest.raises(UsageError, match="a machine cannot bring controls"):
        agentflow.tune(START, "movement", out=tmp_path)
    with pytest.raises(ConfigError, match="max_simulations"):
        agentflow.tune(START, level, simulations=0, out=tmp_path)
    if agentflow.extras.is_installed("cma"):
        with pytest.raises(ConfigError, match=NOTHING):
            design(config(level, BLOCKS), tmp_path)
    without("cma")
    with pytest.raises(ConfigError, match=r"cma is not installed; .*agentflow-machines\[tune\]"):
        design(config(level), tmp_path)
    assert sorted(tmp_path.iterdir()) == [Path(level), file]
