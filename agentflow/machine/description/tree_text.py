"""Owns the tree text: who hangs on whom, indented, by structure where there is a blueprint.

Positions are describe.py's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine, Step

OTHERS = "Other blocks"


def tree_text(machine: Machine, groups: Mapping[str, Sequence[int]] | None = None) -> str:
    """The machine's hierarchy as indented text, one block per line.

    Args:
        machine: a file-valid machine.
        groups: structure name -> ids of its blocks, in the order to show; blocks in none come
            last. Within a structure a block is indented under its parent of the same structure.
    """
    if not groups:
        return "\n".join(_forest(machine, range(len(machine))))
    lines: list[str] = []
    rest = set(range(len(machine)))
    shown = {}
    for name, ids in groups.items():
        shown[name] = sorted(rest.intersection(ids))
        rest.difference_update(ids)
    if rest:
        shown[OTHERS] = sorted(rest)
    for name, members in shown.items():
        lines += [f"{name}:", *(f"  {line}" for line in _forest(machine, members))]
    return "\n".join(lines)


def _forest(machine: Machine, members: Sequence[int]) -> list[str]:
    """Lines of these blocks, each under its parent where that is one of them."""
    within = set(members)
    below: dict[int, list[int]] = {}
    for block_id in reversed(members):
        parent = machine[block_id].parent
        below.setdefault(parent if parent in within else -1, []).append(block_id)
    lines = []
    stack = [(block_id, 0) for block_id in below.get(-1, ())]
    while stack:
        block_id, depth = stack.pop()
        lines.append("  " * depth + _line(machine, machine[block_id], within))
        stack += [(child, depth + 1) for child in below.get(block_id, ())]
    return lines


def _line(machine: Machine, step: Step, within: set[int]) -> str:
    name = f"{step.id} {library()[step.type].name}"
    if step.parent < 0:
        return name
    if step.parent_b is not None and step.face_id_b is not None:
        a = _place(machine, step.parent, step.face_id)
        return f"{name} from {a} to {_place(machine, step.parent_b, step.face_id_b)}"
    if step.parent in within:
        return f"{name} on face {step.face_id} {_direction(machine, step.parent, step.face_id)}"
    return f"{name} on {_place(machine, step.parent, step.face_id)}"


def _place(machine: Machine, parent: int, face: int) -> str:
    name = library()[machine[parent].type].name
    return f"{parent} {name} face {face} {_direction(machine, parent, face)}"


def _direction(machine: Machine, parent: int, face: int) -> str:
    return library()[machine[parent].type].faces[face].direction
