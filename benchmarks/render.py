"""Times pictures and films of rollouts, in CPU time of one core.

    python benchmarks/render.py

Prints one line per rollout. A second of film (640x480, 10 frames) must take at most one second.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from cars import CAR, CATAPULT, PLAIN_CAR

from agentflow.env.drawing.film import save_film
from agentflow.env.drawing.glb import rollout_glb
from agentflow.env.drawing.look import look_at
from agentflow.env.drawing.stills import render_png
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine

FPS, SIZE = 10, (640, 480)
CASES = (
    ("car", PLAIN_CAR, "movement/1"),
    ("tall car", CAR, "movement/2"),
    ("tall car", CAR, "movement/3"),
    ("catapult", CATAPULT, "throwing/1"),
    ("catapult", CATAPULT, "throwing/3"),
)


def main() -> None:
    """Print the table."""
    columns = ("picture", "sheet", "look", "gif per s", "mp4 per s", "glb")
    print(f"{'machine':10}{'task':12}{'blocks':>7}" + "".join(f"{c:>11}" for c in columns))
    with tempfile.TemporaryDirectory() as folder:
        for name, machine, level in CASES:
            figures = "".join(f"{value:>9.3f} s" for value in measure(machine, level, folder))
            print(f"{name:10}{level:12}{len(machine):>7}{figures}")


def measure(machine: Machine, level: str, folder: str) -> list[float]:
    """Seconds for a picture, a sheet, a look from the side at a moment, one second of film as GIF
    and as MP4, and a .glb."""
    task, still, film = get_task(level), Path(folder) / "x.png", Path(folder) / "x"
    rollout = simulate(machine, task, interval=1.0 / FPS)
    assert rollout.trace is not None, rollout.problems
    share = FPS / len(rollout.trace.even.times)
    save = partial(save_film, machine, task, rollout, size=SIZE)
    return [
        seconds(lambda: render_png(machine, still)),
        seconds(lambda: render_png(machine, still, view="sheet")),
        seconds(lambda: look_at(machine, "side", rollout, (1.0,))),
        seconds(lambda: save(film.with_suffix(".gif"))) * share,
        seconds(lambda: save(film.with_suffix(".mp4"))) * share,
        seconds(lambda: rollout_glb(machine, rollout)),
    ]


def seconds(work: Callable[[], object]) -> float:
    """CPU time of all threads; the better of two attempts."""
    times = []
    for _ in range(2):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


if __name__ == "__main__":
    main()
