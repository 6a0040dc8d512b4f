"""Earlier names of commands, options and choices are read, with a note."""

from __future__ import annotations

import pytest

from agentflow.cli import main
from agentflow.cli.renamed import update_arguments


@pytest.mark.parametrize(
    ("given", "now", "notes"),
    [
        ("perturb car.json --n 3", "robustness car.json --n 3", [("perturb", "robustness")]),
        ("diagnose fate -h", "diagnose outcome -h", [("diagnose fate", "diagnose outcome")]),
        ("sweep a.yaml --on ray", "sweep a.yaml --backend ray", [("--on", "--backend")]),
        ("sweep a.yaml --on=ray", "sweep a.yaml --backend=ray", [("--on", "--backend")]),
        ("prompts show --set a", "prompts show --prompt-set a", [("--set", "--prompt-set")]),
        ("design --set a=b", "design --set a=b", []),
        ("table s --show players", "table s --show human", [("--show players", "--show human")]),
        ("table s --show=players", "table s --show=human", [("--show players", "--show human")]),
        (
            "design --keep-rollouts winners",
            "design --keep-rollouts best",
            [("--keep-rollouts winners", "--keep-rollouts best")],
        ),
        ("mcp --looks 3", "mcp --max-pictures 3", [("--looks", "--max-pictures")]),
        ("check -- --on", "check -- --on", []),
        ("", "", []),
    ],
)  # fmt: skip
def test_what_is_read(given: str, now: str, notes: list[tuple[str, str]]) -> None:
    assert update_arguments(given.split()) == (now.split(), notes)


def test_a_note_goes_to_stderr_and_the_command_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prompts", "show", "--set", "compact", "--role", "querier"]) == 0
    out, err = capsys.readouterr()
    assert "prompt set compact" in out
    assert err == (
        "agentflow: note: --set is now --prompt-set; the next version will refuse the earlier "
        "name\n"
    )
