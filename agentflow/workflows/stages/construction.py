"""Builds a blueprint structure by structure, with a beam of one machine per trajectory."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from agentflow.agents.designer import Designer, DesignerInput
from agentflow.agents.meta_designer import Blueprint
from agentflow.machine.tree import Machine
from agentflow.runs.events import (
    FLAWLESS,
    BeamEvent,
    ConstructionEndEvent,
    FirstAttempt,
    RefillEvent,
)
from agentflow.runs.locations import Location
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.stages.designs import ask_designer, failure_reason, first_attempt_of


@dataclass(frozen=True)
class Slot:
    """A place in the beam: a machine under construction, or why there is none."""

    machine: Machine | None = None
    first: FirstAttempt = FLAWLESS
    """Whether the first attempts at all structures so far succeeded."""
    reason: str = ""
    groups: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Structure -> ids of its blocks."""
    spare: tuple[Slot, ...] = ()
    """Further valid designs, for places without one."""


async def build(
    run: WorkflowContext, blueprint: Blueprint, only: int | None = None
) -> list[Candidate]:
    """Build all structures in order, for all trajectories or only one; nothing is simulated yet.

    Construction ends with the machines built so far if no trajectory gets a valid design for a
    structure, or if the budget is spent; machines that lack required blocks are invalid candidates.
    """
    places = run.trajectories if only is None else [only]
    chance = run.stream("beam")
    beam = [Slot() for _ in places]
    for number, structure in enumerate(blueprint.structures, start=1):
        here = Location(structure=number, trajectory=only or 0)
        slots = beam if number == 1 or only else _refill(run, beam, here, chance)
        built = await run_concurrently(
            _build_structure(run, blueprint, number, slot, place)
            for place, slot in zip(places, slots, strict=True)
        )
        if not any(slot.machine for slot in built):
            reason = f"no valid design for structure {structure.name!r}: {built[0].reason}"
            run.note(ConstructionEndEvent(here, reason))
            beam = [
                replace(slot, first=new.first, reason=slot.reason or reason)
                for slot, new in zip(beam, built, strict=True)
            ]
            break
        beam = _share_spares(built)
        machines = tuple(slot.machine.digest if slot.machine else None for slot in beam)
        run.note(BeamEvent(here, machines))
        if run.spent:
            break
    return [
        Candidate(t, slot.machine, first=slot.first, reason=slot.reason, groups=slot.groups)
        for t, slot in zip(places, beam, strict=True)
    ]


def _refill(
    run: WorkflowContext, beam: Sequence[Slot], here: Location, chance: random.Random
) -> list[Slot]:
    """Fill empty places of the beam with copies of randomly drawn valid machines."""
    valid = [place for place, slot in enumerate(beam) if slot.machine]
    sources = [place if slot.machine else chance.choice(valid) for place, slot in enumerate(beam)]
    run.note(RefillEvent(here, tuple(place + 1 for place in sources)))
    return [beam[place] for place in sources]


def _share_spares(built: Sequence[Slot]) -> list[Slot]:
    """Fill empty places with spare valid designs, in order."""
    spare = [design for slot in built for design in slot.spare]
    return [
        slot if slot.machine or not spare else replace(spare.pop(0), first=slot.first)
        for slot in built
    ]


async def _build_structure(
    run: WorkflowContext, blueprint: Blueprint, number: int, slot: Slot, place: int
) -> Slot:
    """Ask `candidates` designers for a structure on a machine; take the first valid design."""
    structure = blueprint.structures[number - 1]
    given = DesignerInput(
        **run.role_input,
        blueprint=blueprint,
        structure=structure.name,
        machine=slot.machine,
        last=number == len(blueprint.structures),
        rationale=run.settings.rationale(place),
        elsewhere=await run.elsewhere(place),
    )

    async def design(index: int) -> Slot:
        asked = Location(Designer.name, structure=number, trajectory=place, candidate=index)
        outcome = await ask_designer(run, given, asked)
        first = slot.first & first_attempt_of(outcome)
        if outcome is None or outcome.output is None:
            return Slot(first=first, reason=failure_reason(outcome))
        machine = outcome.output.machine
        start = len(slot.machine) if slot.machine else 0
        groups = {**slot.groups, structure.name: tuple(range(start, len(machine)))}
        return Slot(machine, first, groups=groups)

    indices = range(1, run.settings.candidates + 1)
    designs = await run_concurrently(design(index) for index in indices)
    valid = [item for item in designs if item.machine]
    if not valid:
        return designs[0]
    return replace(valid[0], first=designs[0].first, spare=tuple(valid[1:]))
