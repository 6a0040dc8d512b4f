"""The work of all forces in MuJoCo's own coordinates, for tests and `benchmarks/balance.py`."""

from __future__ import annotations

from typing import Any

import mujoco


class Works:
    """Work in all steps so far, J."""

    mj_step1 = staticmethod(mujoco.mj_step1)

    def __init__(self) -> None:
        self.inside = self.outside = self.turnover = 0.0
        """Of constraints, dampers and suspensions; of all else but gravity; both by amount."""

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
