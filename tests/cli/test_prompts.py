"""`agentflow prompts` as a user types it."""

from __future__ import annotations

import json

import pytest

from agentflow.cli import main
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prompts", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines] == [
        [name, PromptSet(name).digest] for name in PROMPT_SETS
    ]
    assert main(["prompts", "list", "--json"]) == 0
    assert [item["name"] for item in json.loads(capsys.readouterr().out)] == list(PROMPT_SETS)


def test_show_prints_the_prompt_and_its_length(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["prompts", "show", "--role", "refiner", "--task", "throwing"]
    assert main(command) == 0
    text = capsys.readouterr().out
    assert text.startswith("--- system\nYou refine machines")
    assert "\n--- user\n## Task\nTask: throwing\n" in text
    last = text.splitlines()[-1]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert last == (
        f"--- about {found['tokens']} tokens; prompt set default, content hash {PromptSet().digest}"
    )


def test_diff(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prompts", "diff", "default", "no_motion"]) == 0
    assert "+++ no_motion/_parts/motion.j2" in capsys.readouterr().out
    assert main(["prompts", "diff", "default", "default"]) == 0
    assert capsys.readouterr().out == "identical\n"


def test_unknown_set(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prompts", "show", "--prompt-set", "compct"]) == 2
    assert capsys.readouterr().err.startswith(
        "agentflow: unknown prompt set 'compct'; known: compact, "
    )
