"""How time and memory grow with blocks, machines, runs and workers.

    python benchmarks/growth.py [PART ...] [--lines 1000000] [--rollouts 1000] [--out FILE]

Every point is CPU time; that of commands is of a fresh process, which starts in a quarter of a
second. Writes docs/results/growth.md and the picture in it; with PART, measures only these again.
`ray` needs the extra `cluster`, so an environment that has it runs this part.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import pickle
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

from cars import PLAIN_CAR
from figures import ROOT, cost_of

from agentflow.env.physics.engines import installed_engines
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine import check
from agentflow.machine.edits.random import random_machine

PAGE = ROOT / "docs" / "results" / "growth.md"
RUN = ROOT / "runs" / "recorded-throwing"
BLOCKS = 10, 20, 40, 80, 200, 400
WORKERS = 1, 2, 4, 8, 16
LONGEST = 5.0
"""s of CPU time: an engine that takes longer for a machine gets no larger ones."""
Point = tuple[str, int, float, float | None]
"""Name of the curve, size, seconds of CPU time, and greatest memory, MB."""


def blocks() -> Iterator[Point]:
    """Checks and rollouts of 1 s of a random machine; engines refuse some that are too large."""
    knobs = {"blocks.max": 2 * max(BLOCKS), "window": 1.0}  # else it takes long to find some
    left = [spec.name for spec in installed_engines()]
    for count in BLOCKS:
        brief = get_task("movement", knobs, left[-1]).brief
        machine = random_machine(Random(count), brief, (count, count))
        text = machine.to_text()
        yield "check", count, _least(lambda t=text: check(t)), None  # type: ignore[misc]
        for name in [*left]:
            task = get_task("movement", knobs, name)
            began = time.process_time()
            status = simulate(machine, task, cpu_limit=600.0).status
            seconds = time.process_time() - began
            if status == "ok":
                yield f"rollout, {name}", count, seconds, None
            if seconds > LONGEST or status != "ok":
                left.remove(name)


def machines(lines: int, rollouts: int) -> Iterator[Point]:
    """Streams of the same car."""
    line = json.dumps(PLAIN_CAR.to_json()).encode() + b"\n"
    for command, most in (
        (["check", "-", "--jsonl"], lines),
        (["simulate", "-", "--jsonl", "--workers", "1", *LEVEL], rollouts),
    ):
        for count in _sizes(100, most):
            yield f"{command[0]} --jsonl", count, *cost_of(command, (line for _ in range(count)))


LEVEL = ["--task", "movement", "--set", "window=1", "--engine", "mujoco"]


def runs(most: int) -> Iterator[Point]:
    """Listing copies of a recorded run."""
    with tempfile.TemporaryDirectory() as folder:
        first = Path(folder) / "first"
        shutil.copytree(RUN, first)
        for count in _sizes(10, most):
            place = Path(folder) / f"runs {count}"
            for number in range(count):
                shutil.copytree(first, place / f"run {number}", copy_function=os.link)
            yield "runs FOLDER", count, *cost_of(["runs", str(place)])
            shutil.rmtree(place)


def workers(rollouts: int) -> Iterator[Point]:
    """A stream in pools of several sizes; what workers would do at once, they do in turns where
    there are fewer processors."""
    line = json.dumps(PLAIN_CAR.to_json()).encode() + b"\n"
    for count in WORKERS:
        command = ["simulate", "-", "--jsonl", "--workers", str(count), *LEVEL]
        yield f"{rollouts} rollouts", count, *cost_of(command, [line] * rollouts)


def cluster(rollouts: int) -> Iterator[Point]:
    """The time of the process that sends machines to workers on Ray and gets their rollouts."""
    from cluster import nodes

    from agentflow.cluster.pool import RayPool

    task = get_task("movement", {"window": 1.0}, "mujoco")

    async def spend(workers: int) -> float:
        async with RayPool(workers) as pool:
            await asyncio.gather(*(pool.run(PLAIN_CAR, task) for _ in range(4 * workers)))
            spent = []
            for _ in range(3):
                began = time.process_time()
                await asyncio.gather(*(pool.run(PLAIN_CAR, task) for _ in range(rollouts)))
                spent.append(time.process_time() - began)
            return min(spent)

    for count in WORKERS:
        with nodes(count, 1):
            yield f"driver of {rollouts} rollouts", count, asyncio.run(spend(count)), None


def reckon(points: list[Point]) -> str:
    """How many workers one driver of them keeps busy, and what it then sends and gets."""
    task = get_task("movement", {"window": 1.0}, "mujoco")
    each = max(seconds / int(name.split()[2]) for name, _, seconds, _ in points)
    work = _least(lambda: simulate(PLAIN_CAR, task))
    size = len(pickle.dumps((PLAIN_CAR, task))) + len(pickle.dumps(simulate(PLAIN_CAR, task)))
    return (
        "More workers were not measured. By these figures, a rollout takes a worker "
        f"{1e3 * work:.1f} ms and the driver at most {1e3 * each:.2f} ms, so one driver keeps "
        f"{work / each:.0f} workers busy with these short rollouts. Machine and rollout are "
        f"{size / 1e3:.0f} kB, so it then sends and gets {size / each / 1e6:.0f} MB/s. Longer "
        "windows take workers longer in proportion, and the driver little: see "
        "[costs](../how-to/cluster.md#costs)."
    )


def _tell(points: Iterator[Point]) -> Iterator[Point]:
    for point in points:
        print(*point, file=sys.stderr, flush=True)
        yield point


def _sizes(first: int, most: int) -> Iterator[int]:
    while first <= most:
        yield first
        first *= 10


def _least(work: Callable[[], Any], times: int = 3) -> float:
    """The least CPU time of some calls, s."""
    found = []
    for _ in range(times):
        began = time.process_time()
        work()
        found.append(time.process_time() - began)
    return min(found)


PARTS = {
    "blocks": "Blocks of a machine",
    "machines": "Machines in a stream",
    "runs": "Runs in a folder",
    "workers": "Workers of a pool",
    "ray": "Workers on Ray",
}


def table(points: list[Point]) -> str:
    """A Markdown table."""
    rows = ["| what | size | CPU time | memory |", "|---|--:|--:|--:|"]
    for name, size, seconds, memory in points:
        took = f"{seconds:.2f} s" if seconds >= 1.0 else f"{1e3 * seconds:.1f} ms"
        rows.append(f"| {name} | {size:,} | {took} | {f'{memory:.0f} MB' if memory else ''} |")
    return "\n".join(rows)


def points_of(text: str) -> list[Point]:
    """The points of a table."""
    found: list[Point] = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("|") and cells[1][:1].isdigit():
            (number, unit), memory = cells[2].split(), cells[3].removesuffix(" MB")
            seconds = float(number) / (1e3 if unit == "ms" else 1.0)
            size = int(cells[1].replace(",", ""))
            found.append((cells[0], size, seconds, float(memory) if memory else None))
    return found


def draw(found: dict[str, list[Point]], picture: Path) -> None:
    """Draw CPU time, and memory dashed on an axis of its own."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "growth"
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(13, 7), constrained_layout=True)
    for axis in axes.flat[len(found) :]:
        axis.set_axis_off()
    for axis, (part, points) in zip(axes.flat, found.items(), strict=False):
        axis.set(title=PARTS[part], xscale="log", yscale="log", ylabel="CPU time (s)")
        axis.grid(alpha=0.3)
        other = axis.twinx() if points[0][3] else None
        for name in dict.fromkeys(point[0] for point in points):
            sizes, seconds, memory = zip(*(p[1:] for p in points if p[0] == name), strict=True)
            (line,) = axis.plot(sizes, seconds, "o-", label=name)
            if other:
                other.plot(sizes, memory, ":", color=line.get_color())
        if other:
            other.set_ylim(0, None)
            other.set_ylabel("memory (MB), dotted")
        sizes = sorted({point[1] for point in points})
        axis.set_xticks(sizes, [f"{size:,}" for size in sizes])
        axis.minorticks_off()
        axis.legend(fontsize=8)
    figure.savefig(picture, metadata={"Date": None})


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all but ray by default")
    parser.add_argument("--lines", type=int, default=1_000_000, help="most lines that are checked")
    parser.add_argument("--rollouts", type=int, default=1000, help="most machines simulated")
    parser.add_argument("--runs", type=int, default=10_000, help="most runs listed")
    parser.add_argument("--pool", type=int, default=200, help="machines simulated in each pool")
    parser.add_argument("--out", type=Path, default=PAGE)
    given = parser.parse_args()
    # blocks come last: a process that starts others counts as their memory what it had itself
    work = {
        "machines": lambda: machines(given.lines, given.rollouts),
        "runs": lambda: runs(given.runs),
        "workers": lambda: workers(given.pool),
        "ray": lambda: cluster(given.pool),
        "blocks": blocks,
    }
    text = given.out.read_text(encoding="utf-8") if given.out.exists() else ""
    texts = dict(each.split("\n\n", 1) for each in text.split("## ")[1:])
    for part in given.parts or [part for part in work if part != "ray"]:
        points = [*_tell(work[part]())]
        told = [table(points), reckon(points)] if part == "ray" else [table(points)]
        texts[PARTS[part]] = "\n\n".join(told)
    kept = {part: texts[PARTS[part]].strip() for part in work if PARTS[part] in texts}
    picture = given.out.parent.parent / "pictures" / "growth.svg"
    found = {part: points_of(text) for part, text in kept.items()}
    draw(found, picture if given.out == PAGE else given.out.with_suffix(".svg"))
    parts = [f"## {PARTS[part]}\n\n{text}\n" for part, text in kept.items()]
    given.out.write_text(INTRO + "\n" + "\n".join(parts), encoding="utf-8")


INTRO = """\
# How time and memory grow

This page shows how long checks, rollouts and lists take as machines, streams, folders and pools \
get larger. Use it to plan large experiments.

![CPU time and memory over sizes](../pictures/growth.svg)

Times are CPU time, on two busy cores. Rollouts last 1 s of simulated time; blocks are those of \
random machines, and an engine that takes over 5 s for one gets no larger ones. \
Commands run in a fresh process, whose start of a quarter of a second is included, and so are \
worker processes; memory is the most that one of them held. The size of a stream does not \
matter for it. More workers than cores take their turns: the time is that of their starts and of \
the same work. A worker loads compiled steps, and takes the memory for it, after 50 rollouts. \
On Ray, with all workers on this computer, only the time of the process that asks them is \
counted, the least of three: it is what limits a cluster. \
`python benchmarks/growth.py` writes this page.
"""


if __name__ == "__main__":
    main()
