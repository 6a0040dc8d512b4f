"""Every example of docs/machine-language.md does what the page says."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.machine import check
from agentflow.machine.formats import read_any

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs/machine-language.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"(?ms)^```{language}\n(.*?)^```$", PAGE)


def test_machines_are_valid() -> None:
    machines = blocks("json")
    assert len(machines) == 2
    for text in machines:
        assert check(read_any(text)).machine_valid


def test_commands_print_what_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    shown = "".join(blocks("console")).split("$ ")[1:]
    assert len(shown) == 8
    for entry in shown:
        command, _, expected = entry.partition("\n")
        assert run(shlex.split(command)) == 0
        assert capsys.readouterr().out == expected


def run(words: list[str]) -> int:
    """A command of ours, or `echo TEXT > FILE`."""
    if words[0] == "agentflow":
        return main(words[1:])
    echo, text, arrow, file = words
    assert echo == "echo"
    with Path(file).open({">": "w", ">>": "a"}[arrow]) as script:
        script.write(text + "\n")
    return 0


def test_python_runs() -> None:
    code = "".join(blocks("python"))
    assert code.count("assert") == 3
    exec(compile(code, "machine-language.md", "exec"), {})
