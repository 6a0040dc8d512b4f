"""Isolated programs reach the bench and nothing else; where they cannot be, that is said."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.cli import main
from agentflow.errors import ConfigError
from agentflow.integrations.external.sandbox import is_isolated, sandbox_problem
from agentflow.integrations.external.workflow import require_program
from agentflow.runs.events import ProgramEvent, read_stage
from agentflow.runs.locations import INITIAL, Location
from agentflow.workflows.settings import ExternalSettings, WorkflowSettings
from tests.integrations.external.test_workflow import CAR, ROOT, carry_out, result_of

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sessions and signals")
needs_bubblewrap = pytest.mark.skipif(bool(sandbox_problem()), reason=sandbox_problem())
PACKAGE = Path(agentflow.__file__).parent
ATTACKS = f"""
import socket
from pathlib import Path

def tried(what):
    try:
        return repr(what())
    except Exception as error:
        return type(error).__name__

def write(path):
    Path(path).write_text("def verify(*_): return 1e9")

print("RESULT " + json.dumps(dict(
    records=tried(lambda: sorted(Path({str(ROOT / "records")!r}).iterdir())),
    package=tried(lambda: Path({str(PACKAGE / "env" / "tasks" / "records.json")!r}).read_text()),
    imported=tried(lambda: __import__("agentflow.env.tasks.records")),
    patched=tried(lambda: write(Path({sys.prefix!r}, "lib", "sitecustomize.py"))),
    repository=tried(lambda: write({str(PACKAGE / "holding.py")!r})),
    network=tried(lambda: socket.create_connection(("1.1.1.1", 443), timeout=2)),
    processes=tried(lambda: [p for p in os.listdir("/proc") if p.isdigit() and int(p) > 100]),
    keys=tried(lambda: os.listdir(os.path.expanduser("~/.ssh"))),
)))
"""


def tell(run: Path) -> dict[str, str]:
    """What the attacks of the first stage brought."""
    lines = (run / "log.txt").read_text().splitlines()
    found: dict[str, str] = json.loads(next(x for x in lines if x.startswith("RESULT"))[7:])
    return found


def isolations(run: Path) -> set[bool | None]:
    return {e.isolated for e in read_stage(run, INITIAL) if isinstance(e, ProgramEvent)}


@pytest.mark.slow
@needs_bubblewrap
def test_an_isolated_program_finds_no_records_and_cannot_patch_the_package(tmp_path: Path) -> None:
    before = (PACKAGE / "holding.py").read_bytes()
    run = carry_out(ATTACKS, tmp_path, isolate="always")
    assert tell(run) == {
        "records": "FileNotFoundError",
        "package": "FileNotFoundError",
        "imported": "ModuleNotFoundError",
        "patched": "OSError",  # the file system can only be read
        "repository": "FileNotFoundError",
        "network": "OSError",
        "processes": "[]",
        "keys": "FileNotFoundError",
    }
    assert (PACKAGE / "holding.py").read_bytes() == before
    assert isolations(run) == {True}


@pytest.mark.slow
@needs_bubblewrap
def test_an_isolated_program_reaches_the_bench_and_the_files_that_it_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, str(ROOT / "examples" / "tool_agent.py")]
    assert result_of(carry_out("", tmp_path, command=command, isolate="always"))["score"] > 40


@pytest.mark.slow
@needs_bubblewrap
def test_an_isolated_program_reads_what_is_named_and_is_stopped_at_its_limit(
    tmp_path: Path,
) -> None:
    code = f"shutil.copy({str(CAR)!r}, 'machines/car.json'); time.sleep(600)"
    more: dict[str, Any] = {"readable": [str(CAR.parent)], "limit_s": 3}
    run = carry_out(code, tmp_path, isolate="always", **more)
    assert result_of(run)["score"] == pytest.approx(46, abs=1)
    (event,) = [e for e in read_stage(run, INITIAL) if isinstance(e, ProgramEvent)]
    assert (event.timed_out, event.isolated) == (True, True)


def test_without_bubblewrap_runs_say_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    sandbox_problem.cache_clear()
    try:
        assert not is_isolated(ExternalSettings())
        told = "bubblewrap is not installed: install the package bubblewrap of your Linux"
        assert main(["doctor", "--sandbox"]) == 0
        assert told in capsys.readouterr().out
        always = ExternalSettings(command=[sys.executable], isolate="always")
        with pytest.raises(ConfigError, match=f"external.isolate is always, but {told}"):
            require_program(WorkflowSettings(external=always))
    finally:
        sandbox_problem.cache_clear()


def test_where_namespaces_are_forbidden_the_reason_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = tmp_path / "bwrap"
    fake.write_text("#!/bin/sh\necho 'bwrap: No permissions to create new namespace' >&2; exit 1\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    sandbox_problem.cache_clear()
    try:
        assert sandbox_problem().endswith("bwrap: No permissions to create new namespace")
    finally:
        sandbox_problem.cache_clear()


def test_never_is_not_isolated() -> None:
    assert not is_isolated(ExternalSettings(isolate="never"))
    event = ProgramEvent(Location(INITIAL), 0, False, False)
    assert str(event) == "the program ended with status 0 (not isolated)"
