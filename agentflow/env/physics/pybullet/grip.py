"""Grabbers in PyBullet, which hold objects with constraints of limited force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from agentflow.env.physics.frames import swap
from agentflow.env.physics.grips import EDGE, Grips, Held
from agentflow.env.physics.model import Gripper
from agentflow.env.physics.pybullet.bodies import MIDDLE, Handle
from agentflow.env.physics.pybullet.contacts import TOUCH
from agentflow.env.physics.pybullet.couplings import remove_constraints, set_collision
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


@dataclass
class _Hold:
    """Something gripped with at most `force` (N), and its pose in the grabber's own axes, engine
    frame."""

    held: Held
    force: float
    place: Vec3
    turn: Quat
    constraint: int = -1


class Grippers(Grips[_Hold]):
    """All grabbers of one machine."""

    def __init__(self, client: int, grips: Sequence[Gripper], objects: Mapping[str, int]) -> None:
        """Start with nothing gripped; `objects` are those that can move, and their body numbers."""
        super().__init__(grips)
        self._client = client
        self._loose: dict[Handle, Held] = {(uid, -1): name for name, uid in objects.items()}
        self._names: dict[Handle, Held] = {}
        self._handles: dict[Held, Handle] = {}

    def bind(self, handles: Mapping[int, Handle]) -> None:
        """Switch to new bodies, and keep holding what was held.

        Args:
            handles: Of each part; the new bodies must be where the old ones were.
        """
        remove_constraints(self._client, (hold.constraint for hold in self._holds.values()))
        self._names = self._loose | {handle: part for part, handle in handles.items()}
        self._handles = {held: handle for handle, held in self._names.items()}
        self._tie_again()

    def _release(self, parts: Sequence[int]) -> None:
        gone = {part: self._holds.pop(part) for part in parts}
        remove_constraints(self._client, (hold.constraint for hold in gone.values()))
        for part, hold in gone.items():
            set_collision(self._client, self._handles[part], self._handles[hold.held], True)

    def tighten(self) -> None:
        """Set the force of all grips again; Bullet stores it as an impulse per step."""
        for hold in self._holds.values():
            self._strengthen(hold)

    def watch(self) -> None:
        """Grip what was touched in the last step."""
        if len(self._holds) < len(self._grips):
            for grip in self._grips:
                if grip.part not in self._holds and grip.starts not in self._off:
                    self._grip_touched(grip)

    def _grip_touched(self, grip: Gripper) -> None:
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
                hold = self._holds[grip.part] = _Hold(held, grip.force, arm, product(back, pose))
                self._tie(grip.part, hold)
                return

    def _tie(self, part: int, hold: _Hold) -> None:
        one, other = self._handles[part], self._handles[hold.held]
        hold.constraint = pybullet.createConstraint(
            *one,
            *other,
            pybullet.JOINT_FIXED,
            MIDDLE,
            hold.place,
            MIDDLE,
            hold.turn,
            physicsClientId=self._client,
        )
        self._strengthen(hold)
        set_collision(self._client, one, other, False)

    def _strengthen(self, hold: _Hold) -> None:
        client = self._client
        pybullet.changeConstraint(hold.constraint, maxForce=hold.force, physicsClientId=client)

    def _frame(self, held: Held) -> tuple[Vec3, Quat]:
        """Centre of mass and orientation, engine frame."""
        uid, index = self._handles[held]
        if index < 0:
            place, turn = pybullet.getBasePositionAndOrientation(uid, self._client)
        else:
            place, turn, *_ = pybullet.getLinkState(uid, index, 0, 1, self._client)
        return place, turn
