"""Harbor: levels as task folders, where an agent works in a container and a script grades it.

Run as a program, this module is that script: it reads the machine and writes its reward.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path
from shlex import join
from typing import Any

from agentflow.app.benchmark.plan import item_configs, plan_benchmark, read_items
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine
from agentflow.env.tasks.base import Task
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

The command `agentflow` helps: `agentflow bench start {options}` begins a design with a budget \
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


@dataclass(frozen=True)
class Item:
    """A task to write."""

    name: str
    """Of its folder."""
    task: str
    """Level."""
    knobs: Mapping[str, Any] = field(default_factory=dict)
    engine: str = AUTO
    floor: float = 0.0
    full: float | None = None
    """Scores that shares of 0 and 1 stand for."""
    most: float = inf
    """Greatest share."""

    @property
    def options(self) -> list[str]:
        """Those of the commands that design for it."""
        changed = (f"{name}={json.dumps(value)}" for name, value in self.knobs.items())
        return ["--task", self.task, *(word for each in changed for word in ("--set", each))]


def items_of(tasks: Sequence[str]) -> list[Item]:
    """Levels, such as "throwing" or "bridge/2"; a share is that of the record's score.

    Raises:
        UsageError: A level does not exist, or is a file.
    """
    found = []
    for task in tasks:
        level, record = get_level(task), record_of(get_task(task))
        if not level.number:
            raise UsageError(f"{task} is a file, which containers lack; name a level of a family")
        name, full = f"{level.file.family}-{level.number}", record.score if record else None
        found.append(Item(name, level.name, full=full))
    return found


def items_of_set(benchmark: Path) -> list[Item]:
    """The items of a benchmark, with its shares.

    Raises:
        UsageError: There is no such file, or it is not a benchmark of this version.
    """
    sweep = plan_benchmark(benchmark, (), {}).sweep
    items, configs = read_items(sweep), item_configs(sweep)
    return [
        Item(name, config.task, config.knobs, config.engine, item.floor, item.full, item.most)
        for name, config in configs.items()
        if (item := items[name])
    ]


def export(
    items: Sequence[Item],
    out: Path,
    *,
    solutions: bool = False,
    engine: str | None = None,
    wheel: Path | None = None,
) -> list[str]:
    """Write a folder for each item.

    Args:
        items: What to write, as from `items_of`.
        out: Parent of the folders.
        solutions: Write the best known machines as solutions.
        engine: Physics engine that grades, with the seed 0, in place of that of the items.
        wheel: agentflow as a file, which containers install; by default from the package index.

    Returns:
        The folders.

    Raises:
        UsageError: The engine or the wheel does not exist, an item has no known machine, or a
            folder cannot be written.
    """
    if wheel is not None and not wheel.is_file():
        raise UsageError(f"{wheel} is not there; build it with scripts/release")
    graded_by = {item.name: choose_engine(engine or item.engine).name for item in items}
    folders = {
        out / item.name: _contents(item, graded_by[item.name], solutions, wheel) for item in items
    }
    for folder, contents in folders.items():
        for name, text in contents.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            with write_output(folder / name) as part:
                part.write_text(text, encoding="utf-8")
            (folder / name).chmod(0o755 if name.endswith(".sh") else 0o644)
        if wheel is not None:
            shutil.copy(wheel, folder / "environment")
    return list(map(str, folders))


def _contents(item: Item, engine: str, solutions: bool, wheel: Path | None) -> Mapping[str, str]:
    """Name -> text of each file of a task."""
    made = get_task(item.task, item.knobs, engine)
    source = f"/tmp/{wheel.name}" if wheel else "agentflow-machines"
    wanted = f"{source}[mcp]" if wheel else f"{source}[mcp]=={__version__}"
    graded = {
        **{name: getattr(item, name) for name in ("task", "knobs", "floor", "full")},
        **({"most": item.most} if isfinite(item.most) else {}),
        "engine": engine,
    }
    files = {
        "task.toml": _settings(item),
        "instruction.md": INSTRUCTION.format(
            options=join(item.options), rules=rules_of(made.brief)
        ),
        "environment/Dockerfile": DOCKERFILE.format(
            copy=f"COPY {wheel.name} /tmp/\n" if wheel else "", wanted=wanted
        ),
        "tests/test.sh": TEST,
        f"tests/{GRADED}": json.dumps(graded) + "\n",
    }
    if solutions:
        files["solution/solve.sh"] = SOLVE.format(machine=_solution(item, made))
    return files


def _solution(item: Item, made: Task) -> str:
    """The best known machine as text."""
    record = record_of(made)
    if record is None:
        raise UsageError(f"{item.name} has no record to write as a solution: omit --with-solutions")
    machine = record_machine(record.name)
    if machine is None:
        raise UsageError(
            "the machines of records are not in the package but in its repository: omit "
            "--with-solutions, or run this in a clone of it"
        )
    return machine.to_text()


def _settings(item: Item) -> str:
    server = ["mcp", *item.options, "--out", "/app/runs"]
    return f"""schema_version = "{SCHEMA}"
artifacts = ["/app/{MACHINE}"]

[task]
name = "agentflow/{item.name}"
description = {json.dumps(get_level(item.task).file.title)}
keywords = ["physics", "design"]

[metadata]
agentflow = "{__version__}"
level = "{item.task}"

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
        `reward` (the score), `full_share`, `valid`, and the terms of the score.

    Raises:
        NoScoreError: The simulation timed out or crashed, so that there is no reward.
    """
    setting: Mapping[str, Any] = json.loads(graded.read_bytes())
    text = machine.read_text("utf-8", "replace") if machine.is_file() else ""
    sample = Sample(setting["task"], text, knobs=setting["knobs"], engine=setting["engine"])
    found = shared_scorer(1).rewards([sample])[0]
    score = require_score(found, setting["task"])
    terms = {
        name: float(value)
        for name, value in found.rollout.terms.items()
        if isinstance(value, int | float) and isfinite(value)
    }
    numbers = {**terms, "valid": float(found.valid), "reward": score}
    floor, full, most = setting["floor"], setting["full"], setting.get("most", inf)
    if full is not None and full > floor:
        numbers["full_share"] = round(min(max((score - floor) / (full - floor), 0.0), most), 6)
    out.mkdir(parents=True, exist_ok=True)
    (out / "reward.json").write_text(json.dumps(numbers), encoding="utf-8")
    (out / "reward.txt").write_text(repr(score), encoding="utf-8")
    return numbers


if __name__ == "__main__":
    try:
        print(json.dumps(grade(*map(Path, sys.argv[1:]))))
    except (NoScoreError, UsageError) as error:
        sys.exit(f"agentflow: no reward: {error}")
