"""Friction and rebound of shapes in MuJoCo.

Two surfaces in contact have the geometric mean of their coefficients. MuJoCo takes the greater
friction of two shapes instead, or all values of the shape with the higher priority. So each shape
stores the mean of its own values and the usual ones, and unusual shapes have priority; where two of
these may meet, the pair has values of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import combinations
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.solids import YIELD

STIFFNESS = 55.0
"""1/s: natural frequency of a contact; something that hits it at 10 m/s sinks in by 0.2 m or less.
Scores of cars change by 0.1 % and those of throwers by 2.5 % from 120 to 480 Hz; above 65 contacts
tremble at 120 Hz. In the published throw three blocks come near breaking at once; with 55 the
published one breaks first."""
FIXED = -1
"""Cluster of the ground and of everything fixed."""
IMPEDANCE = (0.9, 0.95, 0.001, 0.5, 2.0)
REBOUND = (0.0, 0.05, 0.1, 0.18, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
DAMPING = (3.0, 1.926, 1.236, 0.797, 0.597, 0.497, 0.355, 0.255, 0.181, 0.122, 0.074, 0.034, 0.017)
"""Damping ratio of a contact with each restitution, measured on a ball without gravity: MuJoCo's
contacts are spring-dampers that cannot pull, so a rebound lasts several steps."""


SLOW = 0.5
"""m/s: contacts of lively surfaces that are slower do not rebound. In one step of free fall a body
gains 0.27 m/s, so what rests on little damping would tremble."""


Floats = tuple[float, ...]


class Surface(NamedTuple):
    """What a shape is like to touch."""

    friction: float
    restitution: float
    rolling: float = 0.0
    """Rolling friction, m."""

    def mean(self, other: Surface) -> Surface:
        """What two surfaces are like against each other."""
        rolling = self.rolling * sqrt(other.friction) + other.rolling * sqrt(self.friction)
        return Surface(
            sqrt(self.friction * other.friction),
            sqrt(self.restitution * other.restitution),
            rolling,
        )


class Covered(NamedTuple):
    """A shape with its surface."""

    geom: Any
    body: str
    """Name of the body that it belongs to."""
    cluster: int
    surface: Surface


class Surfaces:
    """The surfaces of all shapes of one model."""

    def __init__(self, physics: Constants, default: Any) -> None:
        """Start with no shapes; `default` is what those of the model are like at first."""
        self._usual = Surface(physics["friction"], physics["restitution"])
        default.solimp = IMPEDANCE
        self._set(default, self._usual)
        self.lively: list[bool] = []
        """Of each shape, whether it rebounds more than usual."""
        self._fixed: list[Covered] = []
        self._unusual: list[Covered] = []

    def item(self, friction: float | None, restitution: float | None) -> Surface:
        """The surface of an object or the ground; None stands for the constants' values."""
        usual = self._usual
        return Surface(
            usual.friction if friction is None else friction,
            usual.restitution if restitution is None else restitution,
        )

    def cover(self, geom: Any, surface: Surface, cluster: int) -> None:
        """Set the surface of a shape; shapes of one cluster never touch each other."""
        self.lively.append(surface.restitution > self._usual.restitution)
        if surface != self._usual:
            geom.priority = 1
            self._set(geom, surface)
            self._unusual.append(Covered(geom, geom.parent.name, cluster, surface))
        elif cluster == FIXED:
            self._fixed.append(Covered(geom, geom.parent.name, cluster, surface))

    def _set(self, geom: Any, surface: Surface) -> None:
        friction, geom.solref, geom.condim = _contact_between(surface, self._usual)
        geom.friction = friction[1], *friction[2:4]

    def pair(self, spec: Any, apart: set[tuple[str, str]]) -> None:
        """Set the values of every two unusual shapes that may meet.

        Args:
            spec: The model's.
            apart: Names of bodies that do not collide.
        """
        resting = _contact(self._usual)[1]
        for one, other in self._meeting():
            names = one.body, other.body
            if one.cluster == other.cluster or names in apart or names[::-1] in apart:
                continue
            pair, first, second = spec.add_pair(), one.geom, other.geom
            pair.geomname1, pair.geomname2 = first.name, second.name
            touching = _contact_between(one.surface, other.surface)
            pair.friction, pair.solref, pair.condim = touching
            pair.solreffriction, pair.solimp = resting, IMPEDANCE
            pair.gap = max(first.gap, second.gap)

    def _meeting(self) -> Iterator[tuple[Covered, Covered]]:
        """Two unusual shapes, or a lively one and something fixed: friction takes the damping of
        the contact, and with that of a lively one, what rests would creep."""
        yield from combinations(self._unusual, 2)
        for one in self._unusual:
            if self.lively[int(one.geom.name)]:
                yield from ((one, other) for other in self._fixed)


