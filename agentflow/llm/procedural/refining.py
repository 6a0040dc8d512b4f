"""Answers about machines that exist: of the refiner, which edits, of inspector, querier and
analyst; and control programs."""

import json
import random
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from math import dist
from typing import Any, NamedTuple

from agentflow.files.ranges import draw_numbers
from agentflow.llm.procedural import mechanisms
from agentflow.llm.procedural.reading import PromptContent
from agentflow.machine import Geometry, Machine, apply_script, check, place
from agentflow.machine.blocks.library import BOULDER, CONTAINER
from agentflow.machine.controllers.model import Controllers
from agentflow.machine.controls import control_text, driven_blocks
from agentflow.machine.edits.moves import random_control, with_random_program
from agentflow.machine.geometry.balance import centre_of_mass, stands, support_polygon
from agentflow.machine.numbers import numbers_of
from agentflow.machine.tree import Control
from agentflow.machine.validity import budget_problems

BY_THEMSELVES = ("grabbers", "decouplers")
"""Groups that need no control: grabbers grip by themselves, and decouplers should hold at first."""
TUNED = 0.8
"""Share of changes that change a number of the controllers, where there are some."""
MORE = 2
"""Most random entries of a first program."""


def add_program(
    machine: Machine,
    window: float | None,
    rng: random.Random,
    ranges: Sequence[Mapping[str, Any]] = (),
) -> Machine:
    """The machine with a program that switches all groups on; nothing where none is allowed.

    Args:
        machine: With or without controls.
        window: Latest end of a control, s; None if machines may not bring any.
        rng: Random generator.
        ranges: For groups that a mechanism controls in its own way: `group`, and least and most of
            `at` (s), `for` (s) and `level`; one entry each, or several in order, such as full
            thrust and then less.
    """
    if window is None:
        return machine
    named = {control.target for control in machine.controls}
    sensed = machine.controllers.outputs if machine.controllers else ()
    driven = {*driven_blocks(machine).values()}.difference(output.group for output in sensed)
    drawn = [_draw_control(item, window, rng) for item in ranges if item["group"] in driven - named]
    groups = sorted(driven.difference(named, BY_THEMSELVES, (each.target for each in drawn)))
    on = (Control(group, 0.0, window, 1.0) for group in groups)
    switched = replace(machine, controls=(*machine.controls, *drawn, *on))
    more = bool(groups) and rng.random() < 0.5
    return with_random_program(switched, window, rng, MORE) if more else switched


def _draw_control(item: Mapping[str, Any], window: float, rng: random.Random) -> Control:
    """A control with numbers from the ranges, within the window."""
    at, lasts, level = (round(rng.uniform(*item[key]), 2) for key in ("at", "for", "level"))
    at = min(at, window / 2)
    return Control(item["group"], at, min(lasts, window - at), level)


def add_controllers(
    machine: Machine, templates: Sequence[Mapping[str, Any]], rng: random.Random
) -> Machine:
    """The machine with the controllers of its mechanisms, besides those that it has, with numbers
    drawn from the ranges; without those that drive nothing or name a type that it has not."""
    driven = {*driven_blocks(machine).values()}
    data: dict[str, Any] = {"sensors": {}, "laws": {}, "outputs": []}
    if machine.controllers:
        data = machine.controllers.to_json()
    for template in templates:
        own = draw_numbers(template, rng)
        groups = {output["group"] for output in own["outputs"]}
        taken = {output.get("group") for output in data["outputs"]}
        for sensor in own["sensors"].values():
            if kind := sensor.pop("type", 0):
                sensor["block"] = next((step.id for step in machine if step.type == kind), None)
        lacks = any(sensor.get("block", 0) is None for sensor in own["sensors"].values())
        if groups & taken or not groups <= driven or lacks:
            continue
        data["sensors"].update(own["sensors"])
        data["laws"].update(own["laws"])
        data["outputs"] += own["outputs"]
    if not data["laws"]:
        return machine
    return replace(machine, controllers=Controllers.model_validate(data))


def change_program(machine: Machine, window: float, rng: random.Random) -> list[str]:
    """Commands that add a random entry, or put one in place of another, or change a number of the
    controllers; [] if nothing is driven."""
    numbers = numbers_of(machine.controllers) if machine.controllers else ()
    tunable = [number for number in numbers if number.value]
    if tunable and rng.random() < TUNED:
        path, value, *_ = rng.choice(tunable)
        return [f"Set {path} {value * rng.uniform(0.6, 1.6):.3g}"]
    new = random_control(machine, window, rng)
    if new is None:
        return []
    old = rng.randrange(len(machine.controls) + 1)
    replaced = [f"Uncontrol {old}"] if old < len(machine.controls) else []
    return [*replaced, control_text(new)]


