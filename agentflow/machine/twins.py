"""Machines that are the same but for the numbers of their blocks, or for left and right."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import replace

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.placement import face_at, place_step
from agentflow.machine.geometry.pose import Placed, Units3
from agentflow.machine.tree import Machine, Step


def likeness(machine: Machine, brief: Brief) -> str:
    """A key that machines share if they differ in the ids of their blocks only, or, where the task
    does not tell left from right, if they are mirror images.

    A machine with a motor that turns something is not its mirror image: the motor turns the other
    way there. Powered wheels are, as they drive forward on either side.
    """
    key = tree_key(machine)
    if not brief.symmetric or machine.controls or any(_turns(step) for step in machine):
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
    return _hash([sorted(keys.values()), controls])


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
        ends = [
            _image_of(placed[parent], images[parent], face) for parent, face in step.attachments
        ]
        if None in ends:
            return None
        new = _attached(step, [end for end in ends if end is not None])
        images[step.id] = place_step(new, images)
        steps.append(new)
    return replace(machine, steps=tuple(steps))


def _attached(step: Step, faces: list[int]) -> Step:
    """A block on other faces of the same parents."""
    if not faces:
        return step
    first, *second = faces
    return replace(step, face_id=first, face_id_b=second[0] if second else step.face_id_b)


def _image_of(parent: Placed, image: Placed, face: int) -> int | None:
    """The face of an image where the mirror image of a face of the block is."""
    if parent.shape is None or image.shape is None:
        return None
    at, front = face_at(parent, face), parent.shape.faces[face].facing.front
    wanted = flip(at), flip(front)
    found = (
        other.id
        for other in image.shape.faces
        if (face_at(image, other.id), other.facing.front) == wanted
    )
    return next(found, None)


def flip(point: Units3) -> Units3:
    """A point or direction with left and right exchanged."""
    return (-point[0], point[1], point[2])
