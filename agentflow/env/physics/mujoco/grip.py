"""Grabbers in MuJoCo, whose constraints have no greatest force: overloaded ones let go in time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from agentflow.env.physics.frames import swap
from agentflow.env.physics.grips import EDGE, Grips, Held
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Gripper
from agentflow.env.physics.mujoco.bodies import CompiledModel
from agentflow.env.rollout import Array

PATIENCE = 0.1
"""Time for which a grabber bears more than its force, s; longer than the jerk as it grips."""


@dataclass(frozen=True)
class _Hold:
    """Something gripped, and its pose in the grabber's own axes, engine frame."""

    held: Held
    place: Array
    """(3,) from the grabber's centre of mass to that of what it holds, m."""
    turn: Array
    """(4,) w, x, y, z."""


class Grippers(Grips[_Hold]):
    """All grabbers of one machine."""

    def __init__(self, grips: Sequence[Gripper], built: CompiledModel) -> None:
        """Start with nothing gripped."""
        super().__init__(grips)
        self._overcome: dict[int, Held] = {}
        """By part of the grabber: what was torn from it and still touches it."""
        self._bore: dict[int, float] = {}
        """When each grabber last bore no more than its force, s."""
        self.bind(built)

    def bind(self, built: CompiledModel) -> None:
        """Switch to a new model, and keep holding what was held."""
        self._model, self._data, self._constraints = built.model, built.data, built.grips
        self._bore = dict.fromkeys(built.grips, 0.0)  # the time of a new model
        self._bodies: dict[Held, int] = dict(enumerate(built.parts))
        self._bodies.update(built.objects.items())
        self._names = {body: held for held, body in self._bodies.items()}
        self._tie_again()

    def switch(self, entry: Entry, on: bool) -> None:
        super().switch(entry, on)
        for grip in self._grips:
            if grip.starts == entry:
                self._overcome.pop(grip.part, None)

    def watch(self) -> None:
        """Grip what was touched in the last step, and lose what pulled too hard; call it before the
        first half of the next step."""
        for grip in self._grips:
            if grip.starts in self._off:
                continue
            hold = self._holds.get(grip.part)
            if hold is None:
                self._grip_touched(grip)
            elif self._force(grip.part) <= grip.force:
                self._bore[grip.part] = self._data.time
            elif self._data.time - self._bore[grip.part] > PATIENCE:
                self._overcome[grip.part] = hold.held
                self._release([grip.part])

    def _grip_touched(self, grip: Gripper) -> None:
        touched = dict(self._touched(self._bodies[grip.part]))
        if self._overcome.get(grip.part) not in touched:
            self._overcome.pop(grip.part, None)
        body = self._bodies[grip.part]
        axes, middle = self._data.xmat[body].reshape(3, 3), self._data.xipos[body]
        front = (axes * swap(grip.front)).sum(axis=1)
        for held, place in touched.items():
            if held in grip.joined or held == self._overcome.get(grip.part):
                continue
            if ((place - middle) * front).sum() > grip.reach - EDGE:
                hold = self._hold(grip.part, held)
                self._holds[grip.part], self._bore[grip.part] = hold, self._data.time
                self._tie(grip.part, hold)
                return

    def _touched(self, body: int) -> Iterator[tuple[Held, Array]]:
        """What a body was in contact with, and where."""
        contact = self._data.contact
        pairs = self._model.geom_bodyid[contact.geom]
        for row in np.flatnonzero((pairs == body).any(axis=1)).tolist():
            one, other = pairs[row].tolist()
            held = self._names.get(other if one == body else one)
            if held is not None:
                yield held, contact.pos[row]

    def _hold(self, part: int, held: Held) -> _Hold:
        data, one, other = self._data, self._bodies[part], self._bodies[held]
        axes = data.xmat[one].reshape(3, 3)
        arm = data.xipos[other] - data.xipos[one]
        back, turn = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(back, data.xquat[one])
        mujoco.mju_mulQuat(turn, back, data.xquat[other])
        return _Hold(held, (axes * arm[:, None]).sum(axis=0), turn)

    def _tie(self, part: int, hold: _Hold) -> None:
        """Switch a weld on at the centre of mass of what is held."""
        model, constraint = self._model, self._constraints[part]
        one, other = self._bodies[part], self._bodies[hold.held]
        model.eq_obj2id[constraint] = other
        model.eq_data[constraint, :3] = model.body_ipos[other]
        model.eq_data[constraint, 3:6] = model.body_ipos[one] + hold.place
        model.eq_data[constraint, 6:10] = hold.turn
        self._data.eq_active[constraint] = True

    def _release(self, parts: Sequence[int]) -> None:
        for part in parts:
            del self._holds[part]
            self._data.eq_active[self._constraints[part]] = False

    def _force(self, part: int) -> float:
        """Force of a grip in the last step, N."""
        data = self._data
        mine = np.flatnonzero(data.efc_id[: data.ne] == self._constraints[part])[:3]
        return float(np.sqrt(np.square(data.efc_force[mine]).sum()))
