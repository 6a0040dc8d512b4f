"""Damaged and forged run directories, and what every reader of runs does with them."""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml

from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, resume
from agentflow.app.subjects.rescore import rescore
from agentflow.cli import main
from agentflow.cli.display.live import watch
from agentflow.cli.display.show_runs import show_rescored, show_result
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.errors import AgentflowError
from agentflow.machine import Machine
from agentflow.runs.reading import document_text, read_document

VALUES: tuple[Any, ...] = (
    *(None, True, False, -1, 0, 1, 2, 0.5, -7.25, float("nan"), float("inf"), 10**30),
    *("", "x", "1", "movement", "../../own.txt", "/dev/zero", "\x1b[31mred\x07", "\ud800", "ok"),
    *([], {}, [None], [[]], {"x": 1}, [1, 2], ["a"], {"": None}),
)
SAFE = (None, True, -1, 0, 1, 2, 0.5, "", "x", "\x1b[31m", [], {}, [None], {"x": 1}, "movement/2")
"""Values for run.yaml: huge numbers there are long runs, not damage."""
Mutation = Callable[[Path, random.Random], None]


def make_source(folder: Path) -> Path:
    """A small finished run, as a member of a sweep; the folder of the sweep."""
    sweep = {
        "title": "Fuzz",
        "base": {
            "task": "movement",
            "knobs": {"window": 1},
            "workflow": "iterative",
            "settings": {"trajectories": 2, "search": {"rounds": 1, "width": 1}},
        },
        "seeds": [0],
        "table": {"metrics": ["max"]},
    }
    (folder / "fuzz.yaml").write_text(yaml.safe_dump(sweep))
    assert main(["sweep", str(folder / "fuzz.yaml"), "--out", str(folder), "--quiet"]) == 0
    return folder / "fuzz"


