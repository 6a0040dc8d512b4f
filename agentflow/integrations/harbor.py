"""Harbor: levels as task folders, where an agent works in a container and a script grades it.

Run as a program, this module is that script: it reads the machine and writes its reward.
"""

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path
from shlex import join
from typing import Any

from agentflow.app.benchmark.plan import MOST, item_configs, plan_benchmark, read_items, share_of
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_machine, record_of
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.errors import NoScoreError, UsageError
from agentflow.files.atomic import write_file
from agentflow.files.templates import fill
from agentflow.integrations.episode import rules_of
from agentflow.rewards import Sample, require_score, shared_scorer
from agentflow.version import __version__

FILES = {
    "task.toml": "task.toml",
    "instruction.md": "instruction.md",
    "environment/Dockerfile": "Dockerfile",
    "tests/test.sh": "test.sh",
    "solution/solve.sh": "solve.sh",
}
"""Files of a task -> their templates. The format is 1.1, the first with a verifier apart."""


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
        Item(name, config.task, config.knobs, config.engine, par.floor, par.par, MOST)
        for name, config in configs.items()
        if (par := items[name].par)
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
    folders = {out / item.name: _contents(item, solutions, engine, wheel) for item in items}
    for folder, contents in folders.items():
        for name, text in contents.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            write_file(folder / name, text)
            (folder / name).chmod(0o755 if name.endswith(".sh") else 0o644)
        if wheel is not None:
            shutil.copy(wheel, folder / "environment")
    return list(map(str, folders))


def _contents(
    item: Item, solutions: bool, engine: str | None, wheel: Path | None
) -> Mapping[str, str]:
    """Name -> text of each file of a task."""
    engine = choose_engine(engine or item.engine).name
    made = get_task(item.task, item.knobs, engine)
    wanted = f"/tmp/{wheel.name}[mcp]" if wheel else f"agentflow-machines[mcp]=={__version__}"
    known = {
        "item": item,
        "title": json.dumps(get_level(item.task).file.title),
        "version": __version__,
        "options": join(item.options),
        "server": json.dumps(["mcp", *item.options, "--out", "/app/runs"]),
        "rules": rules_of(made.brief),
        "wheel": wheel and wheel.name,
        "wanted": wanted,
        "solution": _solution(item, made) if solutions else "",
    }
    graded = {key: value for key, value in vars(item).items() if value != inf}
    files = {"tests/graded.json": json.dumps({**graded, "engine": engine}) + "\n"}
    for name, template in FILES.items():
        if solutions or not name.startswith("solution"):
            files[name] = fill("agentflow.integrations", template, **known)
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
        numbers["full_share"] = share_of(score, floor, full, most)
    out.mkdir(parents=True, exist_ok=True)
    (out / "reward.json").write_text(json.dumps(numbers), encoding="utf-8")
    (out / "reward.txt").write_text(repr(score), encoding="utf-8")
    return numbers


if __name__ == "__main__":
    try:
        print(json.dumps(grade(*map(Path, sys.argv[1:]))))
    except (NoScoreError, UsageError) as error:
        sys.exit(f"agentflow: no reward: {error}")
