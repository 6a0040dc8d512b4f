"""Owns what a role is and how it is asked: render, call, parse, retry with the reason appended."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

from agentflow.llm.client import Client
from agentflow.llm.messages import Message, Reply, Request, Sampling
from agentflow.prompts.render import PromptSet

In = TypeVar("In")
Out = TypeVar("Out", covariant=True)

UNFINISHED: Mapping[str, tuple[str, str]] = {
    "length": (
        "truncated",
        "It was cut off at the length limit. Send a shorter one: less thought, the whole format.",
    ),
    "empty": ("empty", "It was empty. Send the whole format."),
    "content_filter": (
        "content_filter",
        "A content filter stopped it. Put it in other words and send the whole format.",
    ),
}
"""Finish reason of a reply that is no whole answer -> code and problem."""


@dataclass(frozen=True)
class Parsed(Generic[Out]):
    """What a parser made of a reply: an output, or the problem that goes back to the model."""

    output: Out | None
    problem: str = ""
    """One or two plain sentences that the model can act on; empty when there is an output."""
    code: str = ""
    """Machine-readable kind of the problem, for counting: unparsable, overlap, ..."""
    repaired: bool = False
    parsed: bool = True
    """Whether the reply had the demanded format at all."""
    spatial: bool | None = None
    """Spatial validity of the machine in it; None where there is no machine to judge."""


@dataclass(frozen=True)
class RoleAttempt(Generic[Out]):
    """One call of a role and what came of it; recorded whatever it is."""

    role: str
    label: str
    reply: Reply
    parsed: Parsed[Out]


@dataclass(frozen=True)
class RoleOutcome(Generic[Out]):
    """All attempts of one question; `output` is None when every one failed (a recorded result)."""

    output: Out | None
    attempts: tuple[RoleAttempt[Out], ...]


class Role(ABC, Generic[In, Out]):
    """A template pair and a parser. Roles hold no state."""

    name: ClassVar[str]
    """Folder of its templates and value of `Request.role`."""

    @abstractmethod
    def variables(self, given: In) -> Mapping[str, object]:
        """What the templates may use."""

    def images(self, given: In) -> tuple[str, ...]:  # noqa: ARG002
        """PNG data URLs that go with the user prompt; most roles see none."""
        return ()

    @abstractmethod
    def parse(self, text: str, given: In) -> Parsed[Out]:
        """Read a whole reply; never raises, whatever the text."""


@dataclass(frozen=True)
class AskContext:
    """What every question needs beside its input: who answers, from which prompts, how."""

    client: Client
    prompts: PromptSet
    sampling: Sampling = field(default_factory=Sampling)
    max_retry: int = 5
    """Most attempts per question."""
    on_attempt: Callable[[RoleAttempt[object]], None] = lambda _attempt: None


async def ask(role: Role[In, Out], given: In, context: AskContext, label: str) -> RoleOutcome[Out]:
    """Ask a role until a reply gives an output, at most `context.max_retry` times.

    A reply that does not is sent back within the conversation with the reason. Every attempt goes
    to `context.on_attempt` before the next begins.

    Args:
        role: whose prompts and parser to use.
        given: the typed input.
        context: model, prompts, sampling, number of attempts.
        label: which question of the run this is; attempts are labelled `<label>/attempt-<i>`.

    Raises:
        EndpointError: The endpoint cannot be used.
        BudgetSpentError: The budget has run out.
        ReplayMissError: A replaying client has no record of the request.
    """
    system, user = context.prompts.render(role.name, role.variables(given))
    conversation = [
        Message(role="system", text=system),
        Message(role="user", text=user, images=role.images(given)),
    ]
    attempts: list[RoleAttempt[Out]] = []
    for number in range(1, context.max_retry + 1):
        request = Request(
            role=role.name,
            label=f"{label}/attempt-{number}",
            messages=tuple(conversation),
            sampling=context.sampling,
        )
        reply = await context.client.complete(request)
        attempt = RoleAttempt(role.name, request.label, reply, _judge(role, given, reply))
        context.on_attempt(attempt)
        attempts.append(attempt)
        if attempt.parsed.output is not None:
            break
        conversation += [
            Message(role="assistant", text=reply.text.strip() or "(no text)"),
            Message(role="user", text=context.prompts.retry(attempt.parsed.problem)),
        ]
    return RoleOutcome(attempts[-1].parsed.output if attempts else None, tuple(attempts))


def _judge(role: Role[In, Out], given: In, reply: Reply) -> Parsed[Out]:
    """Parse a whole answer; say what is wrong with one that is not whole."""
    finish = reply.finish if reply.finish != "stop" or reply.text.strip() else "empty"
    if finish != "stop":
        code, problem = UNFINISHED[finish]
        return Parsed(None, problem, code, parsed=False)
    return role.parse(reply.text, given)
