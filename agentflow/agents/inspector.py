"""The inspector: criticises a machine before it is simulated.

Its sense of orientation is scored against the true geometry; this is only recorded.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import RoleInput
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.replies import find_sections
from agentflow.llm.procedural.reading import Script
from agentflow.llm.procedural.refining import inspect
from agentflow.machine.brief import Brief
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.tree import Machine
from agentflow.prompts.text import oneline

TIE = 1e-6
"""Distance within which two blocks count as reaching equally far, m."""
AXES: Mapping[str, str] = {"x+": "right", "y+": "up", "z+": "forward"}
DIRECTIONS: Mapping[str, str] = {
    **dict.fromkeys(("right", "rightward", "rightwards"), "right"),
    **dict.fromkeys(("left", "leftward", "leftwards"), "left"),
    **dict.fromkeys(("up", "upward", "upwards", "top"), "up"),
    **dict.fromkeys(("down", "downward", "downwards", "bottom"), "down"),
    **dict.fromkeys(("forward", "forwards", "front", "ahead"), "forward"),
    **dict.fromkeys(("backward", "backwards", "back", "rear", "behind"), "backward"),
}
EXTREMES: Mapping[str, tuple[int, int]] = {
    "frontmost": (2, 1),
    "rearmost": (2, -1),
    "leftmost": (0, -1),
    "rightmost": (0, 1),
    "topmost": (1, 1),
    "lowest": (1, -1),
}
"""Question -> axis index and sign of the direction in which to compare the blocks' reach."""
_KEY = re.compile(
    r"(?<![\w+-])([xyz]\+|" + "|".join(EXTREMES) + r")[\"'*`_\])]{0,4} ?[:=]", re.IGNORECASE
)
_WORD = re.compile(r"[a-z]+")
ID_LIST = re.compile(r"\d{1,6}(?:(?:, and |,| and |/) ?\d{1,6})*")
"""Block ids in a row: "3", "3, 4", "3, 4 and 5"."""
_NUMBER = re.compile(r"\d{1,6}")
ORIENTATION = "Three-Dimensional Perception of the World"
ANSWERS = "Question Answer"
DEFECTS = "Summary of Design Defects"
MAX_DEFECTS = 100
"""Maximum number of lines read from a summary."""
SEVERITIES = ("fatal", "likely", "minor")
_BULLET = re.compile(r"^\s*(?:[-*+]|\d{1,3}[.)])\s+")
_IDS = re.compile(rf"\bblocks?\W{{0,4}}({ID_LIST.pattern})", re.IGNORECASE)
_NOTHING = frozenset({"", "none", "no defects", "no defect", "no defects found"})


def read_orientation(text: str) -> dict[str, Any]:
    """Read the answers: "key: value" pairs, one per line or in a JSON object.

    Returns:
        Axis -> direction and extreme -> list of block ids, for the keys found. The first answer
        counts if there are several.
    """
    keys = list(_KEY.finditer(text))
    answers: dict[str, Any] = {}
    for match, end in zip(keys, [*(key.start() for key in keys[1:]), len(text)], strict=False):
        value = text[match.end() : min(end, match.end() + 200)].lstrip("[ \r\n\t")
        value = value.partition("\n")[0]
        key = match[1].lower()
        answer = _direction(value) if key in AXES else _find_ids(value)
        if answer:
            answers.setdefault(key, answer)
    return answers


def _find_ids(text: str) -> list[int]:
    """The first list of block ids in a text."""
    match = ID_LIST.search(text)
    return [int(number) for number in _NUMBER.findall(match[0])] if match else []


def _direction(text: str) -> str:
    words = (DIRECTIONS.get(word, "") for word in _WORD.findall(text.lower()))
    return next(filter(None, words), "")


def extreme_blocks(geometry: Geometry) -> dict[str, tuple[int, ...]]:
    """Extreme -> ids of the blocks whose boxes reach farthest, including ties."""
    boxes = [block for block in geometry.blocks if not block.two_ended]
    found = {}
    for question, (axis, sign) in EXTREMES.items():
        reach = {
            block.id: sign * (block.box_max if sign > 0 else block.box_min)[axis] for block in boxes
        }
        limit = max(reach.values()) - TIE
        found[question] = tuple(block for block, value in reach.items() if value >= limit)
    return found


def orientation_score(answers: Mapping[str, Any], geometry: Geometry) -> float:
    """Share of the nine questions answered correctly, 0 to 1.

    The answer for an extreme is correct if it names blocks and all of them reach farthest.
    """
    right: int = sum(answers.get(axis) == word for axis, word in AXES.items())
    for question, blocks in extreme_blocks(geometry).items():
        named = answers.get(question) or []
        right += bool(named) and set(named) <= set(blocks)
    return right / (len(AXES) + len(EXTREMES))


