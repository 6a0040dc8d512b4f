"""The command mcp. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.root import Settings, commands
from agentflow.errors import ConfigError, UsageError


@commands.command(epilog="Example: agentflow mcp --task throwing")
def mcp(
    task: Annotated[str, typer.Option(help="Task, such as throwing or movement/3.")] = "throwing",
    rollouts: Annotated[int, typer.Option(min=1, help="Simulations of a session.")] = 24,
    looks: Annotated[int, typer.Option(min=1, help="Pictures of a session.")] = 24,
    no_vision: Annotated[
        bool, typer.Option("--no-vision", help="Offer no pictures (tool `look`).")
    ] = False,
    stages: Annotated[
        bool,
        typer.Option(
            "--stages",
            help="Let agents design in three stages, of which only the last has simulations, and "
            "submit up to 8 machines in each. By default, they simulate at once and submit one.",
        ),
    ] = False,
    settings: Settings = None,
    out: Annotated[Path, typer.Option(help="Parent directory for runs.")] = Path("runs"),
    http: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve any number of agents over HTTP, each with a run of its own; needs "
            "--token-file. By default, serve one over stdin and stdout.",
        ),
    ] = None,
    token_file: Annotated[
        Path | None,
        typer.Option(help="File with the token that agents must send; created if missing."),
    ] = None,
) -> None:
    """Give coding agents the tools to design a machine, over the Model Context Protocol (MCP).

    Agents such as Claude Code, Codex and VS Code start this command themselves (docs/tools.md).
    What an agent does is a run, like those of `agentflow design`.
    """
    if (http is None) != (token_file is None):
        raise UsageError(
            "--http and --token-file need each other: agents over HTTP must send a token, and "
            "those over stdin and stdout need none"
        )
    try:
        from agentflow.integrations.mcp.serving import serve
    except ModuleNotFoundError as error:
        library = str(error.name).partition(".")[0]
        raise ConfigError(
            f"{library} is not installed; install it with: pip install 'agentflow[mcp]'"
        ) from None
    from agentflow.app.design.config import load_config
    from agentflow.cli.display.live import print_line
    from agentflow.config.run import PROCEDURAL
    from agentflow.integrations.mcp.addresses import HttpAddress, read_token
    from agentflow.runs.places import FEEDBACK, STAGES

    one_machine = [] if stages else ["candidates_per_stage=1"]
    options = {
        "task": task,
        "workflow": "tools",
        "model.name": PROCEDURAL,  # which nobody asks: the agent designs
        "settings.rollouts": rollouts,
        "settings.looks": looks,
        "settings.vision": not no_vision,
    }
    config = load_config(None, [*one_machine, *(settings or ())], options)
    address = None if http is None else HttpAddress.parse(http)
    token = "" if token_file is None else read_token(token_file)
    order = STAGES if stages else (FEEDBACK,)
    serve(config, out, order, lambda line: print_line(f"agentflow: {line}"), address, token)
