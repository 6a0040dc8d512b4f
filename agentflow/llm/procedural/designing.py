"""Designs: answers of the meta-designer and the designer; and work with tools, from design to
submission.

What earlier calls showed is read from the conversation: machines, their scores, and what is left of
the budget.
"""

import json
import random
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import cycle, islice

from agentflow.llm.messages import Message, Request, ToolCall
from agentflow.llm.procedural import refining
from agentflow.llm.procedural.mechanisms import (
    Builder,
    build_part,
    known_mechanisms,
    suitable_mechanisms,
)
from agentflow.llm.procedural.reading import PromptContent, read_listing, read_prompt, value_of
from agentflow.machine import Machine, apply_script, check, library, read_machine
from agentflow.machine.brief import LONE_ROOT

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
    machine = refining.add_controllers(machine, laws, rng) if limits.senses else machine
    return refining.add_program(machine, limits.controls, rng, ranges), notes


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


_NAME = r"[0-9a-f]{8,64}"
_MADE = re.compile(rf"Machine ({_NAME}): valid, ")
_SCORE = re.compile(r"\bscore (-?\d{1,9}(?:\.\d{1,9})?)[ .]")
_LEFT = re.compile(r"(\d{1,6}) of \d{1,6} (submission|simulation)s left")
_KNOWN = re.compile(r"^Machines so far: (.+)$", re.MULTILINE)
_ROW = re.compile(rf"^({_NAME}) \|.* \| ([^|\n]+) \| [^|\n]+$", re.MULTILINE)
Calls = list[tuple[str, Mapping[str, object]]]
"""Names and arguments of tool calls."""
WAVE, PARENTS = 4, 2  # edits in a reply; machines that they start from
TURNS = 40  # replies after which it only submits


@dataclass
class SeenMachine:
    """A named machine, as far as the conversation describes it."""

    machine: Machine | None = None
    score: float | None = None
    simulated: bool = False
    feedback: str = ""
    """What its simulation reported in this conversation."""
    described: bool = False
    """Whether `machine` has been read, as far as it can be."""
    made: bool = False
    """Whether it was made in this conversation, and is complete."""
    submitted: bool = False
    tried: set[str] = field(default_factory=set)
    """Scripts sent for it, normalised."""


@dataclass
class Notes:
    """What a conversation has shown."""

    prompt: PromptContent
    tools: frozenset[str]
    turns: int = 0
    called: set[str] = field(default_factory=set)
    left: dict[str, int] = field(default_factory=lambda: {"submission": 0, "simulation": 0})
    seen_machines: dict[str, SeenMachine] = field(default_factory=dict)
    """By name, oldest first."""

    def at(self, name: str) -> SeenMachine:
        """What is known about a machine."""
        return self.seen_machines.setdefault(name, SeenMachine())

    def make(self, name: str, machine: Machine | None) -> None:
        """Note a machine that was made in this conversation."""
        candidate = self.at(name)
        candidate.machine, candidate.made, candidate.described = machine, True, True

    def by_score(self) -> list[str]:
        """Names of machines with a score, best first."""
        known = self.seen_machines.items()
        scores = {name: found.score for name, found in known if found.score is not None}
        return sorted(scores, key=scores.__getitem__, reverse=True)


def take_notes(request: Request) -> Notes:
    """Read a conversation."""
    notes = Notes(read_prompt(request.messages), frozenset(tool.name for tool in request.tools))
    notes.turns = sum(message.role == "assistant" for message in request.messages)
    for message in request.messages:
        for number, what in _LEFT.findall(message.text):
            notes.left[what] = int(number)
    for names in _KNOWN.findall("\n".join(message.text for message in request.messages[:2])):
        for name in re.findall(_NAME, names):
            notes.at(name)
    for tool, arguments, answer in _finished_calls(request.messages):
        notes.called.add(tool)
        if tool in _READERS:
            _READERS[tool](notes, arguments, answer)
    return notes


def _finished_calls(messages: tuple[Message, ...]) -> Iterator[tuple[str, Mapping[str, str], str]]:
    """Name, arguments and answer of each call that was answered."""
    calls: dict[str, ToolCall] = {}
    for message in messages:
        calls |= {call.id: call for call in message.tool_calls}
        if message.role == "tool" and (call := calls.get(message.tool_call_id)):
            yield call.name, _read_arguments(call.arguments), message.text


