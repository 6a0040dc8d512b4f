"""Machines that are the same but for the numbers of their blocks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping

from agentflow.machine.tree import Machine


def tree_key(machine: Machine) -> str:
    """Content hash, 16 hex digits, of a construction tree whatever the ids of its blocks: machines
    that differ only in the order in which branches are built have the same."""
    keys: dict[int, str] = {}
    for step in machine:
        ends = [[keys.get(parent, ""), face] for parent, face in step.attachments]
        keys[step.id] = _hash([step.type, ends])
    controls = [
        [_target_key(item.target, keys), item.at, item.lasts, item.level]
        for item in machine.controls
    ]
    return _hash([sorted(keys.values()), controls])


def _target_key(target: Collection[int] | str, keys: Mapping[int, str]) -> object:
    return target if isinstance(target, str) else sorted(keys[block] for block in target)


def _hash(data: object) -> str:
    return hashlib.sha256(json.dumps(data).encode()).hexdigest()[:16]
