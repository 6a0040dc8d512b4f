"""Times pictures and films of rollouts, in CPU time of one core.

Run: `python benchmarks/render.py`. One line per rollout; a second of film of 640x480 at 10 frames
per second must take at most one second.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from agentflow.env.drawing.film import save_film
from agentflow.env.drawing.gltf import rollout_glb
from agentflow.env.drawing.stills import render_png
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine, Step

FPS, SIZE = 10, (640, 480)
CAR = ((0, -1, -1), (1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3))
TOWER = (
    *((63, 0, 4), (1, 7, 0), (15, 8, 0), (15, 7, 7), (15, 7, 8), (15, 7, 9)),
    *((15, 7, 10), (15, 7, 11), (15, 7, 12), (1, 7, 3), (1, 7, 6), (35, 16, 0), (35, 17, 0)),
)
CATAPULT = (
    *((0, -1, -1), (1, 0, 1), (1, 0, 2), (1, 0, 0), (1, 1, 2), (1, 2, 4), (1, 0, 3), (1, 6, 6)),
    *((1, 7, 6), (15, 8, 0), (22, 8, 4), (63, 10, 3), (30, 11, 0), (36, 12, 0), (35, 10, 0)),
)
"""(type, parent, face) of each block."""
CASES = (
    ("car", CAR, "movement/1"),
    ("tall car", CAR + TOWER, "movement/2"),
    ("tall car", CAR + TOWER, "movement/3"),
    ("catapult", CATAPULT, "throwing/1"),
    ("catapult", CATAPULT, "throwing/3"),
)


def main() -> None:
    """Print the table."""
    columns = ("picture", "sheet", "gif per s", "mp4 per s", "glb")
    print(f"{'machine':10}{'task':12}{'blocks':>7}" + "".join(f"{c:>11}" for c in columns))
    with tempfile.TemporaryDirectory() as folder:
        for name, rows, level in CASES:
            machine = Machine(tuple(Step(i, *row) for i, row in enumerate(rows)))
            figures = "".join(f"{value:>9.3f} s" for value in measured(machine, level, folder))
            print(f"{name:10}{level:12}{len(machine):>7}{figures}")


def measured(machine: Machine, level: str, folder: str) -> list[float]:
    """Seconds for a picture, a sheet, one second of film as GIF and as MP4, and a .glb."""
    task, still, film = get_task(level), Path(folder) / "x.png", Path(folder) / "x"
    rollout = simulate(machine, task, interval=1.0 / FPS)
    assert rollout.trace is not None, rollout.problems
    share = FPS / len(rollout.trace.times)
    save = partial(save_film, machine, task, rollout, size=SIZE)
    return [
        seconds(lambda: render_png(machine, still)),
        seconds(lambda: render_png(machine, still, view="sheet")),
        seconds(lambda: save(film.with_suffix(".gif"))) * share,
        seconds(lambda: save(film.with_suffix(".mp4"))) * share,
        seconds(lambda: rollout_glb(machine, rollout)),
    ]


def seconds(work: Callable[[], object]) -> float:
    """Processor time of all threads; the best of two, since the computer does other things too."""
    times = []
    for _ in range(2):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


if __name__ == "__main__":
    main()
