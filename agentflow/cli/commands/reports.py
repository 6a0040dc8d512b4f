"""Commands that write HTML pages: report, compare, gallery. Importing it registers them."""

from pathlib import Path
from typing import Annotated

import typer

from agentflow.app.pages.registry import PAGES, page_of
from agentflow.cli import options
from agentflow.cli.display.text import show_count
from agentflow.cli.root import commands, level_of, print_result

Out = Annotated[
    Path | None, typer.Option(help="Output file; default: report.html in the directory.")
]
Films = Annotated[int, typer.Option(min=0, help="Number of machines to film, best first.")]


@commands.command(epilog="Example: agentflow report runs/recorded-throwing --out report.html")
def report(
    run: Path,
    out: Out = None,
    films: Films = 200,
    workers: options.Workers = 2,
    page: Annotated[
        str | None,
        typer.Option(
            help=f"Kind of page: {', '.join(PAGES.ours)}; default: chosen by the kind of directory."
        ),
    ] = None,
) -> None:
    """Write an HTML report about a run (3D films), a sweep (tables) or training (curves, films).

    Args:
        run: Directory of a run, a sweep or a training run.
    """
    write = PAGES[page or page_of(run)]
    say = show_count("simulation")
    print(write(run, out or run / "report.html", films=films, workers=workers, say=say))


@commands.command(
    epilog="Example: agentflow compare runs/recorded-throwing catapult.json --out compare.html"
)
def compare(
    a: str,
    b: str,
    task: str | None = None,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    seed: int | None = None,
    out: Path | None = None,
    workers: options.Workers = 2,
    as_json: options.Json = False,
) -> None:
    """Compare two machines: which blocks differ, and what both score on the same task.

    Args:
        a: Machine file, or run directory (its best machine).
        b: The other machine file or run directory.
        task: Task on which to simulate both; default: the task of the runs. Without a task, only
            blocks are compared.
        seed: Random seed; default: that of the first run, else 0.
        out: Also write an HTML page with both films to this file.
    """
    from agentflow.app.pages.compare import compare as find_difference
    from agentflow.cli.display.show_machines import show_comparison

    level = level_of(task, knobs, engine)
    found = find_difference(
        (a, b), level, seed, engine, out=out, workers=workers, say=show_count("simulation")
    )
    print_result(found, as_json, show_comparison)


@commands.command(epilog="Example: agentflow gallery runs --out gallery.html")
def gallery(
    runs: list[Path], out: Path = Path("gallery.html"), workers: options.Workers = 2
) -> None:
    """Write an HTML gallery of the best machines, with films and scores.

    Args:
        runs: Run directories, or directories that contain runs.
        out: Output file.
    """
    from agentflow.app.pages.gallery import gallery as write

    print(write(runs, out, workers=workers, say=show_count("simulation")))