def _read_arguments(text: str) -> Mapping[str, str]:
    """The arguments that are texts; "" for others."""
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        given = None
    items = given.items() if isinstance(given, dict) else ()
    return defaultdict(str, {name: value for name, value in items if isinstance(value, str)})


def _read_check(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    if made := _MADE.match(answer):
        notes.make(made[1], read_machine(arguments["machine"], library()).machine)


def _read_edit(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    parent, script = notes.at(arguments["machine"]), arguments["script"]
    parent.tried.add(refining.normalise(script.split("\n")))
    if (made := _MADE.match(answer)) and parent.machine:
        notes.make(made[1], apply_script(parent.machine, script, notes.prompt.brief).machine)


def _read_describe(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    candidate = notes.at(arguments["machine"])
    candidate.described, candidate.machine = True, read_listing(answer)


def _read_simulate(notes: Notes, arguments: Mapping[str, str], answer: str) -> None:
    candidate, found = notes.at(arguments["machine"]), _SCORE.search(answer)
    candidate.simulated, candidate.feedback = True, answer
    candidate.score = float(found[1]) if found else None


def _read_history(notes: Notes, _arguments: Mapping[str, str], answer: str) -> None:
    for name, score in _ROW.findall(answer):
        candidate = notes.at(name)
        candidate.simulated = score != "not simulated"
        candidate.score = float(score) if re.fullmatch(r"-?\d{1,9}\.\d\d", score) else None


def _read_submit(notes: Notes, arguments: Mapping[str, str], _answer: str) -> None:
    notes.at(arguments["machine"]).submitted = True


_READERS = {
    "check": _read_check,
    "edit": _read_edit,
    "describe": _read_describe,
    "simulate": _read_simulate,
    "history": _read_history,
    "submit": _read_submit,
}


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
    return _submit(
        notes, [name for name, candidate in notes.seen_machines.items() if candidate.made]
    )


def _submit(notes: Notes, names: Iterable[str]) -> Calls:
    fresh = [name for name in names if not notes.seen_machines[name].submitted]
    return [("submit", {"machine": name}) for name in fresh[: notes.left["submission"]]]


def _write(notes: Notes, rng: random.Random) -> Calls:
    """Check new machines, or edits of those of earlier stages."""
    if earlier := [name for name, known in notes.seen_machines.items() if not known.made]:
        return _describe(notes, earlier) or _edit(notes, earlier, notes.left["submission"], rng)
    machines = [build_machine(notes.prompt, rng)[0] for _ in range(notes.left["submission"])]
    return [("check", {"machine": machine.to_text()}) for machine in machines]


def _measure(notes: Notes, _rng: random.Random) -> Calls:
    """Look up earlier scores, then simulate machines without a score."""
    if "history" not in notes.called:
        return [("history", {})]
    waiting = [name for name, known in notes.seen_machines.items() if not known.simulated]
    return _simulate(waiting[: notes.left["simulation"]])


def _improve(notes: Notes, rng: random.Random) -> Calls:
    """Edit the best machines while there are simulations left."""
    best = notes.by_score()[:PARENTS]
    if not notes.left["simulation"]:
        return []
    if not best:
        return _write(notes, rng)
    unread = [name for name in best if not notes.seen_machines[name].feedback]
    wave = min(WAVE, notes.left["simulation"])
    return [*_describe(notes, best), *_simulate(unread)] or _edit(notes, best, wave, rng)


def _describe(notes: Notes, names: Iterable[str]) -> Calls:
    unknown = [name for name in names if not notes.seen_machines[name].described]
    return [("describe", {"machine": name, "short": True}) for name in unknown]


def _simulate(names: Iterable[str]) -> Calls:
    return [("simulate", {"machine": name}) for name in names]


def _edit(notes: Notes, names: Iterable[str], count: int, rng: random.Random) -> Calls:
    """New changes of these machines, in turns."""
    calls: Calls = []
    for name in islice(cycle(names), count):
        known = notes.seen_machines[name]
        sections = notes.prompt.sections | {"Simulation feedback": known.feedback}
        prompt = replace(notes.prompt, sections=sections, machine=known.machine or LONE_ROOT)
        if script := refining.propose_change(prompt, rng, known.tried).script:
            known.tried.add(refining.normalise(script))
            calls.append(("edit", {"machine": name, "script": "\n".join(script)}))
    return calls
