"""Commands where others design: bench, mcp, studio. Importing this module registers them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import commands, print_json, subcommands
from agentflow.errors import UsageError
from agentflow.extras import needs_extra

if TYPE_CHECKING:
    from agentflow.app.sessions.shell import Answer

bench = subcommands(
    "bench",
    help="Design a machine with one command per step, such as check, simulate and submit.",
    epilog="Example: agentflow bench start --task throwing",
)
TOOLS: Mapping[str, Mapping[str, str]] = json.loads(
    files(__package__).joinpath("bench.json").read_text("utf-8")
)
"""Tool -> help and arguments of an example; `agentflow --help` must not load the tools."""
Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[NAME=]VALUE",
        help="Arguments, in the order above or with their names: text, or JSON for lists and "
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
    rollouts: Annotated[int | None, typer.Option(min=1, show_default="24")] = None,
    settings: options.Settings = None,
    out: options.RunsFolder = Path("runs"),
    name: str = "",
    as_json: options.Json = False,
) -> None:
    """Begin a run and show its task. The other commands go on with it until `submit`.

    Args:
        rollouts: Simulations of the run.
        name: Name of the run directory.
    """
    from agentflow.app.sessions.clients import session_config
    from agentflow.app.sessions.shell import start as begin
    from agentflow.cli.display.live import print_remark

    keys = {"task": task, "settings.max_simulations": rollouts}
    config = session_config(settings or (), keys)
    begun = begin(config, out, name, print_remark)
    print_remark(f"this run is {begun.run}")
    _show(begun, as_json, None)


def _call(
    tool: str, words: list[str] | None, run: Path | None, picture: Path | None, as_json: bool
) -> None:
    from agentflow.app.sessions.shell import call, find_run, read_arguments
    from agentflow.cli.display.live import print_remark, watch_simulations

    arguments = read_arguments(tool, words or ())
    path = run or find_run(Path("runs"))
    with watch_simulations():
        answer = call(path, tool, arguments, print_remark)
    _show(answer, as_json, picture)


def _command(tool: str) -> Callable[..., None]:
    def command(words: Words = None, run: Run = None, as_json: options.Json = False) -> None:
        _call(tool, words, run, None, as_json)

    def look(
        words: Words = None, run: Run = None, picture: Picture = None, as_json: options.Json = False
    ) -> None:
        _call(tool, words, run, picture, as_json)

    return look if tool == "look" else command


for _tool, _told in TOOLS.items():
    _name = _tool.replace("_", "-")
    _words = f"Example: agentflow bench {_name} {_told['example']}".rstrip()
    bench.command(_name, help=_told["help"], epilog=_words)(_command(_tool))


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


@commands.command(epilog="Example: agentflow mcp --task throwing")
def mcp(
    task: Annotated[str | None, typer.Option(help=options.TASK, show_default="throwing")] = None,
    rollouts: Annotated[int | None, typer.Option(min=1, show_default="24")] = None,
    max_pictures: Annotated[int | None, typer.Option(min=1, show_default="24")] = None,
    no_vision: bool = False,
    stages: bool = False,
    settings: options.Settings = None,
    out: options.RunsFolder = Path("runs"),
    http: Annotated[str | None, typer.Option(metavar="HOST:PORT")] = None,
    token_file: Path | None = None,
) -> None:
    """Give coding agents the tools to design a machine, over the Model Context Protocol (MCP).

    Agents such as Claude Code, Codex and VS Code start this command themselves: see
    docs/how-to/mcp.md. The work of an agent is a run, like those of `agentflow design`.

    Args:
        rollouts: Simulations of a session.
        max_pictures: Pictures of a session.
        no_vision: Offer no pictures (tool `look`).
        stages: Let agents design in three stages, of which only the last has simulations, and
            submit up to 8 machines in each. By default, they simulate at once and submit one.
        http: Serve any number of agents over HTTP, each with a run of its own; needs --token-file.
            By default, serve one over stdin and stdout.
        token_file: File with the token that agents must send; created if missing.
    """
    if (http is None) != (token_file is None):
        raise UsageError(
            "--http and --token-file go together: agents over HTTP must send a token, and "
            "those over stdin and stdout need none"
        )
    with needs_extra("mcp"):
        from agentflow.integrations.mcp.serving import serve
    from agentflow.app.sessions.clients import session_config
    from agentflow.cli.display.live import print_remark
    from agentflow.integrations.mcp.addresses import HttpAddress, read_token
    from agentflow.runs.locations import FEEDBACK, STAGES

    keys = {
        "task": task,
        "settings.max_simulations": rollouts,
        "settings.max_pictures": max_pictures,
        "settings.vision": False if no_vision else None,
    }
    config = session_config(settings or (), keys, stages=stages)
    address = None if http is None else HttpAddress.parse(http)
    token = "" if token_file is None else read_token(token_file)
    order = STAGES if stages else (FEEDBACK,)
    serve(config, out, order, print_remark, address, token)


@commands.command(epilog="Example: agentflow studio --runs runs")
def studio(
    runs: Path = Path("runs"), port: Annotated[int | None, typer.Option(min=0, max=65535)] = None
) -> None:
    """Open a local page to watch runs, start them, and build machines by hand.

    The printed address opens it in one browser, once. Nothing leaves this computer unless you name
    a model endpoint. Only the directory of runs is read and written.

    Args:
        runs: Directory of the runs to show and to add to.
        port: Port on 127.0.0.1; 0 is any free one. Without one, it is the same each time for a
            directory of runs, if it is free.
    """
    if runs.exists() and not runs.is_dir():
        raise UsageError(f"{runs} is not a directory; name the directory of your runs with --runs")
    with needs_extra("studio"):
        from agentflow.studio.app import serve
    serve(runs, port, lambda address: print(address, flush=True))
