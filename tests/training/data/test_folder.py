"""Folders that commands fill: each command continues its own, and leaves those of others alone."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import pytest
from pydantic import BaseModel

from agentflow.errors import RunError
from agentflow.training.data.folder import PLAN, work_in


class Answers(BaseModel, extra="forbid"):
    """The plan of one command."""

    kind: Literal["answers"] = "answers"
    size: int = 1


class Set(BaseModel, extra="forbid"):
    """The plan of another."""

    kind: Literal["set"] = "set"


def begin(folder: Path, plan: BaseModel) -> None:
    with work_in(folder, plan, "log.jsonl"):
        pass


def test_a_plan_may_change_until_something_is_on_record(tmp_path: Path) -> None:
    begin(tmp_path, Answers())
    begin(tmp_path, Answers(size=2))
    assert '"size": 2' in (tmp_path / PLAN).read_text()
    (tmp_path / "log.jsonl").write_text("{}\n")
    with pytest.raises(RunError, match="was started with a different value of size: repeat the"):
        begin(tmp_path, Answers(size=3))


def test_the_folder_of_another_command_keeps_its_plan(tmp_path: Path) -> None:
    begin(tmp_path, Answers())
    written = (tmp_path / PLAN).read_text()
    with pytest.raises(RunError, match=r"holds files, but no plan\.json of this command; choose"):
        begin(tmp_path, Set())
    assert (tmp_path / PLAN).read_text() == written
