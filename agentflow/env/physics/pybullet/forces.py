"""Forces applied in every step: air, springs, thrusters, blades, winches."""

from collections.abc import Sequence

from agentflow.env.physics.laws.select import Forces, Law
from agentflow.env.physics.pybullet.bodies import MIDDLE, Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.sensing import Rows
from agentflow.env.physics.rows import POSITION, Row


class AppliedForces(Forces):
    """Applies forces; PyBullet clears them after the step."""

    def __init__(self, built: Built, rows: Rows, laws: Sequence[Law]) -> None:
        assembly, plan, layout = built.assembly, built.plan, built.layout
        super().__init__(assembly, plan, layout, rows, laws)
        self._client, self._heads = built.client, rows
        moving = enumerate(layout.objects, len(assembly.parts))
        self._at = {**built.handles, **{i: (built.objects[name], -1) for i, name in moving}}
        self._leading = [built.handles[part] for part in layout.leading]
        self._stale = [
            body.uid
            for body in built.pieces
            if laws and body.piece.links and len({plan.cluster[part] for part in body.index}) == 1
        ]
        """Bodies whose links are not read. Without a refresh, PyBullet would apply forces at the
        links' positions one step earlier."""
        self._far = bool(laws) or not set(self.drag.rows) <= set(rows.heads)
        """Whether any force acts on a row that is not a head."""

    @property
    def _read(self) -> Sequence[Row]:
        return self._heads.all if self._far else self._heads.known

    def __call__(self) -> None:
        client, rows = self._client, self._read
        for row, local, force, torque in self.drag(rows):
            uid, index = self._leading[row]
            frame = pybullet.LINK_FRAME if local else pybullet.WORLD_FRAME
            at = MIDDLE if local else rows[row][POSITION]
            pybullet.applyExternalForce(uid, index, force, at, frame, client)
            if torque is not None:
                pybullet.applyExternalTorque(uid, index, torque, frame, client)
        for uid in self._stale:
            pybullet.getLinkState(uid, 0, 0, 1, client)
        for forces in self._of_laws(rows):
            for part, force, place in forces:
                uid, index = self._at[part]
                frame = pybullet.LINK_FRAME if place is None else pybullet.WORLD_FRAME
                pybullet.applyExternalForce(uid, index, force, place or MIDDLE, frame, client)
