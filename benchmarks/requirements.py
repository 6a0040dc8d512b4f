"""Draws the Pareto front of score, cost and safety for a task, from designs of the embedded model.

    python benchmarks/requirements.py throwing [--rollouts 40] [--runs FOLDER]
    python benchmarks/requirements.py bridge

Designs with different requirements try machines of different kinds. Every machine is a point: its
score and its safety factor, coloured by its cost. Those that no other beats in all three are
outlined. Writes docs/pictures/requirements-NAME.svg and prints what the designs met.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import agentflow
from agentflow.env.archive import load_npz
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.requirements import SCORE_IF_MET
from agentflow.notebook.figures.style import drawing_style, new_figure
from agentflow.search.pareto import Point, ranks

FOLDER = Path(__file__).parent.parent / "docs" / "pictures"
UNITS = {"throwing": "m", "bridge": "kg"}
SAFE, CHEAP = "safety >= 1.5", "cost <= 60"
DESIGNS = {
    "throwing": (
        ("report", SAFE, CHEAP, {}),
        ("must", SAFE, "cost <= 1000", {}),
        ("must", SAFE, CHEAP, {}),
    ),
    "bridge": tuple(("must", SAFE, CHEAP, {"load.most": load}) for load in (300, 600, 900, 1200)),
}
"""Mode, requirements and other settings of each design."""
MOST = 6.0
"""Safety factors above are drawn there."""


def main() -> None:
    """Design, and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("task", choices=DESIGNS)
    parser.add_argument("--rollouts", type=int, default=40)
    parser.add_argument("--runs", type=Path, default=Path(tempfile.gettempdir()) / "requirements")
    options = parser.parse_args()
    points: list[Point] = []
    for mode, *wanted, others in DESIGNS[options.task]:
        settings = {
            **others,
            "requirements.mode": mode,
            "requirements.wanted": wanted,
            "max_simulations": options.rollouts,
            "keep_rollouts": "all",
            "verify": False,
        }
        run = agentflow.design(
            options.task, workflow="iterative", settings=settings, out=options.runs
        )
        met = [f"{one['requirement']}: {one['value']:.3g}" for one in run.data["requirements"]]
        print(f"{options.task}, {mode}: score {run.score:.2f}; {', '.join(met)}")
        files = sorted((run.run / "rollouts").glob("*.npz"))
        points += [point for file in files for point in _points(load_npz(file))]
    draw(options.task, points)


def _points(rollout: Rollout) -> Iterator[Point]:
    """Score, safety factor and minus cost of a machine that scores."""
    score = rollout.terms.get(SCORE_IF_MET)
    values = {item.requirement.quantity: item.value for item in rollout.requirements}
    safety, cost = values.get("safety"), values.get("cost")
    if isinstance(score, float) and score > 0.0 and safety is not None and cost is not None:
        yield score, min(safety, MOST), -cost


def draw(task: str, points: list[Point]) -> None:
    """Write the picture."""
    front = [front == 1 for front in ranks(points)]
    with drawing_style():
        figure, (panel,) = new_figure(1, (4.6, 3.0))
        scores, factors, costs = zip(*points, strict=True)
        prices = [-cost for cost in costs]
        edges = ["#000000" if first else "none" for first in front]
        marks = panel.scatter(
            scores, factors, c=prices, cmap="viridis_r", s=26, edgecolors=edges, linewidths=0.9
        )
        panel.axhline(1.0, color="#D55E00", linewidth=0.8)
        panel.axhline(1.5, color="#0072B2", linewidth=0.8, linestyle="--")
        panel.set_xlabel(f"score, {UNITS[task]}")
        panel.set_ylabel("safety factor")
        panel.set_title(f"{task}: {len(points)} machines that score, {sum(front)} on the front")
        figure.colorbar(marks, ax=panel, label="cost, credits")
        figure.savefig(FOLDER / f"requirements-{task}.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
