"""The commands that write pages: report and gallery. Importing it adds them to the others."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.root import commands

Out = Annotated[Path | None, typer.Option(help="File to write; by default report.html in the run.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes for rollouts.")]
Films = Annotated[int, typer.Option(min=0, help="Machines with a film, the best ones first.")]


@commands.command(epilog="Example: agentflow report runs/recorded-throwing --out report.html")
def report(
    run: Annotated[Path, typer.Argument(help="Run directory, or the folder of a sweep.")],
    out: Out = None,
    films: Films = 200,
    workers: Workers = 2,
) -> None:
    """Write one HTML page: of a run with films in 3D, of a sweep with its tables."""
    from agentflow.app.pages.runs import report as of_run
    from agentflow.app.pages.sweeps import sweep_report as of_sweep
    from agentflow.app.sweeps.folder import is_sweep

    file = out or run / "report.html"
    if is_sweep(run):
        print(of_sweep(run, file))
    else:
        print(of_run(run, file, films=films, workers=workers, say=_progress))


def _progress(done: int, of: int) -> None:
    if sys.stderr.isatty():
        end = "\n" if done == of else "\r"
        print(f"agentflow: film {done} of {of}", end=end, file=sys.stderr, flush=True)


@commands.command(epilog="Example: agentflow gallery runs --out gallery.html")
def gallery(
    runs: Annotated[list[Path], typer.Argument(help="Run directories, or folders of them.")],
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("gallery.html"),
    workers: Workers = 2,
) -> None:
    """Write one HTML page of the machines that runs have found, with films and scores."""
    from agentflow.app.pages.gallery import gallery as write

    print(write(runs, out, workers=workers, say=_progress))
