"""Runs of the workflow `external` on real physics, with programs good and bad."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.cli import main
from agentflow.config.run import DesignConfig, build_config
from agentflow.errors import ConfigError
from agentflow.integrations.external.process import HEAD, TAIL
from agentflow.integrations.external.workflow import EXTERNAL
from agentflow.runs.events import (
    FilesEvent,
    FileVerdict,
    ProgramEvent,
    ToolEvent,
    read_stage,
)
from agentflow.runs.locations import FEEDBACK, INITIAL, STAGES, Location
from tests.integrations.external.test_process import lives

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sessions and signals")
ROOT = Path(__file__).parents[3]
CAR = ROOT / "examples" / "car.json"
HAND_IN = f"shutil.copy({str(CAR)!r}, 'machines/car.json')"
"""Hands in a car that drives 46 m."""


def configure(code: str, **external: Any) -> DesignConfig:
    """A run with two machines per stage, whose program is Python code."""
    code = f"import json, os, shutil, subprocess, sys, time\n{code}"
    program = {
        "command": [sys.executable, "-c", code],
        "limit_s": 60,
        "isolate": "never",  # it reads files of the repository; see test_sandbox.py
        **external,
    }
    settings = {"external": program, "candidates_per_stage": 2, "max_simulations": 6}
    return build_config(
        {"task": "movement", "workflow": "external", "settings": settings, "verify": False}
    )


def carry_out(code: str, folder: Path, **external: Any) -> Path:
    """The directory of a finished run."""
    return Path(design(configure(code, **external), folder, name="run").run)


def result_of(run: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((run / "result.json").read_text())
    return found


def verdicts(run: Path, stage: str = INITIAL) -> dict[str, str]:
    """File -> why it does not count, of the files in a stage."""
    return {file.file: file.problem for event in files(run, stage) for file in event.files}


def files(run: Path, stage: str = INITIAL) -> list[FilesEvent]:
    return [event for event in read_stage(run, stage) if isinstance(event, FilesEvent)]


def endings(run: Path) -> list[tuple[int, bool]]:
    """Exit status, and whether the limit was reached, of each stage's program."""
    events = (event for stage in STAGES for event in read_stage(run, stage))
    return [(e.status, e.timed_out) for e in events if isinstance(e, ProgramEvent)]


@pytest.mark.slow
def test_the_example_designs_a_cart_that_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, str(ROOT / "examples" / "tool_agent.py")]
    run = carry_out("", tmp_path, command=command)
    result = result_of(run)
    assert result["model"] == f"program {Path(sys.executable).name} tool_agent.py"
    assert len(result["stages"]) == 3
    assert result["score"] > 40
    assert endings(run) == [(0, False)] * 3
    used = [event.tool for event in read_stage(run, FEEDBACK) if isinstance(event, ToolEvent)]
    assert {"check", "edit", "simulate", "submit"} == set(used)
    log = (run / "log.txt").read_text()
    assert log.count("=== env_feedback: ") == 2
    assert "simulate Machine" in log
    assert replay(run, lambda line: pytest.fail(line)) is None
    for command in (["show"], ["report", "--out", "report.html"], ["gallery", "--out", "g.html"]):
        assert main([command[0], str(run), *command[1:]]) == 0


@pytest.mark.slow
def test_files_count_without_any_tool(tmp_path: Path) -> None:
    code = f"""
assert sys.stdin.read() == open("TASK.md").read()
server = json.load(open(".mcp.json"))["mcpServers"]["agentflow"]
assert server["url"] == os.environ["AGENTFLOW_BENCH"]
assert server["headers"] == dict(Authorization="Bearer " + os.environ["AGENTFLOW_BENCH_TOKEN"])
print(sorted(os.listdir("machines/before")))
{HAND_IN}
"""
    run = carry_out(code, tmp_path)
    result = result_of(run)
    assert [row["valid"] for row in result["stages"]] == [1, 1, 1]
    assert result["score"] == pytest.approx(46, abs=1)
    assert result["rollouts"] == 1
    lines = (run / "log.txt").read_text().splitlines()
    assert [line for line in lines if line.startswith("[")] == ["[]"] + 2 * ["['6c45a9a7.json']"]
    assert replay(run, lambda line: pytest.fail(line)) is None


