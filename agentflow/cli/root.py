"""The root command, options shared by several commands, and JSON output.

Heavy imports happen inside the commands that need them.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from agentflow import __version__
from agentflow.cli.display.text import escape_controls
from agentflow.errors import ConfigError

commands = typer.Typer(
    name="agentflow",
    help="Language models design machines; physics decides whether they work.",
    epilog="Example: agentflow design --task movement --seed 3",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

PARTLY = 3
"""Exit status: some of several runs failed."""

Knobs = Annotated[
    list[str] | None,
    typer.Option(
        "--set", help="Set a knob (an adjustable parameter of the task), knob=value; repeatable."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print only JSON to stdout.")]
Format = Annotated[
    Literal["text", "md", "csv", "latex"], typer.Option("--format", help="Output format.")
]
FormatOrJson = Annotated[
    Literal["text", "md", "csv", "latex", "json"], typer.Option("--format", help="Output format.")
]
Published = Annotated[
    bool,
    typer.Option("--published", help="Add the published values of other models as separate rows."),
]
Run = Annotated[Path, typer.Argument(help="Run directory.")]
ModelName = Annotated[
    str | None,
    typer.Option(
        "--model",
        help="Model name (default: AGENTFLOW_MODEL, else procedural: rules and random choices).",
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(help="URL of an OpenAI-compatible endpoint. Its key is read from OPENAI_API_KEY."),
]
Config = Annotated[Path | None, typer.Option(help="YAML configuration file.")]
Engine = Annotated[
    str | None,
    typer.Option(
        "--engine",
        help="Physics engine: auto (the first that is installed), pybullet or mujoco.",
    ),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Send prompts and keys where the given file or directory says, and run the program "
        "that it says, even if you have not named them.",
    ),
]
On = Annotated[
    Literal["local", "ray"],
    typer.Option(
        "--on",
        help="Where to simulate: local (worker processes on this machine) or ray (a Ray cluster: "
        "that at RAY_ADDRESS, else one on this machine).",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Suppress progress and notices.")]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a configuration key or a knob (an adjustable parameter of the task), "
        "key=value; repeatable.",
    ),
]


def approve(sentence: str) -> bool:
    """Ask on a terminal whether to allow what a sentence says; elsewhere, do not allow it."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    return typer.confirm(f"{escape_controls(sentence)}. Allow it?", err=True)


def allow(_sentence: str) -> bool:
    """Allow everything, as `--trust` does."""
    return True


@contextmanager
def needs_extra(name: str, *apart: str) -> Iterator[None]:
    """Tell how to install what is missing: an extra of agentflow, or a library `apart` from it."""
    try:
        yield
    except ModuleNotFoundError as error:
        library = str(error.name).partition(".")[0]
        what = library if library in apart else f"'agentflow[{name}]'"
        raise ConfigError(
            f"{library} is not installed; install it with: pip install {what}"
        ) from None


def _version(wanted: bool) -> None:
    if wanted:
        print(f"agentflow {__version__}")
        raise typer.Exit


@commands.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Print tracebacks of errors.")] = False,
) -> None:
    """Options of all commands. `--debug` may come anywhere; cli.main reads it."""


def print_result(value: Any, as_json: bool, show: Callable[[Any], object]) -> None:
    """Print a result as JSON, or with `show` for people."""
    if as_json:
        print_json(value)
    else:
        show(value)


def print_table(text: str, form: str) -> None:
    """Print a table in one of the formats of `Format` as it is, but text for people safely."""
    print(escape_controls(text, "\n") if form == "text" else text, end="")


def print_json(value: Any) -> None:
    """Print one line of ASCII JSON and flush it."""
    print(json.dumps(_finite(value), allow_nan=False), flush=True)


def _finite(value: Any) -> Any:
    """Replace NaN and infinities, which JSON does not have, by null."""
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value
