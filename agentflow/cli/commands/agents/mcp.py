"""The command mcp. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import commands
from agentflow.errors import UsageError
from agentflow.extras import needs_extra


@commands.command(epilog="Example: agentflow mcp --task throwing")
def mcp(
    task: Annotated[
        str | None,
        typer.Option(help=options.TASK, show_default="throwing"),
    ] = None,
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
