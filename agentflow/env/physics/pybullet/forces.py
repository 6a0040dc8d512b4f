"""Forces that PyBullet is given in every step: air, springs, thrusters, blades, winches, struts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agentflow.env.physics.frames import swap_all
from agentflow.env.physics.laws.air import DragForce
from agentflow.env.physics.laws.forces import PartForce, Wrench
from agentflow.env.physics.laws.select import Law
from agentflow.env.physics.layout import Built, RowLayout, drag_locations
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.rows import Rows
from agentflow.env.physics.rows import POSITION, Row
from agentflow.env.physics.spanning_tree import Skeleton

CENTRE = (0.0, 0.0, 0.0)


class AppliedForces:
    """All such forces on the bodies of one skeleton."""

    def __init__(
        self,
        client: int,
        assembly: Assembly,
        plan: Skeleton,
        built: Sequence[Built],
        layout: RowLayout,
        laws: Sequence[Law],
    ) -> None:
        """Set up.

        Args:
            client: PyBullet client.
            assembly: The machine.
            plan: Its current skeleton.
            built: The bodies.
            layout: The rows.
            laws: All forces except drag.
        """
        self._client, self._layout, self._laws = client, layout, laws
        inertia = swap_all(np.array([part.inertia for part in assembly.parts]).reshape(-1, 3))
        locations = drag_locations(assembly, plan, layout.locations)
        self._drag = DragForce(assembly.parts, locations, inertia)
        self._at = {part: (body.uid, index) for body in built for part, index in body.index.items()}
        for i, handle in enumerate(layout.handles[layout.thing_rows], len(assembly.parts)):
            self._at[i] = handle
        unseen = {uid for uid, links in layout.bodies if not links}
        joined = (body.uid for body in built if body.piece.links)
        self._stale = [uid for uid in joined if laws and uid in unseen]
        """Bodies whose links are not read. Without a refresh PyBullet would push them where they
        were a step ago."""
        led = {layout.handles[row] for row in self._drag.rows}
        self._far = bool(laws) or any(index >= 0 for _, index in led)
        """Whether any force acts on a row that is not a head."""

    def __call__(self, rows: Rows) -> None:
        """Apply everything for one step; PyBullet clears it after the step."""
        known = rows.all if self._far else rows.known
        self._apply_wrenches(self._drag(known), known)
        for uid in self._stale:
            pybullet.getLinkState(uid, 0, 0, 1, self._client)
        for law in self._laws:
            self._apply_forces(law(known))

    def _apply_wrenches(self, wrenches: Sequence[Wrench], rows: Sequence[Row]) -> None:
        """Apply forces and torques to clusters."""
        client, handles = self._client, self._layout.handles
        for row, local, force, torque in wrenches:
            uid, index = handles[row]
            frame = pybullet.LINK_FRAME if local else pybullet.WORLD_FRAME
            at = CENTRE if local else rows[row][POSITION]
            pybullet.applyExternalForce(uid, index, force, at, frame, client)
            if torque is not None:
                pybullet.applyExternalTorque(uid, index, torque, frame, client)

    def _apply_forces(self, pushes: Sequence[PartForce]) -> None:
        """Apply forces at the centres of parts."""
        client = self._client
        for part, force, at in pushes:
            uid, index = self._at[part]
            if at is None:
                pybullet.applyExternalForce(uid, index, force, CENTRE, pybullet.LINK_FRAME, client)
            else:
                pybullet.applyExternalForce(uid, index, force, at, pybullet.WORLD_FRAME, client)
