"""Machines that are the same but for the numbers of their blocks, or for left and right."""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.placement import mirrored_face, place_step
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.tree import Machine, Step


def likeness(machine: Machine, brief: Brief) -> str:
    """A key that machines share if they differ in the ids of their blocks only, or, where the task
    does not tell left from right, if they are mirror images.

    A machine with a motor that turns something is not its mirror image: the motor turns the other
    way there. Powered wheels are, as they drive forward on either side.
    """
    key = tree_key(machine)
    if not brief.symmetric or machine.controlled or any(_turns(step) for step in machine):
        return key
    image = mirrored(machine)
    return key if image is None else min(key, tree_key(image))


def _turns(step: Step) -> bool:
    """Whether a block turns others by a motor, one way or on command."""
    kind = library()[step.type]
    driven = kind.group is not None and kind.joint.kind == "revolute"
    return driven and not kind.powered_wheel


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
    laws: list[object] = []
    if (sensed := machine.controllers) is not None:  # the ids of the blocks that they name stay
        laws = [sensed.to_json(), [keys[block] for block in sorted(sensed.blocks)]]
    return _hash([sorted(keys.values()), controls, *laws])


def _target_key(target: Collection[int] | str, keys: Mapping[int, str]) -> object:
    return target if isinstance(target, str) else sorted(keys[block] for block in target)


def _hash(data: object) -> str:
    return hashlib.sha256(json.dumps(data).encode()).hexdigest()[:16]


def mirrored(machine: Machine) -> Machine | None:
    """The mirror image of a machine in the plane x = 0 of its root, with the same ids; None if a
    block has no face where the image needs one.

    Controls are the same: those that turn something to one side turn it to the same side.
    """
    placed: dict[int, Placed] = {}
    images: dict[int, Placed] = {}
    steps: list[Step] = []
    for step in machine:
        placed[step.id] = place_step(step, placed)
        faces = [
            mirrored_face(placed[parent], face, images[parent]) for parent, face in step.attachments
        ]
        if None in faces:
            return None
        fields: dict[str, Any] = dict(zip(("face_id", "face_id_b"), faces, strict=False))
        steps.append(replace(step, **fields))
        images[step.id] = place_step(steps[-1], images)
    return replace(machine, steps=tuple(steps))
