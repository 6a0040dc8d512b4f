"""Template variables that describe a task, a machine or a simulation report to a model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from agentflow.agents.replies import Representation, machine_text
from agentflow.machine.blocks.library import EXAMPLE, library
from agentflow.machine.blocks.types import BlockType, Face
from agentflow.machine.brief import Brief
from agentflow.machine.controls import GROUPS, MAX_CONTROLS
from agentflow.machine.description.geometry_info import describe_text, list_text
from agentflow.machine.tree import Machine
from agentflow.prompts.render import block_functions, facts
from agentflow.prompts.text import token_estimate

ROOT_TYPE = 0
MOST_TOKENS = 300
"""Most tokens of lessons in a prompt, by estimate."""
SAMPLE_REPORT = "Score: 0.00\nBroken: none"
"""A short simulation report, for sample inputs of roles."""
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")


def within(lines: Sequence[str], most: int) -> list[str]:
    """The first lines that have together at most so many tokens, by estimate."""
    kept: list[str] = []
    for line in lines:
        if token_estimate("\n".join([*kept, line])) > most:
            break
        kept.append(line)
    return kept


@dataclass(frozen=True)
class OtherMachine:
    """The best machine of another trajectory."""

    machine: Machine
    score: float | None
    mechanism: str
    """Class of its mechanism: what drives, what holds, what releases."""


@dataclass(frozen=True)
class Elsewhere:
    """What was learnt elsewhere, in this run or in others; empty fields are left out."""

    machines: tuple[OtherMachine, ...] = ()
    """Of other trajectories, the best first."""
    lessons: tuple[str, ...] = ()
    """What edits of this run did to scores, one line each, the most telling first."""
    analysed: bool = False
    """Whether an analyst has written these lessons."""
    book: tuple[str, ...] = ()
    """What other runs found out."""
    avoid: tuple[str, ...] = ()
    """Mechanisms that have been tried, if another one is asked for."""

    def context(self) -> dict[str, object]:
        """Template variables; none if there is nothing to show."""
        machines = [
            {
                "score": "none" if other.score is None else f"{other.score:.2f}",
                "mechanism": other.mechanism,
                "blocks": list_text(other.machine),
            }
            for other in self.machines
        ]
        lessons, book = within(self.lessons, MOST_TOKENS), within(self.book, MOST_TOKENS)
        data = {**vars(self), "machines": machines, "lessons": lessons, "book": book}
        return {"elsewhere": data} if self != Elsewhere() else {}


@dataclass(frozen=True)
class RoleInput:
    """What the inputs of most roles have in common."""

    brief: Brief
    spatial: bool = field(default=True, kw_only=True)
    """Whether to include 3D information."""
    representation: Representation = field(default="tree", kw_only=True)
    elsewhere: Elsewhere = field(default_factory=Elsewhere, kw_only=True)

    def context(self, machine: Machine | None) -> dict[str, object]:
        """Template variables of the task and of a machine."""
        shown = machine_context(
            machine, spatial=self.spatial, representation=self.representation, brief=self.brief
        )
        return {**task_context(self.brief), **shown, **self.elsewhere.context()}


def task_context(brief: Brief) -> dict[str, object]:
    """Template variables of the task, the block table and the rules on blocks."""
    kinds = [library()[kind] for kind in brief.blocks]
    plain, greatest = _plain(kinds), brief.greatest
    known = [] if greatest is None else [f"The greatest possible score is {greatest:g}."]
    return {
        **types_context(kinds),
        "task": {
            "name": brief.name,
            "objective": brief.objective,
            "required": [
                *(_required_text(kind, n) for kind, n in sorted(brief.required.items())),
                *([f"at most {brief.most_blocks}"] if brief.most_blocks else []),
            ],
            "scene": brief.scene,
            "schedule": brief.schedule,
            "score": [*brief.score, *known],
        },
        "wishes": brief.wishes,
        "sketch": bool(brief.sketch),
        "example_types": sorted({plain[0], EXAMPLE if EXAMPLE in plain else plain[-1]}),
        "motors": any(kind.type in facts()["motor"] for kind in kinds),
        "joints": any(kind.joint.moves for kind in kinds),
        "controls": _control_rules(brief, kinds),
        "strengths": _exceptions(kinds, lambda kind: facts()["strength"].get(kind.type)),
        "drags": _exceptions(kinds, lambda kind: _unusual_drag(kind.linear_drag)),
        "size_limit": f"{' x '.join(f'{limit:g}' for limit in brief.limits.size)} m (x, y, z)",
    }


def types_context(kinds: Sequence[BlockType]) -> dict[str, object]:
    """Template variables of block types: their table, and examples of plain and two-ended ones."""
    plain, linear = _plain(kinds), [kind for kind in kinds if kind.linear]
    return {
        "blocks": block_rows(kinds),
        "types": [kind.type for kind in kinds],
        "example_type": EXAMPLE if EXAMPLE in plain else plain[0],
        "two_ended": [f"{kind.name} {kind.type}" for kind in linear],
        "two_ended_type": linear[0].type if linear else None,
    }


def _plain(kinds: Sequence[BlockType]) -> list[int]:
    return [kind.type for kind in kinds if not kind.linear and kind.type != ROOT_TYPE]


def _control_rules(brief: Brief, kinds: Sequence[BlockType]) -> dict[str, object] | None:
    """What control programs may do; None if machines may not bring any."""
    window, trials = brief.limits.controls, brief.limits.trials
    if window is None:
        return None
    members = {group: [kind.type for kind in kinds if kind.group == group] for group in GROUPS}
    groups = {group: types for group, types in members.items() if types}
    rules = {"window": f"{window:g}", "groups": groups, "most": MAX_CONTROLS, "trials": trials}
    return {**rules, **_controller_rules(brief, next(iter(groups), ""))}


def _controller_rules(brief: Brief, group: str) -> dict[str, object]:
    """How controllers are written, with an example for a group; `senses` is empty if machines may
    not bring any."""
    if not (brief.limits.senses and group):
        return {"senses": ()}
    from agentflow.machine.controllers.model import QUANTITIES  # needs pydantic
    from agentflow.machine.controllers.reading import LONGER, told

    example = f'{{"blocks": [...], "controllers": {LONGER.replace("thrusters", group)}}}'
    kinds = [f"{kind} ({', '.join(q.axes)})" if q.axes else kind for kind, q in QUANTITIES.items()]
    return {"example": example, "senses": [*map(told, QUANTITIES)], "kinds": kinds}


def machine_context(
    machine: Machine | None,
    *,
    spatial: bool,
    representation: Representation = "tree",
    brief: Brief | None = None,
) -> dict[str, object]:
    """The machine as a list or as JSON text and, if `spatial`, with geometry; "" without a machine.

    `geometry_short` is the geometry without building points and positions of faces.
    """
    shown, written = machine if spatial else None, ""
    if machine:
        tree = representation == "tree"
        written = list_text(machine) if tree else machine_text(machine, representation)
    return {
        "representation": representation,
        "machine": written,
        "geometry": describe_text(shown, brief) if shown else "",
        "geometry_short": describe_text(shown, brief, short=True) if shown else "",
    }


def report_context(score: float | None, feedback: str) -> dict[str, object]:
    """The report of a simulation, starting with its score; "" if there was none."""
    if score is None and not feedback:
        return {"report": ""}
    if feedback.startswith("Score:"):
        return {"report": feedback}
    shown = "none" if score is None else f"{score:.2f}"
    return {"report": f"Score: {shown}\n{feedback}".strip()}


def block_rows(kinds: Sequence[BlockType]) -> list[dict[str, object]]:
    """The rows of the block table: size x, y, z in m, mass in kg, faces as direction ids @x,y,z.

    A row refers to an earlier one with the same faces.
    """
    first: dict[tuple[Face, ...], int] = {}
    rows = []
    for kind in kinds:
        same = first.setdefault(kind.faces, kind.type)
        repeated = kind.faces and same != kind.type
        rows.append(
            {
                "type": kind.type,
                "name": kind.name,
                "size": "x".join(f"{n:g}" for n in kind.size) if kind.size else "two-ended",
                "mass": f"{kind.mass:g}",
                "faces": f"as type {same}" if repeated else _faces_text(kind.faces),
                "function": block_functions()[kind.type],
            }
        )
    return rows


def _exceptions(
    kinds: Sequence[BlockType], value: Callable[[BlockType], object]
) -> list[tuple[object, list[BlockType]]]:
    """Each unusual value with its types; None is usual."""
    found: dict[str, tuple[object, list[BlockType]]] = {}
    for kind in kinds:
        if (own := value(kind)) is not None:
            found.setdefault(str(own), (own, []))[1].append(kind)
    return list(found.values())


def _unusual_drag(drag: float) -> float | None:
    return None if drag == facts()["air"]["drag"] else drag


def _faces_text(faces: Sequence[Face]) -> str:
    """Faces by direction; coordinates that differ are listed by id: `Left 1 2 @-0.5,0,0.5/1.5`."""
    groups = []
    for direction, group in groupby(faces, key=lambda face: face.direction):
        members = list(group)
        axes = [
            [f"{value:g}" for value in axis]
            for axis in zip(*(face.position for face in members), strict=True)
        ]
        where = ",".join(axis[0] if len(set(axis)) == 1 else "/".join(axis) for axis in axes)
        groups.append(f"{direction} {' '.join(str(face.id) for face in members)} @{where}")
    return "; ".join(groups) or "none"


def _required_text(kind: int, count: int) -> str:
    number = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    return f"exactly {number} {library()[kind].name} (type {kind})"
