"""The commands on what has been kept: runs, show, rescore, failures, and the configuration.

Importing it adds them to the others.
"""

from __future__ import annotations

import typer

from agentflow.cli.commands import Config, Json, Settings, _print_json, commands

config_commands = typer.Typer(
    help="Look at configurations.", no_args_is_help=True, rich_markup_mode=None
)
commands.add_typer(config_commands, name="config")


@config_commands.command(
    "show", epilog="Example: agentflow config show --set search.rounds=2 --set wall.height=0"
)
def show_config(config: Config = None, settings: Settings = None, as_json: Json = False) -> None:
    """Print the configuration of a run, and of every value where it came from.

    Default, file, --set or environment; what is printed is a configuration file itself.
    """
    from agentflow.app.configuration import as_yaml, resolved

    found = resolved(config, settings or ())
    if as_json:
        _print_json(found)
    else:
        print(as_yaml(found))