@pytest.mark.slow
def test_a_program_that_leaves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = carry_out("sys.exit(3)", tmp_path)
    assert endings(run) == [(3, False)] * 3
    result = result_of(run)
    assert (result["valid"], result["rollouts"]) == (False, 0)
    assert result["reason"] == (
        "no valid machine: submitted no machine: the program ended with status 3 (not isolated)"
    )
    assert main(["show", str(run)]) == 0
    told = (
        "notice: initial: the program ended with status 3 (not isolated); log.txt has its output\n"
    )
    assert told in capsys.readouterr().out
    assert replay(run, lambda line: pytest.fail(line)) is None


@pytest.mark.slow
def test_bad_files_are_refused_with_a_reason(tmp_path: Path) -> None:
    code = f"""
os.chdir("machines")
open("a.json", "w").write("no machine at all")
open("b.json", "w").write("[" * 100_000)
open("c.json", "wb").write(b"\\xff")
os.symlink("/etc/passwd", "d.json")
os.mkfifo("e.json")
os.mkdir("f.json")
open("g.json", "w").write(open({str(CAR)!r}).read().replace('"type": 2', '"type": 99'))
shutil.copy({str(CAR)!r}, "y.json")
shutil.copy({str(CAR)!r}, "z.json")
"""
    found = verdicts(carry_out(code, tmp_path))
    assert list(found) == [f"{name}.json" for name in "abcdefgyz"]
    assert found.pop("y.json") == ""
    assert "already submitted" in found["z.json"]
    assert found["d.json"] == "it is a link; write the machine itself"
    assert all(0 < len(problem) <= 300 for problem in found.values())


@pytest.mark.slow
def test_a_folder_of_machines_that_is_gone_or_a_link(tmp_path: Path) -> None:
    run = carry_out("shutil.rmtree('machines'); os.symlink('/etc', 'machines')", tmp_path)
    assert [event.problem for event in files(run)] == ["it is not a folder; leave it as it is"]


def test_which_files_do_not_count_is_told() -> None:
    good, bad = FileVerdict("a.json", "1234abcd", ""), FileVerdict("b.json", None, "no JSON")
    location = Location(INITIAL)
    assert str(FilesEvent(location, (good,), 0, "")) == ""
    assert str(FilesEvent(location, (good, bad), 0, "")) == (
        "1 file does not count, such as machines/b.json: no JSON"
    )
    assert str(FilesEvent(location, (bad,), 2, "")).startswith("3 files do not count, such as ")
    assert str(FilesEvent(location, (good,), 2, "")) == "2 files do not count: others came first"
    assert str(FilesEvent(location, (), 0, "gone")) == "the folder machines cannot be read: gone"


@pytest.mark.slow
def test_more_files_than_are_read(tmp_path: Path) -> None:
    code = "for n in range(1000): open(f'machines/{n:03d}.json', 'w').close()"
    (found,) = files(carry_out(code, tmp_path))
    assert (len(found.files), found.more) == (100, 900)


@pytest.mark.slow
def test_what_is_there_at_the_limit_counts(tmp_path: Path) -> None:
    code = f"""
{HAND_IN}
print("on", flush=True)
if not os.listdir("machines/before"):
    time.sleep(600)
"""
    run = carry_out(code, tmp_path, limit_s=8.0)
    assert endings(run) == [(-15, True), (0, False), (0, False)]
    assert result_of(run)["stages"][0]["valid"] == 1
    told = "=== initial: stopped at its limit with status -15\n"
    assert f"on\n\n{told}" in (run / "log.txt").read_text()


@pytest.mark.slow
def test_a_flood_of_output_leaves_a_small_log(tmp_path: Path) -> None:
    run = carry_out("os.write(1, b'x' * 5_000_000)", tmp_path)
    log = (run / "log.txt").read_text()
    assert len(log) < 3 * (HEAD + TAIL + 2000)
    assert log.count("bytes of output left out here") == 3