class Calming:
    """Damps slow contacts of lively surfaces."""

    def __init__(self, data: Any, lively: Sequence[bool], usual: float) -> None:
        """Choose the contacts.

        Args:
            data: MuJoCo's.
            lively: Whether each shape is lively, by its number.
            usual: Restitution of usual surfaces.
        """
        self._data, self._lively = data, np.array(lively)
        self._damping = _rate(1.0 / (_damping(usual) * STIFFNESS))

    def __call__(self) -> None:
        """Change the wanted accelerations of contacts, between the two halves of a step."""
        data = self._data
        contact = data.contact
        chosen = np.flatnonzero(self._lively[contact.geom].any(axis=1))
        rows = contact.efc_address[chosen]
        speeds = data.efc_vel[rows]
        more = self._damping - _rate(contact.solref[chosen, 0])
        data.efc_aref[rows] -= np.where(np.abs(speeds) < SLOW, more * speeds, 0.0)


class Yielding:
    """Makes contacts with soft objects springs with dampers, implicit in time as Bullet's are."""

    def __init__(self, model: Any, data: Any, stiffness: Sequence[float]) -> None:
        """Choose the contacts.

        Args:
            model: MuJoCo's.
            data: MuJoCo's.
            stiffness: Of each shape by its number, N/m; 0 for hard ones.
        """
        self._model, self._data, self._stiffness = model, data, np.array(stiffness)

    def __call__(self) -> None:
        """Change the regularisation and wanted accelerations of contacts, between the two halves of
        a step: the normal force is stiffness * depth less damping * speed, both after the step."""
        data, step = self._data, self._model.opt.timestep
        stiffness = self._stiffness[data.contact.geom].max(axis=1)
        for i in np.flatnonzero(stiffness):
            contact, k = data.contact[i], stiffness[i]
            row, c = contact.efc_address, YIELD * k
            if row < 0:
                continue
            yielding = 1.0 / (step * (step * k + c))
            contact.mu *= np.sqrt(data.efc_R[row] / yielding)
            data.efc_R[row], data.efc_D[row] = yielding, 1.0 / yielding
            if data.nisland:  # the solver reads copies
                copy = data.map_efc2iefc[row]
                data.iefc_R[copy], data.iefc_D[copy] = yielding, 1.0 / yielding
            pull = k * contact.dist + (step * k + c) * data.efc_vel[row]
            data.efc_aref[row] = -yielding * pull


def _rate(constant: Any) -> Any:
    """Deceleration over speed of a contact with a time constant, 1/s."""
    return 2.0 / (IMPEDANCE[1] * constant)


def _damping(restitution: float) -> float:
    return float(np.interp(restitution, REBOUND, DAMPING))


@lru_cache
def _contact_between(one: Surface, other: Surface) -> tuple[Floats, Floats, int]:
    """`_contact` of two surfaces against each other; the shapes of a model have few surfaces."""
    return _contact(one.mean(other))


def _contact(surface: Surface) -> tuple[Floats, Floats, int]:
    """MuJoCo's friction along two tangents, about the normal and for rolling about two tangents;
    its time constant and damping ratio; and how many of its directions act."""
    ratio = _damping(surface.restitution)
    friction = (*[surface.friction] * 2, 0.0, *[surface.rolling] * 2)
    return friction, (1.0 / (ratio * STIFFNESS), ratio), 6 if surface.rolling else 3
