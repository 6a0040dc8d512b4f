"""Prompts, roles and how to ask them: render, call, parse, retry with the problem appended."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, Literal, TypeVar

from agentflow.errors import PromptError
from agentflow.llm.messages import Client, Message, Reply, Request, Sampling
from agentflow.llm.procedural.reading import Script
from agentflow.machine.blocks.library import EXAMPLE
from agentflow.machine.brief import Brief
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.prompts.render import PromptSet, open_set

In = TypeVar("In")
Out = TypeVar("Out", covariant=True)

Replies = Literal["answers", "edits", "calls"]
"""What a role replies with: answers, edits of a machine, or calls of tools."""

UNFINISHED: Mapping[str, tuple[str, str, str]] = {
    "length": (
        "truncated",
        "It was cut off at the length limit.",
        "Send a shorter one: think less, but send the whole format.",
    ),
    "empty": ("empty_reply", "It was empty.", "Send the whole format."),
    "tool_calls": (
        "tool_calls",
        "It only called tools, but there are none.",
        "Send the whole format as text.",
    ),
    "content_filter": (
        "content_filter",
        "A content filter stopped it.",
        "Put it in other words and send the whole format.",
    ),
}
"""Finish reason of an incomplete reply -> code, problem, and what to ask of the model."""


@dataclass(frozen=True)
class Parsed(Generic[Out]):
    """A parsed reply: an output, or the problem to send back to the model."""

    output: Out | None
    problem: str = ""
    """One or two plain sentences that the model can act on; empty if there is an output."""
    code: str = ""
    """Machine-readable kind of problem, for counting: unparsable, overlap, ..."""
    repaired: bool = False
    """Whether damaged JSON was repaired."""
    parsed: bool = True
    """Whether the reply had the required format at all."""
    spatial: bool | None = None
    """Whether its machine is spatially valid; None if it holds no machine."""


@dataclass(frozen=True)
class RoleAttempt(Generic[Out]):
    """One call of a role and its parsed reply, valid or not."""

    role: str
    label: str
    reply: Reply
    parsed: Parsed[Out]

    @property
    def reason(self) -> str:
        """Why the reply was refused, for people: without what the model is asked to do."""
        for code, problem, _ in UNFINISHED.values():
            if code == self.parsed.code:
                return f"a model's reply was refused. {problem}"
        lines = self.parsed.problem.split("\n")
        return "\n".join(lines if self.parsed.parsed else (line.split(";")[0] for line in lines))


@dataclass(frozen=True)
class RoleOutcome(Generic[Out]):
    """All attempts at one question; `output` is None if every attempt failed."""

    output: Out | None
    attempts: tuple[RoleAttempt[Out], ...]


class Prompt(ABC, Generic[In, Out]):
    """A pair of templates and a parser, without state."""

    name: ClassVar[str]
    """Folder of its templates, and value of `Request.role`."""

    @abstractmethod
    def variables(self, given: In) -> Mapping[str, object]:
        """Variables of the templates."""

    sees: ClassVar[bool] = False
    """Whether it is shown the user's sketch."""
    templates: ClassVar[Path | None] = None
    """Folder with its `system.j2` and `user.j2`, for prompt sets that lack them."""

    def prompt(self, given: In, prompts: PromptSet) -> tuple[str, str]:
        """The system and the user prompt.

        Raises:
            PromptError: Neither the set nor the role has templates, or a variable is missing.
        """
        found = prompts.completed(self.name, self.templates)
        if f"{self.name}/user.j2" not in found.files:
            raise PromptError(
                f"the prompt set {prompts.name!r} has no templates for the role {self.name!r}: add "
                f"{self.name}/system.j2 and {self.name}/user.j2 to it, or let `templates` of the "
                "role name a folder with both"
            )
        return found.render(self.name, {**self.variables(given), "sees": self.sees})

    def images(self, given: In) -> tuple[str, ...]:  # noqa: ARG002
        """PNG data URLs to send with the user prompt."""
        return ()

    @abstractmethod
    def parse(self, text: str, given: In) -> Parsed[Out]:
        """Read a whole reply; never raises."""


