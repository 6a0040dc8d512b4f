"""Owns refinement: the edit commands that a report suggests, tried on the machine before sending.

Seeing what is wrong before a simulation is inspecting.py's.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterable, Set
from math import dist
from typing import Any

from agentflow.llm.procedural.mechanisms import WHEELS, clusters, data, locked, purpose
from agentflow.llm.procedural.reading import Facts
from agentflow.machine import Geometry, apply_script, check, place
from agentflow.machine.blocks.library import BOULDER, CONTAINER

Spot = tuple[tuple[float, ...], str]  # a face's place in the machine, and its name in a command
TRIES, LONG = 200, 1.5  # most tries; least length of a two-ended block, m
_COMMAND = re.compile(r"(?:add|remove|move) ?[\d\[][\d\[\] toin]*", re.IGNORECASE)
_ENTRY = re.compile(r"^(?:> ?)?\d{1,6}\. ", re.MULTILINE)
_CHANGE = re.compile(r"(-?\d{1,6}\.?\d{0,6}) -> (-?\d{1,6}\.?\d{0,6})")


def refine(facts: Facts, chance: random.Random) -> str:
    """One or two changes that fit the symptoms."""
    geometry, failed, about = place(facts.machine), _failures(facts), purpose(facts.brief)
    told = facts.parts["Simulation feedback"] + facts.parts["Critique"]
    rules = [rule for rule in data("refining.yaml") if about in rule["for"]]
    signs = [[words for words in rule["seen"] if words in told] for rule in rules]
    weights = [rule["for"][about] + 2 * len(seen) for rule, seen in zip(rules, signs, strict=True)]
    script, names, wanted = list[str](), list[str](), chance.choice((1, 1, 2))
    for rule in chance.choices(rules, weights, k=TRIES):
        change = _offer(rule, facts, geometry, chance) if len(names) < wanted else []
        if change and _works(facts, [*script, *change], failed):
            script, names = [*script, *change], [*names, rule["name"]]
    edited = apply_script(facts.machine, "\n".join(script), facts.brief).machine
    whole = "whole modified machine" in facts.parts["Your reply"]
    return str(data("replies.yaml")["refinement"]).format(
        seen=", ".join(sorted({words for seen in signs for words in seen})) or "nothing I know of",
        names=", then ".join(names) or "nothing that works",
        body=f"```json\n{facts.written(edited)}\n```" if whole else "\n".join(script),
    )


def _offer(rule: Any, facts: Facts, geometry: Geometry, chance: random.Random) -> list[str]:
    """A script of a rule by chance, legal or not; empty where it has no place or block."""
    kinds = [kind for kind in rule["types"] if kind in facts.types]
    blocks = [block for block in geometry.blocks if block.type in rule["types"]]
    spots, adds = _spots(rule["at"], geometry), rule["do"] in ("Add", "Join")
    if not (spots and kinds and (blocks or adds)):
        return []
    kind, (at, face) = chance.choice(kinds), chance.choice(spots)
    if rule["do"] == "Join":
        foot, other = chance.choice(_spots("still", geometry))
        return [f"Add {kind} {face} {other}"] if dist(at, foot) > LONG else []
    if rule["do"] == "Add":  # and its like on the other side, where there is a face for it
        twins = [twin for spot, twin in spots if spot == (-at[0], *at[1:]) and at[0]]
        return [f"Add {kind} {each}" for each in (face, *twins[:1])]
    block = chance.choice(blocks)
    if rule["do"] == "Move":
        return [f"Move {block.id} {face}"]
    again = [f"Add {kind} to {block.step.parent} in {block.step.face_id}"]
    return [f"Remove {block.id}", *(again if rule["do"] == "Swap" else [])]


def _spots(where: str, geometry: Geometry) -> list[Spot]:
    """Faces in a place of refining.yaml."""
    group, low = clusters(geometry), geometry.box_min[1] + 1.1
    moves, held = where in ("swung", "ahead"), (*WHEELS, CONTAINER, BOULDER)
    blocks = [b for b in geometry.blocks if bool(group[b.id]) == moves and b.type not in held]
    found = [(b, f) for b in blocks if where != "low" or b.box_min[1] < low for f in b.faces]
    if where in ("ahead", "front"):
        found = [(b, f) for b, f in found if "z+" in (f.facing, b.facing)]
    if where == "side":
        found = [(b, f) for b, f in found if f.facing[0] == "x"]
    return [(f.position, f"to {b.id} in {f.face_id}") for b, f in found]


def _works(facts: Facts, script: list[str], failed: Set[str]) -> bool:
    """Whether the commands can be carried out, are not known to fail and lock no joint."""
    if {_plain(script), *(_plain([line]) for line in script)} & failed:
        return False
    outcome = apply_script(facts.machine, "\n".join(script), facts.brief)
    if not outcome.success or outcome.machine == facts.machine or locked(place(outcome.machine)):
        return False
    return check(outcome.machine, facts.brief).task_valid


def _failures(facts: Facts) -> set[str]:
    """Lines marked Error, and the scripts of edits that failed or did not raise the score."""
    told = f"{facts.parts['Earlier attempts']}\n{facts.later}".splitlines()
    failed = {_plain(_COMMAND.findall(line)[:1]) for line in told if ": Error" in line}
    for entry in _ENTRY.split(facts.parts["Edit history"]):
        change = _CHANGE.search(entry)
        if "Error" in entry or (change and float(change[2]) <= float(change[1])):
            failed.add(_plain(_COMMAND.findall(entry)))
    return failed


def _plain(commands: Iterable[str]) -> str:
    """Edit commands in plain letters, for comparison."""
    return "; ".join(" ".join(re.sub(r"[\[\]]", " ", line).lower().split()) for line in commands)
