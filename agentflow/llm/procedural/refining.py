"""Owns refinement: the edit commands that a report suggests, tried on the machine before sending.

Seeing what is wrong before a simulation is inspecting.py's.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import cache

from pydantic import BaseModel, ConfigDict

from agentflow.llm.procedural.growth import clusters, free, locked, span
from agentflow.llm.procedural.mechanisms import WHEELS, data
from agentflow.llm.procedural.reading import Facts, plain
from agentflow.machine.blocks import BOULDER, CONTAINER
from agentflow.machine.edits import apply_script
from agentflow.machine.geometry import Geometry, Placed, PlacedFace, place
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

TRIES = 60
Spot = tuple[Placed, PlacedFace]
LONG = 1.5
"""Least distance between the ends of a two-ended block, m."""


class Rule(BaseModel):
    """One kind of change, as refining.yaml tells it."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str
    do: str
    types: tuple[int, ...]
    at: str
    throw: float
    drive: float
    seen: tuple[str, ...]


@cache
def _rules() -> tuple[Rule, ...]:
    return tuple(Rule(**rule) for rule in data("refining.yaml"))


_SHAPE = """<Thought Process>
What limits it: {seen}.
</Thought Process>
<Modification Description>
{names}
</Modification Description>
<Simulation Prediction After Modification>
A higher score than before.
</Simulation Prediction After Modification>
<Modification Steps>
{body}
</Modification Steps>"""


def refine(facts: Facts, chance: random.Random) -> str:
    """One or two changes that fit the symptoms."""
    assert facts.machine is not None
    script: list[str] = []
    names = []
    for _ in range(chance.choice((1, 1, 2))):
        script, name = _changed(facts, facts.machine, script, chance)
        names.append(name)
    machine = apply_script(facts.machine, "\n".join(script), facts.brief).machine
    seen = dict.fromkeys(words for rule in _rules() for words in rule.seen if words in facts.told)
    return _SHAPE.format(
        seen=", ".join(seen) or "nothing I know of",
        names=", then ".join(names),
        body=f"```json\n{machine.to_text()}\n```" if facts.whole else "\n".join(script),
    )


def _changed(
    facts: Facts, machine: Machine, script: list[str], chance: random.Random
) -> tuple[list[str], str]:
    """The script with one more change that works, and its name; as it was if none is found."""
    geometry = place(machine)
    throws = BOULDER in facts.brief.required
    choices = []
    for rule in _rules():
        weight = rule.throw if throws else rule.drive
        offers = list(_offers(rule, facts, geometry)) if weight else []
        weight += 2 * sum(words in facts.told for words in rule.seen)
        choices += [(weight, rule.name, offers)] if offers else []
    for _ in range(TRIES if choices else 0):
        _, name, offers = chance.choices(choices, [choice[0] for choice in choices])[0]
        longer = [*script, *chance.choice(offers)]
        if _works(facts, machine, longer):
            return longer, name
    return script, "nothing more"


def _offers(rule: Rule, facts: Facts, geometry: Geometry) -> Iterator[list[str]]:
    """All scripts of a rule, legal or not."""
    kinds = [kind for kind in rule.types if kind in facts.types]
    spots = list(_spots(rule.at, geometry))
    if rule.do == "Join":
        feet = list(_spots("still", geometry))
        pairs = [(s, t) for s in spots for t in feet if span(s[1].position, t[1].position) > LONG]
        yield from ([f"Add {kind} {_at(s)} {_at(t)}"] for kind in kinds for s, t in pairs)
    elif rule.do == "Add":
        open_spots = [(b, f) for b, f in spots if f in free(geometry, b.id)]
        yield from (_mirrored(kind, spot, spots) for kind in kinds for spot in open_spots)
    for block in geometry.blocks:
        if block.type in rule.types and rule.do == "Move":
            yield from ([f"Move {block.id} {_at(spot)}"] for spot in spots)
        elif block.type in rule.types and rule.do in ("Remove", "Swap"):
            step, others = block.step, kinds if rule.do == "Swap" else []
            adds = [f"Add {kind} to {step.parent} in {step.face_id}" for kind in others]
            yield from ([f"Remove {block.id}", add] for add in adds)
            yield from ([[f"Remove {block.id}"]] if rule.do == "Remove" else [])


def _at(spot: Spot) -> str:
    return f"to {spot[0].id} in {spot[1].face_id}"


def _mirrored(kind: int, spot: Spot, spots: list[Spot]) -> list[str]:
    """Add a block, and its like on the other side where there is a face for it."""
    x, y, z = spot[1].position
    twins = [twin for twin in spots if twin[1].position == (-x, y, z) and x]
    return [f"Add {kind} {_at(each)}" for each in (spot, *twins[:1])]


def _spots(where: str, geometry: Geometry) -> Iterator[Spot]:
    """Faces in a place: still, low and side do not move; swung and ahead do."""
    group, low = clusters(geometry), geometry.box_min[1] + 1.1
    for block in geometry.blocks:
        still = group[block.id] == 0
        swung = not still and block.type not in (*WHEELS, CONTAINER, BOULDER)
        fits = swung if where in ("swung", "ahead") else still
        for face in block.faces if fits and (where != "low" or block.box_min[1] < low) else ():
            forward = "z+" in (face.facing, block.facing)
            if (where != "side" or face.facing[0] == "x") and (where != "ahead" or forward):
                yield block, face


def _works(facts: Facts, machine: Machine, script: list[str]) -> bool:
    """Whether the commands can be carried out, are not known to fail and lock no joint."""
    if {plain(script), *(plain([line]) for line in script)} & facts.failed:
        return False
    outcome = apply_script(machine, "\n".join(script), facts.brief)
    changed = outcome.success and outcome.machine != machine
    return (
        changed
        and not locked(place(outcome.machine))
        and check(outcome.machine, facts.brief).task_valid
    )
