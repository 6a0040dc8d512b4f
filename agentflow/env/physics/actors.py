"""Owns the vocabulary of what acts on a machine beside joints: thrust, blades, ropes, grips, cogs.

Everything is given as the machine stands at rest, in the game frame; forces.py has springs.
"""

from __future__ import annotations

from dataclasses import dataclass

from agentflow.env.scene import Vec3


@dataclass(frozen=True)
class Thrust:
    """A steady push on a part at its centre, while `motors` are on."""

    block: int
    part: int
    force: Vec3
    """N; turns with the part."""


@dataclass(frozen=True)
class Lift:
    """A propeller blade: air that passes it pushes it (blade law of spec 2.2), at all times."""

    block: int
    part: int
    push: Vec3
    """Unit vector of the force, the blade's Up."""
    normal: Vec3
    """Unit vector whose share of the velocity makes the force."""
    drag: float
    """kg s/m2: force over share of the velocity and squared speed."""
    speed_cap: float
    """m/s; beyond it the squared speed counts no more."""


@dataclass(frozen=True)
class Rope:
    """A winch: a rope between two parts' centres that is reeled in while `winches` are on.

    It comes into being, taut, when winches are first switched on, and never pushes.
    """

    block: int
    a: int
    b: int
    speed: float
    """m/s of rope taken in."""
    shortest: float
    """m; no more is taken in than down to this."""
    stiffness: float
    """N/m."""
    damping: float
    """N s/m."""
    force: float
    """N, the most that it pulls; what pulls harder draws rope out."""


@dataclass(frozen=True)
class Grip:
    """A grabber: holds on to the first thing that can move and touches its front."""

    block: int
    part: int
    front: Vec3
    """Unit vector."""
    reach: float
    """m from the part's centre to its front."""
    force: float
    """N, the most with which it holds."""
    joined: frozenset[int] = frozenset()
    """Parts that are built on to it; when those break off, it does not catch them."""


@dataclass(frozen=True)
class Mesh:
    """Two cogs whose teeth are in each other: position of joint `a` is -ratio that of `b`."""

    a: int
    """Joint index."""
    b: int
    """Joint index."""
    ratio: float


@dataclass(frozen=True)
class Actors:
    """All that act in one machine."""

    thrusts: tuple[Thrust, ...] = ()
    lifts: tuple[Lift, ...] = ()
    ropes: tuple[Rope, ...] = ()
    grips: tuple[Grip, ...] = ()
    meshes: tuple[Mesh, ...] = ()
