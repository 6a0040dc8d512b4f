"""The command line: typer commands, a few lines each; the work is app's.

`main` turns every error of ours into one or two lines on stderr and an exit status (spec 6.5).
"""

from __future__ import annotations

import os
import sys
import traceback
from contextlib import suppress
from functools import cache
from importlib import import_module
from typing import Any

from agentflow.cli.display.text import harmless, refusal
from agentflow.errors import AgentflowError

USAGE, INTERRUPTED = 2, 130
MODULES = ("design", "machines", "prompts", "records", "reports", "sweeps", "tasks")
"""Importing one adds its commands to the others."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command and return the exit status.

    0 done, 1 comparison failed, 2 usage or configuration, 3 partly failed, 4 the model endpoint
    cannot be used, 130 interrupted. No traceback unless `--debug` is given.
    """
    try:
        status = _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        status = None
    return _say("interrupted", INTERRUPTED) if status is None else status


@cache
def group() -> Any:
    """Every command as the one object that runs them, of click or of typer's copy of it.

    Made once in a process: making it takes longer than most commands.
    """
    import typer

    from agentflow.cli.root import commands

    for name in MODULES:
        import_module(f"agentflow.cli.commands.{name}")
    return typer.main.get_command(commands)


def _run(given: list[str]) -> int | None:
    """The exit status; None when the command was interrupted and has said nothing of it."""
    import typer

    # Typer carries its own copy of click in some versions and depends on click in others; the
    # base of its public BadParameter is click's UsageError in both.
    usage_error: type[BaseException] = typer.BadParameter.__mro__[1]
    if sys.stdout is None:  # closed; what is opened next must not take its number
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    debug = "--debug" in given
    try:
        rest = [item for item in given if item != "--debug"]
        status = group()(args=rest, prog_name="agentflow", standalone_mode=False)
        sys.stdout.flush()
        if status == INTERRUPTED:  # some versions of typer make it of Ctrl-C, others Abort
            return None
        return status if isinstance(status, int) else 0
    except typer.Abort:
        return None
    except (BrokenPipeError, SystemExit):  # who read our output wants no more of it; so says typer
        return _give_up_output(0)
    except OSError as error:
        if debug:
            traceback.print_exc()
        _say(refusal(error), USAGE)
        return _give_up_output(USAGE)
    except usage_error as error:
        return _refuse(error)
    except AgentflowError as error:
        if debug:
            traceback.print_exc()
        return _say(str(error), error.exit_status)


def _refuse(error: BaseException) -> int:
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "agentflow"
    message = getattr(error, "format_message", error.__str__)()
    if message.startswith("Usage:"):  # a group without a command is answered with its help
        print(message, file=sys.stderr)
        return USAGE
    message = message.replace("Value error, ", "")  # of pydantic, by which some typers read values
    return _say(f"{message.rstrip('.?')}. Try '{command} --help'.", USAGE)


def _say(message: str, status: int) -> int:
    with suppress(OSError, ValueError):  # nobody reads; the exit status says it all the same
        print("agentflow:", harmless(message, "\n"), file=sys.stderr, flush=True)
    return status


def _give_up_output(status: int) -> int:
    """Lead standard output nowhere, so that Python does not complain of it once more at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status
