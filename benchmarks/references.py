"""Reference machines (tests/machines/<family>.yaml): find, simulate, draw them.

    python benchmarks/references.py --task T [--rollouts N] [--seed S] [--from machine.json]
                                    [--aim term] [--out machine.json] [--picture]
    python benchmarks/references.py --update [family ...]
    python benchmarks/references.py --table [family ...]
    python benchmarks/references.py --check [family ...]

The first form searches by random legal edits and writes the best machine found; `--aim` names the
score term that breaks ties. `--update` simulates the listed machines and writes their scores into
the files; `--table` prints the score of each reference on every level of its family. `--check`
prints what is not as it should be, of all of which the tests try a part: a score without power, and
what cheats earn on each of their levels.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from functools import partial
from pathlib import Path
from random import Random

from climbing import Found, climb
from PIL import Image
from shelf import DIGITS, IDLE, Shelf, families, here, load, load_file, read, write

from agentflow.env.drawing.stills import render_png
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_level, get_task, task_names
from agentflow.machine.tree import Machine

SIZE, COLORS = (480, 360), 48


def main() -> None:
    """Update, print or search, as the options say."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("families", nargs="*", help="all by default")
    parser.add_argument("--task")
    parser.add_argument("--rollouts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--from", dest="start", type=Path)
    parser.add_argument("--aim")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--picture", action="store_true")
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    for family in options.families or families():
        if options.update:
            update(read(family))
        if options.table:
            table(read(family))
        if options.check:
            check(read(family))
    if options.task:
        search(options)


def search(options: argparse.Namespace) -> None:
    """Search for a better machine and save it; with no rollouts, only draw the picture."""
    task = get_task(options.task)
    start = load_file(options.start) if options.start else None
    out = options.out or options.start or Path(f"{task.name.replace('/', '-')}.json")
    machine = start
    if options.rollouts:
        rng = Random(options.seed)
        save = partial(_save, out)
        found = asyncio.run(climb(task, options.rollouts, rng, start, options.aim, save))
        machine = found.machine
        print(f"{out}: {found.value[0]:.{DIGITS}f}")
    if options.picture and machine is not None:
        draw(machine, out.with_suffix(".png"))


def _save(out: Path, count: int, found: Found) -> None:
    """Save the best machine so far, so that the search can be interrupted."""
    out.write_text(found.machine.to_text() + "\n", encoding="utf-8")
    blocks = len(found.machine)
    print(f"{count:6d} {found.value[0]:10.3f} {found.value[1]:10.3f} {blocks:4d}", file=sys.stderr)


def draw(machine: Machine, path: Path) -> None:
    """A small picture of a machine as built."""
    render_png(machine, path, size=SIZE)
    with Image.open(path) as picture:
        few = picture.quantize(COLORS, dither=Image.Dither.NONE)
    few.save(path, "PNG", optimize=True)


def score_of(machine: Machine, level: str, power: bool = True) -> float:
    """Score rounded as in the files; nan if there is none."""
    score = simulate(machine, get_task(level), power=power).score
    return float("nan") if score is None else round(score, DIGITS)


def update(shelf: Shelf) -> None:
    """Simulate and print a family's references and cheats; write the scores of the references."""
    found = []
    for item in shelf.references:
        score = score_of(load(item.machine), item.level)
        share = score / get_level(item.level).file.good
        print(
            f"{item.level:12s} {item.machine:36s} {item.score:10.3f} -> {score:10.3f} {share:5.0%}"
        )
        found.append(item.model_copy(update={"score": score}))
    for cheat in shelf.cheats:
        scores = [score_of(load(cheat.machine), level) for level in cheat.levels]
        print(f"{'cheat':12s} {cheat.machine:36s} {scores} <= {cheat.most:g}")
    write(shelf.model_copy(update={"references": tuple(found), "platform": here()}))


def table(shelf: Shelf) -> None:
    """Print the score of each reference on every level of its family."""
    levels = [name for name in task_names() if get_task(name).family == shelf.family]
    print(f"{'machine':36s}" + "".join(f"{level:>12s}" for level in levels))
    for name in dict.fromkeys(item.machine for item in shelf.references):
        scores = [score_of(load(name), level) for level in levels]
        print(f"{name:36s}" + "".join(f"{score:12.2f}" for score in scores))


def check(shelf: Shelf) -> None:
    """Print the references that earn something without power, and the cheats that earn too much."""
    for item in shelf.references:
        score = score_of(load(item.machine), item.level, power=False)
        if not score <= IDLE * get_level(item.level).file.good:
            print(f"{item.machine} at {item.level}: {score:g} without power")
    for cheat in shelf.cheats:
        for level in cheat.levels:
            score = score_of(load(cheat.machine), level)
            if not score <= cheat.most:
                print(f"{cheat.machine} at {level}: {score:g}, not at most {cheat.most:g}")


if __name__ == "__main__":
    main()
