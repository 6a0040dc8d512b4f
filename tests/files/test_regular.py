"""What a received folder may hold in place of a file, and documents that would exhaust a reader."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.errors import ConfigError, RunError, UsageError
from agentflow.files.lines import open_regular, parse_object, read_new_lines, read_regular
from agentflow.files.yaml import parse_yaml
from agentflow.integrations.mcp.addresses import read_token
from agentflow.runs import read_document, read_result
from tests.processes import run_python

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"
ALIASES = "a0: &a0 [x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 12)
)
unix = pytest.mark.skipif(os.name != "posix", reason="pipes with names are of Unix")


@unix
def test_pipes_devices_and_folders_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(OSError, match=r"pipe or device|directory"):
            read_regular(path)
    (tmp_path / "link").symlink_to(__file__)
    assert read_regular(tmp_path / "link", 3) == b'"""'
    with pytest.raises(OSError, match="link"):
        open_regular(tmp_path / "link", links=False)


@unix
def test_a_run_whose_result_or_events_are_a_pipe_or_link(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "result.json")
    with pytest.raises(RunError, match="pipe or device"):
        read_result(tmp_path)
    os.mkfifo(tmp_path / "pipe.jsonl")
    (tmp_path / "link.jsonl").symlink_to(RECORDED / "events.jsonl")
    for name, why in (("pipe", "pipe or device"), ("link", "it is a link")):
        with pytest.raises(RunError, match=why):
            read_new_lines(tmp_path / f"{name}.jsonl", json.loads, 0)


@unix
def test_a_token_file_that_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe", 0o600)
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    for name, why in (("pipe", "pipe or device"), ("dangling", "a file that does not exist")):
        with pytest.raises(UsageError, match=why):
            read_token(tmp_path / name)
    with pytest.raises(UsageError, match="pipe or device"):
        read_token(Path("/dev/zero"))


EXHAUSTING = ("[" * 100_000, "{a: " * 5000, ALIASES, "a: &a [*a]", "- " * 5000)


def test_documents_that_would_exhaust_the_reader(tmp_path: Path) -> None:
    runs = [tmp_path / str(number) for number in range(len(EXHAUSTING))]
    for run, text in zip(runs, EXHAUSTING, strict=True):
        shutil.copytree(RECORDED, run)
        (run / "run.yaml").write_text(text)
        with pytest.raises(ConfigError, match="is not YAML"):
            parse_yaml(text, "text")
    # in a process of its own: a fault of the loader is a signal
    shown = f"print([main(['show', run]) for run in {list(map(str, runs))}])"
    done = run_python("-c", f"from agentflow.cli import main; {shown}")
    assert done.stdout.strip() == str([2] * len(runs)), done.stderr
    assert done.stderr.count("run.yaml is damaged") == len(runs)


def test_aliases_and_groups_that_people_write_are_read() -> None:
    text = "a: &a {b: [1, 2]}\nc: *a\nd: {<<: *a, e: &e 3}\nf: *e"
    inner = {"b": [1, 2]}
    assert parse_yaml(text, "text") == {"a": inner, "c": inner, "d": {**inner, "e": 3}, "f": 3}
    assert read_document(RECORDED)["config"]["task"] == "throwing"


@pytest.mark.parametrize("number", ["1e999", "-1e999", "NaN", "Infinity", "1" * 400])
def test_numbers_beyond_the_range_are_not_json(
    number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert parse_object(f'{{"score": {number}}}'.encode()) is None
    run = shutil.copytree(RECORDED, tmp_path / "run")
    lines = (run / "events.jsonl").read_text().splitlines()
    at, line = next((n, line) for n, line in enumerate(lines) if '"kind": "evaluation"' in line)
    event = json.loads(line)
    event["data"]["score"] = 123.25
    lines[at] = json.dumps(event).replace("123.25", number)
    (run / "events.jsonl").write_text("\n".join(lines) + "\n")
    assert main(["report", str(run), "--out", str(tmp_path / "page.html")]) == 2
    assert f"damaged in line {at + 1}" in capsys.readouterr().err
