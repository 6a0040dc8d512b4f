"""Answers of the refiner: edit commands suggested by the feedback and checked for validity."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable, Set
from math import dist
from typing import Any, NamedTuple

from agentflow.llm.procedural.controlling import change_program
from agentflow.llm.procedural.mechanisms import (
    WHEELS,
    has_locked_joint,
    load_data,
    purpose,
    rigid_groups,
)
from agentflow.llm.procedural.reading import PromptContent
from agentflow.machine import Geometry, apply_script, check, place
from agentflow.machine.blocks.library import BOULDER, CONTAINER

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
    return str(load_data("replies.yaml")["refinement"]).format(
        seen=", ".join(seen) or "no known symptom",
        names=", then ".join(names) or "no change found",
        body=f"```json\n{prompt.format_machine(edited)}\n```"
        if whole
        else "\n".join(script) or "No change found.",  # not an empty script, which is accepted
    )


def propose_change(prompt: PromptContent, rng: random.Random, failed: Set[str]) -> Change:
    """One or two changes that fit the symptoms; `failed` are scripts not to try again."""
    geometry, goal = place(prompt.machine), purpose(prompt.brief)
    feedback, _, trials = prompt.sections["Simulation feedback"].partition(TRIALS)
    script = _adopted_gains(prompt, trials, rng, failed)
    names = ["what trials showed"] * bool(script)
    symptoms = feedback + prompt.sections["Critique"]
    every = load_data("refining.yaml")
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
    group, low = rigid_groups(geometry), geometry.box_min[1] + 1.1
    moves, loads = where in ("swung", "ahead"), (*WHEELS, CONTAINER, BOULDER)
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
    outcome = apply_script(prompt.machine, "\n".join(script), prompt.brief)
    if not outcome.success or outcome.machine == prompt.machine:
        return False
    locks = has_locked_joint(place(outcome.machine))
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
