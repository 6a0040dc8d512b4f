"""The contacts of a rollout: first and hardest hit of each pair of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from agentflow.env.measurements import Contact, Hit
from agentflow.env.physics.engine import Touch
from agentflow.env.tasks.base import Body
from agentflow.machine.geometry.vectors import Vec3

LONGEST = 0.1
"""Longest time over which the impulse of a hit is summed, s: bodies that rest on each other press
for ever."""


@dataclass
class _Pair:
    """Two bodies that touched."""

    standing: bool
    begin: float
    """Time at which the current hit began, s."""
    place: Vec3
    seen: float
    """Time at which they last touched, s."""
    impulse: float
    first: Hit | None = None
    hardest: Hit | None = None

    def close(self) -> None:
        """End the current hit."""
        if self.hardest is None or self.impulse > self.hardest.impulse:
            self.hardest = Hit(self.begin, self.place, self.impulse)
            self.first = self.first or self.hardest


class ContactLog:
    """Collects what touched; `step` is the length of a step, s."""

    def __init__(self, step: float) -> None:
        self._step = step
        self._pairs: dict[tuple[Body, Body], _Pair] = {}

    def add(self, time: float, touches: Sequence[Touch]) -> bool:
        """Add one reading; returns whether any two bodies touched for the first time.

        Readings may skip steps: a hit ends when a pair is missing from a reading or a step was
        skipped.
        """
        pairs, new = self._pairs, False
        for a, b, place, force in touches:
            pair = pairs.get((a, b))
            if pair is None:
                pairs[a, b] = _Pair(time <= 0.0, time, place, time, force * self._step)
                new = True
            elif time - pair.seen < 1.5 * self._step and time - pair.begin < LONGEST:
                pair.seen, pair.impulse = time, pair.impulse + force * self._step
            else:
                pair.close()
                pair.begin = pair.seen = time
                pair.place, pair.impulse = place, force * self._step
        return new

    def contacts(self) -> tuple[Contact, ...]:
        """All contacts in order of time."""
        found = []
        for (a, b), pair in self._pairs.items():
            pair.close()
            assert pair.first is not None
            assert pair.hardest is not None
            found.append(Contact(a, b, pair.first, pair.hardest, pair.standing, pair.seen))
        return tuple(sorted(found, key=lambda contact: contact.first.time))
