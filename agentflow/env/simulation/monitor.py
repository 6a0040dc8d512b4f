"""Watches a rollout: loads in every step, contacts now and then, and closely at events.

Reading contacts in every step would make rollouts of small machines a tenth slower. So most steps
are skipped until speeds or loads jump, something breaks, touches or is switched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from math import inf

import numpy as np

from agentflow.env.measurements import Energy, Measured, Pull
from agentflow.env.physics.engine import World
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly
from agentflow.env.rollout import Array, Broken, Moment, Trace
from agentflow.env.simulation.logs import ContactLog, LoadHistory, energy_until
from agentflow.env.simulation.recorder import FineInterval, Recorder, thin_out

FINE = 0.02
"""Least time between fine samples, s."""
SELDOM = 0.1
"""Time between readings of contacts while nothing happens, s."""
ALERT = 0.1
"""How long to look closely after something happened, s."""
JOLT, TWIST = 60.0, 120.0
"""Acceleration (m/s2, twice gravity) and angular acceleration (rad/s2) that count as a jump."""
SHOCK = 0.1
"""Growth of the greatest load over strength in a step that counts as a jump."""
LONG_BEFORE, BEFORE, AFTER = 0.2, 0.05, 0.05
"""How long before the decisive moment, before other events, and after either of them fine samples
are kept, s: springs throw within 0.2 s."""
PRESSING = 3
"""How many steps to read contacts in after a jump: what bounces off presses for as long."""
ERROR, SMALL = 0.05, 1000.0
"""Energy that errors of an engine's steps may add: share of what motors, springs, gravity and wind
gave, ten times as much as with any machine of a record; or J, too little to throw a block far."""
LONG, SHORT, SHARE = 0.4, 0.2, 0.02
"""For how long to look closely, and to read contacts in every step, in any rollout, s; share of
all other steps in which either may be done besides."""


class Monitor:
    """What is measured and when; `connections` are the breakable joints."""

    def __init__(
        self, world: World, assembly: Assembly, loads: Loads, objects: tuple[str, ...], rate: float
    ) -> None:
        self._world, self._loads, self._rate = world, loads, rate
        self.recorder = Recorder(world, assembly, loads.connections, objects)
        self.history = LoadHistory(loads, assembly.joints)
        """To be added to after each part of a step."""
        self._contacts = ContactLog(1.0 / rate)
        self._fine = max(1, round(FINE * rate - 0.5))
        self._seldom = max(1, round(SELDOM * rate))
        self.change = JOLT / rate, TWIST / rate, SHOCK
        """Greatest change of linear speed (m/s), angular speed (rad/s) and load over strength in a
        step that is no jump."""
        self._alert = 0
        """For how many more steps to look closely."""
        self._pressing = 0
        """For how many more steps to read contacts."""
        self._spare, self._glances = LONG * rate, SHORT * rate
        """How many more steps may be looked at closely, and in how many contacts may be read."""
        self._speeds, self._peak, self._steps = (0.0, 0.0), 0.0, 0
        self._touches: list[float] = []
        """Times at which bodies touched for the first time, s."""
        self.unexplained = 0.0
        """Energy that all bodies have at the decisive moment and that nothing gave them, J; 0 if
        errors may have added it. Known once all is measured."""

    def start(self) -> None:
        """t = 0: what touches now stands."""
        self._contacts.add(0.0, self._world.contacts())
        self.look_closely()
        self.history.add(0.0)
        self.recorder.sample(0.0)

    def look_closely(self) -> None:
        """Something happened or was switched."""
        self._alert, self._pressing = round(ALERT * self._rate), PRESSING

    @property
    def idle(self) -> int:
        """In how many steps to come there is nothing to do, unless something jumps."""
        steps = self._seldom - self._steps % self._seldom - 1
        if self._alert:
            steps = min(steps, int((1.0 - self._spare) / SHARE) - 1)
        if self._pressing:
            steps = min(steps, int((1.0 - self._glances) / SHARE) - 1)
        return steps

    def pass_over(self, times: list[float], speeds: tuple[float, float]) -> None:
        """Go on by calm steps, as many as are `idle` at most: times after each, s, and greatest
        speeds after the last one."""
        self.history.extend(times, self._loads.pass_over(len(times)))
        self._steps += len(times)
        for _ in times:
            self._spare += SHARE
            self._glances += SHARE
        self._speeds, self._peak = speeds, self._loads.peak

    def add_step(self, time: float, speeds: tuple[float, float]) -> None:
        """Look at a whole step.

        Args:
            time: s.
            speeds: Greatest linear and angular speed, of the same bodies in every step.
        """
        self._steps += 1
        self._spare += SHARE
        self._glances += SHARE
        (linear, angular), self._speeds = self._speeds, speeds
        peak, self._peak = self._peak, self._loads.peak
        jolt, twist, shock = self.change
        if (
            abs(speeds[0] - linear) > jolt
            or abs(speeds[1] - angular) > twist
            or self._peak - peak > shock
        ):
            self.look_closely()
        if self._pressing and self._glances >= 1.0:
            self._pressing -= 1
            self._glances -= 1.0
            self._read(time)
        elif self._steps % self._seldom == 0:
            self._read(time)
        if self._alert and self._spare >= 1.0:
            self._alert -= 1
            self._spare -= 1.0
            if self._steps % self._fine == 0:
                self.recorder.sample(time, regular=False)

    def _read(self, time: float) -> None:
        if self._contacts.add(time, self._world.contacts()):
            self._touches.append(time)
            self.look_closely()

    def trace(self) -> Trace:
        """The trace with all fine samples."""
        return self.recorder.trace(self.history.greatest, self._pulls(self.recorder.times))

    def thin_out(self, trace: Trace, moment: Moment | None, broken: tuple[Broken, ...]) -> Trace:
        """The trace with fine samples around events only.

        Args:
            trace: All samples.
            moment: The decisive one.
            broken: The connections that broke.
        """
        breaks = [item.time for item in broken if item.time > 0.0]
        events = [] if moment is None else [FineInterval.around(moment.time, LONG_BEFORE, AFTER)]
        others = (*breaks[:1], *self._touches[:1], *breaks[1:2], *self._touches[1:2])
        events += [FineInterval.around(time, BEFORE, AFTER) for time in others]
        return thin_out(trace, events)

    def measure(self, moment: Moment | None, broken: tuple[Broken, ...]) -> Measured:
        """What was measured, before and after the decisive moment; the last call of all."""
        time = None if moment is None else moment.time
        peaks = self.history.peaks(time, broken)
        works, history = self._world.works(), self.history
        works = works[len(works) - 1 - history.steps_until([inf])[0] :]
        energy = self._energy(moment, works)
        return Measured(
            self._contacts.contacts(),
            peaks,
            energy,
            history.recoil(time, broken),
            self._pulled(energy.time),
            history.drawn(works),
            history.greatest_peak(),
        )

    @cached_property
    def _lines(self) -> Mapping[int, tuple[Array, Array]]:
        """`World.pulls` once the rollout is over."""
        return self._world.pulls()

    def _pulls(self, times: Sequence[float]) -> dict[int, tuple[Array, Array]]:
        """Pull of springs and winches at some times, N, and their work from t = 0, J."""
        found, steps = {}, self.history.steps_until([inf, *times])
        for block, (pull, work) in self._lines.items():
            start = len(work) - 1 - steps[0]
            rows = start + steps[1:]
            found[block] = pull[rows], work[rows] - work[start]
        return found

    def _pulled(self, until: float) -> tuple[Pull, ...]:
        """What springs and winches did until a time, s."""
        times = self.history.times_until(until)
        return tuple(
            Pull(block, float(work[-1]), float(pull.max()), times[int(pull.argmax())])
            for block, (pull, work) in self._pulls(times).items()
        )

    def _energy(self, moment: Moment | None, works: Array) -> Energy:
        _, start = self.recorder.snapshot_near(0.0)
        time, then = self.recorder.snapshot_near(inf if moment is None else moment.time)
        thrown = None if moment is None else moment.body
        done = works[self.history.steps_until([time])[0]] - works[0]
        energies = before, after = self._world.energies(start), self._world.energies(then)
        given = np.append(done, before[:, 1].sum() - after[:, 1].sum())
        excess = float((after[:, 0] - before[:, 0]).sum() - given.sum())
        if excess > max(SMALL, ERROR * float(given.clip(0.0).sum())):
            self.unexplained = excess
        return energy_until(time, done, energies, thrown, self.recorder.objects)
