"""The commands study segments, elan and metrics. Importing this module registers them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.display.text import show_count
from agentflow.cli.root import print_json, print_sources, print_table, subcommands
from agentflow.extras import needs_extra

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
        from agentflow.study.segments import format_segments, segment

    config = load_config(None, settings or (), {"model.name": model, "model.base_url": base_url})
    found = segment(
        session,
        transcript,
        config,
        notify=print_remark,
        say=show_count("episode"),
    )
    if as_json:
        print_json(found.model_dump(mode="json"))
        return
    print_table(format_segments(found, form), form)


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
        from agentflow.study.results import format_results, measure

        results = measure(sources)
    print_sources(results, form, as_json, format_results)
