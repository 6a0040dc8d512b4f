"""Moving joints between bodies at rest, and loops that they close."""

from collections.abc import Sequence
from typing import Protocol

from agentflow.machine.geometry.vectors import Vec3


class MovingJoint(Protocol):
    """A joint at rest, between two bodies; fixed ones have no pivot and axis."""

    @property
    def a(self) -> int:
        """Body."""

    @property
    def b(self) -> int:
        """Body."""

    @property
    def kind(self) -> str:
        """`revolute`, `prismatic` or `spherical`."""

    @property
    def pivot(self) -> Vec3:
        """m."""

    @property
    def axis(self) -> Vec3:
        """Unit vector."""


Loop = Sequence[tuple[int, float]]
"""The joints along a closed way through clusters; 1 where it leads from `a` to `b`, else -1."""