FacePosition = tuple[tuple[float, ...], str]  # a face's position, and its name in a command
REVISED = 0.5  # share of changes that revise the control program, where there is one
ATTEMPTS, MIN_LENGTH = 200, 1.5  # changes tried; length of a two-ended block, m
TRIALS = "Trials of single edits"  # how what local trials showed begins
ADOPTED, COMBINED = 0.6, 0.5  # shares of changes that adopt a gain, and of further gains added
_GAIN = re.compile(r"^(?:> ?)?- ([A-Z][^:\n]{1,400}): \+\d", re.MULTILINE)
_COMMAND = re.compile(r"(?:add|remove|move) ?[\d\[][\d\[\] toin]*", re.IGNORECASE)
_ENTRY = re.compile(r"^(?:> ?)?\d{1,6}\. ", re.MULTILINE)
_CHANGE = re.compile(r"(-?\d{1,6}\.?\d{0,6}) -> (-?\d{1,6}\.?\d{0,6})")


class Change(NamedTuple):
    """A change of a machine and the reasons for it."""

    script: list[str]
    """Commands; empty if no change was found."""
    rules: list[str]
    """Names of the rules that proposed it."""
    seen: list[str]
    """Symptoms that rules know."""


def refine(prompt: PromptContent, rng: random.Random) -> str:
    """Answer with one or two changes that fit the symptoms."""
    script, names, seen = propose_change(prompt, rng, _failed_scripts(prompt))
    edited = apply_script(prompt.machine, "\n".join(script), prompt.brief).machine
    whole = "whole modified machine" in prompt.sections["Your reply"]
    return str(mechanisms.load_data("replies.yaml")["refinement"]).format(
        seen=", ".join(seen) or "no known symptom",
        names=", then ".join(names) or "no change found",
        body=f"```json\n{prompt.format_machine(edited)}\n```"
        if whole
        else "\n".join(script) or "No change found.",  # not an empty script, which is accepted
    )


def propose_change(prompt: PromptContent, rng: random.Random, failed: Set[str]) -> Change:
    """One or two changes that fit the symptoms; `failed` are scripts not to try again."""
    geometry, goal = place(prompt.machine), mechanisms.purpose(prompt.brief)
    feedback, _, trials = prompt.sections["Simulation feedback"].partition(TRIALS)
    script = _adopted_gains(prompt, trials, rng, failed)
    names = ["what trials showed"] * bool(script)
    symptoms = feedback + prompt.sections["Critique"]
    every = mechanisms.load_data("refining.yaml")
    rules = [rule for rule in every if goal in rule["for"]] or every
    matches = [[words for words in rule["seen"] if words in symptoms] for rule in rules]
    weights = [
        rule["for"].get(goal, 1) + 2 * len(seen) for rule, seen in zip(rules, matches, strict=True)
    ]
    window = prompt.brief.limits.controls
    tried = "only its controls may change" in prompt.sections["Controls"]
    if window is not None and (tried or rng.random() < REVISED):
        program = change_program(prompt.machine, window, rng)
        if program and _is_usable(prompt, [*script, *program], failed):
            return Change([*script, *program], [*names, "other controls"], [])
    wanted = rng.choice((1, 1, 2)) + bool(script)
    for rule in rng.choices(rules, weights, k=ATTEMPTS):
        change = _propose(rule, prompt, geometry, rng) if len(names) < wanted else []
        if change and _is_usable(prompt, [*script, *change], failed):
            script, names = [*script, *change], [*names, rule["name"]]
    return Change(script, names, sorted({words for seen in matches for words in seen}))


def _adopted_gains(
    prompt: PromptContent, trials: str, rng: random.Random, failed: Set[str]
) -> list[str]:
    """The edits of local trials that raised the score, the best and some others, as far as they go
    together; none in some of the replies. Another change is added to them."""
    gains = [gain.split("; ") for gain in _GAIN.findall(trials)]
    script = list[str]()
    if not gains or rng.random() >= ADOPTED:
        return script
    for gain in gains:
        wanted = not script or rng.random() < COMBINED
        if wanted and _is_usable(prompt, [*script, *gain], failed):
            script = [*script, *gain]
    return script


