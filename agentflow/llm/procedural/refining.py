"""Owns refinement: the edit commands that a report suggests, tried on the machine before sending.

Seeing what is wrong before a simulation is inspecting.py's.
"""

from __future__ import annotations

import random
from math import dist
from typing import Any

from agentflow.llm.procedural.mechanisms import WHEELS, clusters, data, locked, purpose
from agentflow.llm.procedural.reading import Facts, plain
from agentflow.machine.blocks import BOULDER, CONTAINER
from agentflow.machine.edits import apply_script
from agentflow.machine.geometry import Geometry, Placed, PlacedFace, place
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

Spot = tuple[Placed, PlacedFace]
TRIES, LONG = 200, 1.5  # most tries; least length of a two-ended block, m


def refine(facts: Facts, machine: Machine, chance: random.Random) -> str:
    """One or two changes that fit the symptoms."""
    geometry = place(machine)
    about = purpose(facts.brief)
    rules = [rule for rule in data("refining.yaml") if about in rule["for"]]
    weights = [
        rule["for"][about] + 2 * sum(w in facts.told for w in rule["seen"]) for rule in rules
    ]
    script: list[str] = []
    names: list[str] = []
    wanted = chance.choice((1, 1, 2))
    for rule in chance.choices(rules, weights, k=TRIES):
        change = _offer(rule, facts, geometry, chance) if len(names) < wanted else []
        if change and _works(facts, machine, [*script, *change]):
            script, names = [*script, *change], [*names, rule["name"]]
    edited = apply_script(machine, "\n".join(script), facts.brief).machine
    seen = {words for rule in rules for words in rule["seen"] if words in facts.told}
    return str(data("replies.yaml")["refinement"]).format(
        seen=", ".join(sorted(seen)) or "nothing I know of",
        names=", then ".join(names) or "nothing that works",
        body=f"```json\n{facts.written(edited)}\n```" if facts.whole else "\n".join(script),
    )


def _offer(rule: Any, facts: Facts, geometry: Geometry, chance: random.Random) -> list[str]:
    """A script of a rule by chance, legal or not; empty where it has no place or block."""
    kinds = [kind for kind in rule["types"] if kind in facts.types]
    blocks = [block for block in geometry.blocks if block.type in rule["types"]]
    spots, adds = _spots(rule["at"], geometry), rule["do"] in ("Add", "Join")
    if not (spots and kinds and (blocks or adds)):
        return []
    kind, spot = chance.choice(kinds), chance.choice(spots)
    if rule["do"] == "Join":
        foot = chance.choice(_spots("still", geometry))
        far = dist(spot[1].position, foot[1].position) > LONG
        return [f"Add {kind} {_at(spot)} {_at(foot)}"] if far else []
    if rule["do"] == "Add":  # and its like on the other side, where there is a face for it
        x, y, z = spot[1].position
        twins = [twin for twin in spots if twin[1].position == (-x, y, z) and x]
        return [f"Add {kind} {_at(each)}" for each in (spot, *twins[:1])]
    block = chance.choice(blocks)
    again = [f"Add {kind} to {block.step.parent} in {block.step.face_id}"]
    move = [f"Move {block.id} {_at(spot)}"]
    removed = [f"Remove {block.id}", *(again if rule["do"] == "Swap" else [])]
    return move if rule["do"] == "Move" else removed


def _at(spot: Spot) -> str:
    return f"to {spot[0].id} in {spot[1].face_id}"


def _spots(where: str, geometry: Geometry) -> list[Spot]:
    """Faces in a place of refining.yaml."""
    group, low = clusters(geometry), geometry.box_min[1] + 1.1
    moves, held = where in ("swung", "ahead"), (*WHEELS, CONTAINER, BOULDER)
    blocks = [b for b in geometry.blocks if bool(group[b.id]) == moves and b.type not in held]
    spots = [(b, f) for b in blocks if where != "low" or b.box_min[1] < low for f in b.faces]
    if where in ("ahead", "front"):
        return [(b, f) for b, f in spots if "z+" in (f.facing, b.facing)]
    return [(b, f) for b, f in spots if where != "side" or f.facing[0] == "x"]


def _works(facts: Facts, machine: Machine, script: list[str]) -> bool:
    """Whether the commands can be carried out, are not known to fail and lock no joint."""
    if {plain(script), *(plain([line]) for line in script)} & facts.failed:
        return False
    outcome = apply_script(machine, "\n".join(script), facts.brief)
    if not outcome.success or outcome.machine == machine or locked(place(outcome.machine)):
        return False
    return check(outcome.machine, facts.brief).task_valid
