"""Indented text of a machine's hierarchy, grouped by structure if there is a blueprint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine, Step

OTHERS = "Other blocks"


def tree_text(machine: Machine, groups: Mapping[str, Sequence[int]] | None = None) -> str:
    """The machine's hierarchy as indented text, one block per line.

    Args:
        machine: a file-valid machine.
        groups: structure name -> ids of its blocks, in display order. Blocks are indented under
            their parent in the same structure; blocks in no structure come last.
    """
    if not groups:
        return "\n".join(_forest(machine, range(len(machine))))
    lines: list[str] = []
    rest = set(range(len(machine)))
    grouped = {}
    for name, ids in groups.items():
        grouped[name] = sorted(rest.intersection(ids))
        rest.difference_update(ids)
    if rest:
        grouped[OTHERS] = sorted(rest)
    for name, members in grouped.items():
        lines += [f"{name}:", *(f"  {line}" for line in _forest(machine, members))]
    return "\n".join(lines)


def _forest(machine: Machine, members: Sequence[int]) -> list[str]:
    """Lines of these blocks, each under its parent if that is one of them."""
    group = set(members)
    children_of: dict[int, list[int]] = {}
    for block_id in reversed(members):
        parent = machine[block_id].parent
        children_of.setdefault(parent if parent in group else -1, []).append(block_id)
    lines = []
    stack = [(block_id, 0) for block_id in children_of.get(-1, ())]
    while stack:
        block_id, depth = stack.pop()
        lines.append("  " * depth + _line(machine, machine[block_id], group))
        stack += [(child, depth + 1) for child in children_of.get(block_id, ())]
    return lines


def _line(machine: Machine, step: Step, group: set[int]) -> str:
    name = f"{step.id} {library()[step.type].name}"
    if step.parent < 0:
        return name
    if step.parent_b is not None and step.face_id_b is not None:
        a = _face(machine, step.parent, step.face_id)
        return f"{name} from {a} to {_face(machine, step.parent_b, step.face_id_b)}"
    if step.parent in group:
        direction = library()[machine[step.parent].type].faces[step.face_id].direction
        return f"{name} on face {step.face_id} {direction}"
    return f"{name} on {_face(machine, step.parent, step.face_id)}"


def _face(machine: Machine, parent: int, face: int) -> str:
    carrier = library()[machine[parent].type]
    return f"{parent} {carrier.name} face {face} {carrier.faces[face].direction}"
