"""Owns planning and building: the meta-designer's blueprint and the designer's machine.

The rules by which parts grow are mechanisms.py's.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Mapping

from agentflow.llm.procedural.growth import Growth
from agentflow.llm.procedural.mechanisms import LOOSE, PARTS, Mechanism, Part, suited
from agentflow.llm.procedural.reading import Facts
from agentflow.machine.blocks import library
from agentflow.machine.validity import check

TRIES = 12
"""Drafts of a structure; the first valid one is the answer."""
MOST_TYPES = 3
"""Block types per structure (spec 4.2)."""


def plan(facts: Facts, chance: random.Random) -> str:
    """A blueprint of one mechanism, with ranges for its dimensions in the guidance."""
    mechanism = chance.choice(suited(facts.brief))
    parts = {part.name: _types(part, facts, chance) for part in mechanism.parts}
    parts = {name: types for name, types in parts.items() if types} or {LOOSE.name: [0]}
    left = sorted(set(facts.brief.required) - {k for types in parts.values() for k in types} - {0})
    if left:
        parts["Payload"] = left[:MOST_TYPES]
    blueprint = _blueprint(mechanism, parts, chance)
    words = f"{mechanism.idea} Structures: {', '.join(parts)}."
    return f"{words}\n```json\n{json.dumps(blueprint, indent=1)}\n```"


def _blueprint(
    mechanism: Mechanism, parts: Mapping[str, list[int]], chance: random.Random
) -> dict[str, object]:
    known = {name: PARTS.get(name, LOOSE) for name in parts}
    return {
        "definition": f"{mechanism.name}: {mechanism.idea}",
        "function_points": [part.duty for part in known.values()],
        "design_structure": [
            {
                "function_name": name,
                "description": part.duty,
                "related_function_points": [part.duty],
            }
            for name, part in known.items()
        ],
        "build_order": list(parts),
        "machine_structure": {
            name: {
                "type": types,
                "guidance": f"{known[name].guidance} {_told(known[name], chance)}",
            }
            for name, types in parts.items()
        },
    }


def _types(part: Part, facts: Facts, chance: random.Random) -> list[int]:
    """One allowed type per slot, at most three; all that is allowed where a part names none."""
    open_to = [k for k in facts.brief.blocks if k and not library()[k].linear]
    slots = part.slots if any(part.slots) else tuple((k,) for k in open_to)
    fills = [[k for k in slot if k in facts.brief.blocks] for slot in slots]
    return list(dict.fromkeys(chance.choice(fill) for fill in fills if fill))[:MOST_TYPES]


def _told(part: Part, chance: random.Random) -> str:
    """The dimensions as words: for each a narrower range within the honest one."""
    told = []
    for name, (least, most) in part.ranges.items():
        low = chance.randint(least, most)
        high = chance.randint(low, most)
        told.append(f"{name} {low}" if low == high else f"{name} {low} to {high}")
    return f"Counted in blocks: {', '.join(told)}."


def design(facts: Facts, chance: random.Random) -> str:
    """The machine extended by one structure, or by a whole mechanism."""
    if facts.structure:
        name, parts = facts.structure, [_part(facts)]
    else:
        mechanism = chance.choice(suited(facts.brief))
        name, parts = mechanism.name, list(mechanism.parts)
    grown, told = _draft(facts, parts, chance), {}
    for _ in range(TRIES):
        grown = _draft(facts, parts, chance)
        told = grown[1]
        if _complete(facts, grown[0]):
            break
    dims = ", ".join(f"{key} {value}" for key, value in told.items())
    added = len(grown[0].machine) - (len(facts.machine) if facts.machine else 0)
    words = f"{name}: {added} blocks added; counted in blocks: {dims or 'nothing'}."
    return f"{words}\n```json\n{grown[0].machine.to_text()}\n```"


def _draft(facts: Facts, parts: list[Part], chance: random.Random) -> tuple[Growth, dict[str, int]]:
    growth = Growth(facts.machine, facts.types, facts.brief.size_limit, chance)
    told: dict[str, int] = {}
    for part in parts:
        dims = {name: _drawn(name, part, facts.guidance, chance) for name in part.ranges}
        part.grow(growth, dims)
        told.update(dims)
    if facts.last:
        _payload(growth, facts)
    return growth, told


def _drawn(name: str, part: Part, guidance: str, chance: random.Random) -> int:
    """A dimension by chance within the range of the guidance, else within the part's own."""
    found = re.search(rf"\b{re.escape(name)} (\d{{1,3}})(?: to (\d{{1,3}}))?", guidance)
    low, high = part.ranges[name]
    if found:
        low, high = int(found[1]), int(found[2] or found[1])
    return chance.randint(min(low, high), max(low, high))


def _part(facts: Facts) -> Part:
    """The rule for a structure: of its name, else the one that shares most block types."""
    if facts.structure in PARTS:
        return PARTS[facts.structure]

    def shared(part: Part) -> int:
        return len(facts.types & {kind for slot in part.slots for kind in slot})

    best = max(PARTS.values(), key=shared)
    return best if shared(best) else LOOSE


def _payload(growth: Growth, facts: Facts) -> None:
    """Hang what the task demands and still lacks wherever it fits."""
    for kind, count in sorted(facts.brief.required.items()):
        usable = kind in facts.types and not library()[kind].linear
        spots = [(b.id, f.face_id) for b in growth.geometry.blocks for f in growth.free(b.id)]
        growth.chance.shuffle(spots)
        for spot in spots if usable else ():
            if growth.machine.count(kind) >= count:
                break
            growth.add(kind, spot)


def _complete(facts: Facts, growth: Growth) -> bool:
    report = check(growth.machine, facts.brief)
    grown = len(growth.machine) > (len(facts.machine) if facts.machine else 1)
    return grown and (report.task_valid if facts.last else report.machine_valid)
