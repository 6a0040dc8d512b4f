"""Commands for prompt sets: list, show, diff. Importing this module registers them."""

from __future__ import annotations

from typing import Annotated

import typer

from agentflow.agents.registry import ROLES
from agentflow.cli import options
from agentflow.cli.root import print_json, subcommands
from agentflow.prompts.registry import PROMPT_SETS

prompts = subcommands(
    "prompts",
    help="Inspect the prompts that models get.",
    epilog="Example: agentflow prompts show --role designer --task throwing",
)

Set = Annotated[str, typer.Argument(help="Prompt set.")]


@prompts.command("list", epilog="Example: agentflow prompts list")
def list_(as_json: options.Json = False) -> None:
    """List the prompt sets and their content hashes."""
    from agentflow.app.prompts import list_prompt_sets

    found = list_prompt_sets()
    if as_json:
        print_json(found)
        return
    for item in found:
        print(f"{item['name']:<12} {item['digest']}  {item['about']}")


@prompts.command(epilog="Example: agentflow prompts show --role refiner --task throwing")
def show(
    role: Annotated[str, typer.Option(help=f"Role: {', '.join(ROLES.ours)}.")] = "designer",
    task: options.NamedTask = "throwing",
    name: Annotated[
        str,
        typer.Option("--prompt-set", help=f"Prompt set to show: {', '.join(PROMPT_SETS.ours)}."),
    ] = "default",
    knobs: Annotated[
        list[str] | None,
        typer.Option("--knob", help=options.SET_KNOB),
    ] = None,
    machine: str | None = None,
    as_json: options.Json = False,
) -> None:
    """Print a prompt exactly as a model gets it, with an estimate of its token count.

    Args:
        machine: Machine to include in the prompt; default: a small example.
    """
    from agentflow.app.machines.files import machine_text
    from agentflow.app.prompts import render_prompt
    from agentflow.app.tasks import find_task

    text = None if machine is None else machine_text(machine)
    found = render_prompt(name, role, find_task(task, knobs or ()).brief, text)
    if as_json:
        print_json(found)
        return
    print(f"--- system\n{found['system']}\n--- user\n{found['user']}")
    print(
        f"--- about {found['tokens']} tokens; prompt set {found['set']}, content hash "
        f"{found['digest']}"
    )


@prompts.command(epilog="Example: agentflow prompts diff default compact")
def diff(first: Set, second: Set) -> None:
    """Compare the templates of two prompt sets."""
    from agentflow.app.prompts import compare_prompt_sets

    print(compare_prompt_sets(first, second) or "identical")
