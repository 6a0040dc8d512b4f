"""The work of all forces in MuJoCo's own coordinates, for tests and `benchmarks/balance.py`."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np


class Works:
    """Work in all steps so far, J."""

    def __init__(self) -> None:
        self.inside = self.outside = self.turnover = 0.0
        """Of constraints, dampers and suspensions; of all else but gravity; both by amount."""
        self.steps = 0.0
        """What the engine's steps add by themselves. They move bodies on with the velocity after a
        step, but their inertial forces and weight are those of the place and velocity before it:
        what turns fast or is hit gains or loses a little. It follows from inertia and these forces
        alone, whatever else acts."""
        self._stepped: Any = None
        """The state in which a second half of a step left it, until the next first half."""
        self._before = 0.0

    def mj_step1(self, model: Any, data: Any) -> None:
        """In place of MuJoCo's."""
        mujoco.mj_step1(model, data)
        if self._stepped is data:
            self.steps += _energy(model, data) - self._before
        self._stepped = None

    def mj_step2(self, model: Any, data: Any) -> None:
        """In place of MuJoCo's."""
        before, step = data.qvel.copy(), model.opt.timestep
        mujoco.mj_step2(model, data)
        mean = (before + data.qvel) / 2
        damping = -model.dof_damping * data.qvel  # at the end of the step: it is implicit
        springs = data.qfrc_passive - data.qfrc_damper
        own = data.qfrc_constraint + springs + damping + data.qfrc_applied
        other = data.qfrc_smooth - data.qfrc_passive + data.qfrc_bias - data.qfrc_applied
        inside, outside = step * float((own * mean).sum()), step * float((other * mean).sum())
        self.inside += inside
        self.outside += outside
        self.turnover += abs(inside) + abs(outside)
        self._stepped = data
        self._before = _energy(model, data) + step * float((data.qfrc_bias * mean).sum())


def _energy(model: Any, data: Any) -> float:
    """Kinetic energy and energy of height, J, with the inertia and heights that MuJoCo has
    computed: after the second half of a step, those before it."""
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    height = (model.body_mass[:, None] * data.xipos * model.opt.gravity).sum()
    return float((momentum * data.qvel).sum() / 2 - height)
