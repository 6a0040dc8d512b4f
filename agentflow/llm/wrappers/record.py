"""Clients around a call log: one records and resumes, the other only replays."""

from __future__ import annotations

import asyncio
from difflib import SequenceMatcher
from itertools import takewhile

from agentflow.errors import BudgetSpentError, ReplayMissError
from agentflow.llm.client import Client, ClientWrapper
from agentflow.llm.messages import Reply, Request
from agentflow.llm.wrappers.call_log import CallLog, RecordedCall, key_of

_EXCERPT_CHARS = 30


class RecordingClient(ClientWrapper):
    """Answers from the call log if possible; otherwise asks the inner client and records its reply.

    Several clients may share one call log; the caller closes it.
    """

    def __init__(self, inner: Client, call_log: CallLog) -> None:
        super().__init__(inner)
        self._call_log = call_log
        self._locks: dict[str, asyncio.Lock] = {}

    def holds(self, request: Request) -> bool:
        """Whether the call log already has the reply."""
        return key_of(self.name, request) in self._call_log

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`.

        Raises:
            RunError: The call log cannot be written.
        """
        key = key_of(self.name, request)
        try:
            async with self._locks.setdefault(key, asyncio.Lock()):
                reply = self._call_log.find(key)
                if reply is None:
                    reply = await self._inner.complete(request)
                    call = RecordedCall(key=key, model=self.name, request=request, reply=reply)
                    self._call_log.append(call)
                return reply
        finally:
            self._locks.pop(key, None)


class ReplayClient:
    """Answers from the call log only.

    Args:
        call_log: The record.
        model: Name of the model in the recorded run.
        budget_spent: Whether the recorded run stopped at its budget; replay then stops at the first
            call that is missing from the call log.
    """

    def __init__(self, call_log: CallLog, model: str, *, budget_spent: bool = False) -> None:
        self._call_log = call_log
        self.name = model
        self._budget_spent = budget_spent

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            ReplayMissError: It is not in the call log.
            BudgetSpentError: It is not in the call log, and the run stopped at its budget.
        """
        reply = self._call_log.find(key_of(self.name, request))
        if reply is None and self._budget_spent:
            raise BudgetSpentError("the recorded run ended here")
        if reply is None:
            raise ReplayMissError(_explain_miss(self._call_log, self.name, request))
        return reply

    async def aclose(self) -> None:
        """Nothing to release; the call log stays open."""


def _explain_miss(call_log: CallLog, model: str, request: Request) -> str:
    """The nearest recorded request and the first field that differs."""
    requested = _fields(model, request)

    def likeness(call: RecordedCall) -> tuple[bool, float, int]:
        known = _fields(call.model, call.request)
        label, role = call.request.label, call.request.role
        return (
            label == request.label,
            (role == request.role) + SequenceMatcher(None, label, request.label).ratio(),
            sum(known.get(name) == value for name, value in requested.items()),
        )

    nearest = max(call_log.calls(), key=likeness, default=None)
    miss = f"{call_log.path} does not contain the call {request.label!r}"
    if nearest is None:
        return f"{miss}; it contains no calls"
    difference = _first_difference(_fields(nearest.model, nearest.request), requested)
    return f"{miss}; nearest is {nearest.request.label!r}, first difference: {difference}"


def _fields(model: str, request: Request) -> dict[str, str]:
    """A request's fields by path, those whose difference says most first."""
    fields = {"label": request.label, "role": request.role, "model": model}
    for name, value in request.sampling.model_dump().items():
        fields[f"sampling.{name}"] = str(value)
    for index, message in enumerate(request.messages):
        fields[f"messages[{index}].role"] = message.role
        fields[f"messages[{index}].text"] = message.text
        fields[f"messages[{index}].images"] = " ".join(message.images)
        for number, call in enumerate(message.tool_calls):
            fields[f"messages[{index}].tool_calls[{number}]"] = call.model_dump_json()
        fields[f"messages[{index}].tool_call_id"] = message.tool_call_id
    for tool in request.tools:
        fields[f"tools.{tool.name}"] = tool.model_dump_json()
    fields["tool_choice"] = str(request.tool_choice)
    return fields


def _first_difference(recorded: dict[str, str], requested: dict[str, str]) -> str:
    for name in {**recorded, **requested}:
        old, new = recorded.get(name), requested.get(name)
        if old == new:
            continue
        if old is None or new is None:
            return f"{name} is {'missing' if old is None else 'only'} in the record"
        same = takewhile(lambda pair: pair[0] == pair[1], zip(old, new, strict=False))
        at = len(list(same))
        start = max(0, at - _EXCERPT_CHARS // 2)
        excerpts = [repr(text[start : start + _EXCERPT_CHARS]) for text in (old, new)]
        return f"{name} at character {at}: recorded {excerpts[0]}, requested {excerpts[1]}"
    return "none"
