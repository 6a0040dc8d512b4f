"""Owns planning and building: the meta-designer's blueprint and the designer's machine.

How parts grow is mechanisms.py's.
"""

from __future__ import annotations

import json
import random
import re

from agentflow.llm.procedural.mechanisms import Growth, data, grow, suited
from agentflow.llm.procedural.reading import Facts, line
from agentflow.machine import check, library

LOOSE = "Frame"  # the part that takes any types
TRIES, MOST_TYPES, MOST_BLOCKS = 20, 3, 20  # drafts; per structure (spec 4.2); per dimension


def plan(facts: Facts, chance: random.Random) -> str:
    """A blueprint of one mechanism, with ranges for its dimensions in the guidance."""
    mechanism, parts = chance.choice(suited(facts.brief)), data("mechanisms.yaml")["parts"]
    types = {name: _types(parts[name]["slots"], facts, chance) for name in mechanism["parts"]}
    lacking = set(facts.brief.required).difference(*types.values())
    if lacking:
        types["Payload"] = sorted(lacking)[:MOST_TYPES]
    told, structures, points = [], {}, [mechanism["idea"]]
    for name, kinds in types.items():
        part = parts.get(name, parts[LOOSE])
        dims = [f"{key} {chance.randint(a, (a + b) // 2)} to {chance.randint((a + b + 1) // 2, b)}"
                for key, (a, b) in part["dims"].items()]  # fmt: skip
        words = part["guidance"]
        told.append(
            {"function_name": name, "description": words, "related_function_points": points}
        )
        guidance = f"{words} Counted in blocks: {', '.join(dims)}."
        structures[name] = {"type": kinds, "guidance": guidance}
    blueprint = {"definition": f"{mechanism['name']}: {points[0]}", "function_points": points,
                 "design_structure": told, "build_order": list(types),
                 "machine_structure": structures}  # fmt: skip
    return f"{mechanism['idea']}\n```json\n{json.dumps(blueprint, indent=1)}\n```"


def _types(slots: list[list[int]], facts: Facts, chance: random.Random) -> list[int]:
    """One allowed type per slot, at most three; the root's where nothing else is left."""
    blocks = [kind for kind in facts.brief.blocks if kind and not library()[kind].linear]
    usable = slots if slots[0] else [blocks] * MOST_TYPES
    fills = [[kind for kind in slot if kind in facts.brief.blocks] for slot in usable]
    return list(dict.fromkeys(chance.choice(fill) for fill in fills if fill)) or [0]


def design(facts: Facts, chance: random.Random) -> str:
    """The machine with one structure more, or with a whole mechanism."""
    parts = data("mechanisms.yaml")["parts"]
    shared = {name: len(facts.types.intersection(part["slots"][0])) for name, part in parts.items()}
    now = facts.parts["Structure to build now"]
    wanted, guidance = line(now, "Name"), now.partition("Guidance:")[2]
    guidance += facts.parts["Rationale to follow"]
    likely = max(parts, key=lambda name: (name == wanted, shared[name], name == LOOSE))
    names = [likely] if wanted else chance.choice(suited(facts.brief))["parts"]
    for attempt in range(TRIES):
        growth = Growth(facts, chance)
        told = []
        for name in names:
            ranges = parts[name]["dims"].items()
            heard = guidance if attempt < TRIES / 2 else ""
            dims = {key: _drawn(key, span, heard, chance) for key, span in ranges}
            grow(growth, parts[name], dims)
            told.append(f"{name}: {', '.join(f'{key} {value}' for key, value in dims.items())}.")
        if _done(growth, [parts[name]["slots"][0] for name in names], facts):
            break
    return f"Counted in blocks: {' '.join(told)}\n```json\n{facts.written(growth.machine)}\n```"


def _done(growth: Growth, slots: list[list[int]], facts: Facts) -> bool:
    """Whether it is valid, with what each part is for, and what the task demands of its types."""
    new, usable = {step.type for step in growth.machine.steps[len(facts.machine) :]}, growth.types
    served = bool(new) and all((usable.intersection(slot) or new) & new for slot in slots)
    demanded = facts.brief.required.items()
    loaded = all(growth.machine.count(kind) == n for kind, n in demanded if kind in usable)
    return loaded and served and check(growth.machine, facts.brief).machine_valid


def _drawn(name: str, own: tuple[int, int], guidance: str, chance: random.Random) -> int:
    """A dimension by chance within the range of the guidance, else within the part's own."""
    pattern = rf"\b{re.escape(name)} ([0-9]{{1,3}})(?: to ([0-9]{{1,3}}))?"
    told = re.findall(pattern, guidance)[-1:]
    ends = sorted((int(told[0][0]), int(told[0][1] or told[0][0]))) if told else own
    return min(MOST_BLOCKS, chance.randint(*ends))
