"""Verified scores of runs: made at their end, stored, resumed, replayed, shown."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import pytest

import agentflow
from agentflow.app.design.replay import replay
from agentflow.app.inspect.overview import run_details, run_list
from agentflow.app.subjects.subject import Subject
from agentflow.app.subjects.verify import verify
from agentflow.cli.display.show_runs import show_run, show_runs
from agentflow.cli.display.show_scores import show_verified
from agentflow.errors import RunError
from agentflow.holding import with_holding
from agentflow.runs import Notify, read_events, read_result, state_of

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "examples" / "car.json").read_text()
TINY = {"trajectories": 1, "search.rounds": 0, "window": 1}


def car(_request: agentflow.Request) -> str:
    return f"```json\n{TEXT}\n```"


def design(out: Path, **settings: object) -> agentflow.Design:
    return agentflow.design(
        "movement", workflow="single", answer=car, settings={**TINY, **settings}, out=out
    )


def events_of(run: Path, kind: str) -> list[dict[str, Any]]:
    return [dict(event.data) for event in read_events(run) if event.kind == kind]


def verify_run(run: Path, workers: int, notify: Notify) -> dict[str, Any]:
    return verify(Subject.of_run(run), workers, notify)


def ignore(_line: str) -> None:
    """Ignores remarks."""


@pytest.fixture(scope="module")
def verified(tmp_path_factory: pytest.TempPathFactory) -> agentflow.Design:
    """A run with one machine, verified."""
    return design(tmp_path_factory.mktemp("verified"))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> agentflow.Design:
    """The same run without verification."""
    return design(tmp_path_factory.mktemp("plain"), verify=False)


@pytest.mark.slow
def test_a_run_ends_with_the_verification_of_its_best_machine(verified: agentflow.Design) -> None:
    found = verified.data["verified"]
    assert found == agentflow.verify(TEXT, "movement", knobs={"window": 1}).to_json()
    assert verified.verified == found["score"]
    assert found["scores"][0]["score"] == verified.score
    (event,) = events_of(verified.run, "verification")
    assert verified.machine is not None
    assert event == {"machine": verified.machine.digest, **found}
    assert [event.kind for event in read_events(verified.run)][-2:] == ["result", "verification"]
    assert replay(verified.run, ignore) is None


@pytest.mark.slow
def test_verification_is_not_counted_among_the_rollouts(
    verified: agentflow.Design, plain: agentflow.Design
) -> None:
    same = ("score", "machine", "rollouts", "stages", "simulated_seconds")
    assert [verified.data[key] for key in same] == [plain.data[key] for key in same]
    assert verified.data["rollouts"] == 1


@pytest.mark.slow
def test_verification_can_be_switched_off_and_made_later(
    plain: agentflow.Design, verified: agentflow.Design, tmp_path: Path
) -> None:
    assert (plain.verified, plain.data["verified"]) == (None, None)
    assert not events_of(plain.run, "verification")
    assert replay(plain.run, ignore) is None
    run = shutil.copytree(plain.run, tmp_path / "run")
    found = verify_run(run, 1, pytest.fail)
    assert found["verified"] == with_holding(verified.data["verified"])
    assert read_result(run).to_json()["verified"] == verified.data["verified"]
    assert replay(run, ignore) is None
    assert state_of(run) == "done"


@pytest.mark.slow
def test_a_verified_run_is_not_verified_again(verified: agentflow.Design) -> None:
    before = {path: path.stat().st_mtime_ns for path in verified.run.rglob("*")}
    found = verify_run(verified.run, 1, pytest.fail)
    assert found["verified"] == with_holding(verified.data["verified"])
    assert {path: path.stat().st_mtime_ns for path in verified.run.rglob("*")} == before


@pytest.mark.slow
def test_an_incomplete_verification_is_made_again(
    verified: agentflow.Design, tmp_path: Path
) -> None:
    run = shutil.copytree(verified.run, tmp_path / "run")
    result = read_result(run).to_json()
    for part in (result["verified"], (lost := result["verified"]["scores"][3])):
        part["score"] = None
    lost["status"] = "timeout"
    (run / "result.json").write_text(json.dumps(result))
    found = verify_run(run, 1, pytest.fail)
    assert found["verified"] == with_holding(verified.data["verified"])
    assert read_result(run).to_json()["verified"] == verified.data["verified"]


@pytest.mark.slow
def test_a_score_that_physics_no_longer_gives_is_not_verified_in_the_run(
    plain: agentflow.Design, tmp_path: Path
) -> None:
    run = shutil.copytree(plain.run, tmp_path / "run")
    result = read_result(run).to_json()
    (run / "result.json").write_text(json.dumps({**result, "score": 99.0}))
    said: list[str] = []
    found = verify_run(run, 1, said.append)
    assert found["score"] == 99.0
    assert found["verified"]["score"] < 50
    assert said == [
        f"the verification is not stored in {run}: the recorded score is 99.00, but simulated "
        f"again with current physics, it is {plain.score:.2f}"
    ]
    assert read_result(run).verified is None


@pytest.mark.slow
def test_a_damaged_verification_is_reported(verified: agentflow.Design, tmp_path: Path) -> None:
    run = shutil.copytree(verified.run, tmp_path / "run")
    wrongs: tuple[Any, ...] = ({}, [], {**verified.data["verified"], "low": "much"}, {"scores": []})
    for wrong in wrongs:
        (run / "result.json").write_text(json.dumps({**verified.data, "verified": wrong}))
        with pytest.raises(RunError, match=r"result\.json is damaged: its verified is "):
            verify_run(run, 1, ignore)


def test_runs_without_a_valid_machine_cannot_be_verified(tmp_path: Path) -> None:
    failed = agentflow.design(
        "throwing", workflow="single", answer=car, settings=TINY, out=tmp_path, say=ignore
    )
    assert failed.data["verified"] is None
    with pytest.raises(RunError, match="has no valid machine; no valid machine: "):
        verify_run(failed.run, 1, ignore)


@pytest.mark.slow
def test_lists_and_details_show_the_verified_score(
    verified: agentflow.Design, plain: agentflow.Design
) -> None:
    for run in (verified, plain):
        (row,) = run_list(run.run.parent)
        told = with_holding(run.data["verified"])
        assert row["verified"] == run_details(run.run)["verified"] == told


def with_scores(run: Path, change: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]) -> None:
    """Change the scores of a run's verification, in its result and in its event alike."""
    result = json.loads((run / "result.json").read_text())
    scores = change(result["verified"]["scores"])
    known = [item["score"] for item in scores]
    found = {"score": median(known), "low": min(known), "high": max(known), "scores": scores}
    (run / "result.json").write_text(json.dumps({**result, "verified": found}))
    lines = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    for line in lines:
        if line["kind"] == "verification":
            line["data"].update(found)
    (run / "events.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


@pytest.mark.slow
def test_a_run_that_was_verified_otherwise_replays_identical(
    verified: agentflow.Design, tmp_path: Path
) -> None:
    """Other versions verify under other variations: those of the run are repeated."""
    run = shutil.copytree(verified.run, tmp_path / "run")
    with_scores(run, lambda scores: scores[:3])
    assert replay(run, ignore) is None
    assert [item["variation"] for item in run_details(run)["verified"]["scores"]] == [
        "default", "4 x step rate", "masses +2 %",
    ]  # fmt: skip
    with_scores(run, lambda scores: [{**item, "variation": "moonlight"} for item in scores])
    with pytest.raises(RunError, match="was verified under 'moonlight', which this version does"):
        replay(run, ignore)


@pytest.mark.slow
def test_a_machine_that_fails_under_a_variation_is_fragile_everywhere(
    verified: agentflow.Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The median is above 0, and the verified score alone would hide the failure."""
    run = shutil.copytree(verified.run, tmp_path / "run")
    with_scores(run, lambda scores: [{**item, "score": item["score"] * (i != 2)}
                                     for i, item in enumerate(scores)])  # fmt: skip
    assert read_result(run).fragile is True
    assert verified.fragile is False
    (row,) = run_list(run)
    told = [row["verified"][key] for key in ("holds", "fails", "fragile")]
    assert told == [7, ["masses +2 %"], True]
    show_run(run_details(run))
    text = " ".join(capsys.readouterr().out.split())
    assert "; fragile, holds in 7 of 8 (masses +2 %: 0.00)" in text
    show_runs([row])
    assert f"{row['verified']['score']:.2f} (fragile)" in capsys.readouterr().out
    show_verified(verify_run(run, 1, ignore))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines if line.startswith("masses")] == ["no", "%"]


@pytest.mark.slow
def test_runs_from_before_verification_still_read_and_replay(
    verified: agentflow.Design, tmp_path: Path
) -> None:
    run = shutil.copytree(verified.run, tmp_path / "run")
    result = read_result(run).to_json()
    del result["verified"]
    (run / "result.json").write_text(json.dumps(result))
    lines = (run / "events.jsonl").read_text().splitlines(keepends=True)
    kept = [line for line in lines if json.loads(line)["kind"] != "verification"]
    assert len(kept) == len(lines) - 1
    (run / "events.jsonl").write_text("".join(kept))
    assert run_details(run)["verified"] is None
    again = agentflow.resume(run)  # finished: only reads it
    assert (again.score, again.verified) == (result["score"], None)
    assert replay(run, ignore) is None


HANG = """
import asyncio, sys
from pathlib import Path
import agentflow
from agentflow.env.simulation.variations import DEFAULT
from tests.app.subjects.test_verify import TINY, car

class Hangs(agentflow.RolloutPool):
    async def run(self, machine, task, *, variation=DEFAULT, **options):
        if variation is not DEFAULT:
            print("verifying", flush=True)
            await asyncio.sleep(3600)
        return await super().run(machine, task, **options)

async def main():
    async with Hangs(1) as pool:
        await agentflow.design_async("movement", workflow="single", answer=car, settings=TINY,
                                     out=Path(sys.argv[1]), pool=pool)

asyncio.run(main())
"""
"""Designs a machine and hangs while it is verified."""


@pytest.mark.slow
def test_a_run_killed_before_its_verification_resumes_to_the_same_result(
    verified: agentflow.Design, tmp_path: Path
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HANG, str(tmp_path)], stdout=subprocess.PIPE, cwd=ROOT, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "verifying\n"
        process.kill()
    (run,) = tmp_path.iterdir()
    assert [event.kind for event in read_events(run)][-1] == "result"
    assert state_of(run) == "stopped"
    resumed = agentflow.resume(run, answer=car)
    volatile = {"seconds", "worker_seconds", "run"}
    assert {key: value for key, value in resumed.data.items() if key not in volatile} == {
        key: value for key, value in verified.data.items() if key not in volatile
    }
    assert events_of(run, "verification") == events_of(verified.run, "verification")
    assert replay(run, ignore) is None
