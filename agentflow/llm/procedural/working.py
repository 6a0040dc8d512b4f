"""Work with tools: design machines and check them, edit and simulate the best, submit."""

from __future__ import annotations

import json
import random
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import cycle, islice

from agentflow.llm.messages import Request, ToolCall
from agentflow.llm.procedural.designing import build_machine
from agentflow.llm.procedural.notes import Notes, take_notes
from agentflow.llm.procedural.refining import normalise, propose_change
from agentflow.machine.brief import LONE_ROOT

Calls = list[tuple[str, Mapping[str, object]]]
"""Names and arguments of tool calls."""
WAVE, PARENTS = 4, 2  # edits in a reply; machines that they start from
TURNS = 40  # replies after which it only submits


def choose_calls(request: Request, rng: random.Random) -> tuple[ToolCall, ...]:
    """The tool calls of the next reply; none if there is nothing left to do."""
    notes = take_notes(request)
    steps = (_measure, _improve) if "simulate" in notes.tools else (_submit_new, _write)
    calls: Calls = []
    for step in steps if notes.turns < TURNS else ():
        calls = calls or step(notes, rng)
    return tuple(
        ToolCall(id=f"call{number:05d}", name=name, arguments=json.dumps(arguments))
        for number, (name, arguments) in enumerate(calls or _submit(notes, notes.by_score()))
    )


def _submit_new(notes: Notes, _rng: random.Random) -> Calls:
    """Submit what was made in this conversation."""
    return _submit(notes, [name for name, candidate in notes.candidates.items() if candidate.made])


def _submit(notes: Notes, names: Iterable[str]) -> Calls:
    fresh = [name for name in names if not notes.candidates[name].submitted]
    return [("submit", {"machine": name}) for name in fresh[: notes.left["submission"]]]


def _write(notes: Notes, rng: random.Random) -> Calls:
    """Check new machines, or edits of those of earlier stages."""
    if earlier := [name for name, known in notes.candidates.items() if not known.made]:
        return _describe(notes, earlier) or _edit(notes, earlier, notes.left["submission"], rng)
    machines = [build_machine(notes.prompt, rng)[0] for _ in range(notes.left["submission"])]
    return [("check", {"machine": machine.to_text()}) for machine in machines]


def _measure(notes: Notes, _rng: random.Random) -> Calls:
    """Look up earlier scores, then simulate machines without a score."""
    if "history" not in notes.called:
        return [("history", {})]
    waiting = [name for name, known in notes.candidates.items() if not known.simulated]
    return _simulate(waiting[: notes.left["simulation"]])


def _improve(notes: Notes, rng: random.Random) -> Calls:
    """Edit the best machines while there are simulations left."""
    best = notes.by_score()[:PARENTS]
    if not notes.left["simulation"]:
        return []
    if not best:
        return _write(notes, rng)
    unread = [name for name in best if not notes.candidates[name].feedback]
    wave = min(WAVE, notes.left["simulation"])
    return [*_describe(notes, best), *_simulate(unread)] or _edit(notes, best, wave, rng)


def _describe(notes: Notes, names: Iterable[str]) -> Calls:
    unknown = [name for name in names if not notes.candidates[name].described]
    return [("describe", {"machine": name, "short": True}) for name in unknown]


def _simulate(names: Iterable[str]) -> Calls:
    return [("simulate", {"machine": name}) for name in names]


def _edit(notes: Notes, names: Iterable[str], count: int, rng: random.Random) -> Calls:
    """New changes of these machines, in turns."""
    calls: Calls = []
    for name in islice(cycle(names), count):
        known = notes.candidates[name]
        sections = notes.prompt.sections | {"Simulation feedback": known.feedback}
        prompt = replace(notes.prompt, sections=sections, machine=known.machine or LONE_ROOT)
        if script := propose_change(prompt, rng, known.tried).script:
            known.tried.add(normalise(script))
            calls.append(("edit", {"machine": name, "script": "\n".join(script)}))
    return calls
