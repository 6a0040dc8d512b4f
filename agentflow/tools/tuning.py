"""The tool that tunes the numbers of what controls a machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from agentflow.errors import ConfigError
from agentflow.machine.numbers import machine_numbers, with_numbers
from agentflow.machine.tree import Machine
from agentflow.search import tuning
from agentflow.tools.results import RefusedCall, ToolResult
from agentflow.tools.workspace import Call, require_complete

MOST = 100
"""Most simulations of one call."""


async def tune(
    call: Call, machine: str, simulations: Annotated[int, Field(ge=2, le=MOST)] = 24
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
