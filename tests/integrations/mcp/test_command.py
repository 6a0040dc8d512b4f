"""What the command `agentflow mcp` says instead of serving."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from agentflow.cli import main
from tests.integrations.mcp.clients import ENVIRONMENT, MAIN


def test_says_what_is_wrong_with_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    token = tmp_path / "token"
    for options, words in (
        (["--task", "walking"], "unknown task 'walking'"),
        (["--http", "127.0.0.1:8000"], "--http and --token-file go together"),
        (["--token-file", str(token)], "--http and --token-file go together"),
        (["--http", "8000", "--token-file", str(token)], "--http takes HOST:PORT"),
        (["--http", "0.0.0.0:0"], "--http and --token-file go together"),
    ):
        assert main(["mcp", *options]) == 2
        assert words in capsys.readouterr().err


def test_says_what_to_install() -> None:
    without = f"import sys; sys.modules['mcp'] = None; {MAIN}"
    done = subprocess.run(
        [sys.executable, "-c", without, "mcp"],
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )
    words = (
        "agentflow: mcp is not installed; install it with: pip install 'agentflow-machines[mcp]'\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (2, "", words)


def test_settings_hold_where_no_option_is_given(capsys: pytest.CaptureFixture[str]) -> None:
    for options, words in (
        (["--set", "max_simulations=0"], "settings.max_simulations: must be at least 1, not 0"),
        (
            ["--set", "max_pictures=many"],
            "settings.max_pictures: expected a whole number, not 'many'",
        ),
        (["--set", "vision=5"], "settings.vision: expected true or false, not 5"),
        (["--set", "task=walking"], "unknown task 'walking'"),
        (["--set", "workflow=single"], "remove workflow and model.name from --set"),
        (["--set", "model.name=any"], "remove workflow and model.name from --set"),
    ):
        assert main(["mcp", *options]) == 2
        assert words in capsys.readouterr().err
