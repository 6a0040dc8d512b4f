"""Owns planning and building: the meta-designer's blueprint and the designer's machine.

How parts grow is mechanisms.py's.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Sequence

from agentflow.llm.procedural.growth import Growth
from agentflow.llm.procedural.mechanisms import Part, grow, parts, suited
from agentflow.llm.procedural.reading import Facts
from agentflow.machine.blocks import library
from agentflow.machine.validity import check

LOOSE = "Frame"
"""The part that takes any types."""
TRIES = 20
"""Drafts of a structure; the first valid one is the answer."""
MOST_TYPES = 3
"""Block types per structure (spec 4.2)."""
MOST_BLOCKS = 20
"""Greatest dimension that is taken from foreign guidance."""


def plan(facts: Facts, chance: random.Random) -> str:
    """A blueprint of one mechanism, with ranges for its dimensions in the guidance."""
    mechanism = chance.choice(suited(facts.brief))
    types = {name: _types(parts()[name], facts, chance) for name in mechanism.parts}
    lacking = set(facts.brief.required).difference(*types.values())
    if lacking:
        types["Payload"] = sorted(lacking)[:MOST_TYPES]
    told = {name: parts().get(name, parts()[LOOSE]) for name in types}
    points = [mechanism.idea]
    blueprint = {
        "definition": f"{mechanism.name}: {mechanism.idea}",
        "function_points": points,
        "design_structure": [
            {"function_name": name, "description": part.guidance, "related_function_points": points}
            for name, part in told.items()
        ],
        "build_order": list(types),
        "machine_structure": {
            name: {"type": types[name], "guidance": f"{part.guidance} {_narrowed(part, chance)}"}
            for name, part in told.items()
        },
    }
    return f"{mechanism.idea}\n```json\n{json.dumps(blueprint, indent=1)}\n```"


def _types(part: Part, facts: Facts, chance: random.Random) -> list[int]:
    """One allowed type per slot, at most three; the root's where nothing else is left."""
    blocks = [kind for kind in facts.brief.blocks if kind and not library()[kind].linear]
    slots = part.slots if part.slots[0] else [blocks] * MOST_TYPES
    fills = [[kind for kind in slot if kind in facts.brief.blocks] for slot in slots]
    return list(dict.fromkeys(chance.choice(fill) for fill in fills if fill)) or [0]


def _narrowed(part: Part, chance: random.Random) -> str:
    """The dimensions in words: for each a range within the honest one."""
    told = []
    for name, (least, most) in part.dims.items():
        low, high = sorted((chance.randint(least, most), chance.randint(least, most)))
        told.append(f"{name} {low} to {high}")
    return f"Counted in blocks: {', '.join(told)}."


def design(facts: Facts, chance: random.Random) -> str:
    """The machine with one structure more, or with a whole mechanism."""
    names = (_known(facts),) if facts.structure else chance.choice(suited(facts.brief)).parts
    start = len(facts.machine) if facts.machine else 1
    for attempt in range(TRIES):
        growth = Growth(facts.machine, facts.types, facts.brief, chance)
        guidance = facts.guidance if attempt < TRIES / 2 else ""
        told = []
        for name in names:
            dims = {key: _drawn(key, parts()[name], guidance, chance) for key in parts()[name].dims}
            grow(growth, name, dims)
            told.append(f"{name}: {', '.join(f'{key} {value}' for key, value in dims.items())}.")
        if _done(growth, names, start, facts):
            break
    words = f"{len(growth.machine) - start} blocks more. {' '.join(told)}"
    return f"{words}\n```json\n{growth.machine.to_text()}\n```"


def _done(growth: Growth, names: Sequence[str], start: int, facts: Facts) -> bool:
    """Whether it is valid, with what each part is for, and what the task demands of its types."""
    new = {step.type for step in growth.machine.steps[start:]}
    usable = growth.types
    main = [usable.intersection(parts()[name].slots[0]) or new for name in names]
    demanded = facts.brief.required.items()
    loaded = all(growth.machine.count(kind) == n for kind, n in demanded if kind in usable)
    served = bool(new) and all(kinds & new for kinds in main)
    return loaded and served and check(growth.machine, facts.brief).machine_valid


def _drawn(name: str, part: Part, guidance: str, chance: random.Random) -> int:
    """A dimension by chance within the range of the guidance, else within the part's own."""
    pattern = rf"\b{re.escape(name)} ([0-9]{{1,3}})(?: to ([0-9]{{1,3}}))?"
    told = re.findall(pattern, guidance)[-1:]
    least, most = (int(told[0][0]), int(told[0][1] or told[0][0])) if told else part.dims[name]
    return min(MOST_BLOCKS, chance.randint(min(least, most), max(least, most)))


def _known(facts: Facts) -> str:
    """The part of the structure's name, else the one whose main types it has most of."""
    shared = {name: len(facts.types.intersection(part.slots[0])) for name, part in parts().items()}
    best = max(shared, key=lambda name: shared[name])
    return facts.structure if facts.structure in parts() else best if shared[best] else LOOSE
