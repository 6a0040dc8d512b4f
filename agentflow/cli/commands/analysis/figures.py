"""The command for figures. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path

from agentflow.cli.root import commands
from agentflow.notebook.words import By, View


@commands.command(epilog="Example: agentflow plot sweeps/inspector --view curve --out curve.pdf")
def plot(
    sources: list[Path],
    view: View = "curve",
    by: By = "simulations",
    out: Path = Path("figure.pdf"),
) -> None:
    """Draw a figure for a paper.

    Runs that differ only in their seeds are one condition. Scores are verified ones where there are
    any, except in curves.

    Args:
        sources: Directory of a run or a sweep, or a folder with runs, finished or not; or a .csv
            file that this command wrote.
        view: curve: best score so far, with bands over seeds; scores: that of every run, with means
            and intervals; pareto: scores against cost; ranks: mean rank of each condition;
            validity: how many trajectories got how far.
        by: Horizontal axis of curve and pareto.
        out: File to write: .pdf, .svg or .png; or .csv for the numbers themselves.
    """
    from agentflow.notebook.figures.plot import plot as draw

    draw(*sources, view=view, by=by, out=out)
    print(out)
