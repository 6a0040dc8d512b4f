"""Owns building by blueprint: structure by structure, a beam of trajectories side by side."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from agentflow.agents.designer import Designer, DesignerInput
from agentflow.agents.meta_designer import Blueprint
from agentflow.machine.tree import Machine
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, FirstAttempt
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.stages.shared import failure_reason, first_attempt_of

FLAWLESS = FirstAttempt(parsed=True, spatial=True, valid=True)


@dataclass(frozen=True)
class Slot:
    """One place in the beam: a machine under construction, or why there is none."""

    machine: Machine | None = None
    first: FirstAttempt = FLAWLESS
    """Whether the first attempts at all structures so far succeeded."""
    reason: str = ""
    groups: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Structure -> ids of its blocks."""
    spare: tuple[Slot, ...] = ()
    """Further valid designs of the same place, for places that have none."""


async def build(run: WorkflowContext, blueprint: Blueprint) -> list[Candidate]:
    """Build all structures in order (spec 5.2, hierarchical); nothing is simulated yet.

    A structure for which no trajectory obtains a valid design, or a spent budget, ends the
    construction with the machines built so far; those that lack what the task requires are invalid
    candidates.
    """
    chance = run.stream("beam")
    beam = [Slot() for _ in range(run.settings.trajectories)]
    for number, structure in enumerate(blueprint.structures, start=1):
        label = f"structure-{number}"
        places = beam if number == 1 else _refill(run, beam, label, chance)
        built = await run_concurrently(
            _build_structure(run, blueprint, number, slot, place)
            for place, slot in enumerate(places, start=1)
        )
        if not any(slot.machine for slot in built):
            reason = f"structure {structure.name!r} obtained no valid design: {built[0].reason}"
            run.record.event("construction_end", label, reason=reason)
            beam = [
                replace(slot, first=new.first, reason=slot.reason or reason)
                for slot, new in zip(beam, built, strict=True)
            ]
            break
        beam = _share_spares(built)
        run.record.event(
            "beam", label, machines=[slot.machine and slot.machine.digest for slot in beam]
        )
        if run.spent:
            break
    return [_candidate(i, s) for i, s in enumerate(beam, start=1)]


def _refill(
    run: WorkflowContext, beam: Sequence[Slot], label: str, chance: random.Random
) -> list[Slot]:
    """The beam with copies of valid machines, drawn by chance, where there is none."""
    valid = [place for place, slot in enumerate(beam) if slot.machine]
    sources = [place if slot.machine else chance.choice(valid) for place, slot in enumerate(beam)]
    run.record.event("refill", label, sources=[place + 1 for place in sources])
    return [beam[place] for place in sources]


def _share_spares(built: Sequence[Slot]) -> list[Slot]:
    """Spare valid designs take the places that have none, in order."""
    spare = [design for slot in built for design in slot.spare]
    return [
        slot if slot.machine or not spare else replace(spare.pop(0), first=slot.first)
        for slot in built
    ]


async def _build_structure(
    run: WorkflowContext, blueprint: Blueprint, number: int, slot: Slot, place: int
) -> Slot:
    """Ask `candidates` designers for one structure on one machine; the first valid one holds."""
    structure = blueprint.structures[number - 1]
    given = DesignerInput(
        brief=run.brief,
        blueprint=blueprint,
        structure=structure.name,
        machine=slot.machine,
        last=number == len(blueprint.structures),
        spatial=run.settings.spatial,
        representation=run.settings.representation,
        rationale=run.settings.rationale(place),
    )

    async def design(index: int) -> Slot:
        label = f"designer/structure-{number}/traj-{place}/candidate-{index}"
        outcome = await run.ask(Designer(), given, label, stage="initial")
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


def _candidate(trajectory: int, slot: Slot) -> Candidate:
    return Candidate(
        trajectory, slot.machine, first=slot.first, reason=slot.reason, groups=slot.groups
    )
