"""The workflow `tools`: in each stage, an agent works at a bench and submits machines, in a
conversation with calls of tools."""

import base64
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace

from agentflow.agents.context import RoleInput
from agentflow.agents.tool_agent import Agent
from agentflow.llm.messages import Message, Tool, ToolCall
from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, CandidateEvent, RunEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, STAGES, Location, StageName
from agentflow.tools.bench import Bench
from agentflow.tools.results import ToolResult
from agentflow.tools.workspace import Allowance, KnownMachines, StageBudget
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.random_dsl import RANDOM_DSL
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import UNANSWERED, design_machines, simulate
from agentflow.workflows.workflow import Workflow

ROLLOUTS = 24
"""Simulations of a run by default: as many as three stages of eight machines need."""
UNSUBMITTED = "submitted no machine"
Worker = Callable[[Bench, StageName], Awaitable[None]]
"""Works at the bench of a stage; the stage ends when it returns, with what it has submitted."""


async def work_in_stages(
    run: WorkflowContext, worker: Worker, stages: Sequence[StageName] = STAGES
) -> WorkflowResult:
    """Let a worker submit machines in one stage after the other.

    Only the stage with feedback has simulations; the submissions of the others are simulated when
    the stage is over, and count in `settings.max_simulations` too. These stages may therefore
    submit no more machines than leave an equal share for each stage that follows. All stages share
    their machines. A start machine takes the place of the stages without feedback. Where nothing is
    submitted, the best machine that was simulated in the stage counts.
    """
    settings, machines = run.settings, KnownMachines()
    rollouts = Allowance.of_simulations(count_rollouts(settings))
    pictures = Allowance.of_pictures(settings.max_pictures) if settings.vision else None
    if settings.start_machine:
        run.begin_stage(INITIAL)
        run.end_stage(INITIAL, await simulate(run, INITIAL, await design_machines(run)))
        machines.add(settings.start_machine).submitted = INITIAL
        rollouts.left, stages = rollouts.total - run.rollouts, (FEEDBACK,)
    for number, stage in enumerate(stages):
        submissions = settings.candidates_per_stage
        if stage != FEEDBACK:
            share = max(1, rollouts.left // (len(stages) - number))
            submissions = min(submissions, share)
        left = len(stages) - number - 1
        budget = StageBudget(submissions, rollouts if stage == FEEDBACK else None, pictures, left)
        bench = Bench(run, stage, budget, machines)
        run.begin_stage(stage)
        await worker(bench, stage)
        await bench.close()
        closed = run.end_stage(stage, await simulate(run, stage, _candidates(run, bench)))
        rollouts.left = rollouts.total - run.rollouts
        run.reached_greatest = any(candidate.perfect for candidate in closed.candidates)
        if run.spent or run.reached_greatest or not rollouts.left:
            break
    return run.result()


async def repeat(run: WorkflowContext, bench: Bench, stage: StageName) -> Sequence[RunEvent]:
    """Do again what is recorded of a stage, and return that; nothing in a new run."""
    earlier = run.earlier(stage)
    for event in earlier:
        await bench.repeat(event, run.load_machine)
    return earlier


def reason_of(earlier: Sequence[RunEvent]) -> str:
    """Why a recorded stage ended before its last submission; "" if it did not, or is not over."""
    start = f"{UNSUBMITTED}: "
    reasons = [event.reason for event in earlier if isinstance(event, CandidateEvent)]
    told = (reason.removeprefix(start) for reason in reasons if reason.startswith(start))
    return next(told, "")


def count_rollouts(settings: WorkflowSettings) -> int:
    """Simulations that a run may use."""
    return settings.max_simulations or ROLLOUTS


def _candidates(run: WorkflowContext, bench: Bench) -> list[Candidate]:
    """One candidate for each machine that might have been submitted."""
    submitted = bench.submitted or _best_simulated(run, bench)
    made = [
        Candidate(number, machine, first=FLAWLESS)
        for number, machine in enumerate(submitted, start=1)
    ]
    missing = list(run.trajectories)[len(made) :]
    reason = f"{UNSUBMITTED}: {bench.reason}" if bench.reason else UNSUBMITTED
    return [*made, *(Candidate(number, reason=reason) for number in missing)]


def _best_simulated(run: WorkflowContext, bench: Bench) -> Sequence[Machine]:
    """The best machine that was simulated but never submitted, if there is any."""
    tried = [
        (evaluation.reward, known.machine)
        for known in bench.machines
        if known.submitted is None
        and (evaluation := run.evaluation_of(known.machine))
        and evaluation.valid
        and evaluation.reward is not None
    ]
    return [max(tried, key=lambda pair: pair[0])[1]] if tried else []


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
        system, _ = run.prompts_of(Agent(), RoleInput(**run.role_input))
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
