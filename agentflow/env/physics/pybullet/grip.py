"""Grabbers in PyBullet: each holds the first thing that it touches until grabbers are switched off.

Grips outlive splits: they name parts and things, and are bound again when bodies are rebuilt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from agentflow.env.physics.frames import swap
from agentflow.env.physics.layout import Built, Handle
from agentflow.env.physics.model import Gripper
from agentflow.env.physics.pybullet.contacts import TOUCH
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.machine.geometry.vectors import (
    Quat,
    Vec3,
    dot,
    inverse,
    product,
    rotate_vector,
    subtract,
)

EDGE = 0.05
"""Contacts at most this far behind a grabber's front plane are on its front, m."""

Held = int | str
"""A part, or a thing's name."""


@dataclass
class _Hold:
    """Something gripped, and its pose in the grabber's own axes, engine frame."""

    held: Held
    force: float
    """Greatest holding force, N."""
    place: Vec3
    turn: Quat
    constraint: int = -1


class Grippers:
    """All grabbers of one machine."""

    def __init__(self, client: int, grips: Sequence[Gripper], things: Mapping[str, int]) -> None:
        """Start with nothing gripped.

        Args:
            client: PyBullet client.
            grips: All grabbers.
            things: Body number of each of the scene's things that can move.
        """
        self._client, self._grips = client, grips
        self._loose: dict[Handle, Held] = {(uid, -1): name for name, uid in things.items()}
        self._holds: dict[int, _Hold] = {}
        """By part of the grabber."""
        self._open = True
        self._names: dict[Handle, Held] = {}
        self._handles: dict[Held, Handle] = {}

    def __bool__(self) -> bool:
        return bool(self._grips)

    def bind(self, built: Sequence[Built]) -> None:
        """Switch to new bodies, and keep holding what was held.

        The new bodies must be where the old ones were.
        """
        for hold in self._holds.values():
            self._remove(hold)
        self._names = dict(self._loose)
        for body in built:
            self._names |= {(body.uid, index): part for part, index in body.index.items()}
        self._handles = {held: handle for handle, held in self._names.items()}
        for part, hold in self._holds.items():
            self._tie(part, hold)

    def switch(self, on: bool) -> None:
        """Let go of everything, or get ready to grip."""
        self._open = on
        if not on:
            for part, hold in self._holds.items():
                self._remove(hold)
                self._collide(part, hold, True)
            self._holds.clear()

    def tighten(self) -> None:
        """Set the force of all grips again; Bullet stores it as an impulse per step."""
        for hold in self._holds.values():
            self._strengthen(hold)

    def watch(self) -> None:
        """Grip what was touched in the last step."""
        if self._open and len(self._holds) < len(self._grips):
            for grip in self._grips:
                if grip.part not in self._holds:
                    self._try(grip)

    def _try(self, grip: Gripper) -> None:
        uid, index = self._handles[grip.part]
        contacts = pybullet.getContactPoints(
            bodyA=uid, linkIndexA=index, physicsClientId=self._client
        )
        touched = [contact for contact in contacts if contact[8] <= TOUCH]
        if not touched:
            return
        place, turn = self._frame(grip.part)
        front = rotate_vector(turn, swap(grip.front))
        for contact in touched:
            held = self._names.get((contact[2], contact[4]))
            if held is None or held in grip.joined:
                continue
            if dot(subtract(contact[5], place), front) > grip.reach - EDGE:
                back = inverse(turn)
                there, pose = self._frame(held)
                arm = rotate_vector(back, subtract(there, place))
                hold = _Hold(held, grip.force, arm, product(back, pose))
                self._holds[grip.part] = hold
                self._tie(grip.part, hold)
                return

    def _tie(self, part: int, hold: _Hold) -> None:
        hold.constraint = pybullet.createConstraint(
            *self._handles[part],
            *self._handles[hold.held],
            pybullet.JOINT_FIXED,
            (0.0, 0.0, 0.0),
            hold.place,
            (0.0, 0.0, 0.0),
            hold.turn,
            physicsClientId=self._client,
        )
        self._strengthen(hold)
        self._collide(part, hold, False)

    def _strengthen(self, hold: _Hold) -> None:
        pybullet.changeConstraint(
            hold.constraint, maxForce=hold.force, physicsClientId=self._client
        )

    def _collide(self, part: int, hold: _Hold, on: bool) -> None:
        (uid, index), (other, link) = self._handles[part], self._handles[hold.held]
        pybullet.setCollisionFilterPair(uid, other, index, link, on, self._client)

    def _remove(self, hold: _Hold) -> None:
        """Remove a constraint, unless PyBullet already has, as one of its bodies was removed."""
        count = pybullet.getNumConstraints(self._client)
        ids = [pybullet.getConstraintUniqueId(i, self._client) for i in range(count)]
        if hold.constraint in ids:
            pybullet.removeConstraint(hold.constraint, self._client)

    def _frame(self, held: Held) -> tuple[Vec3, Quat]:
        """Centre of mass and orientation, engine frame."""
        uid, index = self._handles[held]
        if index < 0:
            place, turn = pybullet.getBasePositionAndOrientation(uid, self._client)
        else:
            place, turn = pybullet.getLinkState(uid, index, 0, 1, self._client)[:2]
        return place, turn
