"""Owns refinement: the edit commands that a report suggests, tried on the machine before sending.

Seeing what is wrong before a simulation is inspecting.py's.
"""

from __future__ import annotations

import random
from functools import cache

from pydantic import BaseModel, ConfigDict

from agentflow.llm.procedural.growth import clusters, locked, span
from agentflow.llm.procedural.mechanisms import WHEELS, data
from agentflow.llm.procedural.reading import Facts, plain
from agentflow.machine.blocks import BOULDER, CONTAINER
from agentflow.machine.edits import apply_script
from agentflow.machine.geometry import Geometry, Placed, PlacedFace, place
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

TRIES = 200
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
    weights = {rule: rule.throw if throws else rule.drive for rule in _rules()}
    for rule in filter(weights.get, weights):
        weights[rule] += 2 * sum(words in facts.told for words in rule.seen)
    for _ in range(TRIES):
        rule = chance.choices(list(weights), list(weights.values()))[0]
        longer = [*script, *_offer(rule, facts, geometry, chance)]
        if len(longer) > len(script) and _works(facts, machine, longer):
            return longer, rule.name
    return script, "nothing more"


def _offer(rule: Rule, facts: Facts, geometry: Geometry, chance: random.Random) -> list[str]:
    """A script of a rule by chance, legal or not; empty where it has no place or block."""
    kinds = [kind for kind in rule.types if kind in facts.types]
    blocks = [block for block in geometry.blocks if block.type in rule.types]
    spots = _spots(rule.at, geometry)
    if not (spots and kinds and (blocks or rule.do in ("Add", "Join"))):
        return []
    kind, spot = chance.choice(kinds), chance.choice(spots)
    if rule.do == "Add":
        return _mirrored(kind, spot, spots)
    if rule.do == "Join":
        foot = chance.choice(_spots("still", geometry))
        far = span(spot[1].position, foot[1].position) > LONG
        return [f"Add {kind} {_at(spot)} {_at(foot)}"] if far else []
    block = chance.choice(blocks)
    if rule.do == "Move":
        return [f"Move {block.id} {_at(spot)}"]
    again = f"Add {kind} to {block.step.parent} in {block.step.face_id}"
    return [f"Remove {block.id}", *([again] if rule.do == "Swap" else [])]


def _at(spot: Spot) -> str:
    return f"to {spot[0].id} in {spot[1].face_id}"


def _mirrored(kind: int, spot: Spot, spots: list[Spot]) -> list[str]:
    """Add a block, and its like on the other side where there is a face for it."""
    x, y, z = spot[1].position
    twins = [twin for twin in spots if twin[1].position == (-x, y, z) and x]
    return [f"Add {kind} {_at(each)}" for each in (spot, *twins[:1])]


def _spots(where: str, geometry: Geometry) -> list[Spot]:
    """Faces in a place of refining.yaml."""
    group, low = clusters(geometry), geometry.box_min[1] + 1.1
    found = []
    for block in geometry.blocks:
        still = group[block.id] == 0
        swung = not still and block.type not in (*WHEELS, CONTAINER, BOULDER)
        for face in block.faces if (swung if where in ("swung", "ahead") else still) else ():
            if (
                (where != "low" or block.box_min[1] < low)
                and (where != "side" or face.facing[0] == "x")
                and (where != "ahead" or "z+" in (face.facing, block.facing))
            ):
                found.append((block, face))
    return found


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
