"""The command line: short typer commands that call `agentflow.app`."""

import os
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from copy import copy
from functools import cache
from importlib import import_module
from typing import Any

from agentflow.cli.display.text import describe_os_error, escape_controls
from agentflow.cli.renamed import update_arguments
from agentflow.config.renamed import RenamedWarning, rename_note
from agentflow.errors import AgentflowError

USAGE, INTERRUPTED = 2, 130
MODULES = (
    "analysis",
    "machines",
    "sweeps",
    "benchmark",
    "design",
    "learning.data",
    "learning.train",
    "agents",
    "records",
    "reports",
    "tasks",
    "verify",
)
"""Modules of `agentflow.cli.commands`; importing one registers its commands, and `agentflow --help`
lists commands in this order."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command, print errors to stderr, and return the exit status.

    0 success, 1 comparison or strict check failed, 2 usage or configuration error, 3 partly failed,
    4 model endpoint unusable, 130 interrupted. Tracebacks only with `--debug`.
    """
    try:
        status = _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        status = None
    return _print_error("interrupted", INTERRUPTED) if status is None else status


@cache
def command_group(whole: str | None = None) -> Any:
    """The click group of all commands.

    Args:
        whole: The command that is used. The others then have their names and first lines only:
            building them all takes longer than most commands.
    """
    import typer

    from agentflow.cli.root import commands

    for name in MODULES:
        import_module(f"agentflow.cli.commands.{name}")
    if whole is None or "_AGENTFLOW_COMPLETE" in os.environ:
        return typer.main.get_command(commands)
    listed = copy(commands)
    listed.registered_commands = [_listed(each, whole) for each in commands.registered_commands]
    listed.registered_groups = [copy(each) for each in commands.registered_groups]
    for group in listed.registered_groups:
        if group.name != whole:
            group.typer_instance = empty = copy(group.typer_instance)
            if empty:
                empty.registered_commands = []
    return typer.main.get_command(listed)


def _listed(command: Any, whole: str) -> Any:
    """A command of typer's as lists show it, unless it is the one that is used."""
    name = command.name or command.callback.__name__.replace("_", "-")
    if name == whole:
        return command
    listed = copy(command)
    listed.name, listed.help = name, command.help or command.callback.__doc__
    listed.callback = lambda: None
    return listed


def _run(given: list[str]) -> int | None:
    """Run a command. Returns its exit status, or None if it was interrupted without a message."""
    import typer

    # Typer carries its own copy of click in some versions and depends on click in others; the
    # base of its public BadParameter is click's UsageError in both.
    usage_error: type[BaseException] = typer.BadParameter.__mro__[1]
    _open_closed_streams()
    debug = "--debug" in given
    try:
        rest, renamed = update_arguments([item for item in given if item != "--debug"])
        for earlier, now in renamed:
            _print_note(rename_note(earlier, now))
        with _renames_as_notes():
            used = next((item for item in rest if not item.startswith("-")), "")
            status = command_group(used)(args=rest, prog_name="agentflow", standalone_mode=False)
        sys.stdout.flush()
        if status == INTERRUPTED:  # some versions of typer return this on Ctrl-C
            return None
        return status if isinstance(status, int) else 0
    except typer.Abort:
        return None
    except (BrokenPipeError, SystemExit):  # nothing reads the output any more
        return _give_up_output(0)
    except OSError as error:
        if debug:
            traceback.print_exc()
        _print_error(describe_os_error(error), USAGE)
        return _give_up_output(USAGE)
    except usage_error as error:
        return _print_usage_error(error)
    except AgentflowError as error:
        if debug:
            traceback.print_exc()
        return _print_error(str(error), error.exit_status)


def _open_closed_streams() -> None:
    """Lead streams that are closed to the null device.

    Otherwise later files would take their descriptors, and libraries that write to them, or
    redirect them for a while, would write into those files or fail.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor, which is this one
            os.set_inheritable(descriptor, True)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


@contextmanager
def _renames_as_notes() -> Iterator[None]:
    """Show warnings of earlier names in one line, once each; others as Python does."""

    def show(message: Warning | str, category: type[Warning], *place: Any, **options: Any) -> None:
        if issubclass(category, RenamedWarning):
            _print_note(str(message))
        else:
            others(message, category, *place, **options)

    with warnings.catch_warnings():
        others, warnings.showwarning = warnings.showwarning, show
        warnings.simplefilter("once", RenamedWarning)
        yield


def _print_note(text: str) -> None:
    with suppress(OSError, ValueError):  # stderr is closed
        print("agentflow: note:", escape_controls(text), file=sys.stderr, flush=True)


def _print_usage_error(error: BaseException) -> int:
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "agentflow"
    message = getattr(error, "format_message", error.__str__)()
    if message.startswith("Usage:"):  # a group without a command prints its help
        print(message, file=sys.stderr)
        return USAGE
    message = message.replace("Value error, ", "")  # added by pydantic in some versions of typer
    return _print_error(f"{message.rstrip('.?')}. Try '{command} --help'.", USAGE)


def _print_error(message: str, status: int) -> int:
    with suppress(OSError, ValueError):  # stderr is closed
        print("agentflow:", escape_controls(message, "\n"), file=sys.stderr, flush=True)
    return status


def _give_up_output(status: int) -> int:
    """Redirect stdout to /dev/null; otherwise Python would report the error again at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status
