"""The commands study segments, elan and metrics. Importing this module registers them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.display.text import show_count
from agentflow.cli.root import (
    BaseUrl,
    Format,
    Json,
    ModelName,
    Settings,
    commands,
    needs_extra,
    print_json,
    print_table,
)

study = typer.Typer(
    help="Study how people design, from the sessions that the studio records.",
    epilog="Example: agentflow study metrics runs/sessions",
    no_args_is_help=True,
    rich_markup_mode=None,
)
commands.add_typer(study, name="study")
EXTRA = "study"

SessionPath = Annotated[
    Path, typer.Argument(metavar="SESSION", help="Session: a folder with session.jsonl.")
]


@study.command(epilog="Example: agentflow study segments runs/sessions/one --transcript one.vtt")
def segments(
    session: SessionPath,
    transcript: Annotated[
        Path | None,
        typer.Option(help="What was said, with times: a .vtt or .srt file."),
    ] = None,
    model: ModelName = None,
    base_url: BaseUrl = None,
    settings: Settings = None,
    form: Format = "text",
    as_json: Json = False,
) -> None:
    """Cut a session into labelled episodes.

    Labels are Plan, Hypothesize, Build, Test, Observe, Diagnose, Revise, Restructure, Reflect and
    Query. The result is episodes.json in the folder of the session. The procedural model labels by
    rules on actions; a language model gets the actions, notes and transcript of the session.
    """
    from agentflow.app.design.config import load_config
    from agentflow.cli.display.live import print_line

    with needs_extra(EXTRA):
        from agentflow.study.segments import format_segments, segment

    config = load_config(None, settings or (), {"model.name": model, "model.base_url": base_url})
    found = segment(
        session,
        transcript,
        config,
        notify=lambda line: print_line(f"agentflow: {line}"),
        say=show_count("episode"),
    )
    if as_json:
        print_json(found.model_dump(mode="json"))
        return
    print_table(format_segments(found, form), form)


@study.command(epilog="Example: agentflow study elan runs/sessions/one")
def elan(
    session: SessionPath,
    out: Annotated[
        Path | None,
        typer.Option(help="File to write.", show_default="session.eaf in that folder"),
    ] = None,
) -> None:
    """Write a session as a file for the annotation program ELAN.

    Labels, episodes, speech, notes, actions, trials and pauses have a tier each.
    """
    from agentflow.study.session import read_session

    found = read_session(session)
    with needs_extra(EXTRA):
        from agentflow.study.elan import write_elan

        print(write_elan(found, out or found.path / "session.eaf"))


@study.command(epilog="Example: agentflow study metrics runs/sessions runs/recorded-throwing")
def metrics(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="SOURCE...", help="Session, run, or directory that contains some."),
    ],
    form: Format = "text",
    as_json: Json = False,
) -> None:
    """Compare sessions of people and runs of agents.

    One row per session or run: scores, behaviour, use of time, type of design, clusters. Sessions
    without episodes.json are labelled by rules. The rules of all columns are in docs/study.md.
    """
    with needs_extra(EXTRA):
        from agentflow.study.results import format_results, measure

        results = measure(sources)
    if as_json:
        print_json({"sources": [result.to_json() for result in results]})
        return
    print_table(format_results(results, form), form)
