"""The work of springs and motors over time, and energies at a moment."""

from __future__ import annotations

import numpy as np

from agentflow.env.measurements import Energy
from agentflow.env.physics.engine import Power, World
from agentflow.env.tasks.base import Body


class WorkLog:
    """Adds up the work of the devices of a world from readings of their power.

    The power in a step is that of the forces that act in it, which are constant, so that the work
    is what the bodies gain. `step` is the length of an undivided step, s.
    """

    def __init__(self, world: World, step: float) -> None:
        self._world, self._step = world, step
        self._times, self._work = [0.0], [Power()]
        self._last = Power()

    def add(self, time: float) -> None:
        """Read the mean power of the last step; over skipped steps it changed evenly."""
        power, before, work = self._world.power(), self._last, self._work[-1]
        gap = time - self._times[-1]
        if gap < 1.5 * self._step:
            before = power
        self._work.append(
            Power(
                work.springs + gap * (power.springs + before.springs) / 2,
                work.motors + gap * (power.motors + before.motors) / 2,
            )
        )
        self._times.append(time)
        self._last = power

    def energy(
        self, time: float, start: object, then: object, thrown: Body | None, things: tuple[str, ...]
    ) -> Energy:
        """Work until a time (s), and kinetic energy then.

        Args:
            time: Of the second snapshot.
            start: Snapshot of t = 0.
            then: Snapshot of that time.
            thrown: What counts as thrown; None for nothing.
            things: Names of the moving things; only one that is thrown counts.
        """
        work = np.array(self._work)
        springs, motors = (np.interp(time, self._times, column) for column in work.T)
        before, after = self._world.energies(start), self._world.energies(then)
        blocks = len(after) - len(things)
        counted = np.arange(len(after)) < blocks
        index = blocks + things.index(thrown) if isinstance(thrown, str) else thrown
        if index is not None:
            counted[index] = True
        kinetic = after[:, 0] - before[:, 0]
        own = 0.0 if index is None else float(kinetic[index])
        return Energy(
            time=time,
            springs=float(springs),
            motors=float(motors),
            gravity=float((before[:, 1] - after[:, 1])[counted].sum()),
            thrown=own,
            machine=float(kinetic[counted].sum()) - own,
        )
