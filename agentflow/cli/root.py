"""Owns the root of all commands, the options that several have, and how they print JSON.

Heavy imports happen inside the commands that need them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

from agentflow import __version__

commands = typer.Typer(
    name="agentflow",
    help="Language models design machines; physics decides whether they work.",
    epilog="Example: agentflow design --task movement --seed 3",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Knobs = Annotated[list[str] | None, typer.Option("--set", help="knob=value of the task.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else on stdout.")]
Run = Annotated[Path, typer.Argument(help="Run directory.")]
ModelName = Annotated[
    str | None, typer.Option("--model", help="Model name; without one, rules and chance answer.")
]
BaseUrl = Annotated[
    str | None, typer.Option(help="OpenAI-compatible endpoint; the key is OPENAI_API_KEY.")
]
Config = Annotated[Path | None, typer.Option(help="YAML file with any of the keys.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Show no progress and no remarks.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="key=value of the configuration, or knob=value of the task."),
]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"agentflow {__version__}")
        raise typer.Exit


@commands.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")] = False,
) -> None:
    """Options of all commands; `--debug` is read in cli.main, wherever it stands."""


def print_json(value: Any) -> None:
    """One line of JSON, at once: who reads lines may wait for each. ASCII, for any terminal."""
    print(json.dumps(_finite(value), allow_nan=False), flush=True)


def _finite(value: Any) -> Any:
    """The value with null for every number that JSON does not know."""
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value
