"""Every command has a help with an example that the command line understands."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest

from agentflow import __version__
from agentflow.cli import command_group, main
from agentflow.workflows.registry import WORKFLOWS
from tests.processes import MAIN, run_python
from tests.test_documented import parse

Captured = pytest.CaptureFixture[str]


def every_command() -> Iterator[tuple[str, Any]]:
    waiting = [("", command_group())]
    for name, command in waiting:
        inner = getattr(command, "commands", {})
        waiting += [(f"{name} {key}".strip(), item) for key, item in inner.items()]
        yield name, command


COMMANDS = dict(every_command())


@pytest.mark.parametrize("name", COMMANDS)
def test_help_explains_and_gives_an_example(name: str, capsys: Captured) -> None:
    assert main([*name.split(), "--help"]) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"Usage: agentflow {name}")
    command = COMMANDS[name]
    assert command.help
    assert f"{command.epilog} ".startswith(f"Example: agentflow {name} ".replace("  ", " "))
    for parameter in command.params:
        assert getattr(parameter, "help", None), f"{name}: {parameter.name} has no help"
    parse(shlex.split(command.epilog.removeprefix("Example: "))[1:])


def test_version(capsys: Captured) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"agentflow {__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["desing"], "No such command 'desing'. Did you mean 'design'. Try 'agentflow --help'."),
        (["config", "shwo"], "No such command 'shwo'. Did you mean 'show'. Try 'agentflow config"),
        (["design", "--tsk", "x"], "No such option: --tsk (Possible options: "),
    ],
)
def test_a_misspelt_name_is_hinted_at(arguments: list[str], message: str, capsys: Captured) -> None:
    assert main(arguments) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")


@pytest.mark.parametrize(
    ("words", "place", "completed"),
    [("agentflow des", 1, "design"), ("agentflow config s", 2, "show")],
)
@pytest.mark.slow
def test_the_shell_completes(words: str, place: int, completed: str) -> None:
    asked = {"COMP_WORDS": words, "COMP_CWORD": str(place)}
    done = run_python("-c", MAIN, _AGENTFLOW_COMPLETE="complete_bash", **asked)
    assert (done.stdout.split(), done.stderr) == ([completed], "")


def test_every_workflow_is_named_in_the_help() -> None:
    (option,) = (item for item in COMMANDS["design"].params if item.name == "workflow")
    assert set(WORKFLOWS) <= set(re.split(r"[ ,;.]+", option.help))
