"""Harbor: levels as task folders, where an agent works in a container and a script grades it.

Run as a program, this module is that script: it reads the machine and writes its reward.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine
from agentflow.env.tasks.records import record_machine, record_of
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.errors import NoScoreError, UsageError
from agentflow.files.atomic import write_output
from agentflow.integrations.episode import rules_of
from agentflow.rewards.scoring import Sample, require_score, shared_scorer
from agentflow.version import __version__

MACHINE, GRADED = "machine.json", "graded.json"
SCHEMA = "1.1"
"""Version of the format: the first with MCP servers, artifacts and verifiers apart."""
INSTRUCTION = """Design a machine and write it to `/app/machine.json`. Only this file is graded: \
by the score of the machine in it, 0 without a valid one.

The command `agentflow` helps: `agentflow bench start --task {task}` begins a design with a budget \
of simulations, `agentflow bench --help` lists the steps, and after `agentflow bench submit`, \
`agentflow convert RUN /app/machine.json` writes the machine of the run that it names. The MCP \
server `agentflow` has the same steps as tools.

{rules}
"""
DOCKERFILE = """FROM python:3.11-slim
{copy}RUN pip install --no-cache-dir "{wanted}"
WORKDIR /app
"""
TEST = """#!/bin/sh
# Grades machine.json and nothing else. Without a reward file, the simulation failed: no sample.
cd "$(dirname "$0")" && exec python3 -m agentflow.integrations.harbor graded.json \\
  "${APP:-/app}/machine.json" "${LOGS:-/logs/verifier}"
"""
SOLVE = """#!/bin/sh
cat >"${{APP:-/app}}/machine.json" <<'END'
{machine}
END
"""


def export(
    tasks: Sequence[str],
    out: Path,
    *,
    solutions: bool = False,
    engine: str = AUTO,
    wheel: Path | None = None,
) -> list[str]:
    """Write a folder for each level.

    Args:
        tasks: Levels, such as "throwing" or "bridge/2".
        out: Parent of the folders, which are named as `bridge-2`.
        solutions: Write the best known machines as solutions.
        engine: Physics engine that grades, with the seed 0.
        wheel: agentflow as a file, which containers install; by default from the package index.

    Returns:
        The folders.

    Raises:
        UsageError: A level, the engine or the wheel does not exist, a level is a file, or has no
            record; solutions are not at hand; or a folder cannot be written.
    """
    graded_by = choose_engine(engine).name
    if wheel is not None and not wheel.is_file():
        raise UsageError(f"{wheel} is not there; build it with scripts/release")
    folders = {}
    for task in tasks:
        level = get_level(task)
        if not level.number:
            raise UsageError(f"{task} is a file, which containers lack; name a level of a family")
        contents = _contents(level.name, graded_by, solutions, wheel)
        folders[out / f"{level.file.family}-{level.number}"] = contents
    for folder, contents in folders.items():
        for name, text in contents.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            with write_output(folder / name) as part:
                part.write_text(text, encoding="utf-8")
            (folder / name).chmod(0o755 if name.endswith(".sh") else 0o644)
        if wheel is not None:
            shutil.copy(wheel, folder / "environment")
    return list(map(str, folders))


def _contents(task: str, engine: str, solutions: bool, wheel: Path | None) -> Mapping[str, str]:
    """Name -> text of each file of a task."""
    level, made = get_level(task), get_task(task, engine=engine)
    record = record_of(made)
    solution = record_machine(record.name) if solutions and record else None
    if solutions and record is None:
        raise UsageError(f"{task} has no record to write as a solution: omit --with-solutions")
    if solutions and solution is None:
        raise UsageError(
            "the machines of records are not in the package but in its repository: omit "
            "--with-solutions, or run this in a clone of it"
        )
    graded = {"task": task, "engine": engine, "record": record.score if record else None}
    source = f"/tmp/{wheel.name}" if wheel else "agentflow-machines"
    wanted = f"{source}[mcp]" if wheel else f"{source}[mcp]=={__version__}"
    files = {
        "task.toml": _settings(task, f"{level.file.family}-{level.number}", level.file.title),
        "instruction.md": INSTRUCTION.format(task=task, rules=rules_of(made.brief)),
        "environment/Dockerfile": DOCKERFILE.format(
            copy=f"COPY {wheel.name} /tmp/\n" if wheel else "", wanted=wanted
        ),
        "tests/test.sh": TEST,
        f"tests/{GRADED}": json.dumps(graded) + "\n",
    }
    if solution is not None:
        files["solution/solve.sh"] = SOLVE.format(machine=solution.to_text())
    return files


def _settings(task: str, name: str, title: str) -> str:
    server = ["mcp", "--task", task, "--out", "/app/runs"]
    return f"""schema_version = "{SCHEMA}"
artifacts = ["/app/{MACHINE}"]

[task]
name = "agentflow/{name}"
description = {json.dumps(title)}
keywords = ["physics", "design"]

[metadata]
agentflow = "{__version__}"
level = "{task}"

[agent]
timeout_sec = 3600.0

[verifier]
timeout_sec = 600.0
environment_mode = "separate"

[environment]
build_timeout_sec = 1200.0
cpus = 2
memory_mb = 4096

[[environment.mcp_servers]]
name = "agentflow"
transport = "stdio"
command = "agentflow"
args = {json.dumps(server)}
"""


def grade(graded: Path, machine: Path, out: Path) -> dict[str, float]:
    """Write the reward of a machine as `reward.txt`, and with its terms as `reward.json`.

    Args:
        graded: The task, as exported.
        machine: The file of the machine; without one, the reward is 0.
        out: Folder of the two files.

    Returns:
        `reward` (the score), `record_share`, `valid`, and the terms of the score.

    Raises:
        NoScoreError: The simulation timed out or crashed, so that there is no reward.
    """
    setting: Mapping[str, Any] = json.loads(graded.read_bytes())
    text = machine.read_text("utf-8", "replace") if machine.is_file() else ""
    sample = Sample(setting["task"], text, engine=setting["engine"])
    found = shared_scorer(1).rewards([sample])[0]
    score = require_score(found, setting["task"])
    terms = {
        name: float(value)
        for name, value in found.rollout.terms.items()
        if isinstance(value, int | float) and isfinite(value)
    }
    share = {"record_share": round(score / setting["record"], 6)} if setting["record"] else {}
    numbers = {**terms, **share, "valid": float(found.valid), "reward": score}
    out.mkdir(parents=True, exist_ok=True)
    (out / "reward.json").write_text(json.dumps(numbers), encoding="utf-8")
    (out / "reward.txt").write_text(repr(score), encoding="utf-8")
    return numbers


if __name__ == "__main__":
    try:
        print(json.dumps(grade(*map(Path, sys.argv[1:]))))
    except (NoScoreError, UsageError) as error:
        sys.exit(f"agentflow: no reward: {error}")