def _propose(rule: Any, prompt: PromptContent, geometry: Geometry, rng: random.Random) -> list[str]:
    """A random script of a rule, legal or not; empty if it finds no face or block."""
    kinds = [kind for kind in rule["types"] if kind in prompt.types]
    blocks = [block for block in geometry.blocks if block.type in rule["types"]]
    spots, adds = _faces_at(rule["at"], geometry), rule["do"] in ("Add", "Join")
    if not (spots and kinds and (blocks or adds)):
        return []
    kind, (at, face) = rng.choice(kinds), rng.choice(spots)
    if rule["do"] == "Join":
        foot, other = rng.choice(_faces_at("still", geometry))
        return [f"Add {kind} {face} {other}"] if dist(at, foot) > MIN_LENGTH else []
    if rule["do"] == "Add":  # and its mirror image, if there is a face for it
        twins = [twin for spot, twin in spots if spot == (-at[0], *at[1:]) and at[0]]
        return [f"Add {kind} {each}" for each in (face, *twins[:1])]
    block = rng.choice(blocks)
    if rule["do"] == "Move":
        return [f"Move {block.id} {face}"]
    again = [f"Add {kind} to {block.step.parent} in {block.step.face_id}"]
    return [f"Remove {block.id}", *(again if rule["do"] == "Swap" else [])]


def _faces_at(where: str, geometry: Geometry) -> list[FacePosition]:
    """Faces at a location named in refining.yaml."""
    group, low = mechanisms.rigid_groups(geometry), geometry.box_min[1] + 1.1
    moves, loads = where in ("swung", "ahead"), (*mechanisms.WHEELS, CONTAINER, BOULDER)
    blocks = [b for b in geometry.blocks if bool(group[b.id]) == moves and b.type not in loads]
    found = [(b, f) for b in blocks if where != "low" or b.box_min[1] < low for f in b.faces]
    if where in ("ahead", "front"):
        found = [(b, f) for b, f in found if "z+" in (f.facing, b.facing)]
    if where == "side":
        found = [(b, f) for b, f in found if f.facing[0] == "x"]
    return [(f.position, f"to {b.id} in {f.face_id}") for b, f in found]


def _is_usable(prompt: PromptContent, script: list[str], failed: Set[str]) -> bool:
    """Whether a script can be applied, has not failed before and locks no joint."""
    if {normalise(script), *(normalise([line]) for line in script)} & failed:
        return False
    adds = [line for line in script if line.startswith("Add")]
    if adds == script and budget_problems(len(prompt.machine) + len(adds), prompt.brief):
        return False  # quick to tell: most changes add blocks, and a full machine takes none
    outcome = apply_script(prompt.machine, "\n".join(script), prompt.brief)
    if not outcome.success or outcome.machine == prompt.machine:
        return False
    locks = mechanisms.has_locked_joint(place(outcome.machine))
    return not locks and check(outcome.machine, prompt.brief).task_valid


def _failed_scripts(prompt: PromptContent) -> set[str]:
    """Commands marked Error, and scripts that failed or did not raise the score."""
    lines = f"{prompt.sections['Earlier attempts']}\n{prompt.later}".splitlines()
    failed = {normalise(_COMMAND.findall(line)[:1]) for line in lines if ": Error" in line}
    for entry in _ENTRY.split(prompt.sections["Edit history"]):
        change = _CHANGE.search(entry)
        if "Error" in entry or (change and float(change[2]) <= float(change[1])):
            failed.add(normalise(_COMMAND.findall(entry)))
    return failed


def normalise(commands: Iterable[str]) -> str:
    """A script in the form in which scripts are compared."""
    return "; ".join(" ".join(re.sub(r"[\[\]]", " ", line).lower().split()) for line in commands)


_QUOTED = re.compile(r"^> (.+)$", re.MULTILINE)
_NUMBER = r"(-?\d{1,6}\.?\d{0,6})"
_BROKEN = re.compile(rf"block (\d{{1,6}}) \([^()\n]*\) off block (\d{{1,6}}) at {_NUMBER} s")


