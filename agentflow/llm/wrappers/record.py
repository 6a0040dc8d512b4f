"""Owns the clients around a tape: one that records and resumes, one that only replays."""

from __future__ import annotations

import asyncio
from difflib import SequenceMatcher

from agentflow.errors import BudgetSpentError, ReplayMissError
from agentflow.llm.client import Client
from agentflow.llm.messages import Reply, Request
from agentflow.llm.wrappers.tape import Entry, Tape, key_of

_EXCERPT_CHARS = 30


class RecordingClient:
    """Answers from the tape where it can; otherwise asks, records, and only then answers.

    Several clients may share one tape; whoever opened it closes it.
    """

    def __init__(self, inner: Client, tape: Tape) -> None:
        self._inner = inner
        self._tape = tape
        self._asking: dict[str, asyncio.Lock] = {}
        self._last: tuple[Request, str] | None = None

    @property
    def name(self) -> str:
        """The model's name."""
        return self._inner.name

    def holds(self, request: Request) -> bool:
        """Whether the tape has the answer already."""
        return self._key(request) in self._tape

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`.

        Raises:
            RunError: The tape cannot be written.
        """
        key = self._key(request)
        try:
            async with self._asking.setdefault(key, asyncio.Lock()):
                reply = self._tape.find(key)
                if reply is None:
                    reply = await self._inner.complete(request)
                    self._tape.append(Entry(key=key, model=self.name, request=request, reply=reply))
                return reply
        finally:
            self._asking.pop(key, None)

    def _key(self, request: Request) -> str:
        """Its key; kept for the last one, because whoever asks `holds` goes on to `complete`."""
        if self._last is None or self._last[0] is not request:
            self._last = (request, key_of(self.name, request))
        return self._last[1]

    async def aclose(self) -> None:
        """Close the inner client; the tape stays open."""
        await self._inner.aclose()


class ReplayClient:
    """Answers from the tape alone.

    Args:
        tape: The record.
        model: The model's name as the recorded run was configured.
        cut: Whether the recorded run ended because its budget was spent: then a call that the
            tape does not hold is one that the budget did not allow.
    """

    def __init__(self, tape: Tape, model: str, *, cut: bool = False) -> None:
        self._tape = tape
        self._model = model
        self._cut = cut

    @property
    def name(self) -> str:
        """The model's name."""
        return self._model

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            ReplayMissError: The tape does not hold it.
            BudgetSpentError: The same, of a run that its budget cut off.
        """
        reply = self._tape.find(key_of(self._model, request))
        if reply is None and self._cut:
            raise BudgetSpentError("the recorded run ended here")
        if reply is None:
            raise ReplayMissError(_miss(self._tape, self._model, request))
        return reply

    async def aclose(self) -> None:
        """Nothing to release; the tape stays open."""


def _miss(tape: Tape, model: str, request: Request) -> str:
    """What the tape holds instead: the nearest request and the first field that differs."""
    asked = _fields(model, request)
    nearest: Entry | None = None
    best = (False, -1.0, -1)
    for entry in tape.entries():
        known = _fields(entry.model, entry.request)
        label, role = entry.request.label, entry.request.role
        rank = (
            label == request.label,
            (role == request.role) + SequenceMatcher(None, label, request.label).ratio(),
            sum(known.get(name) == value for name, value in asked.items()),
        )
        if rank > best:
            best, nearest = rank, entry
    said = f"{tape.path} does not hold the call {request.label!r}"
    if nearest is None:
        return f"{said}; it holds no calls"
    difference = _first_difference(_fields(nearest.model, nearest.request), asked)
    return f"{said}; nearest is {nearest.request.label!r}, first difference: {difference}"


def _fields(model: str, request: Request) -> dict[str, str]:
    """A request's fields by path, in the order in which a difference is most telling."""
    fields = {"label": request.label, "role": request.role, "model": model}
    for name, value in request.sampling.model_dump().items():
        fields[f"sampling.{name}"] = str(value)
    for index, message in enumerate(request.messages):
        fields[f"messages[{index}].role"] = message.role
        fields[f"messages[{index}].text"] = message.text
        fields[f"messages[{index}].images"] = " ".join(message.images)
    return fields


def _first_difference(recorded: dict[str, str], asked: dict[str, str]) -> str:
    for name in {**recorded, **asked}:
        old, new = recorded.get(name), asked.get(name)
        if old == new:
            continue
        if old is None or new is None:
            return f"{name} is {'missing' if old is None else 'only'} in the record"
        pairs = zip(old, new, strict=False)
        shorter = min(len(old), len(new))
        at = next((i for i, (one, other) in enumerate(pairs) if one != other), shorter)
        start = max(0, at - _EXCERPT_CHARS // 2)
        shown = [repr(text[start : start + _EXCERPT_CHARS]) for text in (old, new)]
        return f"{name} at character {at}: recorded {shown[0]}, asked {shown[1]}"
    return "none"
