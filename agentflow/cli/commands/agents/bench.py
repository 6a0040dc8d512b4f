"""The commands of `agentflow bench`. Importing this module registers them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import print_json, subcommands

if TYPE_CHECKING:
    from agentflow.app.sessions.shell import Answer

bench = subcommands(
    "bench",
    help="Design a machine with one command per step, such as check, simulate and submit.",
    epilog="Example: agentflow bench start --task throwing",
)
TOOLS = {
    "brief": "Show the task, the blocks, the rules and the budget.",
    "check": "Check a machine, such as @machine.json, and give it a name.",
    "describe": "Show where the blocks of a machine are, and which faces are free.",
    "edit": "Change a machine: its name, then edit commands, such as 'Remove 6' or @edits.txt.",
    "simulate": "Simulate a machine and show its score and what happened.",
    "verify": "Simulate a machine under small changes, and show how its score holds.",
    "explore_edits": "Simulate single random edits of a machine and show what each gains.",
    "tune": "Improve the numbers of a machine's controls by simulations.",
    "query": "Show recorded states of blocks: the name of a machine, then queries as JSON.",
    "look": "Draw a machine, as built or at times of its simulation.",
    "history": "List the machines so far, with their scores.",
    "submit": "Hand in a machine, which ends the run.",
}
"""Tool -> what its command says; `--help` of `agentflow` must not load the tools themselves."""
Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[NAME=]VALUE",
        help="Arguments of the tool, in its order or with their names: text, or JSON for lists and "
        "numbers; @FILE for the text of a file, - for standard input.",
        show_default=False,
    ),
]
Run = Annotated[
    Path | None,
    typer.Option(
        "--run",
        envvar="AGENTFLOW_RUN",
        help="Run directory; default: the only unfinished one in runs.",
        show_default=False,
    ),
]
Picture = Annotated[
    Path | None,
    typer.Option("--picture", help="File for a picture; default: look.png in the run directory."),
]


@bench.command(epilog="Example: agentflow bench start --task throwing --rollouts 12")
def start(
    task: Annotated[str | None, typer.Option(help=options.TASK, show_default="throwing")] = None,
    rollouts: Annotated[
        int | None, typer.Option(min=1, help="Simulations of the run.", show_default="24")
    ] = None,
    settings: options.Settings = None,
    out: options.RunsFolder = Path("runs"),
    name: Annotated[str, typer.Option(help="Name of the run directory.")] = "",
    as_json: options.Json = False,
) -> None:
    """Begin a run and show its task. The other commands go on with it until `submit`."""
    from agentflow.app.sessions.clients import session_config
    from agentflow.app.sessions.shell import start as begin
    from agentflow.cli.display.live import print_remark

    keys = {"task": task, "settings.max_simulations": rollouts}
    config = session_config(settings or (), keys)
    _show(begin(config, out, name, print_remark), as_json, None)


def _call(
    tool: str, words: list[str] | None, run: Path | None, picture: Path | None, as_json: bool
) -> None:
    from agentflow.app.sessions.shell import call, find_run, read_arguments
    from agentflow.cli.display.live import print_remark

    arguments = read_arguments(tool, words or ())
    _show(call(run or find_run(Path("runs")), tool, arguments, print_remark), as_json, picture)


def _command(tool: str) -> Callable[..., None]:
    def command(words: Words = None, run: Run = None, as_json: options.Json = False) -> None:
        _call(tool, words, run, None, as_json)

    def look(
        words: Words = None,
        run: Run = None,
        picture: Picture = None,
        as_json: options.Json = False,
    ) -> None:
        _call(tool, words, run, picture, as_json)

    return look if tool == "look" else command


for _tool, _about in TOOLS.items():
    _name = _tool.replace("_", "-")
    bench.command(_name, help=_about, epilog=f"Example: agentflow bench {_name}")(_command(_tool))


def _show(answer: Answer, as_json: bool, picture: Path | None) -> None:
    from agentflow.app.sessions.shell import save_picture
    from agentflow.cli.display.text import escape_controls

    data, told = dict(answer.result.data), [answer.result.text]
    data["run"] = str(answer.run)
    if answer.result.image is not None:
        data["picture"] = str(save_picture(answer, picture))
        told.append(f"The picture is in {data['picture']}.")
    if answer.end:
        data["end"] = answer.end
        told.append(answer.end)
    if as_json:
        print_json(data)
    else:
        print(escape_controls("\n\n".join(told), "\n"))
    if answer.result.refused:
        raise typer.Exit(1)
