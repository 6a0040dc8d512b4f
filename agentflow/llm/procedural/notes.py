"""Read a conversation with tools: machines, their scores, and what is left of the budget."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from agentflow.llm.messages import Message, Request, ToolCall
from agentflow.llm.procedural.reading import Prompt, read_listing, read_prompt
from agentflow.llm.procedural.refining import normalise
from agentflow.machine import Machine, apply_script, library, read_machine

_NAME = r"[0-9a-f]{8,64}"
_MADE = re.compile(rf"Machine ({_NAME}): valid, ")
_SCORE = re.compile(r"\bscore (-?\d{1,9}(?:\.\d{1,9})?) ")
_LEFT = re.compile(r"(\d{1,6}) of \d{1,6} (submission|simulation)s left")
_KNOWN = re.compile(r"^Machines so far: (.+)$", re.MULTILINE)
_ROW = re.compile(rf"^({_NAME}) \|.* \| ([^|\n]+) \| [^|\n]+$", re.MULTILINE)


@dataclass
class Candidate:
    """A named machine, as far as the conversation tells about it."""

    machine: Machine | None = None
    score: float | None = None
    simulated: bool = False
    feedback: str = ""
    """What its simulation told in this conversation."""
    described: bool = False
    """Whether `machine` has been read, as far as it can be."""
    made: bool = False
    """Whether it was made in this conversation, and is complete."""
    submitted: bool = False
    """Whether it was submitted in this conversation."""
    tried: set[str] = field(default_factory=set)
    """Scripts sent for it, normalised."""


@dataclass
class Notes:
    """What a conversation tells."""

    prompt: Prompt
    tools: frozenset[str]
    """Tools on offer."""
    turns: int = 0
    """Replies so far."""
    called: set[str] = field(default_factory=set)
    """Tools called so far."""
    left: dict[str, int] = field(default_factory=lambda: {"submission": 0, "simulation": 0})
    """What is left: submissions and simulations."""
    candidates: dict[str, Candidate] = field(default_factory=dict)
    """By name, oldest first."""

    def at(self, name: str) -> Candidate:
        """What is known about a machine."""
        return self.candidates.setdefault(name, Candidate())

    def by_score(self) -> list[str]:
        """Names of machines with a score, best first."""
        known = self.candidates.items()
        scores = {name: found.score for name, found in known if found.score is not None}
        return sorted(scores, key=scores.__getitem__, reverse=True)


def take_notes(request: Request) -> Notes:
    """Read a conversation."""
    notes = Notes(read_prompt(request.messages), frozenset(tool.name for tool in request.tools))
    notes.turns = sum(message.role == "assistant" for message in request.messages)
    for message in request.messages:
        for number, what in _LEFT.findall(message.text):
            notes.left[what] = int(number)
    for names in _KNOWN.findall("\n".join(message.text for message in request.messages[:2])):
        for name in re.findall(_NAME, names):
            notes.at(name)
    for tool, arguments, answer in _finished_calls(request.messages):
        notes.called.add(tool)
        if tool in _READERS:
            _READERS[tool](notes, arguments, answer)
    return notes


def _finished_calls(messages: tuple[Message, ...]) -> Iterator[tuple[str, Mapping[str, str], str]]:
    """Name, arguments and answer of each call that was answered."""
    calls: dict[str, ToolCall] = {}
    for message in messages:
        calls |= {call.id: call for call in message.tool_calls}
        if message.role == "tool" and (call := calls.get(message.tool_call_id)):
            yield call.name, _read_arguments(call.arguments), message.text


def _read_arguments(text: str) -> Mapping[str, str]:
    """The arguments that are texts; "" for others."""
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        given = None
    items = given.items() if isinstance(given, dict) else ()
    return defaultdict(str, {name: value for name, value in items if isinstance(value, str)})


def _read_check(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    if made := _MADE.match(answer):
        candidate = notes.at(made[1])
        candidate.made = candidate.described = True
        candidate.machine = read_machine(arguments["machine"], library()).machine


def _read_edit(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    parent, script = notes.at(arguments["machine"]), arguments["script"]
    parent.tried.add(normalise(script.split("\n")))
    if (made := _MADE.match(answer)) and parent.machine:
        candidate = notes.at(made[1])
        candidate.made = candidate.described = True
        candidate.machine = apply_script(parent.machine, script, notes.prompt.brief).machine


def _read_describe(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    candidate = notes.at(arguments["machine"])
    candidate.described, candidate.machine = True, read_listing(answer)


def _read_simulate(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    candidate, found = notes.at(arguments["machine"]), _SCORE.search(answer)
    candidate.simulated, candidate.feedback = True, answer
    candidate.score = float(found[1]) if found else None


def _read_history(notes: Notes, _arguments: Mapping[str, str], answer: str) -> None:
    for name, score in _ROW.findall(answer):
        candidate = notes.at(name)
        candidate.simulated = score != "not simulated"
        candidate.score = float(score) if re.fullmatch(r"-?\d{1,9}\.\d\d", score) else None


def _read_submit(notes: Notes, arguments: Mapping[str, str], _answer: str) -> None:
    notes.at(arguments["machine"]).submitted = True


_READERS = {
    "check": _read_check,
    "edit": _read_edit,
    "describe": _read_describe,
    "simulate": _read_simulate,
    "history": _read_history,
    "submit": _read_submit,
}
