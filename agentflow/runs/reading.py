"""Reading run directories: run.yaml, events one at a time, calls, machines, state, and lists."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from shlex import quote
from typing import Any, Literal

import yaml
from pydantic import BaseModel, Field, NonNegativeInt, ValidationError

from agentflow.errors import DamagedError, RunError
from agentflow.files.atomic import os_errors
from agentflow.files.chains import Chains
from agentflow.files.documents import break_seal, read_yaml_document, sealed
from agentflow.files.folders import lock_file
from agentflow.files.lines import parse_object, read_lines


class _ToolCall(BaseModel):
    name: str
    arguments: str


class _Message(BaseModel):
    role: str
    text: str
    tool_calls: list[_ToolCall] = []


class _Request(BaseModel):
    role: str
    label: str
    messages: list[_Message] = []
    tools: list[dict[str, Any]] = []


class _Usage(BaseModel):
    prompt: NonNegativeInt
    completion: NonNegativeInt
    reasoning: NonNegativeInt
    cached: NonNegativeInt


class _Reply(BaseModel):
    text: str
    reasoning: str = ""
    reasoning_field: str = ""
    tool_calls: list[_ToolCall] = []
    usage: _Usage
    latency_s: float = Field(ge=0, allow_inf_nan=False)
    retries: NonNegativeInt


class _Call(BaseModel):
    """What readers of calls rely on; lines may hold more."""

    key: str = ""
    model: str
    request: _Request
    reply: _Reply
    after: str = ""
    shared: NonNegativeInt = 0


def read_calls(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of calls.jsonl as data: `key`, `model`, `request`, `reply`.

    Each has all its messages; in the file, a line of a conversation holds only those that are new.

    Raises:
        RunError: A line before the last is damaged, or a finished run lacks the file.
    """
    if (path / RESULT).exists() and not (path / CALLS).exists():
        raise DamagedError(f"{path / CALLS} is missing; restore it from a copy")
    conversations = Chains[Any]()
    return read_lines(path / CALLS, lambda line: _parse_call(line, conversations))


def _parse_call(line: bytes, conversations: Chains[Any]) -> dict[str, Any]:
    item = parse_object(line)
    try:
        call = _Call.model_validate(item, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the line"
        raise ValueError(f"{where}: {first['msg']}") from None
    assert item is not None
    request = item["request"]
    if call.after:
        own = request.get("messages", ())
        request["messages"] = list(conversations.whole(call.after, call.shared, own))
        del item["after"], item["shared"]
    if call.request.tools:
        conversations.add(call.key, [*request.get("messages", ()), _message_of(item["reply"])])
    return item


def _message_of(reply: dict[str, Any]) -> dict[str, Any]:
    """A reply as the message of a conversation, as requests hold it."""
    said = {"role": "assistant", "text": reply["text"], "images": []}
    if reply.get("tool_calls"):
        said["tool_calls"] = reply["tool_calls"]
    if field := reply.get("reasoning_field"):
        said["extra"] = {field: reply.get("reasoning", "")}
    return said


SCHEMA = 1
"""Version of the layout of run directories; other versions are refused."""
FILE_NAME = "run.yaml"
EVENTS, CALLS, RESULT = "events.jsonl", "calls.jsonl", "result.json"
MACHINES = "machines"
AGAIN = b'{"again": true, '
"""Start of the line of an event that replaces an earlier one with the same kind and label."""
State = Literal["done", "running", "stopped"]
"""State of a run: complete, running in some process, or stopped before its end."""


def document_text(document: Mapping[str, Any]) -> str:
    """The text of run.yaml for JSON-like data: schema first, the seal last."""
    return yaml.safe_dump(sealed({"schema": SCHEMA, **document}), sort_keys=False)


def read_document(path: Path) -> dict[str, Any]:
    """The content of a run's run.yaml, without its seal.

    Raises:
        RunError: It is missing, damaged or edited, or has another schema; or the run holds links.
    """
    file = path / FILE_NAME
    document = read_yaml_document(file, "a run directory", SCHEMA)
    if not isinstance(document.get("config", {}), dict):
        raise RunError(f"{file} is damaged: its config is not a mapping")
    if not break_seal(document):
        raise RunError(
            f"{file} was edited after the run began and no longer matches the recording; restore "
            f"it, or start a new run with: agentflow design --config {quote(str(file))}"
        )
    return document


@dataclass(frozen=True)
class Event:
    """One thing that happened. `(kind, label)` is unique in a run; `data` holds no timings.

    `at` counts seconds of work into the run, without the time between a kill and a resumption.
    `line` is its number in the file; 0 if it was not read from one.
    """

    kind: str
    label: str
    data: Mapping[str, Any]
    at: float = field(default=0.0, compare=False)
    line: int = field(default=0, compare=False)


def read_events(path: Path) -> Iterator[Event]:
    """The recorded events in order, without a half-written last line.

    If events have the same kind and label, only the last one is yielded. Memory use does not grow
    with the number of events.

    Raises:
        RunError: A line before the last is damaged.
    """
    replaced: dict[tuple[str, str], int] = {}
    for number, again in enumerate(read_lines(path / EVENTS, _parse_again), start=1):
        if again is not None:
            replaced[again.kind, again.label] = number
    for number, event in enumerate(read_lines(path / EVENTS, parse_event), start=1):
        if replaced.get((event.kind, event.label), 0) <= number:
            yield replace(event, line=number)


def read_machine_text(path: Path, digest: str) -> str:
    """The text of a machine of a run, by its content hash.

    Raises:
        RunError: It cannot be read.
    """
    try:
        return (path / MACHINES / f"{digest}.json").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise DamagedError(
            f"{path} is damaged: it has no readable {MACHINES}/{digest}.json"
        ) from None


def state_of(path: Path) -> State:
    """Whether a run is complete, running, or waiting to be resumed.

    Raises:
        RunError: It is not a run directory.
    """
    try:
        if (path / RESULT).exists():
            return "done"
        file = (path / FILE_NAME).open("rb") if (path / FILE_NAME).is_file() else None
    except OSError:
        file = None
    if file is None:
        raise RunError(f"{path} is not a run directory: it has no readable {FILE_NAME}")
    with file:
        try:
            lock_file(file.fileno(), shared=True)
        except OSError:
            return "running"
    return "stopped"


def find_runs(folder: Path) -> Iterator[Path]:
    """The run directories in a folder and its subfolders, by name; `folder` may be a run itself.

    Runs inside runs are not found; links to folders are not followed.
    """
    with os_errors(f"cannot read {folder}"):
        if (folder / FILE_NAME).is_file():
            yield folder
            return
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
        inside = [entry for entry in entries if entry.is_dir() and not entry.is_symlink()]
    for entry in inside:
        yield from find_runs(entry)


def require_runs(folder: Path) -> list[Path]:
    """`find_runs`; raises RunError if there are none."""
    runs = list(find_runs(folder))
    if not runs:
        raise RunError(f"{folder} contains no run")
    return runs


def _parse_again(line: bytes) -> Event | None:
    return parse_event(line) if line.startswith(AGAIN) else None


def parse_event(line: bytes) -> Event:
    """The event in a line of events.jsonl; ValueError if there is none."""
    item = parse_object(line)
    if item is not None:
        kind, label, data = item.get("kind"), item.get("label"), item.get("data")
        at = item.get("at", 0.0)
        timed = type(at) in (int, float) and isfinite(at)
        if timed and isinstance(kind, str) and isinstance(label, str) and isinstance(data, dict):
            return Event(kind, label, data, at)
    raise ValueError
