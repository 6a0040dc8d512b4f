"""A bench for the shell: each command is a process that goes on with one run, from its record."""

import asyncio
import json
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import Any

from agentflow.app.design.plan import AUTHOR
from agentflow.app.design.run import DesignRun, RunOptions
from agentflow.app.sessions.clients import summarise_end
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.pool.store import Store
from agentflow.errors import RunError, UsageError
from agentflow.files.atomic import write_file
from agentflow.machine.formats.detect import read_text
from agentflow.runs import Notify, read_document, read_result, state_of
from agentflow.runs.locations import FEEDBACK, StageName
from agentflow.tools import Bench, ToolResult
from agentflow.tools.bench import TOOLS
from agentflow.workflows.tools import repetition_of

WORKER = "agent at the shell"
"""Who designs, as results name it."""
KEPT = "bench"
"""Folder in an unfinished run where its rollouts are kept from one command to the next."""
STDIN, FILE = "-", "@"
"""A value that is read from standard input, and what stands before the path of one."""
_SPECS = {tool.spec.name: tool.spec for tool in TOOLS}


@dataclass(frozen=True)
class Answer:
    """What a command has done."""

    run: Path
    result: ToolResult
    end: str = ""
    """How the run ended, if it has."""


class _Paused(Exception):
    """The stage goes on in a later command."""


def start(config: DesignConfig, out: Path, name: str, notify: Notify) -> Answer:
    """Begin a run, and return its brief; see `DesignRun.create`."""
    run = DesignRun.create(config, out, _options(asked := _Call("brief", {}), notify), name)
    return _carry_out(run, asked)


def call(path: Path, tool: str, arguments: Mapping[str, Any], notify: Notify) -> Answer:
    """Call a tool in an unfinished run.

    Raises:
        RunError: It was not begun by `start`, is finished, or another command works there.
    """
    if read_document(path).get(AUTHOR) != WORKER:
        raise RunError(f"{path} was not begun with `agentflow bench start`; begin one with that")
    if state_of(path) == "done":
        raise RunError(summarise_end(read_result(path)))
    asked = _Call(tool, arguments)
    return _carry_out(DesignRun.reopen(path, _options(asked, notify)), asked)


def save_picture(answer: Answer, path: Path | None) -> Path:
    """Write the picture of an answer to a file, by default look.png in the run; the file.

    Raises:
        UsageError: It cannot be written.
    """
    assert answer.result.image is not None
    path = path or answer.run / "look.png"
    write_file(path, answer.result.image)
    return path


def find_run(out: Path) -> Path:
    """The only unfinished run of a bench at the shell below a folder.

    Raises:
        UsageError: There is none, or there are several.
    """
    found = []
    for path in sorted(out.iterdir()) if out.is_dir() else ():
        with suppress(UsageError):
            if read_document(path).get(AUTHOR) == WORKER and state_of(path) != "done":
                found.append(path)
    if len(found) == 1:
        return found[0]
    if not found:
        raise UsageError(f"{out} has no unfinished run; begin one with: agentflow bench start")
    listed = ", ".join(quote(str(path)) for path in found)
    raise UsageError(f"{out} has several unfinished runs; name one with --run: {listed}")


def read_arguments(tool: str, words: Sequence[str]) -> Mapping[str, Any]:
    """The arguments of a tool from words `NAME=VALUE`; a word without a name is the first argument.

    A value is text, or JSON where the tool takes something else; `@FILE` is the text of a file, and
    `-` that of standard input.

    Raises:
        UsageError: A word has no place, or a file cannot be read.
    """
    properties: Mapping[str, Any] = _SPECS[tool].parameters["properties"]
    given: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if name not in properties or not equals:
            name, value = next((key for key in properties if key not in given), ""), word
        if not name:
            takes = ", ".join(properties) or "no arguments"
            raise UsageError(f"{tool} takes {takes}; {word[:80]!r} is none of these")
        if value == STDIN or value.startswith(FILE):
            value = read_text(value.removeprefix(FILE))
        given[name] = _value(value, properties[name])
    return given


def _value(text: str, schema: Mapping[str, Any]) -> Any:
    """Text, or the JSON in it where the schema has no text or the text is a list."""
    kinds = {item.get("type") for item in schema.get("anyOf", [schema])}
    if "string" in kinds and not ("array" in kinds and text.lstrip().startswith("[")):
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text  # which the tool refuses, saying what it takes


@dataclass
class _Call:
    """A call of a tool, and its answer once there is one."""

    tool: str
    arguments: Mapping[str, Any]
    result: ToolResult | None = None

    async def work(self, bench: Bench, _stage: StageName) -> None:
        """Make the call; the stage goes on in a later command unless that ended it."""
        self.result = await bench.call(self.tool, self.arguments)
        if not bench.ended:
            raise _Paused


def _options(asked: _Call, notify: Notify) -> RunOptions:
    work = repetition_of(WORKER, (FEEDBACK,), asked.work)
    return RunOptions(notify, again="then give this command again", workflow=work)


def _carry_out(run: DesignRun, asked: _Call) -> Answer:
    """Do again what is recorded, from stored rollouts, then the call, then the end if it is one."""
    path = run.directory.path

    async def go_on() -> str:
        async with RolloutPool(run.plan.config.workers) as pool:
            store = Store(path / KEPT, pool)
            work = replace(run, options=replace(run.options, pool=store))
            return summarise_end(await work.carry_out())

    end = ""
    with suppress(_Paused):
        end = asyncio.run(go_on())
        shutil.rmtree(path / KEPT)
    # Without one, an earlier command was killed between its last submission and the result.
    return Answer(
        path, asked.result or ToolResult("The last machine was submitted before.", {}), end
    )
