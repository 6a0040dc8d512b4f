"""The workflow `tools`: a model designs machines in a conversation with calls of tools."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace

from agentflow.agents.tool_agent import Agent, AgentInput
from agentflow.llm.messages import Message, Tool, ToolCall
from agentflow.runs.locations import STAGES, Location, StageName
from agentflow.tools.bench import Bench
from agentflow.tools.results import ToolResult
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.random_dsl import RANDOM_DSL
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import UNANSWERED
from agentflow.workflows.tools.stages import (
    Worker,
    count_rollouts,
    reason_of,
    repeat,
    work_in_stages,
)
from agentflow.workflows.workflow import Workflow

MOST_CALLS = 200
"""Most calls of tools in a stage: four times what eight machines with feedback need."""
MOST_REFUSED = 12
"""Refused calls in a row that end a stage."""
MOST_SILENT = 2
"""Replies in a row without a tool call that end a stage."""


def converse(run: WorkflowContext) -> Worker:
    """A worker that lets the agent call the tools of each bench in a new conversation.

    The calls of a reply are carried out one after the other, so that a record always replays. A
    stage ends without its last submission when the model stops calling tools, when all its calls
    are refused, after many calls, and when the budget of the run is spent.
    """

    async def work(bench: Bench, stage: StageName) -> None:
        tools = [Tool(**vars(spec)) for spec in bench.tools]
        system, _ = run.prompts_of(Agent(), AgentInput(**run.role_input))
        messages = [
            Message(role="system", text=system),
            Message(role="user", text=bench.brief_text),
        ]
        calls = refused = silent = turn = 0
        reason = ""
        while not bench.ended and not reason:
            turn += 1
            location = Location(f"{Agent.name}/{stage}", attempt=turn)
            attempt = await run.take_turn(messages, tools, location, stage=stage)
            if attempt is None:
                reason = UNANSWERED
                break
            reply = attempt.reply
            text = reply.text.strip() or "(no text)" * (not reply.tool_calls)
            messages.append(reply.message.model_copy(update={"text": text}))
            carried_out = reply.tool_calls[: MOST_CALLS - calls]
            for call in carried_out:
                result = await bench.call(call.name, call.arguments)
                messages.append(_answer(call, result))
                refused = refused + 1 if result.refused else 0
            calls += len(carried_out)
            silent = 0 if reply.tool_calls else silent + 1
            if silent:
                messages.append(Message(role="user", text=_remind(attempt.parsed.problem, bench)))
            reason = _reason_to_stop(calls, refused, silent)
        bench.end(reason)

    return work


def _reason_to_stop(calls: int, refused: int, silent: int) -> str:
    if silent >= MOST_SILENT:
        return f"{silent} replies in a row called no tool"
    if refused >= MOST_REFUSED:
        return f"{refused} calls in a row were refused"
    return f"{calls} calls were made" if calls >= MOST_CALLS else ""


def _remind(problem: str, bench: Bench) -> str:
    return (
        f"{problem} {bench.budget_text} Call a tool; `submit` takes your machines. To end this "
        "stage with what is submitted, reply without a tool call again."
    )


def _answer(call: ToolCall, result: ToolResult) -> Message:
    image = result.image
    urls = (f"data:image/png;base64,{base64.b64encode(image).decode()}",) if image else ()
    return Message(role="tool", text=result.text, images=urls, tool_call_id=call.id)


async def tools(run: WorkflowContext) -> WorkflowResult:
    """One model works in the three stages, with up to 8 machines each and 24 simulations."""
    return await work_in_stages(run, converse(run))


def submit_each(settings: WorkflowSettings) -> WorkflowSettings:
    """One trajectory per machine that may be submitted."""
    return settings.model_copy(update={"trajectories": settings.candidates_per_stage})


def _calls(settings: WorkflowSettings) -> dict[str, int]:
    """Per machine: check and submit in every stage, and in the last an edit and a simulation."""
    many = settings.candidates_per_stage
    return {Agent.name: (4 if settings.start else 8) * many}


TOOLS = Workflow(
    "tools",
    tools,
    calls=_calls,
    rollouts=count_rollouts,
    adapt=submit_each,
    baseline=RANDOM_DSL.name,
)


def workflow_of(worker: Worker, author: str, stages: Sequence[StageName] = STAGES) -> Workflow:
    """The workflow with somebody else as worker, who cannot be asked again.

    Args:
        worker: Works at the bench of each stage.
        author: Who it is, as results name it.
        stages: The stages, in order.
    """
    return replace(
        TOOLS,
        stages=lambda run: work_in_stages(run, worker, stages),
        author=lambda _: author,
        repeatable=False,
    )


def repetition_of(author: str, stages: Sequence[StageName], then: Worker | None = None) -> Workflow:
    """The workflow of `workflow_of`, from the record.

    Args:
        author: Who designed, as results name it.
        stages: The stages, in order.
        then: Goes on in the stage that the record leaves open; without it, that ends there.
    """

    async def repeat_stages(run: WorkflowContext) -> WorkflowResult:
        async def work(bench: Bench, stage: StageName) -> None:
            reason = reason_of(await repeat(run, bench, stage))
            if then is None or bench.ended:
                bench.end(reason)
            else:
                await then(bench, stage)

        return await work_in_stages(run, work, stages)

    return replace(TOOLS, stages=repeat_stages, author=lambda _: author, repeatable=False)
