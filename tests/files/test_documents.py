"""A folder says what it holds, and other work in it is refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import pytest
from pydantic import BaseModel

from agentflow.errors import RunError
from agentflow.files.documents import (
    Difference,
    Document,
    break_seal,
    digest_of,
    first_difference,
    read_object,
    sealed,
)


class Sums(BaseModel, frozen=True, extra="forbid"):
    """What is added, and how."""

    format: Literal[1] = 1
    size: int
    how: Mapping[str, int] = {}
    results: int | None = None


DOCUMENT = Document("sums.json", Sums, "a folder of sums", outcome=("results",))


def refusal(folder: Path, about: Sums) -> str:
    with pytest.raises(RunError) as caught:
        DOCUMENT.begin(folder, about, ("log.jsonl",))
    return str(caught.value)


def test_it_reads_back(tmp_path: Path) -> None:
    about = Sums(size=2, how={"a": 1})
    assert DOCUMENT.begin(tmp_path, about, ()) == about
    assert DOCUMENT.read(tmp_path) == about
    assert (tmp_path / "sums.json").read_text().startswith('{\n "format": 1,\n "size": 2,')


def test_a_folder_with_other_things_is_refused(tmp_path: Path) -> None:
    (tmp_path / ".lock").touch()
    assert DOCUMENT.find(tmp_path) is None
    (tmp_path / "photo.png").touch()
    assert DOCUMENT.find(tmp_path, leftovers=["photo.png"]) is None
    assert refusal(tmp_path, Sums(size=2)) == (
        f"{tmp_path} is not a folder of sums: it has photo.png and no sums.json; choose a new "
        "folder with --out"
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"size": 2, "format": 2}', "format: expected 1, not 2"),
        ('{"size": 2, "sise": 3}', "unknown key 'sise'; known: size, format, how, results"),
        ('{"how": {"a": "b"}, "size": 2}', "how.a: expected a whole number, not 'b'"),
        ("{}", "size is missing"),
        ("[", "the file invalid JSON: EOF while parsing a list at line 1 column 1"),
    ],
)
def test_a_damaged_one_is_named_with_its_key(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "sums.json").write_text(text)
    with pytest.raises(RunError) as caught:
        DOCUMENT.read(tmp_path)
    assert str(caught.value) == f"{tmp_path / 'sums.json'} is damaged: {why}"


def test_a_missing_one_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunError) as caught:
        DOCUMENT.read(tmp_path)
    assert str(caught.value) == f"{tmp_path} is not a folder of sums: it has no sums.json"
    (tmp_path / "sums.json").mkdir()
    with pytest.raises(RunError, match=r"^cannot read .*sums\.json: Is a directory$"):
        DOCUMENT.read(tmp_path)


def test_other_work_is_refused_once_something_is_on_record(tmp_path: Path) -> None:
    DOCUMENT.begin(tmp_path, Sums(size=2), ())
    other = Sums(size=2, how={"a": 1})
    assert DOCUMENT.begin(tmp_path, other, ("log.jsonl",)) == other
    (tmp_path / "log.jsonl").write_text("{}\n")
    assert refusal(tmp_path, Sums(size=2, how={"a": 2})) == (
        f"{tmp_path} holds a folder of sums with another how.a: 1, not 2; give the same options "
        "to continue it, or choose another folder with --out"
    )
    assert DOCUMENT.begin(tmp_path, other, ("log.jsonl",)) == other


def test_finished_work_is_kept(tmp_path: Path) -> None:
    DOCUMENT.write(tmp_path, Sums(size=2, results=7))
    assert DOCUMENT.begin(tmp_path, Sums(size=2), ()).results == 7
    assert "with another size: 2, not 3" in refusal(tmp_path, Sums(size=3))


def test_a_folder_that_is_gone_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"^cannot write to .*; choose another folder with --out$"):
        DOCUMENT.write(tmp_path / "gone", Sums(size=2))


def test_the_first_difference_is_named_with_its_groups() -> None:
    assert first_difference({"a": 1, "b": {"c": [1]}}, {"b": {"c": [1]}, "a": 1}) is None
    assert first_difference({"a": 1}, {"a": 1, "b": None}) is None
    before, now = {"a": 1, "b": {"c": 2, "d": [3]}}, {"a": 1, "b": {"c": 2, "d": [4]}}
    assert first_difference(before, now) == Difference("b.d", [3], [4])
    assert first_difference({"b": {"c": 2}}, {"b": 5}) == Difference("b", {"c": 2}, 5)
    assert first_difference({}, {"a": 1}) == Difference("a", None, 1)


def test_a_seal_reveals_edits_and_no_other_order() -> None:
    content = sealed({"b": 1, "a": [2], "seal": "that of an older content"})
    assert list(content) == ["b", "a", "seal"]
    assert break_seal({"seal": content["seal"], "a": [2], "b": 1})
    assert not break_seal({**content, "b": 2})
    assert not break_seal({"a": 1})
    assert digest_of({"b": 1, "a": [2]}) == content["seal"]


def test_an_object_is_expected(tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    with pytest.raises(FileNotFoundError):
        read_object(file)
    file.write_text(json.dumps([1]))
    with pytest.raises(RunError, match=r"result\.json is damaged: expected a JSON object$"):
        read_object(file)
