"""Owns the translation of a construction tree into parts and joints (spec 2.2), for any engine.

The look and feel of each block type is in blockforms.py; spanning trees are tree.py's.
"""

from __future__ import annotations

from agentflow.env.constants import Constants
from agentflow.env.physics.block_parts import caster_parts, drive_of, end_parts, kind_of, whole_part
from agentflow.env.physics.fittings import WINCH, fit
from agentflow.env.physics.model import Assembly, Drive, Joint, Part, Pull, Strength
from agentflow.env.physics.vectors import add
from agentflow.env.scene import Vec3
from agentflow.machine.blocks.library import BOULDER, library
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.placement import Geometry, Placed
from agentflow.machine.tree import Machine

SPRING = 9
CASTERS = frozenset({50, 86})


def assemble(machine: Machine, geometry: Geometry, constants: Constants) -> Assembly:
    """Parts, joints and springs of a valid machine, standing on the ground at the world's middle.

    The centre of the machine's box lies over x = z = 0 and its lowest point on y = 0 (spec 3).

    Args:
        machine: A machine-valid construction tree.
        geometry: Its placement.
        constants: Masses and sizes come from the block library, everything else from here.
    """
    low, high = geometry.box_min, geometry.box_max
    shift = (-(low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2)
    return _Assembler(machine, geometry, constants, shift).run()


class _Assembler:
    """Collects parts and joints in id order; what closes loops comes last: trees prefer early."""

    def __init__(
        self, machine: Machine, geometry: Geometry, constants: Constants, shift: Vec3
    ) -> None:
        self.machine, self.geometry, self.constants = machine, geometry, constants
        self.shift = shift
        self.parts: list[Part] = []
        self.joints: list[Joint] = []
        self.closing: list[Joint] = []
        self.pulls: list[Pull] = []
        self.blocks: list[tuple[int, ...]] = []
        self.spans: list[tuple[int, int, int]] = []

    def run(self) -> Assembly:
        for placed in self.geometry.blocks:
            kind = library()[placed.type]
            if kind.linear:
                self._two_ended(placed, kind)
            elif kind.type in CASTERS:
                self._caster(placed, kind)
            else:
                self._standard(placed, kind)
        for link in self.geometry.auto_connections:
            self._auto_connection(link.block, link.partner, link.face_id)
        return Assembly(
            parts=tuple(self.parts),
            joints=(*self.joints, *self.closing),
            pulls=tuple(self.pulls),
            blocks=tuple(self.blocks),
            origins=tuple(
                add(b.center if b.two_ended else b.origin, self.shift) for b in self.geometry.blocks
            ),
            centres=tuple(add(b.center, self.shift) for b in self.geometry.blocks),
            rotations=tuple(b.quaternion for b in self.geometry.blocks),
            spans=tuple(self.spans),
            actors=fit(
                self.geometry.blocks, self.blocks, (*self.joints, *self.closing), self.constants
            ),
        )

    def _add(self, parts: list[Part]) -> tuple[int, ...]:
        indices = tuple(range(len(self.parts), len(self.parts) + len(parts)))
        self.parts += parts
        self.blocks.append(indices)
        return indices

    def _standard(self, placed: Placed, kind: BlockType) -> None:
        (part,) = self._add([whole_part(placed, kind, self.constants, self.shift)])
        parent = self.machine[placed.id].parent
        if parent < 0 or kind.type == BOULDER:
            return
        joint_kind, axis = kind_of(kind.type)
        self.joints.append(
            Joint(
                block=placed.id,
                partner=parent,
                a=self.blocks[parent][-1],
                b=part,
                kind=joint_kind,
                pivot=add(placed.origin, self.shift),
                axis=getattr(placed, axis),
                drive=drive_of(placed, kind, self.constants),
                strength=self._strength(kind.type),
            )
        )

    def _caster(self, placed: Placed, kind: BlockType) -> None:
        fork, wheel, hub = caster_parts(placed, kind, self.constants, self.shift)
        first, second = self._add([fork, wheel])
        parent = self.machine[placed.id].parent
        pivot = add(placed.origin, self.shift)
        self.joints.append(
            Joint(
                block=placed.id,
                partner=parent,
                a=self.blocks[parent][-1],
                b=first,
                kind="revolute",
                pivot=pivot,
                axis=placed.front,
                drive=drive_of(placed, kind, self.constants),
                strength=self._strength(kind.type),
            )
        )
        self.joints.append(
            Joint(
                placed.id,
                placed.id,
                first,
                second,
                kind="revolute",
                pivot=hub,
                axis=placed.right,
                drive=Drive(friction=self.constants["axle_friction"]),
            )
        )

    def _two_ended(self, placed: Placed, kind: BlockType) -> None:
        step = self.machine[placed.id]
        ends = end_parts(placed, kind, self.constants, self.shift)
        first, second = self._add(list(ends))
        self.spans.append((placed.id, first, second))
        strength = self._strength(kind.type)
        for partner, end, part, joints in (
            (step.parents[0], ends[0], first, self.joints),
            (step.parents[1], ends[1], second, self._later(kind.type)),
        ):
            carrier = self.blocks[partner][0]
            joints.append(
                Joint(placed.id, partner, carrier, part, pivot=end.centre, strength=strength)
            )
        if kind.type == SPRING:
            self.pulls.append(self._pull(placed.id, kind.type, first, second))
        elif kind.type != WINCH:
            self.joints.append(Joint(placed.id, placed.id, first, second, pivot=ends[1].centre))

    def _later(self, block_type: int) -> list[Joint]:
        """Where the joint of a second end goes: a brace closes a loop, a spring does not."""
        return self.joints if block_type in (SPRING, WINCH) else self.closing

    def _pull(self, block: int, block_type: int, a: int, b: int) -> Pull:
        value = self.constants
        return Pull(
            block=block,
            a=a,
            b=b,
            natural=value["spring_length"],
            ramp=value["spring_ramp"],
            force=value.of("spring_force", block_type),
            damping=value["spring_damping"],
        )

    def _auto_connection(self, block: int, partner: int, face_id: int) -> None:
        face = next(f for f in self.geometry.blocks[block].faces if f.face_id == face_id)
        self.closing.append(
            Joint(
                block=block,
                partner=partner,
                a=self.blocks[partner][-1],
                b=self.blocks[block][-1],
                pivot=add(face.position, self.shift),
                extra=True,
                strength=self._strength(self.machine[block].type),
            )
        )

    def _strength(self, block_type: int) -> Strength:
        return Strength(
            force=self.constants.of("strength_force", block_type),
            torque=self.constants.of("strength_torque", block_type),
        )
