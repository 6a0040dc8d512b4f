"""Design runs end to end: real prompts, real text, real physics, real files."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
import yaml

from agentflow.app.design.config import load_config
from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.cli import main
from agentflow.errors import RunError
from agentflow.runs import read_events, read_result
from agentflow.runs.reading import document_text
from tests.app.test_doctor import threaded
from tests.llm.hostile import body

Captured = pytest.CaptureFixture[str]

ROOT = Path(__file__).parents[3]
SMALL = ROOT / "configs" / "small.yaml"


def ignore(_line: str) -> None:
    """Ignores remarks."""


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """What the command for a small run with the procedural model writes: its output and errors."""
    out, err = io.StringIO(), io.StringIO()
    arguments = ["--out", str(tmp_path_factory.mktemp("runs")), "--json", "--quiet"]
    with redirect_stdout(out), redirect_stderr(err):
        assert main(["design", "--config", str(SMALL), *arguments]) == 0
    return out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def run(said: tuple[str, str]) -> Path:
    """The folder of that run."""
    return Path(json.loads(said[0])["run"])


@pytest.mark.slow
def test_a_run_directory_is_complete(run: Path) -> None:
    result = read_result(run)
    document = yaml.safe_load((run / "run.yaml").read_text())
    assert document["config"]["settings"]["trajectories"] == 2
    digests = {len(document[key]) for key in ("prompts", "demands", "constants")}
    assert digests == {16}
    calls = [json.loads(line) for line in (run / "calls.jsonl").read_text().splitlines()]
    assert result.calls == len(calls)
    assert {call["request"]["role"] for call in calls} == {
        "meta_designer",
        "designer",
        "inspector",
        "querier",
        "refiner",
    }
    assert [stage.name for stage in result.stages] == [
        "initial",
        "blind_refinement",
        "env_feedback",
    ]
    assert result.model == "procedural (no language model)"
    assert result.valid is True
    kept = {path.stem for path in (run / "machines").iterdir()}
    tried = {e.data["machine"] for e in read_events(run) if e.kind == "evaluation"}
    assert tried <= kept
    assert {path.stem for path in (run / "rollouts").iterdir()} <= tried
    assert list((run / "rollouts").iterdir())


@pytest.mark.slow
def test_simulating_the_best_machine_again_gives_the_recorded_score(
    run: Path, tmp_path: Path, capsys: Captured
) -> None:
    result = read_result(run)
    (tmp_path / "best.json").write_text(json.dumps(result.machine))
    assert main(["simulate", str(tmp_path / "best.json"), "--task", "throwing", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["score"] == result.score


@pytest.mark.slow
def test_a_replay_reports_the_first_difference(run: Path, tmp_path: Path) -> None:
    other = shutil.copytree(run, tmp_path / "other")
    lines = (other / "events.jsonl").read_text().splitlines(keepends=True)
    at, line = next((i, item) for i, item in enumerate(lines) if '"evaluation"' in item)
    event = json.loads(line)
    event["data"]["score"] = 1234.5
    lines[at] = json.dumps(event) + "\n"
    (other / "events.jsonl").write_text("".join(lines))
    assert (replay(other, ignore) or "").startswith(
        f"evaluation {event['label']}: score was 1234.5, is now "
    )


@pytest.mark.slow
def test_resuming_a_finished_run_returns_its_result(run: Path) -> None:
    assert resume(run) == read_result(run)


@pytest.mark.parametrize("what", ["constants", "demands", "prompts", "schema"])
@pytest.mark.slow
def test_resuming_under_other_conditions_is_refused(run: Path, tmp_path: Path, what: str) -> None:
    """An unfinished run; of another schema, also a finished one."""
    other = shutil.copytree(run, tmp_path / "other")
    document = yaml.safe_load((other / "run.yaml").read_text())
    if what == "schema":
        changed, told = 2, "has schema 2, but this version reads only schema 1"
    else:
        (other / "result.json").unlink()
        assert len(document[what]) == 16
        changed, told = "0" * 16, f"was started with different {what}, so its recording "
    (other / "run.yaml").write_text(document_text({**document, what: changed}))
    with pytest.raises(RunError, match=told):
        resume(other)


@pytest.mark.slow
def test_a_killed_run_resumes_to_the_same_result(run: Path, tmp_path: Path) -> None:
    """tests/runs/test_kills.py kills runs at many moments."""
    after = 8
    command = [sys.executable, "-c", "from agentflow.cli import main; main()", "design"]
    process = subprocess.Popen(
        [*command, "--config", str(SMALL), "--out", str(tmp_path), "--quiet"],
        stdout=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 60
    while _calls_in(tmp_path) < after and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    (killed,) = tmp_path.iterdir()
    with pytest.raises(RunError, match="the run is unfinished"):
        read_result(killed)
    recorded = _calls_in(tmp_path)
    result = resume(killed)
    first = read_result(run)
    for key in ("score", "machine", "stages", "calls", "rollouts"):
        assert getattr(result, key) == getattr(first, key), key
    assert recorded >= after
    assert _calls_in(tmp_path) == first.calls
    assert replay(killed, ignore) is None


def _calls_in(out: Path) -> int:
    return sum(path.read_bytes().count(b"\n") for path in out.glob("*/calls.jsonl"))


@pytest.mark.slow
def test_an_edited_record_is_reported_and_corrected(run: Path, tmp_path: Path) -> None:
    other = shutil.copytree(run, tmp_path / "other")
    (other / "result.json").unlink()
    text = (other / "events.jsonl").read_text()
    event = next(e for e in read_events(run) if e.kind == "evaluation")
    score = json.dumps(event.data["score"])
    (other / "events.jsonl").write_text(text.replace(f'"score": {score}', '"score": 1234.5', 1))
    edited = (other / "events.jsonl").read_bytes()
    said: list[str] = []
    assert resume(other, RunOptions(said.append)).score == read_result(run).score
    assert said == [
        f"recorded events that now differ: 1 (first: evaluation {event.label}), because a file "
        f"in {other} was edited, or a simulation that had been cut off went through; both "
        "versions are kept, the later one counts"
    ]
    assert (other / "events.jsonl").read_bytes().startswith(edited)
    assert replay(other, ignore) is None


@pytest.mark.slow
def test_an_interrupted_run_says_how_to_resume(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "import sys; from agentflow.cli import main; sys.exit(main())"]
    process = subprocess.Popen(
        [*command, "design", "--config", str(SMALL), "--out", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while _calls_in(tmp_path) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    (run,) = tmp_path.iterdir()
    assert (process.returncode, out) == (130, "")
    assert err.splitlines()[-1] == (
        f"agentflow: interrupted; continue with: agentflow design --resume {run}"
    )
    assert resume(run).valid is True


@pytest.mark.slow
def test_a_spent_budget_ends_a_run_cleanly_and_the_run_replays(run: Path, tmp_path: Path) -> None:
    config = load_config(SMALL, ["seed=1", "model.budget.calls=9"], {})
    result = design(config, tmp_path)
    assert (result.stopped, result.calls) == ("budget", 9)
    assert result.machine != read_result(run).machine  # of another seed
    assert replay(Path(result.run), ignore) is None


@pytest.mark.slow
def test_any_endpoint_can_answer_instead_of_the_procedural_model(
    stub_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret-1234567890")
    job = ["--task", "movement", "--workflow", "single", "--out", str(tmp_path)]
    few = ["--set", "trajectories=1", "--set", "search.rounds=0"]
    model = ["--model", "some-model", "--base-url", stub_url]
    status = main(["design", *job, *few, *model, "--quiet", "--json"])
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert (status, result["model"], result["calls"]) == (0, "some-model", 1)
    assert 40 <= result["score"] <= 50
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not any(b"sk-secret" in path.read_bytes() for path in written)
    assert {"best.png", "best.gif"} <= {path.name for path in written}


@pytest.mark.slow
def test_json_output_is_only_the_result(said: tuple[str, str]) -> None:
    out, err = said
    result = json.loads(out)
    assert err == ""
    wanted = "score machine valid stages model calls tokens rollouts seconds run"
    assert {*wanted.split()} <= set(result)
    assert {"name", "valid", "mean", "max"} <= set(result["stages"][0])


def test_an_unreachable_endpoint_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    attempts = ["--set", "model.endpoint.retry.attempts=1"]
    url = "http://127.0.0.1:9/v1"
    assert main(["design", "--model", "m", "--base-url", url, *attempts, "--quiet"]) == 4
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"agentflow: no answer from {url} ")
    assert "check OPENAI_BASE_URL or --base-url" in captured.err
    assert os.listdir(tmp_path) == []


def test_an_unknown_model_is_named(
    stub_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["design", "--model", "nonesuch", "--base-url", stub_url, "--quiet"]) == 4
    assert "nonesuch" in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


def test_an_endpoint_without_tools_is_refused_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    refusal = {"error": {"message": "registry.ollama.ai/library/m does not support tools"}}
    with threaded(body(refusal, 400)) as server:
        model = ["--model", "m", "--base-url", server.base_url]
        assert main(["design", "--workflow", "tools", *model, "--quiet"]) == 4
        assert len(server.asked) == 1
    assert capsys.readouterr().err == (
        f"agentflow: model 'm' at {server.base_url} does not support tools (400: "
        "registry.ollama.ai/library/m does not support tools); switch on tool calling at the "
        "server, or use another model, or a workflow without tools\n"
    )