class Role(Prompt[In, Out]):
    """What a model does in a run. `agents.registry.ROLES` lists all roles.

    Its name is also the first part of its call labels.
    """

    stage: ClassVar[str]
    """Stage of a run in which it is asked: initial, blind_refinement or env_feedback."""
    tokens: ClassVar[tuple[int, int]]
    """Prompt and completion tokens of a typical call, without reasoning, for cost estimates.

    Those of our roles are from runs/recorded-throwing, at four characters per token.
    """
    model_role: ClassVar[str] = ""
    """Role whose model and sampling it uses; its own by default."""
    replies: ClassVar[Replies] = "answers"
    """What refused replies are counted as. Tool calls are recorded one by one, and counted in
    place of the replies that hold them."""
    labels: ClassVar[tuple[str, ...]] = ()
    """The steps of people's designing that are its work, as docs/how-to/studies.md labels them. Its
    own calls have the first of them."""
    script: ClassVar[Script | None] = None
    """How the procedural model plays it; None if it cannot."""

    def images(self, given: Any) -> tuple[str, ...]:
        """The user's sketch, for a role that sees it and whose input has a `brief`."""
        return given.brief.sketch if self.sees else ()

    @classmethod
    @abstractmethod
    def sample(cls, brief: Brief, machine: Machine) -> In:
        """The input of its first question in a run, for a task and a machine."""

    @classmethod
    def prediction(cls, text: str) -> str:  # noqa: ARG003
        """What a reply predicts of the machine that it makes; "" if it predicts nothing."""
        return ""

    @classmethod
    def stage_for(cls, purpose: str) -> str:  # noqa: ARG003
        """Stage of a call; `purpose` says what a role with several uses is asked for."""
        return cls.stage


def chat_prompt(
    role: type[Role[Any, Any]],
    brief: Brief,
    prompts: str = "default",
    machine: Machine | None = None,
) -> list[dict[str, str]]:
    """The prompt of a role's first question in a run, as chat messages: `role` and `content`.

    Args:
        role: Who is asked.
        brief: The task.
        prompts: Prompt set.
        machine: For roles that receive one; by default a small one.
    """
    system, user = first_prompt(role, brief, open_set(prompts), machine)
    return [{"role": "system", "content": system}, {"role": "user", "content": user}]


def first_prompt(
    role: type[Role[Any, Any]], brief: Brief, prompts: PromptSet, machine: Machine | None = None
) -> tuple[str, str]:
    """The system and the user prompt of a role's first question in a run; see `chat_prompt`."""
    asked = role()
    return asked.prompt(asked.sample(brief, machine or _small_machine(brief)), prompts)


def _small_machine(brief: Brief) -> Machine:
    kind = EXAMPLE if EXAMPLE in brief.blocks else ROOT.type
    return Machine((ROOT, *((Step(1, kind, 0, 4),) if kind else ())))


@dataclass(frozen=True)
class AskContext:
    """How to ask a role: client, prompts, sampling, retries."""

    client: Client
    prompts: PromptSet
    sampling: Sampling = field(default_factory=Sampling)
    max_retry: int = 5
    on_attempt: Callable[[RoleAttempt[object]], None] = lambda _attempt: None


async def ask(
    role: Prompt[In, Out], given: In, context: AskContext, label: str
) -> RoleOutcome[Out]:
    """Ask until a reply parses, at most `context.max_retry` times.

    A reply that does not parse stays in the conversation, followed by the problem. Every attempt is
    passed to `context.on_attempt` before the next one starts. The label names the question within
    the run; attempts are labelled `<label>/attempt-<i>`.
    """
    system, user = role.prompt(given, context.prompts)
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
        attempt = RoleAttempt(role.name, request.label, reply, _parse(role, given, reply))
        context.on_attempt(attempt)
        attempts.append(attempt)
        if attempt.parsed.output is not None:
            break
        conversation += [
            Message(role="assistant", text=reply.text.strip() or "(no text)"),
            Message(role="user", text=context.prompts.retry(attempt.parsed.problem)),
        ]
    return RoleOutcome(attempts[-1].parsed.output if attempts else None, tuple(attempts))


def _parse(role: Prompt[In, Out], given: In, reply: Reply) -> Parsed[Out]:
    """Parse a complete reply; give the problem of an incomplete one."""
    finish = reply.finish if reply.finish != "stop" or reply.text.strip() else "empty"
    if finish != "stop":
        code, problem, request = UNFINISHED[finish]
        return Parsed(None, f"{problem} {request}", code, parsed=False)
    return role.parse(reply.text, given)
