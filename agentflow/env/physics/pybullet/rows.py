"""Rows read from PyBullet: those that lead a body in every step, the others on demand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from agentflow.env.physics.layout import RowLayout
from agentflow.env.physics.pybullet.bodies import Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.rows import WIDTH, Row, top_speeds
from agentflow.env.rollout import Array


class Rows:
    """The rows of one layout."""

    def __init__(
        self, client: int, layout: RowLayout, built: Sequence[Built], things: Mapping[str, int]
    ) -> None:
        """Read the heads; `things` are the body numbers of the scene's things."""
        self._client = client
        self._heads: list[tuple[int, int]] = []
        self._tails: list[tuple[slice, int, tuple[int, ...]]] = []
        row = 0
        leading = set(layout.leading)
        for body in built:
            links = tuple(
                body.index[link.part] for link in body.piece.links if link.part in leading
            )
            self._heads.append((row, body.uid))
            if links:
                self._tails.append((slice(row + 1, row + 1 + len(links)), body.uid, links))
            row += 1 + len(links)
        self._heads += [(i, things[name]) for i, name in enumerate(layout.things, row)]
        self._blank: list[Row] = [()] * layout.thing_rows.stop
        self._partial = False
        self.known = self._blank
        """Rows read so far; empty tuples for the others."""
        self.heads = [row for row, _ in self._heads]
        """Rows of the bodies' roots and of moving things."""
        self.read()

    def read(self) -> None:
        """Read the heads after a step, and forget the other rows."""
        client, rows = self._client, self._blank.copy()
        for row, uid in self._heads:
            position, rotation = pybullet.getBasePositionAndOrientation(uid, client)
            velocity, spin = pybullet.getBaseVelocity(uid, client)
            rows[row] = position + rotation + velocity + spin
        self.known = rows
        self._partial = bool(self._tails)

    def __getitem__(self, row: int) -> Row:
        """One row."""
        return self.known[row] or self.all[row]

    @property
    def all(self) -> list[Row]:
        """Every row; a new list in every step.

        Reading makes PyBullet update the positions of links, which pushing them requires.
        """
        if self._partial:
            for place, uid, links in self._tails:
                self.known[place] = [
                    state[0] + state[1] + state[6] + state[7]
                    for state in pybullet.getLinkStates(uid, links, 1, 1, self._client)
                ]
            self._partial = False
        return self.known

    @property
    def table(self) -> Array:
        """Every row, as an array (C, 13)."""
        return np.array(self.all).reshape(-1, WIDTH)

    @property
    def head_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed of the heads, m/s and rad/s."""
        known = self.known
        return top_speeds([known[row] for row in self.heads])