@pytest.mark.parametrize(
    ("external", "told"),
    [
        ({"command": ""}, "external.command is empty"),
        ({"command": "no-such-agent"}, "no program 'no-such-agent' is on the PATH"),
        ({"command": str(CAR)}, "car.json is not executable"),
        ({"variables": ["NO_SUCH_KEY"]}, "external.variables names NO_SUCH_KEY"),
    ],
)
def test_what_cannot_be_run_leaves_no_run(
    external: dict[str, Any], told: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=told):
        carry_out("", tmp_path / "runs", **external)
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_a_script_without_an_interpreter_leaves_no_run(tmp_path: Path) -> None:
    agent = tmp_path / "agent"
    agent.write_text("no script")
    agent.chmod(0o755)
    with pytest.raises(ConfigError) as caught:
        carry_out("", tmp_path / "runs", command=[str(agent)])
    assert str(caught.value) == f"external.command: cannot run {agent}: Exec format error"
    assert os.listdir(tmp_path) == ["agent"]


def test_a_run_is_named_after_the_program_without_its_keys() -> None:
    for command, name in (
        ("codex exec --sandbox workspace-write", "program codex exec"),
        ("/opt/bin/claude -p", "program claude"),
        ("API_KEY=secret A=1 claude -p", "program claude"),
    ):
        settings = configure("", command=command, shell=True).settings
        assert EXTERNAL.author(settings) == name


def test_other_workflows_run_no_program(tmp_path: Path) -> None:
    config = configure("").model_copy(update={"workflow": "random-dsl"})
    with pytest.raises(ConfigError) as caught:
        design(config, tmp_path / "runs")
    assert str(caught.value) == (
        "external.command names a program, but only the workflow external runs one; add "
        "--workflow external, or remove external.command"
    )


STOPPED = """
stage = os.path.basename(os.getcwd())
open(sys.argv[1], "a").write(stage + "\\n")
if stage == "blind_refinement" and open(sys.argv[1]).read().count(stage) == 1:
    child = subprocess.Popen(["sleep", "600"], start_new_session=True)
    open(sys.argv[1] + ".child", "w").write(str(child.pid))
    time.sleep(600)
"""
"""Notes each stage in a file; the first time in the second stage, it works for ever."""


@pytest.mark.slow
def test_ctrl_c_ends_the_program_and_a_resumed_run_goes_on(tmp_path: Path) -> None:
    notes = tmp_path / "notes"
    config = configure(STOPPED + HAND_IN)
    words = [*config.settings.external.command, str(notes)]
    settings = {"candidates_per_stage": 2, "external": {"command": words, "isolate": "never"}}
    (tmp_path / "c.json").write_text(
        json.dumps({**config.model_dump(mode="json"), "settings": settings})
    )
    command = ["design", "--config", "c.json", "--out", "runs", "--trust"]
    code = "import sys; from agentflow.cli import main; sys.exit(main())"
    running = subprocess.Popen(
        [sys.executable, "-c", code, *command], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    child = tmp_path / "notes.child"
    wait_for(lambda: child.exists() and bool(child.read_text()))
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=60)
    (run,) = (tmp_path / "runs").iterdir()
    assert running.returncode == 130
    assert f"interrupted; continue with: agentflow design --resume runs/{run.name} --trust" in told
    assert not lives(child)
    with pytest.raises(ConfigError, match="which you have not named on the command line"):
        resume(run)
    before = notes.read_text()
    resume(run, RunOptions(approve=lambda _: True))
    assert before.split() == ["initial", "blind_refinement"]
    assert notes.read_text().split()[2:] == ["blind_refinement", "env_feedback"]
    assert [row["valid"] for row in result_of(run)["stages"]] == [1, 1, 1]
    assert replay(run, lambda line: pytest.fail(line)) is None


def wait_for(done: Callable[[], bool], seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.05)
