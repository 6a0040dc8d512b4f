"""Answers of the meta-designer (blueprints) and the designer (machines)."""

from __future__ import annotations

import json
import random
import re

from agentflow.llm.procedural.controlling import add_controllers, add_program
from agentflow.llm.procedural.mechanisms import (
    Builder,
    build_part,
    known_mechanisms,
    suitable_mechanisms,
)
from agentflow.llm.procedural.reading import PromptContent, value_of
from agentflow.machine import Machine, check, library

ANY_TYPES = "Frame"  # the part that takes any types
ATTEMPTS = 20
MAX_TYPES = 3  # per structure
MAX_BLOCKS = 20  # per dimension


def plan(prompt: PromptContent, rng: random.Random) -> str:
    """Write a blueprint of one mechanism, with ranges for its dimensions in the guidance."""
    mechanism = rng.choice(suitable_mechanisms(prompt.brief))
    parts = known_mechanisms(prompt.brief)["parts"]
    types = {name: _choose_types(parts[name]["slots"], prompt, rng) for name in mechanism["parts"]}
    missing = set(prompt.brief.required).difference(*types.values())
    if missing:
        types["Payload"] = sorted(missing)[:MAX_TYPES]
    functions, structures, points = [], {}, [mechanism["idea"]]
    for name, kinds in types.items():
        part = parts.get(name, parts[ANY_TYPES])
        dims = [f"{key} {rng.randint(a, (a + b) // 2)} to {rng.randint((a + b + 1) // 2, b)}"
                for key, (a, b) in part["dims"].items()]  # fmt: skip
        text = part["guidance"]
        functions.append(
            {"function_name": name, "description": text, "related_function_points": points}
        )
        guidance = f"{text} Dimensions in blocks: {', '.join(dims)}."
        structures[name] = {"type": kinds, "guidance": guidance}
    blueprint = {"definition": f"{mechanism['name']}: {points[0]}", "function_points": points,
                 "design_structure": functions, "build_order": list(types),
                 "machine_structure": structures}  # fmt: skip
    return f"{mechanism['idea']}\n```json\n{json.dumps(blueprint, indent=1)}\n```"


def _choose_types(slots: list[list[int]], prompt: PromptContent, rng: random.Random) -> list[int]:
    """Choose an allowed type per slot, at most three; type 0 if there is none."""
    blocks = [kind for kind in prompt.brief.blocks if kind and not library()[kind].linear]
    usable = slots if slots[0] else [blocks] * MAX_TYPES
    fills = [[kind for kind in slot if kind in prompt.brief.blocks] for slot in usable]
    return list(dict.fromkeys(rng.choice(fill) for fill in fills if fill)) or [0]


def design(prompt: PromptContent, rng: random.Random) -> str:
    """Answer with the machine extended by one structure, or with a whole mechanism."""
    machine, notes = build_machine(prompt, rng)
    return (
        f"Dimensions in blocks: {' '.join(notes)}\n```json\n{prompt.format_machine(machine)}\n```"
    )


def build_machine(prompt: PromptContent, rng: random.Random) -> tuple[Machine, list[str]]:
    """Extend the machine by one structure, or build a whole mechanism; notes on its parts."""
    parts = known_mechanisms(prompt.brief)["parts"]
    shared = {name: len(prompt.types & {*part["slots"][0]}) for name, part in parts.items()}
    structure = prompt.sections["Structure to build now"]
    wanted, guidance = value_of(structure, "Name"), structure.partition("Guidance:")[2]
    guidance += prompt.sections["Rationale to follow"]
    likely = max(parts, key=lambda name: (name == wanted, shared[name], name == ANY_TYPES))
    names = [likely] if wanted else rng.choice(suitable_mechanisms(prompt.brief))["parts"]
    for attempt in range(ATTEMPTS):
        builder = Builder(prompt, rng)
        notes = []
        for name in names:
            ranges = parts[name]["dims"].items()
            hints = guidance if attempt < ATTEMPTS / 2 else ""
            dims = {key: _draw_dimension(key, span, hints, rng) for key, span in ranges}
            build_part(builder, parts[name], dims)
            notes.append(f"{name}: {', '.join(f'{key} {value}' for key, value in dims.items())}.")
        if _is_complete(builder, [parts[name]["slots"][0] for name in names], prompt):
            break
    ranges = [entry for name in names for entry in parts[name].get("controls", ())]
    laws = [parts[name]["controllers"] for name in names if "controllers" in parts[name]]
    machine, limits = builder.machine, prompt.brief.limits
    machine = add_controllers(machine, laws, rng) if limits.senses else machine
    return add_program(machine, limits.controls, rng, ranges), notes


def _is_complete(builder: Builder, slots: list[list[int]], prompt: PromptContent) -> bool:
    """Whether the machine is valid and has each part's main block and the required blocks."""
    machine, usable = builder.machine, builder.types
    new = {step.type for step in machine.steps[len(prompt.machine) :]}
    has_parts = bool(new) and all((usable.intersection(slot) or new) & new for slot in slots)
    required = prompt.brief.required.items()
    has_required = all(machine.count(kind) == n for kind, n in required if kind in usable)
    return has_required and has_parts and not check(machine, prompt.brief).lasting_problems


def _draw_dimension(name: str, own: tuple[int, int], guidance: str, rng: random.Random) -> int:
    """Draw a dimension from the range in the guidance, else from the part's own range."""
    pattern = rf"\b{re.escape(name)} ([0-9]{{1,3}})(?: to ([0-9]{{1,3}}))?"
    found = re.findall(pattern, guidance)[-1:]
    ends = sorted((int(found[0][0]), int(found[0][1] or found[0][0]))) if found else own
    return min(MAX_BLOCKS, rng.randint(*ends))
