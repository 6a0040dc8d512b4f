"""Growing files are read line by line; damaged lines are named, half ones do not count."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pydantic import BaseModel

from agentflow.errors import ConfigError, RunError
from agentflow.files.lines import (
    open_lines,
    read_lines,
    read_new_lines,
    require_planned,
)


class Item(BaseModel, extra="forbid"):
    """A line."""

    n: int


READ = Item.model_validate_json


def made(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "log.jsonl"
    file.write_text(text)
    return file


def test_there_are_none_without_a_file(tmp_path: Path) -> None:
    assert list(read_lines(tmp_path / "log.jsonl", READ)) == []


def test_half_a_last_line_does_not_count_but_one_without_a_break_does(tmp_path: Path) -> None:
    assert list(read_lines(made(tmp_path, '{"n": 1}\n{"n": 2'), READ)) == [Item(n=1)]
    assert list(read_lines(made(tmp_path, '{"n": 1}\n{"n": 2}'), READ)) == [Item(n=1), Item(n=2)]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ('{"n": "x"}', "n: expected a whole number"),
        ('{"m": 1}', "m: extra inputs are not permitted"),
        ("{", "the line: invalid JSON: EOF while parsing an object at line 2 column 0"),
    ],
)
def test_a_damaged_line_is_named_with_what_is_wrong(tmp_path: Path, line: str, why: str) -> None:
    file = made(tmp_path, f'{{"n": 1}}\n{line}\n{{"n": 3}}\n')
    found = read_lines(file, READ)
    assert next(found) == Item(n=1)
    with pytest.raises(RunError) as caught:
        next(found)
    assert str(caught.value) == f"{file} is damaged in line 2: {why}"


def test_callers_choose_the_words_and_the_error(tmp_path: Path) -> None:
    file = made(tmp_path, "x\n")

    def is_number(line: bytes) -> int:
        if not line.strip().isdigit():
            raise ValueError("expected a number")
        return int(line)

    with pytest.raises(RunError, match=r"log\.jsonl is damaged in line 1: expected a number$"):
        list(read_lines(file, is_number))
    with pytest.raises(ConfigError, match=r"^log\.jsonl: 1: expected a number$"):
        list(
            read_lines(
                file, is_number, lambda path, n, why: ConfigError(f"{path.name}: {n}: {why}")
            )
        )


def test_only_what_is_new_is_read(tmp_path: Path) -> None:
    file = made(tmp_path, '{"n": 1}\n{"n": 2')
    found, offset = read_new_lines(file, READ, 0)
    assert (found, offset) == ([Item(n=1)], 9)
    with file.open("a") as log:
        log.write('}\n{"n": 3}\n')
    assert read_new_lines(file, READ, offset) == ([Item(n=2), Item(n=3)], 27)
    assert read_new_lines(file, READ, 27) == ([], 27)
    assert read_new_lines(tmp_path / "none", READ, 0) == ([], 0)
    with file.open("a") as log:
        log.write("x\n")
    with pytest.raises(RunError, match="is damaged in line 4: the line: invalid JSON"):
        read_new_lines(file, READ, 27)


def test_a_file_is_opened_for_more_lines_without_its_half_one(tmp_path: Path) -> None:
    file = made(tmp_path, '{"n": 1}\n{"n": 2')
    with open_lines(file, READ) as (lines, found):
        assert found == [Item(n=1)]
        lines.append(json.dumps({"n": 3}).encode())
    assert file.read_text() == '{"n": 1}\n{"n": 3}\n'


def test_lines_must_be_the_first_of_the_plan(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    require_planned(file, [1, 2], [1, 2, 3])
    for found, number in (([1, 3], 2), ([1, 2, 3, 4], 4)):
        with pytest.raises(RunError, match=rf"damaged in line {number}: the plan has another"):
            require_planned(file, found, [1, 2, 3])
