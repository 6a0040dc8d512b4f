"""The root command, and how commands print results.

Heavy imports happen inside the commands that need them.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand

from agentflow.cli.display.text import escape_controls
from agentflow.docstrings import split_docstring
from agentflow.errors import UsageError
from agentflow.metrics.tables import FORMATS, Table
from agentflow.version import __version__

Command = TypeVar("Command", bound=Callable[..., None])


class Documented(TyperCommand):
    """A command whose docstring describes its own options and arguments, under `Args:`.

    Those of several commands, whose help is made, or that have it with their type keep it.
    """

    def __init__(self, name: str | None, *, params: list[Any], help: str, **rest: Any) -> None:
        about, told = split_docstring(help)
        for each in params:
            if not each.help:
                each.help, each.secondary_opts = told[each.name], []  # no --no-... beside a flag
        super().__init__(name, params=params, help=about, **rest)


class Commands(typer.Typer):
    """Commands that are `Documented`."""

    def command(self, name: str | None = None, **settings: Any) -> Callable[[Command], Command]:
        """Decorate a function that is a command."""
        return super().command(name, cls=Documented, **settings)


commands = Commands(
    name="agentflow",
    help="Language models design machines; physics decides whether they work.",
    epilog="Example: agentflow design --task movement --seed 3",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def subcommands(name: str, *, help: str, epilog: str) -> Commands:
    """Add a command that has commands of its own, such as `study`."""
    group = Commands(help=help, epilog=epilog, no_args_is_help=True, rich_markup_mode=None)
    commands.add_typer(group, name=name)
    return group


PARTLY = 3
"""Exit status: some of several runs failed."""


def approve(sentence: str) -> bool:
    """Ask on a terminal whether to allow what a sentence says; elsewhere, do not allow it."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    return typer.confirm(f"{escape_controls(sentence)}. Allow it?", err=True)


def allow(_sentence: str) -> bool:
    """Allow everything, as `--trust` does."""
    return True


def level_of(task: str | None, knobs: list[str] | None, engine: str | None = None) -> Any:
    """The task that options name; None if they name none.

    Raises:
        UsageError: There are knobs without a task, or one of the three does not exist.
    """
    if task is None:
        if knobs:
            raise UsageError("--set changes a knob of a task; name the task with --task")
        return None
    from agentflow.app.tasks import find_task

    return find_task(task, knobs or (), engine)


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


def print_table(table: Table | str, form: str) -> None:
    """Print a table, or what is in that format already, as it is, but text for people safely."""
    text = table if isinstance(table, str) else FORMATS[form](table)
    print(escape_controls(text, "\n") if form == "text" else text, end="")


def print_sources(
    results: Sequence[Any], form: str, as_json: bool, table: Callable[..., Table], **further: Any
) -> None:
    """Print what was measured of each source: JSON with `further` beside it, or a table."""
    if as_json:
        print_json({"sources": [result.to_json() for result in results], **further})
    else:
        print_table(table(results), form)


def print_json(value: Any) -> None:
    """Print one line of ASCII JSON and flush it."""
    try:
        text = json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        text = json.dumps(_finite(value), allow_nan=False)
    print(text, flush=True)


def _finite(value: Any) -> Any:
    """Replace NaN and infinities, which JSON does not have, by null."""
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value
