"""The folder that a program works in: what it finds there."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from agentflow.machine.tree import Machine
from agentflow.runs.places import BLIND, FEEDBACK, INITIAL, StageName
from agentflow.tools import ToolSpec

TASK, MCP, MACHINES, BEFORE = "TASK.md", ".mcp.json", "machines", "before"
URL, TOKEN = "AGENTFLOW_BENCH", "AGENTFLOW_BENCH_TOKEN"
"""Environment variables: where the tools are, and the bearer token that they ask for."""
_STAGES: Mapping[StageName, str] = {
    INITIAL: "Design machines. Nothing is simulated before this stage is over.",
    BLIND: "Improve the machines of the stage before. Nothing is simulated before this stage is "
    "over.",
    FEEDBACK: "Improve the machines of the stages before. You can simulate machines.",
}


@dataclass(frozen=True)
class Assignment:
    """What a program is to do in a stage."""

    stage: StageName
    task: str
    """The task, the blocks, the rules and the budget as the tool `brief` tells them."""
    tools: Sequence[ToolSpec]
    limit: float
    """Seconds until the program is stopped."""
    before: Mapping[str, Machine]
    """Name -> machine submitted in an earlier stage, or given to start with."""


def write_folder(folder: Path, assignment: Assignment, url: str, token: str) -> None:
    """Write everything that a program finds in its empty folder."""
    (folder / TASK).write_text(task_text(assignment), encoding="utf-8")
    server = {"type": "http", "url": url, "headers": {"Authorization": f"Bearer {token}"}}
    config = json.dumps({"mcpServers": {"agentflow": server}}, indent=1)
    (folder / MCP).write_text(f"{config}\n", encoding="utf-8")
    before = folder / MACHINES / BEFORE
    before.mkdir(parents=True)
    for name, machine in assignment.before.items():
        (before / f"{name}.json").write_text(machine.to_text() + "\n", encoding="utf-8")


def task_text(assignment: Assignment) -> str:
    """The text of TASK.md."""
    tools = "\n".join(f"- `{tool.name}`: {tool.description}" for tool in assignment.tools)
    limit = assignment.limit
    time = f"{limit:.3g} seconds" if limit < 120 else f"{limit / 60:.3g} minutes"
    earlier = (
        f"\nThe machines so far are in `{MACHINES}/{BEFORE}`, under their names. They do not count "
        "again in this stage unless you hand them in again.\n"
        if assignment.before
        else ""
    )
    return f"""\
# Stage {assignment.stage}

{_STAGES[assignment.stage]}
{earlier}
# How to hand in machines

Do this in the folder that this file is in:

- Write each machine to a file of its own, such as `{MACHINES}/a.json`, in a form that the task \
below describes: JSON and nothing else. Files are checked when you have ended.
- Or call the tool `submit`.
- No more machines count than the budget below has submissions: the submitted ones, then those in \
files, in the order of the files' names.
- You are stopped after {time}. What is there by then counts.

# Tools

`{MCP}` describes an MCP server, `agentflow`. Its URL is also in the environment variable {URL}, \
and its bearer token in {TOKEN}. Its tools:

{tools}

{assignment.task.strip()}
"""
