"""Owns what winches pull: ropes that are reeled in, and how long each is at the moment.

A rope outlives splits of the machine, so it is set up once per world and then only moved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.actors import Rope
from agentflow.env.physics.kinematics import Row
from agentflow.env.physics.laws.air import Members, Push
from agentflow.env.physics.laws.springs import end_of
from agentflow.env.physics.vectors import dot, length, scale, subtract


class Ropes:
    """All ropes of one machine, on plain floats."""

    def __init__(self, ropes: Sequence[Rope], levels: Mapping[str, float], step: float) -> None:
        """Set up, with no rope strung yet.

        Args:
            ropes: All of them.
            levels: How far each schedule entry is switched on; -1 gives rope out.
            step: Time between calls, s.
        """
        self._ropes, self._levels = ropes, levels
        self.step = step
        """Time between calls, s."""
        self._left: list[float | None] = [None] * len(ropes)
        """Length of each rope, m."""

    def __bool__(self) -> bool:
        return bool(self._ropes)

    def place(self, members: Members) -> None:
        """Take note of where the parts are since the last split."""
        self._ends = [(members.place(rope.a), members.place(rope.b)) for rope in self._ropes]

    def __call__(self, rows: Sequence[Row]) -> list[Push]:
        """Reel, and what all ropes do in this step."""
        level = self._levels["winches"]
        pushes = []
        for i, (rope, ends) in enumerate(zip(self._ropes, self._ends, strict=True)):
            (at_a, speed_a), (at_b, speed_b) = (end_of(rows[row], offset) for row, offset in ends)
            line = subtract(at_b, at_a)
            distance = max(length(line), 1e-9)
            left = self._left[i]
            if left is None:
                if not level:
                    continue
                left = distance
            left = max(left - level * rope.speed * self.step, min(left, rope.shortest))
            left = self._left[i] = max(left, distance - rope.force / rope.stiffness)
            if distance <= left:
                continue
            along = scale(line, 1.0 / distance)
            parting = dot(subtract(speed_b, speed_a), along)
            pull = rope.stiffness * (distance - left) + rope.damping * parting
            force = scale(along, min(max(pull, 0.0), rope.force))
            pushes += [Push(rope.a, force, at_a), Push(rope.b, scale(force, -1.0), at_b)]
        return pushes
