"""The inspector: criticises a machine before it is simulated."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import RoleInput
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.orientation import ID_LIST, orientation_score, read_orientation
from agentflow.agents.replies import find_sections
from agentflow.machine.brief import Brief
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from agentflow.prompts.text import oneline

ORIENTATION = "Three-Dimensional Perception of the World"
ANSWERS = "Question Answer"
DEFECTS = "Summary of Design Defects"
MAX_DEFECTS = 100
"""Maximum number of lines read from a summary."""
SEVERITIES = ("fatal", "likely", "minor")
_BULLET = re.compile(r"^\s*(?:[-*+]|\d{1,3}[.)])\s+")
_IDS = re.compile(rf"\bblocks?\W{{0,4}}({ID_LIST.pattern})", re.IGNORECASE)
_NUMBER = re.compile(r"\d{1,6}")
_NOTHING = frozenset({"", "none", "no defects", "no defect", "no defects found"})


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
    tokens: ClassVar[tuple[int, int]] = (4010, 230)

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> InspectorInput:
        return InspectorInput(brief, machine)

    def variables(self, given: InspectorInput) -> Mapping[str, object]:
        return {
            **given.context(given.machine),
            "blueprint": given.blueprint and given.blueprint.to_json(),
            "statics": statics_text(given.machine) if given.spatial else "",
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
