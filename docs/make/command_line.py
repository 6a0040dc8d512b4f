"""The page on the command line: every command and option, from the tree of commands."""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from agentflow.cli import command_group
from docs.make.markdown import blocks, code, fence, generated, sentence, table

ABOUT = (
    "Every command prints its help with `--help`. Options marked *repeatable* may be given several "
    "times. Exit statuses: 0 success, 1 a comparison or a strict check failed, 2 wrong usage or "
    "configuration, 3 some of several runs failed, 4 the model endpoint cannot be used, "
    "130 interrupted."
)
NAMES = {int: "integer", float: "number", str: "text", Path: "path"}


def page() -> str:
    """The whole page."""
    root = command_group()
    listed = [
        (f"[`{path}`](#{path.replace(' ', '-')})", sentence(command.help.split("\n\n")[0]))
        for path, command in _commands(root, root.name)
        if not _is_group(command)
    ]
    sections = [_section(path, command) for path, command in _commands(root, root.name)]
    options = blocks("## Options of all commands", _parameters(root))
    head = generated("Command line", ABOUT, table(("command", "what it does"), listed))
    return blocks(head, options, *sections) + "\n"


def _commands(group: Any, above: str) -> Iterator[tuple[str, Any]]:
    """Every command below a group with its path, by name."""
    for name, command in sorted(group.commands.items()):
        path = f"{above} {name}"
        yield path, command
        if _is_group(command):
            yield from _commands(command, path)


def _is_group(command: Any) -> bool:
    return hasattr(command, "commands")


def _section(path: str, command: Any) -> str:
    heading = f"{'#' * (path.count(' ') + 1)} {path}"
    about = [sentence(part) for part in inspect.cleandoc(command.help).split("\n\n")]
    if _is_group(command):
        return blocks(heading, *about)
    example = command.epilog.removeprefix("Example: ")
    return blocks(heading, *about, fence("sh", example), _parameters(command))


def _parameters(command: Any) -> str:
    """The arguments and options of a command; types and defaults are those of its function."""
    function = inspect.unwrap(command.callback)
    hints = get_type_hints(function, include_extras=True)
    defaults = {
        name: parameter.default
        for name, parameter in inspect.signature(function).parameters.items()
    }
    rows = [
        (_spelling(item), _type_words(hints[item.name]), _default(defaults[item.name]), item.help)
        for item in command.params
        if item.name in hints
    ]
    return table(("argument or option", "type", "default", "meaning"), rows)


def _spelling(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        name = str(parameter.name).upper()
        return code(f"{name}..." if parameter.nargs == -1 else name)
    return ", ".join(map(code, (*parameter.opts, *parameter.secondary_opts)))


def _type_words(hint: Any) -> str:
    """A type with its range, for a reader."""
    found, *rest = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    info = rest[0] if rest else None
    if get_origin(found) in (Union, types.UnionType):
        found = next(item for item in get_args(found) if item is not type(None))
    if found is bool:
        return "flag"
    if get_origin(found) in (list, tuple):
        return f"{_type_words(get_args(found)[0])}, repeatable"
    if get_origin(found) is Literal:
        return ", ".join(code(str(choice)) for choice in get_args(found))
    return NAMES[found] + _range(info)


def _range(info: Any) -> str:
    low, high = getattr(info, "min", None), getattr(info, "max", None)
    if low is not None and high is not None:
        return f", {low:g} to {high:g}"
    return f", at least {low:g}" if low is not None else ""


def _default(value: Any) -> str:
    if value is inspect.Parameter.empty:
        return "required"
    return "" if value is None or value is False else code(str(value))
