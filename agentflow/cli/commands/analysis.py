"""Commands that measure: behaviour, diagnose, diversity, figures, studies. Importing this module
registers them."""

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from agentflow.cli import options
from agentflow.cli.display.text import show_count
from agentflow.cli.root import commands, print_json, print_sources, print_table, subcommands
from agentflow.errors import UsageError
from agentflow.extras import needs_extra
from agentflow.notebook.words import By, View

OVERLAP = "overlap"
PAIRS = 77
"""The published accuracies are multiples of 1/77."""
QUESTIONS = 24


@commands.command(epilog="Example: agentflow behaviour runs/language-model-throwing")
def behaviour(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...")],
    form: options.Format = "text",
    as_json: options.Json = False,
) -> None:
    """Show how the designers of runs behave: predictions, repairs, edits, effort.

    One row per source: edits that failed although success was predicted, repairs that keep the
    moving types of a failed machine, how large edits are, errors of predicted scores, and each
    role's share of the tokens. The rules are in docs/reference/behaviour.md.

    Args:
        sources: Run, or directory that contains runs.
    """
    from agentflow.app.inspect.behaviour import observe, results_table

    with needs_extra("diversity"):
        results = observe(sources)
    print_sources(results, form, as_json, results_table)


@commands.command(epilog="Example: agentflow diagnose overlap --model NAME --out overlap")
def diagnose(
    name: Annotated[Literal["overlap", "facing", "outcome"], typer.Argument(metavar="DIAGNOSTIC")],
    out: Annotated[Path, typer.Option()],
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    pairs: Annotated[int | None, typer.Option(min=1, show_default=str(PAIRS))] = None,
    questions: Annotated[int | None, typer.Option(min=1, show_default=str(QUESTIONS))] = None,
    seed: int = 0,
    form: options.Format = "text",
    published: options.Published = False,
    settings: options.Settings = None,
    engine: options.Engine = None,
    workers: options.Workers = 2,
    as_json: options.Json = False,
) -> None:
    """Ask a model what it knows about machines: their geometry, and how they will behave.

    The machines are random ones and designs of the built-in model. Replies without an answer count
    as wrong.

    Args:
        name: overlap: which blocks overlap. facing: which way blocks face, where their centres are.
            outcome: will the machine stand, drive or throw; judged by simulation.
        out: Directory of the diagnosis; resumed if it exists.
        pairs: Total number of overlapping pairs, for overlap.
        questions: Questions, for facing and outcome.
        seed: Random seed of the questions.
    """
    from agentflow.app.design.config import load_config
    from agentflow.app.diagnose.results import published_accuracies, require_published, table_of
    from agentflow.app.diagnose.run import diagnose as carry_out
    from agentflow.cli.display.live import print_remark

    if published:
        require_published(name)
    keys = {
        "model.name": model,
        "model.base_url": base_url,
        "seed": seed,
        "engine": engine,
        "workers": workers,
    }
    found = carry_out(
        name,
        load_config(None, settings or (), keys),
        _size(name, pairs, questions),
        out,
        notify=print_remark,
        say=show_count("question"),
    )
    if as_json:
        about = found.model_dump(mode="json", exclude={"results", "answers"})
        known = {"published": published_accuracies()} if published else {}
        print_json({**about, **(found.results or {}), **known})
        return
    print_table(table_of(found, published=published), form)


def _size(name: str, pairs: int | None, questions: int | None) -> int:
    """Pairs of the diagnostic overlap, or questions of the others; the other option is refused."""
    if name == OVERLAP:
        if questions is not None:
            raise UsageError(f"--questions does not apply to {OVERLAP}; use --pairs")
        return pairs or PAIRS
    if pairs is not None:
        raise UsageError(f"--pairs does not apply to {name}; use --questions")
    return questions or QUESTIONS


@commands.command(epilog="Example: agentflow diversity runs/recorded-throwing --published")
def diversity(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...")],
    valid: bool = False,
    most: Annotated[int, typer.Option("--n", min=2)] = 20,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    form: options.Format = "text",
    published: options.Published = False,
    as_json: options.Json = False,
) -> None:
    """Measure how different the machines of a source are from each other.

    Two measures compare surfaces (Chamfer and Hausdorff distance), one volumes (IoU), and two the
    trees of blocks (graph similarity, tree edit distance). Each is a mean over all pairs.

    Args:
        sources: Run, sweep, training run (one row per step), or folder of .json or .bsg files.
        valid: Leave out invalid machines.
        most: Machines of each source; if it has more, a random sample is used.
        seed: Random seed of samples, embedding and intervals.
    """
    from agentflow.app.diversity.results import measure_sources, published_json, results_table

    # the extra leaves gensim out on Python 3.14, where it must be compiled
    with needs_extra("diversity", "gensim"):
        results = measure_sources(sources, valid, most, seed, show_count("pair"))
    known = {"published": published_json()} if published else {}
    print_sources(results, form, as_json, partial(results_table, published=published), **known)


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


study = subcommands(
    "study",
    help="Study how people design, from the sessions that the studio records.",
    epilog="Example: agentflow study metrics runs/sessions",
)
EXTRA = "study"

SessionPath = Annotated[
    Path, typer.Argument(metavar="SESSION", help="Session: a folder with session.jsonl.")
]


@study.command(epilog="Example: agentflow study segments runs/sessions/one --transcript one.vtt")
def segments(
    session: SessionPath,
    transcript: Path | None = None,
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    settings: options.Settings = None,
    form: options.Format = "text",
    as_json: options.Json = False,
) -> None:
    """Cut a session into labelled episodes.

    Labels are Plan, Hypothesize, Build, Test, Observe, Diagnose, Revise, Restructure, Reflect and
    Query. The result is episodes.json in the folder of the session. The procedural model labels by
    rules on actions; a language model gets the actions, notes and transcript of the session.

    Args:
        transcript: What was said, with times: a .vtt or .srt file.
    """
    from agentflow.app.design.config import load_config
    from agentflow.cli.display.live import print_remark

    with needs_extra(EXTRA):
        from agentflow.study.segments import segment, table_of

    config = load_config(None, settings or (), {"model.name": model, "model.base_url": base_url})
    found = segment(session, transcript, config, notify=print_remark, say=show_count("episode"))
    if as_json:
        print_json(found.model_dump(mode="json"))
        return
    print_table(table_of(found), form)


@study.command(epilog="Example: agentflow study elan runs/sessions/one")
def elan(
    session: SessionPath,
    out: Annotated[Path | None, typer.Option(show_default="session.eaf in that folder")] = None,
) -> None:
    """Write a session as a file for the annotation program ELAN.

    Labels, episodes, speech, notes, actions, trials and pauses each have a tier.

    Args:
        out: File to write.
    """
    from agentflow.study.session import read_session

    found = read_session(session)
    with needs_extra(EXTRA):
        from agentflow.study.elan import write_elan

        print(write_elan(found, out or found.path / "session.eaf"))


@study.command(epilog="Example: agentflow study metrics runs/sessions runs/recorded-throwing")
def metrics(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...")],
    form: options.Format = "text",
    as_json: options.Json = False,
) -> None:
    """Compare sessions of people and runs of agents.

    One row per session or run: scores, behaviour, use of time, type of design, clusters. Sessions
    without episodes.json are labelled by rules. docs/how-to/studies.md explains the columns.

    Args:
        sources: Session, run, or directory that contains some.
    """
    with needs_extra(EXTRA):
        from agentflow.study.results import measure, results_table

        results = measure(sources)
    print_sources(results, form, as_json, results_table)
