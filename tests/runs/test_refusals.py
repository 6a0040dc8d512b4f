"""Full disks, missing permissions and locks are reported in one line and destroy nothing."""

from __future__ import annotations

import fcntl
import os
import resource
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.errors import RunError
from agentflow.runs import Event, RunDirectory, read_events, read_result, state_of
from tests.processes import run_python
from tests.runs.results import a_result

NOBODY = 65534
SMALL = Path(__file__).parents[2] / "configs" / "small.yaml"


@contextmanager
def no_file_larger_than(size: int) -> Iterator[None]:
    """A disk that is full beyond a file size."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextmanager
def unprivileged() -> Iterator[None]:
    """Drop root privileges, which bypass file permissions."""
    mine = os.geteuid()
    if mine == 0:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(mine)


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that every user can read."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


def test_a_full_disk_removes_the_partial_line_and_is_reported(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    with no_file_larger_than(10_000):
        run.event(Event("attempt", "a/1", {"problem": "x" * 5_000}))
        with pytest.raises(RunError) as caught:
            run.event(Event("attempt", "a/2", {"problem": "x" * 20_000}))
        assert str(caught.value) == (f"cannot write {run.path / 'events.jsonl'}: File too large")
        with pytest.raises(RunError, match=r"cannot write .*machines/ab\.json: File too large"):
            run.save_machine("ab", "x" * 20_000)
        with pytest.raises(RunError, match=r"cannot write .*result\.json: File too large"):
            run.finish(a_result(reason="x" * 20_000))
    run.event(Event("attempt", "a/3", {"problem": ""}))
    run.close()
    assert [event.label for event in read_events(run.path)] == ["a/1", "a/3"]
    assert not (run.path / "machines" / "ab.json").exists()
    assert not (run.path / "result.json").exists()


def test_a_disk_that_is_full_from_the_start_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "runs"
    with no_file_larger_than(100), pytest.raises(RunError) as caught:
        RunDirectory.create(out, "demo", {"config": {"text": "x" * 200}})
    assert str(caught.value) == (
        f"cannot write to {out}: File too large; choose another folder with --out"
    )
    assert os.listdir(tmp_path) == []


def test_a_read_only_folder_is_reported(open_folder: Path) -> None:
    run = RunDirectory.create(open_folder, "demo", {})
    run.event(Event("stage", "initial", {"valid": 1}))
    run.close()
    for path in (run.path / "events.jsonl", run.path, open_folder):
        path.chmod(0o444 if path.is_file() else 0o555)
    with unprivileged():
        with pytest.raises(RunError) as caught:
            RunDirectory.resume(run.path)
        assert str(caught.value) == f"cannot write to {run.path}: Permission denied"
        with pytest.raises(RunError) as caught:
            RunDirectory.create(open_folder, "demo", {})
        assert str(caught.value) == (
            f"cannot write to {open_folder}: Permission denied; choose another folder with --out"
        )
        assert [event.data for event in read_events(run.path)] == [{"valid": 1}]
    RunDirectory.resume(run.path).close()


def test_unreadable_files_are_reported(open_folder: Path) -> None:
    run = RunDirectory.create(open_folder, "demo", {})
    run.event(Event("stage", "initial", {"valid": 1}))
    run.finish(a_result())
    run.close()
    files = [run.path / name for name in ("events.jsonl", "result.json")]
    for file in files:
        file.chmod(0)
    readers: list[Callable[[Path], object]] = [lambda path: list(read_events(path)), read_result]
    with unprivileged():
        for file, read in zip(files, readers, strict=True):
            with pytest.raises(RunError) as caught:
                read(run.path)
            assert str(caught.value) == f"cannot read {file}: Permission denied"
    run.path.chmod(0)
    with unprivileged(), pytest.raises(RunError, match="it has no readable run"):
        state_of(run.path)
    run.path.chmod(0o755)


@pytest.mark.slow
def test_a_second_process_is_refused(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    code = "import sys; from agentflow.runs import *; RunDirectory.resume(Path(sys.argv[1]))"
    other = run_python("-c", f"from pathlib import Path; {code}", run.path, status=1)
    assert other.stderr.splitlines()[-1] == (
        f"agentflow.errors.RunError: {run.path} is in use by another process; wait for it or "
        "stop it"
    )
    run.close()


def test_readers_do_not_lock_a_run_for_others(tmp_path: Path) -> None:
    """`agentflow runs` locks each run for a moment to see whether a process holds it."""
    run = RunDirectory.create(tmp_path, "demo", {})
    run.close()
    looking = (run.path / "run.yaml").open()
    fcntl.flock(looking, fcntl.LOCK_SH)
    timer = threading.Timer(0.02, looking.close)
    timer.start()
    RunDirectory.resume(run.path).close()
    timer.join()


@pytest.mark.slow
def test_a_run_can_be_resumed_after_the_disk_was_full(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["design", "--config", str(SMALL), "--out", str(tmp_path), "--quiet"]
    with no_file_larger_than(150_000):
        assert main(command) == 2
    (run,) = tmp_path.iterdir()
    assert capsys.readouterr().err == (
        f"agentflow: cannot write {run / 'calls.jsonl'}: File too large; continue with: "
        f"agentflow design --resume {run}\n"
    )
    recorded = (run / "calls.jsonl").read_bytes()
    assert recorded.endswith(b"}\n")
    assert main(["design", "--resume", str(run), "--quiet"]) == 0
    assert (run / "calls.jsonl").read_bytes().startswith(recorded)
    assert main(["replay", str(run)]) == 0
    assert capsys.readouterr().out.endswith("identical\n")
