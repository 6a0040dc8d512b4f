"""Which program runs, and which variables it gets."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from agentflow.config.run import apply_settings, build_config
from agentflow.errors import ConfigError
from agentflow.integrations.external.workflow import command_words, program_environment
from agentflow.workflows.settings import ExternalSettings


def settings(*given: str) -> ExternalSettings:
    """The settings of `--set external.NAME=VALUE`."""
    document = apply_settings({}, [f"external.{item}" for item in given])
    return build_config(document).settings.external


def words(*given: str) -> list[str]:
    return command_words(settings(*given))


def refusal(*given: str) -> str:
    with pytest.raises(ConfigError) as caught:
        words(*given)
    return str(caught.value)


def test_a_line_is_split_like_a_shells_words() -> None:
    found = words(f"command={sys.executable} -c 'print(1)' --full-auto")
    assert found == [sys.executable, "-c", "print(1)", "--full-auto"]


def test_a_list_is_taken_as_it_is() -> None:
    assert words(f'command=[{sys.executable}, "a b", "$HOME"]') == [sys.executable, "a b", "$HOME"]


@pytest.mark.skipif(os.name != "posix", reason="sh")
def test_a_shell_only_if_asked() -> None:
    assert words("command=true; echo $HOME", "shell=true") == ["/bin/sh", "-c", "true; echo $HOME"]
    expected = "external.command: with external.shell, give one line, not a list"
    assert refusal("command=[echo]", "shell=true") == expected


def test_the_program_is_found_on_the_path_or_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in (tmp_path, tmp_path / "bin"):
        folder.mkdir(exist_ok=True)
        (folder / "agent").touch(mode=0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.chdir(tmp_path)
    assert words("command=agent") == [str(tmp_path / "bin" / "agent")]
    assert words("command=./agent -x") == [str(tmp_path / "agent"), "-x"]


def test_no_command() -> None:
    expected = (
        "external.command is empty, but the workflow external runs a program; name it, for "
        "example with --set external.command='claude -p'"
    )
    assert [refusal(), refusal("command=  "), refusal("command=", "shell=true")] == [expected] * 3


def test_words_that_yaml_reads_as_something_else() -> None:
    assert refusal("command=[agent, 5]") == (
        "settings.external.command: expected one line, or a list of words, not ['agent', 5]"
    )


def test_a_program_that_is_not_there() -> None:
    assert refusal("command=no-such-agent --yes") == (
        "external.command: no program 'no-such-agent' is on the PATH; install it, or give its path"
    )
    assert refusal("command=bin/no-such-agent") == (
        "external.command: there is no program bin/no-such-agent; check its path"
    )


@pytest.mark.skipif(os.name != "posix", reason="file modes")
def test_a_program_that_may_not_be_run(tmp_path: Path) -> None:
    agent = tmp_path / "agent.py"
    agent.touch()
    assert refusal(f"command={agent}") == (
        f"external.command: {agent} is not executable; run chmod +x on it, or put its "
        "interpreter before it"
    )


def test_a_quotation_without_an_end() -> None:
    assert refusal("command=agent 'x") == (
        'external.command: "agent \'x" cannot be split into words: No closing quotation; close '
        "the quotation, or give a list of words"
    )


def test_programs_get_no_variables_but_the_harmless_ones_and_those_named() -> None:
    environ = {
        "PATH": "/bin",
        "LC_ALL": "C",
        "OPENAI_API_KEY": "ours",
        "AGENTFLOW_MODEL": "gpt",
        "AGENT_KEY": "its own",
        "PYTHONPATH": "/src",
    }
    named = settings("variables=[AGENT_KEY]")
    assert program_environment(named, environ, {"AGENTFLOW_BENCH": "http://"}) == {
        "PATH": "/bin",
        "LC_ALL": "C",
        "AGENT_KEY": "its own",
        "NO_PROXY": "127.0.0.1",
        "no_proxy": "127.0.0.1",
        "AGENTFLOW_BENCH": "http://",
    }


def test_the_bench_is_reached_without_the_proxy() -> None:
    environ = {"https_proxy": "http://proxy", "no_proxy": "intranet"}
    found = program_environment(settings(), environ, {})
    assert (found["no_proxy"], found["NO_PROXY"]) == ("intranet,127.0.0.1",) * 2
    assert found["https_proxy"] == "http://proxy"


def test_a_variable_that_is_not_set() -> None:
    with pytest.raises(ConfigError) as caught:
        program_environment(settings("variables=[AGENT_KEY]"), {}, {})
    assert str(caught.value) == (
        "external.variables names AGENT_KEY, which is not set; set it, or remove the name"
    )