def _paths(item: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    pairs = item.items() if isinstance(item, dict) else enumerate(item)
    for key, value in pairs:
        yield (*at, key)
        if isinstance(value, dict | list):
            yield from _paths(value, (*at, key))


def _change_value(document: Any, values: tuple[Any, ...], rng: random.Random) -> None:
    """Replace or remove one value of JSON data, anywhere in it."""
    paths = list(_paths(document))
    if not paths:
        return
    *above, last = rng.choice(paths)
    for key in above:
        document = document[key]
    if rng.random() < 0.2:
        del document[last]
    else:
        document[last] = rng.choice(values)


def _change_line(file: Path, rng: random.Random) -> None:
    lines = file.read_text().splitlines()
    number = rng.randrange(len(lines))
    item = json.loads(lines[number])
    _change_value(item, VALUES, rng)
    lines[number] = json.dumps(item)
    file.write_text("\n".join(lines) + "\n")


def change_event(run: Path, rng: random.Random) -> None:
    _change_line(run / "events.jsonl", rng)


def change_call(run: Path, rng: random.Random) -> None:
    _change_line(run / "calls.jsonl", rng)


def change_result(run: Path, rng: random.Random) -> None:
    item = json.loads((run / "result.json").read_text())
    _change_value(item, VALUES, rng)
    (run / "result.json").write_text(json.dumps(item))


def change_document(run: Path, rng: random.Random) -> None:
    """Forge run.yaml, with a seal that fits."""
    document = read_document(run)
    _change_value(document, SAFE, rng)
    (run / "run.yaml").write_text(document_text(document))


def change_machine(run: Path, rng: random.Random) -> None:
    file = rng.choice(sorted((run / "machines").iterdir()))
    item = json.loads(file.read_text())
    _change_value(item, VALUES, rng)
    file.write_text(json.dumps(item))


def change_lines(run: Path, rng: random.Random) -> None:
    """Drop, repeat or swap lines."""
    file = run / rng.choice(("events.jsonl", "calls.jsonl", "run.yaml"))
    lines = file.read_bytes().splitlines(keepends=True)
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(3)
    if change == 0:
        del lines[one]
    elif change == 1:
        lines.insert(other, lines[one])
    else:
        lines[one], lines[other] = lines[other], lines[one]
    file.write_bytes(b"".join(lines))


def change_bytes(run: Path, rng: random.Random) -> None:
    """Cut a file off, or overwrite some of its bytes."""
    file = rng.choice(sorted(path for path in run.rglob("*") if path.is_file()))
    content = bytearray(file.read_bytes())
    at = rng.randrange(len(content) + 1)
    if rng.random() < 0.5:
        del content[at:]
    else:
        content[at : at + 4] = rng.choice((b"\0\0\0\0", b"\xff\xfe", b'"', b"{", b"\x1b[0m", b""))
    file.write_bytes(content)


def change_files(run: Path, rng: random.Random) -> None:
    """Remove a file, put a folder in its place, or a link to a file outside."""
    file = rng.choice(sorted(path for path in run.rglob("*") if path.is_file()))
    file.unlink()
    if (change := rng.randrange(3)) == 1:
        file.mkdir()
    elif change == 2:
        file.symlink_to(run.parents[2] / "own.txt")


MUTATIONS: tuple[Mutation, ...] = (
    *(change_event, change_event, change_call, change_call, change_result, change_result),
    *(change_document, change_document, change_machine, change_lines, change_bytes, change_files),
)


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


def readers(sweep: Path, run: Path, pool: InProcess) -> dict[str, Callable[[], object]]:
    """Every reader of runs, by name; resuming comes last because it writes."""

    def command(*words: str) -> Callable[[], object]:
        return lambda: main([*words])

    def resume_run() -> None:
        with watch(quiet=False) as (listener, notify):
            found = resume(run, RunOptions(notify, listener, pool=pool))
            show_result(found.to_json(), {})

    page = str(sweep.parent / "page.html")
    return {
        "show": command("show", str(run)),
        "show --json": command("show", str(run), "--json"),
        "failures": command("failures", str(run)),
        "runs": command("runs", str(sweep)),
        "table": command("table", str(sweep)),
        "table usage": command("table", str(sweep), "--show", "usage"),
        "check": command("check", str(run)),
        "report": command("report", str(run), "--films", "0", "--out", page),
        "rescore": lambda: show_rescored(rescore(run, pool=pool)),
        "replay": lambda: replay(run, print, pool=pool),
        "resume": resume_run,
        "show resumed": command("show", str(run)),
    }


def _outcome(read: Callable[[], object]) -> str:
    """What a reader did: "ok", "refused", or the traceback or output that it should not have."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = read()
    except AgentflowError as error:
        return "refused" if "\n" not in str(error) else f"several lines: {error}"
    except Exception:  # noqa: BLE001 - this is what is looked for
        return traceback.format_exc()
    shown = out.getvalue() + err.getvalue()
    if "Traceback" in shown:
        return shown
    if "\x1b" in shown or "\x07" in shown:
        return f"control characters: {shown!r}"
    if status == 2 and err.getvalue().count("\n") != 1:
        return f"several lines: {err.getvalue()}"
    return "refused" if status == 2 else "ok"


def outcomes(source: Path, folder: Path, count: int, seed: int) -> Iterator[tuple[str, str, str]]:
    """(mutations, reader, outcome) for `count` mutated copies of the sweep `source`.

    Outcomes other than "ok" and "refused" are faults; "written outside" is one of them.
    """
    pool = InProcess()
    own = folder / "own.txt"
    own.write_text("own\n")
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        sweep = folder / "copy"
        shutil.copytree(source, sweep)
        (run,) = (sweep / "runs").iterdir()
        names = [f"{number}:"]
        if rng.random() < 0.3:
            (run / "result.json").unlink()
        for mutate in rng.choices(MUTATIONS, k=rng.choice((1, 1, 2, 3))):
            # an earlier mutation may have left nothing that this one can change
            with contextlib.suppress(OSError, ValueError, LookupError, AgentflowError, TypeError):
                mutate(run, rng)
                names.append(mutate.__name__)
        for name, read in readers(sweep, run, pool).items():
            yield " ".join(names), name, _outcome(read)
        (folder / "page.html").unlink(missing_ok=True)
        shutil.rmtree(sweep)
        if own.read_text() != "own\n" or sorted(p.name for p in folder.iterdir()) != ["own.txt"]:
            yield " ".join(names), "all", f"written outside: {sorted(folder.iterdir())}"


def summary(source: Path, folder: Path, count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Numbers of outcomes by reader, and the faults."""
    counts: Counter[str] = Counter()
    faults = []
    for names, reader, outcome in outcomes(source, folder, count, seed):
        kind = outcome if outcome in ("ok", "refused") else "fault"
        counts[f"{reader}: {kind}"] += 1
        if kind == "fault":
            faults.append(f"{names}: {reader}: {outcome}")
    return counts, faults
