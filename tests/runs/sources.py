"""One small example of every kind of file that a command reads, and everything that reads it."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import yaml

from agentflow.app.design.replay import replay
from agentflow.app.design.run import DesignRun, RunOptions, design, resume, with_rationales
from agentflow.app.diagnose.run import diagnose
from agentflow.app.subjects.verify import rescore
from agentflow.cli import main
from agentflow.cli.display.live import print_remark, watch
from agentflow.cli.display.show_runs import show_rescored, show_result
from agentflow.config.run import build_config
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.machine import Machine
from agentflow.models.completion import complete_config
from agentflow.studio.folder import RunFolder
from agentflow.studio.watching.listing import Listing
from agentflow.tools import Bench
from agentflow.workflows.tools import workflow_of
from tests.app.benchmark import boards
from tests.llm.foreign import ROOT
from tests.scripted import ScriptedClient
from tests.study.example import TRANSCRIPT, record
from tests.tools.benches import CAR
from tests.training.data.conftest import OBJECTIVES
from tests.training.folders import drives, throws, write_evaluation, write_training
from tests.training.sets import write_set

Reader = Callable[[], object]
WINDOW = {"task": "movement", "knobs": {"window": 1}}


class InProcess(RolloutPool):
    """Simulates in this process, each machine once; workers take a second to start."""

    def __init__(self) -> None:
        super().__init__(1)
        self._known: dict[str, Rollout] = {}

    async def run(self, machine: Machine, task: Task, *, seed: int = 0, **_: Any) -> Rollout:
        key = f"{machine.digest} {task!r} {seed}"
        if key not in self._known:
            self._known[key] = simulate(machine, task, seed=seed)
        return self._known[key]


@dataclass(frozen=True)
class Source:
    """Files of one kind in a folder, and their readers: (copy of the folder, pool) -> by name."""

    folder: Path
    readers: Callable[[Path, InProcess], Mapping[str, Reader]]


def command(*words: object) -> Reader:
    return lambda: main([str(word) for word in words])


def commands(**known: tuple[object, ...]) -> dict[str, Reader]:
    return {name.replace("_", " "): command(*words) for name, words in known.items()}


def read_run(run: Path, pool: InProcess, out: Path) -> dict[str, Reader]:
    """Every reader of runs; some write in them."""

    def resume_run() -> None:
        with watch(quiet=False) as (listener, notify):
            found = resume(run, RunOptions(notify, listener, pool=pool))
            show_result(found.to_json(), {})

    def rescore_run() -> None:
        with patch("agentflow.app.subjects.verify.RolloutPool", lambda _workers: pool):
            show_rescored(rescore(run))

    rationales = partial(build_config, {**WINDOW, "settings": {"rationales_from": str(run)}})
    return {
        **commands(
            show=("show", run),
            show_json=("show", run, "--json"),
            failures=("failures", run),
            runs=("runs", run.parent),
            behaviour=("behaviour", run),
            diversity=("diversity", run),
            check=("check", run),
            compare=("compare", run, ROOT / "examples" / "car.json"),
            convert=("convert", run, out / "machine.bsg"),
            report=("report", run, "--films", 0, "--out", out / "page.html"),
            gallery=("gallery", run, "--out", out / "gallery.html"),
            study=("study", "metrics", run),
        ),
        "rescore": rescore_run,
        "replay": lambda: replay(run, print_remark, pool=pool),
        "resume": resume_run,
        "studio": lambda: json.dumps(Listing(RunFolder(run.parent)).rows(), allow_nan=False),
        "rationales": lambda: with_rationales(rationales()),
    }


def only_run(folder: Path, pool: InProcess) -> dict[str, Reader]:
    (run,) = (folder / "runs").iterdir()
    return read_run(run, pool, folder.parent / "out")


def make_run(folder: Path, workflow: str, **settings: Any) -> None:
    config = build_config({**WINDOW, "workflow": workflow, "verify": False, "settings": settings})
    design(config, folder / "runs", RunOptions(pool=InProcess()), "one")


def make_session(folder: Path) -> None:
    """A run at which a client worked, who cannot be asked again."""

    async def work(bench: Bench, _stage: object) -> None:
        checked = await bench.call("check", {"machine": CAR, "note": "a car"})
        name = checked.data["machine"]
        await bench.call("simulate", {"machine": name})
        query = {"id": 0, "duration": [0, 1], "properties": ["position"]}
        await bench.call("query", {"machine": name, "queries": [query]})
        await bench.call("look", {"machine": name, "time": 0.5})
        made = await bench.call("edit", {"machine": name, "script": "Remove 6"})
        await bench.call("simulate", {"machine": made.data["machine"]})
        await bench.call("edit", {"machine": name, "script": "no command"})
        await bench.call("submit", {"machine": name, "last": True})

    settings = {"max_simulations": 5, "candidates_per_stage": 2, "vision": True}
    config = build_config({**WINDOW, "workflow": "tools", "verify": False, "settings": settings})
    options = RunOptions(pool=InProcess(), workflow=workflow_of(work, "client", ["env_feedback"]))
    asyncio.run(DesignRun.create(config, folder / "runs", options, "one").carry_out())


def make_sweep(folder: Path) -> None:
    search = {"trajectories": 2, "search": {"rounds": 1, "width": 1}}
    base = {**WINDOW, "workflow": "iterative", "settings": search}
    sweep = {"title": "Fuzz", "base": base, "seeds": [0], "table": {"metrics": ["max"]}}
    (folder / "fuzz.yaml").write_text(yaml.safe_dump(sweep))
    assert main(["sweep", str(folder / "fuzz.yaml"), "--out", str(folder), "--quiet"]) == 0


def read_sweep(folder: Path, pool: InProcess) -> dict[str, Reader]:
    sweep, file, out = folder / "fuzz", folder / "fuzz.yaml", folder.parent / "out"
    (run,) = (sweep / "runs").iterdir()
    return {
        **read_run(run, pool, out),
        **commands(
            table=("table", sweep),
            table_usage=("table", sweep, "--show", "usage"),
            table_scores=("table", sweep, "--show", "scores"),
            report_sweep=("report", sweep, "--out", out / "page.html"),
            sweep=("sweep", file, "--dry-run", "--out", out),
            sweep_again=("sweep", sweep, "--dry-run"),
        ),
    }


MACHINE_FILES = ("car.json", "car.coords.json", "car.bsg")


def make_files(folder: Path) -> None:
    """The files that people write."""
    shutil.copy(ROOT / "examples" / "car.json", folder)
    for name in MACHINE_FILES[1:]:
        assert main(["convert", str(folder / "car.json"), str(folder / name)]) == 0
    machine = json.loads((folder / "car.json").read_text())
    script = "Remove 6\nAdd 15 to 0 in 4\nMove 2 to 0 in 4\nControl 2 at 1 for 2 level 1"
    (folder / "script.txt").write_text(script)
    (folder / "edits.jsonl").write_text(json.dumps({"machine": machine, "script": script}) + "\n")
    design_config = (ROOT / "configs" / "design.yaml").read_text()
    (folder / "design.yaml").write_text(design_config)
    level = ROOT / "agentflow" / "env" / "tasks" / "levels"
    for name in ("movement-3", "rocket-2", "bridge-1"):
        shutil.copy(level / f"{name}.yaml", folder)
    shutil.copy(ROOT / "configs" / "inspector.yaml", folder)
    boards.write(folder)
    (folder / "objectives.yaml").write_text(OBJECTIVES)
    talk = [{"role": "system", "content": "You design."}, {"role": "user", "content": "A car."}]
    talk.append({"role": "assistant", "content": f"```json\n{json.dumps(machine)}\n```"})
    (folder / "talk.jsonl").write_text(json.dumps({"messages": talk}) + "\n")


def read_files(folder: Path, _: InProcess) -> dict[str, Reader]:
    out, car = folder.parent / "out", ROOT / "examples" / "car.json"
    found: dict[str, Reader] = {}
    for name in MACHINE_FILES:
        machine = folder / name
        found |= {
            f"check {name}": command("check", machine, "--task", "movement", "--geometry"),
            f"convert {name}": command("convert", machine, out / "machine.urdf"),
            f"compare {name}": command("compare", machine, car),
            f"prompts {name}": command(
                "prompts", "show", "--machine", machine, "--role", "refiner"
            ),
        }
    for name in ("movement-3.yaml", "rocket-2.yaml", "bridge-1.yaml"):
        found[f"tasks {name}"] = command("tasks", folder / name)
        found[f"check with {name}"] = command("check", car, "--task", folder / name)
    read: dict[str, tuple[object, ...]] = {
        "script.txt": ("edit", car, "--script"),
        "edits.jsonl": ("edit", "--jsonl"),
        "design.yaml": ("config", "show", "--config"),
        "inspector.yaml": ("sweep", "--dry-run", "--out", out),
        "small.yaml": ("benchmark", "--dry-run", "--out", out),
        "objectives.yaml": ("data", "generate", "--samples", 1, "--quiet", "--out", out / "d"),
        "talk.jsonl": ("data", "import", "--out", out / "set"),
    }
    return found | {name: command(*words, folder / name) for name, words in read.items()}


def make_study(folder: Path) -> None:
    record(folder / "session")
    (folder / "said.vtt").write_text(TRANSCRIPT)


def read_study(folder: Path, _: InProcess) -> dict[str, Reader]:
    session = folder / "session"
    return commands(
        metrics=("study", "metrics", session),
        segments=("study", "segments", session, "--transcript", folder / "said.vtt"),
        elan=("study", "elan", session),
    )


def ask_about_overlaps(out: Path) -> None:
    config = complete_config({"seed": 3, "workers": 1})
    diagnose("overlap", config, 4, out, client=ScriptedClient(lambda _: "[[0, 1]]"))


def make_learning(folder: Path) -> None:
    write_evaluation(folder / "evaluation", "one", [*throws(), *drives(), *drives()])
    write_training(folder / "training")
    write_set(folder / "set", 3)
    ask_about_overlaps(folder / "diagnosis")
    for name, card in zip("ab", sorted((ROOT / "docs" / "cards").glob("*.json")), strict=False):
        (folder / "cards" / name).mkdir(parents=True)
        shutil.copy(card, folder / "cards" / name / "card.json")


def read_learning(folder: Path, _: InProcess) -> dict[str, Reader]:
    out = folder.parent / "out"
    cards = sorted((folder / "cards").glob("*/card.json"))
    return {"diagnosis": lambda: ask_about_overlaps(folder / "diagnosis")} | commands(
        table_evaluation=("table", folder / "evaluation"),
        table_training=("table", folder / "training", "--show", "curves"),
        report_training=("report", folder / "training", "--out", out / "page.html"),
        diversity_evaluation_training=("diversity", folder / "evaluation", folder / "training"),
        csv_evaluation_training=(
            "table",
            folder / "evaluation",
            folder / "training",
            "--format",
            "csv",
        ),
        leaderboard_cards=("leaderboard", *cards),
        leaderboard_cards_page=("leaderboard", *cards, "--html", out / "page.html"),
        import_set=("data", "import", folder / "set" / "train.jsonl", "--out", out / "set"),
    )


KINDS: dict[str, tuple[Callable[[Path], None], Callable[..., Mapping[str, Reader]]]] = {
    "sweep": (make_sweep, read_sweep),
    "hierarchical": (partial(make_run, workflow="hierarchical", trajectories=1), only_run),
    "tools": (
        partial(make_run, workflow="tools", max_simulations=4, candidates_per_stage=1, vision=True),
        only_run,
    ),
    "explore": (
        partial(make_run, workflow="explore", trajectories=1, max_simulations=8, querier=False),
        only_run,
    ),
    "session": (make_session, only_run),
    "files": (make_files, read_files),
    "study": (make_study, read_study),
    "learning": (make_learning, read_learning),
}
"""Kind -> how a folder with it is filled, and who reads it."""


def make_sources(folder: Path, kinds: tuple[str, ...] = tuple(KINDS)) -> dict[str, Source]:
    """A source of each kind below a folder; those that are there already are used again."""
    found = {}
    for kind in kinds:
        make, readers = KINDS[kind]
        if not (folder / f"{kind}.made").exists():
            shutil.rmtree(folder / kind, ignore_errors=True)
            (folder / kind).mkdir(parents=True)
            make(folder / kind)
            (folder / f"{kind}.made").touch()
        found[kind] = Source(folder / kind, readers)
    return found
