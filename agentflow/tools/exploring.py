"""Trials of single edits, and of the numbers of what controls a machine: what each does to the
score."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from agentflow.errors import ConfigError
from agentflow.machine.edits.difference import edit_commands
from agentflow.machine.edits.local import local_edits
from agentflow.machine.numbers import machine_numbers, with_numbers
from agentflow.machine.tree import Machine
from agentflow.search import tuning
from agentflow.tools.results import RefusedCall, ToolResult
from agentflow.tools.workspace import Call, require_complete

MOST_GAINS, MOST_LOSSES = 5, 3
"""Most edits told one by one that raise the score, and that lower it."""
SAME = 0.005
"""Share of the score below which a change counts as none."""
MOST_EDITS = 24


@dataclass(frozen=True)
class EditTrial:
    """One edit of a machine, tried alone."""

    edit: str
    """Commands, with `; ` between them, or words."""
    score: float | None
    """What searches compare; None if the simulation failed."""
    broken: bool


def trials_text(score: float | None, broken: bool, trials: Sequence[EditTrial]) -> str:
    """What single edits did to the score of a machine, the best first; "" without any.

    Those that gain most and lose most have a line each; the others are counted.

    Args:
        score: Score of the machine.
        broken: Whether a connection of it broke.
        trials: The edits.
    """
    if not trials or score is None:
        return ""
    found = [(t.score - score, t) for t in trials if t.score is not None]
    found.sort(key=lambda pair: -pair[0])
    least = max(SAME * abs(score), 0.01)
    gains = [pair for pair in found if pair[0] >= least][:MOST_GAINS]
    losses = [pair for pair in found if pair[0] <= -least][-MOST_LOSSES:]
    lines = [f"- {t.edit}: {gain:+.2f}{_breakage(broken, t)}" for gain, t in gains + losses]
    others = [gain for gain, _ in found[len(gains) : len(found) - len(losses)]]
    if others:
        noun = "other" if len(others) == 1 else "others"
        span = sorted({f"{value:+.2f}" for value in (min(others), max(others))}, key=float)
        lines.append(f"- {len(others)} {noun}: {' to '.join(span)}")
    if failed := len(trials) - len(found):
        lines.append(f"- {failed} without a score")
    head = "Trials of single edits around this machine, each alone, and how they change its score"
    return "\n".join([f"{head} {score:.2f}:", *lines])


def _breakage(before: bool, trial: EditTrial) -> str:
    """Whether an edit decided that something breaks."""
    if before == trial.broken:
        return ""
    return ", something breaks" if trial.broken else ", nothing breaks"


async def explore_edits(
    call: Call, machine: str, count: Annotated[int, Field(ge=1, le=MOST_EDITS)] = 8
) -> ToolResult:
    """Try random single edits of a machine, each alone: tells what each does to its score.

    Args:
        machine: Name of the machine; it is simulated too, if it has not been.
        count: How many edits; each costs a simulation. `edit` makes any of them again, and
            simulating it then costs nothing.
    """
    workspace = call.workspace
    host, known = workspace.host, workspace.machines.find(machine)
    require_complete(known.machine, host.brief)
    commands: dict[Machine, str] = {}

    def is_new(edited: Machine) -> bool:
        commands[edited] = "; ".join(edit_commands(known.machine, edited, host.brief))
        return bool(commands[edited]) and workspace.result_of(edited) is None

    rng = host.stream(f"explore_edits/{call.location}")
    edited = local_edits(known.machine, rng, host.brief, count, is_new)
    if not edited:
        raise RefusedCall("no single edit of this machine leads to a new one")
    base, *found = await workspace.simulate([known.machine, *edited], call.location)
    tried = [
        EditTrial(commands[new], result.score, bool(result.broken))
        for new, result in zip(edited, found, strict=True)
    ]
    text = trials_text(base.score, bool(base.broken), tried) or "The machine has no score."
    rows = [{"script": t.edit, "score": t.score, "broken": t.broken} for t in tried]
    data = {"machine": known.name, "score": base.score, "trials": rows, **workspace.budget_data}
    return ToolResult(f"Machine {known.name}: {text}\n{workspace.budget_text}", data)


MOST_SIMULATIONS = 100
"""In one call of `tune`."""


async def tune(
    call: Call, machine: str, simulations: Annotated[int, Field(ge=2, le=MOST_SIMULATIONS)] = 24
) -> ToolResult:
    """Improve the numbers of a machine's controls by a search (CMA-ES): times, levels, gains. The
    best machine found gets a name; blocks, and how many controls there are, stay as they are.

    Args:
        machine: Name of the machine, which brings controls; it is simulated too, if it has not
            been.
        simulations: How many simulations this may cost; 10 to 20 for each number help most.
    """
    workspace, location = call.workspace, call.location
    brief, known = workspace.host.brief, workspace.machines.find(machine)
    allowance, window = workspace.budget.simulations, brief.limits.controls
    assert allowance is not None
    assert window is not None, "the tool is on offer only where machines bring controls"
    require_complete(known.machine, brief)
    numbers = machine_numbers(known.machine, window)
    if not numbers:
        raise RefusedCall("this machine brings no controls, so it has no numbers: `edit` adds some")
    try:
        tuning.require_cma()
    except ConfigError as error:
        raise RefusedCall(str(error)) from None
    if simulations > allowance.left:
        allowance.take(simulations)
    before = allowance.left
    (base,) = await workspace.simulate([known.machine], location)

    async def judge(machines: Sequence[Machine], generation: int) -> list[float | None]:
        found = await workspace.simulate(machines, replace(location, round=generation))
        return [item.score for item in found]

    best, score = await tuning.tune(
        tuning.Cma(numbers, workspace.host.stream(f"tune/{location}").getrandbits(32)),
        lambda values: with_numbers(known.machine, values, window),
        judge,
        known.machine,
        base.score,
        simulations - (before - allowance.left),
        brief.greatest,
    )
    made = workspace.name(best, known.name) if best != known.machine else known
    cost = before - allowance.left
    changes = [
        f"{old.path} {old.value:g} to {new.value:g}"
        for old, new in zip(numbers, machine_numbers(best, window), strict=True)
        if old != new
    ]
    data = {
        "machine": made.name,
        "score": score,
        "parent": known.name,
        "before": base.score,
        "changes": changes,
        "simulations": cost,
        **workspace.budget_data,
    }
    if made is known:
        text = f"{cost} simulations of other numbers found none better than machine {known.name}."
    else:
        text = (
            f"Machine {made.name}: score {_shown(score)}, up from {_shown(base.score)} of machine "
            f"{known.name}, by {cost} simulations. Changes: {'; '.join(changes)}"
        )
    return ToolResult(f"{text}\n{workspace.budget_text}", data)


def _shown(score: float | None) -> str:
    return "none" if score is None else f"{score:.2f}"