def inspect(prompt: PromptContent, rng: random.Random) -> str:  # noqa: ARG001
    """Write a critique from geometry alone, without random choices."""
    geometry = place(prompt.machine)
    x, y, z = centre_of_mass(geometry)
    boxes = [block for block in geometry.blocks if not block.two_ended]
    replies = mechanisms.load_data("replies.yaml")
    reach = {word: max(boxes, key=lambda b: max(s * b.lo[axis], s * b.hi[axis]))
             for word, (axis, s) in replies["extremes"].items()}  # fmt: skip
    defects = [f"- likely | blocks {', '.join(map(str, blocks))} | structure none | {text}"
               for blocks, text in _find_defects(geometry)]  # fmt: skip
    names = [f"block {b.id} ({b.name}) facing {b.facing}" for b in geometry.blocks]
    idle = [f"block {b} on block {geometry[b].step.parent}" for b in _idle_blocks(geometry)]
    return str(replies["inspection"]).format(
        world="\n".join(f"{word}: {block.id}" for word, block in reach.items()),
        moving="; ".join(names[b.id] for b in geometry.blocks if b.type in mechanisms.MOVERS)
        or "None.",
        special="; ".join(names[b.id] for b in geometry.blocks if b.type in mechanisms.LOADS)
        or "None.",
        mass=f"({x:.1f}, {y:.1f}, {z:.1f})",
        stands="stands" if stands(geometry) else "falls over before t = 0",
        idle="; ".join(idle) or "None.",
        defects="\n".join(defects) or "none",
    )


def _find_defects(geometry: Geometry) -> Iterator[tuple[list[int], str]]:
    """Failed checks: block ids and the consequence."""
    blocks, depth = geometry.blocks, [z for _, z in support_polygon(geometry)]
    ground = [b.id for b in blocks if not b.two_ended and b.lo[1] == geometry.lo[1]]
    arms = [b.id for b in blocks if b.type in mechanisms.JOINTS]
    wheels = [b.id for b in blocks if b.type in mechanisms.WHEELS]
    if not stands(geometry):
        yield ground, "the centre of mass is not above the footprint: it tips"
    elif arms and max(depth) - min(depth) < geometry.size[1]:
        yield ground, "footprint shorter than the height: the swinging arm tips it"
    for wheel in (b for b in blocks if b.type in mechanisms.WHEELS and b.facing[0] != "x"):
        yield [wheel.id], f"facing {wheel.facing} it does not drive to z+"
    if 0 < len(wheels) < 6:
        yield wheels, "too few wheels for a quick start"
    for arm in (arm for arm in arms if len(geometry.children(arm)) == 1):
        yield [arm], "unbalanced: loaded on one side only"
    for block in _idle_blocks(geometry):
        yield [block], "useless: it carries nothing and does not touch the ground"


def _idle_blocks(geometry: Geometry) -> list[int]:
    """Ids of static rigid blocks above the ground that carry nothing."""
    carried = {parent for block in geometry.blocks for parent in block.step.parents}
    group, high = mechanisms.rigid_groups(geometry), geometry.box_min[1] + 1.1
    still = [b for b in geometry.blocks if b.type in mechanisms.RIGID and group[b.id] == 0]
    return [b.id for b in still if b.id not in carried and b.box_min[1] > high]


def query(prompt: PromptContent, rng: random.Random) -> str:
    """Query the first broken connection around its time, else a moving block and the root."""
    moving = [step.id for step in prompt.machine if step.type in mechanisms.MOVERS]
    intervals = [(rng.choice(moving or [0]), 0.0, 1.0), (0, 0.0, 1.0)]
    broken = _BROKEN.search(prompt.sections["Simulation feedback"])
    if broken:
        start, end = max(0.0, float(broken[3]) - 0.4), float(broken[3]) + 0.4
        intervals = [(int(block), round(start, 2), round(end, 2)) for block in broken.groups()[:2]]
    queries = [{"id": b, "duration": [start, end], "properties": ["position", "velocity"]}
               for b, start, end in intervals if b < len(prompt.machine)]  # fmt: skip
    thought = "The broken connection is the weak point." if broken else "No breakage is reported."
    template = str(mechanisms.load_data("replies.yaml")["inquiry"])
    return template.format(thought=thought, queries=json.dumps(queries))


def analyse(prompt: PromptContent, rng: random.Random) -> str:  # noqa: ARG001
    """Repeat what edits did, which is all that it knows."""
    lines = _QUOTED.findall(prompt.sections["What edits did"])
    return "<Lessons>\n" + "\n".join(lines) + "\n</Lessons>"