@dataclass(frozen=True)
class InspectorInput(RoleInput):
    """A machine to inspect."""

    machine: Machine
    blueprint: Blueprint | None = None
    groups: Mapping[str, Sequence[int]] = field(default_factory=dict)
    """Structure -> ids of its blocks, if known."""


@dataclass(frozen=True)
class Defect:
    """One defect that the inspector found."""

    blocks: tuple[int, ...]
    """Ids of blocks of the machine, in the order named."""
    structure: str
    text: str
    severity: str = ""
    """One of `SEVERITIES`; "" if the reply gives none."""


@dataclass(frozen=True)
class Inspection:
    """A parsed critique."""

    text: str
    """Answers and defects in the inspector's words, for the refiner."""
    orientation: dict[str, Any]
    """Answers on orientation: axis -> direction, extreme -> block ids."""
    orientation_score: float
    """Share of those answers that are correct, 0 to 1."""
    defects: tuple[Defect, ...]


class Inspector(Role[InspectorInput, Inspection]):
    """Criticises a machine before it is simulated."""

    name: ClassVar[str] = "inspector"
    stage: ClassVar[str] = "blind_refinement"
    sees: ClassVar[bool] = True
    tokens: ClassVar[tuple[int, int]] = (4010, 230)
    labels: ClassVar[tuple[str, ...]] = ("Diagnose", "Observe", "Reflect")
    script: ClassVar[Script] = Script(inspect, f"<{ORIENTATION}>")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> InspectorInput:
        return InspectorInput(brief, machine)

    def variables(self, given: InspectorInput) -> Mapping[str, object]:
        return {
            **given.context(given.machine),
            "blueprint": given.blueprint and given.blueprint.to_json(),
            "statics": statics_text(given.machine, given.brief) if given.spatial else "",
            "structures": _structure_lines(given.groups),
        }

    def parse(self, text: str, given: InspectorInput) -> Parsed[Inspection]:
        """Read the three sections; the one on orientation may be missing and then scores 0."""
        found = find_sections(text, (ORIENTATION, ANSWERS, DEFECTS))
        missing = [f"<{name}>" for name in (ANSWERS, DEFECTS) if name not in found]
        if missing:
            problem = f"The reply has no section {' or '.join(missing)}."
            return Parsed(None, problem, "missing_section", parsed=False)
        answers = read_orientation(found.get(ORIENTATION, ""))
        inspection = Inspection(
            text=f"{found[ANSWERS]}\n\nDefects:\n{found[DEFECTS] or 'none'}".strip(),
            orientation=answers,
            orientation_score=orientation_score(answers, place(given.machine)),
            defects=read_defects(found[DEFECTS], len(given.machine)),
        )
        return Parsed(inspection)


def read_defects(text: str, count: int) -> tuple[Defect, ...]:
    """Read one defect per line: `- fatal | blocks 3, 4 | structure NAME | what is wrong`.

    The severity may be missing. In lines without bars, block ids are found by the words "block 3".
    Ids that do not exist in a machine of `count` blocks are dropped; a line that names no block is
    still a defect.
    """
    defects = []
    for line in text.splitlines()[:MAX_DEFECTS]:
        words = _BULLET.sub("", line[:2000]).strip()
        if words.strip(" .*`").casefold() in _NOTHING or not words.strip("`-=*_ "):
            continue
        first, _, rest = words.partition("|")
        severity = first.strip(" *`:").casefold()
        severity, words = (severity, rest.strip()) if severity in SEVERITIES else ("", words)
        parts = [part.strip() for part in words.split("|", 2)]
        if len(parts) == 3:
            ids, structure, description = _NUMBER.findall(parts[0]), _structure(parts[1]), parts[2]
        else:
            named = [match[1] for match in _IDS.finditer(words)]
            ids, structure, description = _NUMBER.findall(" ".join(named)), "", words
        blocks = dict.fromkeys(int(number) for number in ids if int(number) < count)
        defects.append(Defect(tuple(blocks), structure, description, severity))
    return tuple(defects)


def _structure_lines(groups: Mapping[str, Sequence[int]]) -> str:
    """One line per structure: its name and the ids of its blocks."""
    lines = (f"{oneline(name)}: blocks {', '.join(map(str, ids))}" for name, ids in groups.items())
    return "\n".join(lines)


def _structure(text: str) -> str:
    name = re.sub(r"^structure\b\W{0,3}", "", text, flags=re.IGNORECASE).strip()
    return "" if name.casefold() in ("none", "-") else name
