"""The settings for MCP clients in docs/how-to/mcp.md start our command, and its code runs."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.integrations.mcp.clients import ENVIRONMENT, MAIN, ROOT, only_run
from tests.test_documented import parse


def section() -> str:
    """The part of the page that connects clients."""
    page = (ROOT / "docs" / "how-to" / "mcp.md").read_text(encoding="utf-8")
    return page.split("\n## Connect your client\n")[1].partition("\n## ")[0]


def blocks(language: str) -> list[str]:
    """The code of that part in a language."""
    return re.findall(rf"(?ms)^```{language}\n(.*?)^```$", section())


def settings() -> list[list[str]]:
    """Every command line that a client is told to start."""
    lines = re.findall(r"^claude mcp add \w+ -- (.*)$", section(), re.MULTILINE)
    (code,) = map(json.loads, blocks("json"))
    server = code["servers"]["agentflow"]
    (codex,) = blocks("toml")
    assert codex.startswith("[mcp_servers.agentflow]\n")
    values = dict(line.split(" = ", 1) for line in codex.splitlines()[1:])
    return [
        *map(shlex.split, lines),
        [server["command"], *server["args"]],
        [json.loads(values["command"]), *json.loads(values["args"])],
    ]


def test_clients_start_a_command_that_the_command_line_understands() -> None:
    found = settings()
    assert len(found) == 3
    for program, *arguments in found:
        assert program == "agentflow"
        parse(arguments)


@pytest.mark.slow
def test_the_python_program_drives_a_car(tmp_path: Path) -> None:
    (code,) = blocks("python")
    command = tmp_path / "bin" / "agentflow"
    command.parent.mkdir()
    command.write_text(
        f"#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -c '{MAIN}' \"$@\"\n", encoding="utf-8"
    )
    command.chmod(0o755)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    path = f"{command.parent}:/usr/bin:/bin"
    subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={**ENVIRONMENT, "PATH": path}, check=True
    )
    assert only_run(tmp_path).is_dir()
