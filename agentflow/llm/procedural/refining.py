"""Owns refinement: the edit commands that a report suggests, tried on the machine before they are
sent. Seeing what is wrong before a simulation is inspecting.py's.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

from agentflow.llm.procedural.growth import clusters, is_free, locked
from agentflow.llm.procedural.mechanisms import BALLAST, BEAMS, CUBE, HINGE, MOTOR, SPRING, WHEELS
from agentflow.llm.procedural.reading import Facts, command
from agentflow.machine.blocks import BOULDER, CONTAINER, library
from agentflow.machine.edits import apply_script
from agentflow.machine.geometry import Geometry, Placed, PlacedFace, place
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

TRIES = 60
BRACE = 7
SOLID = (*BEAMS, CUBE, BALLAST)
Spot = tuple[Placed, PlacedFace]

RULES: dict[str, tuple[str, tuple[int, ...], str, float, float]] = {
    "widen or weigh down the base": ("Add", SOLID, "low", 2, 0.5),
    "weigh the arm on the other side": ("Add", SOLID, "ahead", 2, 0),
    "hold the boulder elsewhere": ("Move", (CONTAINER, BOULDER), "arm", 2, 0),
    "set the pivot elsewhere": ("Move", (MOTOR, HINGE), "tower", 1, 0),
    "turn the arm": ("Move", BEAMS, "joint", 1, 0),
    "add a spring": ("Add", (SPRING,), "ahead", 2, 0),
    "brace": ("Add", (BRACE,), "tower", 0.5, 0),
    "add powered wheels": ("Add", WHEELS, "side", 0, 2),
    "set a wheel elsewhere": ("Move", WHEELS, "side", 0, 1),
    "take idle mass away": ("Remove", SOLID, "", 1, 3),
    "put another block in its place": ("Swap", SOLID, "", 1, 1),
}
"""What is done -> command, types, place, weight where a boulder is thrown, weight elsewhere."""
SYMPTOMS = {
    "with its top to": ("widen",), "it tips": ("widen",), "tips it": ("widen",),
    "off block": ("brace", "take idle"),
    "not thrown": ("hold the boulder", "turn the arm", "add a spring"),
    "the wrong way": ("turn the arm", "set the pivot"),
    "Motor stalled": ("weigh the arm", "take idle", "hold the boulder"),
    "useless": ("take idle",), "unbalanced": ("weigh the arm",), "too few wheels": ("add powered",),
}  # fmt: skip
"""Words of a report or a critique -> beginnings of the rules that are then likelier."""


def refine(facts: Facts, chance: random.Random) -> str:
    """One or two changes that fit the symptoms."""
    assert facts.machine is not None
    script: list[str] = []
    names = []
    for _ in range(chance.choice((1, 1, 2))):
        script, name = _change(facts, script, chance)
        names += [name] if name else []
    told = facts.report + facts.critique
    seen = ", ".join(words for words in SYMPTOMS if words in told) or "nothing that I know"
    machine = apply_script(facts.machine, "\n".join(script), facts.brief).machine
    body = f"```json\n{machine.to_text()}\n```" if facts.whole else "\n".join(script)
    return (
        f"<Thought Process>\nScore: {facts.score}. What limits it: {seen}.\n</Thought Process>\n"
        f"<Modification Description>\n{', then '.join(names) or 'nothing'}\n"
        "</Modification Description>\n<Simulation Prediction After Modification>\n"
        "A higher score.\n</Simulation Prediction After Modification>\n"
        f"<Modification Steps>\n{body}\n</Modification Steps>"
    )


def _change(facts: Facts, before: list[str], chance: random.Random) -> tuple[list[str], str]:
    """A script that goes on from `before` and works, with what it adds in words, "" for nothing."""
    assert facts.machine is not None
    geometry = place(facts.machine)
    weights = _weights(facts)
    offers = {name: list(_offers(RULES[name], facts, geometry)) for name in weights}
    for _ in range(TRIES):
        name = chance.choices(list(weights), list(weights.values()))[0]
        if offers[name]:
            script = [*before, *chance.choice(offers[name])]
            if _works(facts, facts.machine, script):
                return script, name
    return before, ""


def _weights(facts: Facts) -> dict[str, float]:
    throws = BOULDER in facts.brief.required
    weights = {name: rule[3 if throws else 4] for name, rule in RULES.items()}
    for words, rules in SYMPTOMS.items():
        if words in facts.report + facts.critique:
            for name in weights:
                weights[name] += 2 * (weights[name] > 0 and name.startswith(rules))
    return weights


def _offers(
    rule: tuple[str, tuple[int, ...], str, float, float], facts: Facts, geometry: Geometry
) -> Iterator[list[str]]:
    """All scripts of a rule, legal or not."""
    verb, wanted, where, *_ = rule
    kinds = [kind for kind in wanted if kind in facts.types]
    spots = list(_spots(where, geometry))
    if verb == "Add" and any(library()[kind].linear for kind in kinds):
        ends = list(_spots("any", geometry))
        for a, f in spots:
            for b, g in ends:
                if _span(f, g) > 1.5:
                    yield [f"Add {kinds[0]} to {a.id} in {f.face_id} to {b.id} in {g.face_id}"]
    elif verb == "Add":
        for kind in kinds:
            for spot in spots:
                if is_free(geometry, *spot):
                    yield _mirrored(kind, spot, spots)
    for block in geometry.blocks if verb != "Add" else ():
        if verb == "Move" and block.type in wanted:
            for a, f in spots:
                yield [f"Move {block.id} to {a.id} in {f.face_id}"]
        elif block.type in wanted and verb != "Move":
            yield [f"Remove {block.id}"]
            for kind in kinds if verb == "Swap" else ():
                add = f"Add {kind} to {block.step.parent} in {block.step.face_id}"
                yield [f"Remove {block.id}", add]


def _mirrored(kind: int, spot: Spot, spots: list[Spot]) -> list[str]:
    """Add a block, and its like on the other side where there is a face for it."""
    x, y, z = spot[1].position
    opposite = {"x+": "x-", "x-": "x+"}.get(spot[1].facing, spot[1].facing)
    twins = [s for s in spots if s[1].position == (-x, y, z) and s[1].facing == opposite and x]
    return [f"Add {kind} to {b.id} in {f.face_id}" for b, f in (spot, *twins[:1])]


def _spots(where: str, geometry: Geometry) -> Iterator[Spot]:
    """Faces in a place: low, tower (stand still), arm, ahead, joint (swing), side, any."""
    group, ground = clusters(geometry), geometry.box_min[1] + 1.1
    for block in geometry.blocks:
        still, joint = group[block.id] == 0, block.type in (MOTOR, HINGE)
        fits = {
            "low": still and block.box_min[1] < ground,
            "tower": still,
            "any": still,
            "arm": not still and block.type not in (*WHEELS, CONTAINER, BOULDER),
            "ahead": not still and block.type not in (*WHEELS, CONTAINER, BOULDER),
            "joint": joint,
            "side": still,
        }
        for face in block.faces if fits.get(where) else ():
            if (where != "side" or face.facing[0] == "x") and (
                where != "ahead" or face.facing == "z+" or block.facing == "z+"
            ):
                yield block, face


def _span(a: PlacedFace, b: PlacedFace) -> float:
    return sum(abs(p - q) for p, q in zip(a.position, b.position, strict=True))


def _works(facts: Facts, machine: Machine, script: list[str]) -> bool:
    """Whether the commands can be carried out, are not known to fail and lock no joint."""
    plain = [command(line) for line in script]
    if "; ".join(plain) in facts.failed or any(line in facts.failed for line in plain):
        return False
    outcome = apply_script(machine, "\n".join(script), facts.brief)
    if not outcome.success or outcome.machine == machine:
        return False
    return not locked(place(outcome.machine)) and check(outcome.machine, facts.brief).task_valid
