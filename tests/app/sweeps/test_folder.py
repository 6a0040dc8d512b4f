"""The folder of a sweep is locked before the first file is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.app.sweeps.folder import NAME, lock_folder, read_folder, sweep_document
from agentflow.config.sweep import read_sweep
from agentflow.errors import RunError

SWEEP = read_sweep({"title": "T", "table": {"metrics": ["valid"]}}, "t.yaml")
DOCUMENT = sweep_document("t", SWEEP)


def test_a_sweep_in_use_by_another_process_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "sweep"
    busy = f"^{folder} is in use by another process; wait for it or stop it$"
    with lock_folder(folder, DOCUMENT, resume=False):
        before = (folder / NAME).read_bytes()
        for resume in (False, True):
            with pytest.raises(RunError, match=busy), lock_folder(folder, DOCUMENT, resume=resume):
                raise AssertionError("two at once")
        assert (folder / NAME).read_bytes() == before
    with lock_folder(folder, DOCUMENT, resume=True):
        assert read_folder(folder)[0]["name"] == "t"


def test_an_unwritable_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / "sweep"
    wanted = f"^cannot write to {folder}: Not a directory; choose another folder with --out$"
    with pytest.raises(RunError, match=wanted), lock_folder(folder, DOCUMENT, resume=False):
        raise AssertionError("written")
