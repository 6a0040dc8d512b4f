"""From a construction tree to parts, joints and devices."""

from dataclasses import replace

from agentflow.env.constants import Constants
from agentflow.env.physics.assembly.devices import control_devices, devices_of
from agentflow.env.physics.assembly.parts import block_parts, end_parts, joint_drive
from agentflow.env.physics.model import Assembly, Drive, Joint, Part, Strength
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, add
from agentflow.machine.tree import Machine

_last: tuple[object, Constants | None, Assembly | None] = (), None, None
"""The blocks that were assembled last, with which constants: many worlds have one machine."""


def assemble(machine: Machine, geometry: Geometry, constants: Constants) -> Assembly:
    """Parts, joints and devices of a valid machine, placed on the ground.

    The centre of its bounding box is at x = z = 0 and its lowest point at y = 0.

    Args:
        machine: A machine-valid construction tree.
        geometry: Its placement.
        constants: All other numbers; masses and sizes come from the block library.
    """
    global _last
    blocks = machine.steps, machine.controlled
    known, physics, assembly = _last
    if assembly and physics is constants and known == blocks:
        return assembly
    low, high = geometry.box_min, geometry.box_max
    shift = (-(low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2)
    assembly = _Assembler(machine, geometry, constants, shift).run()
    _last = blocks, constants, assembly
    return assembly


class _Assembler:
    """Collects parts and joints in id order.

    Joints that close loops come last, because spanning trees prefer early joints.
    """

    def __init__(
        self, machine: Machine, geometry: Geometry, constants: Constants, shift: Vec3
    ) -> None:
        self.machine, self.geometry, self.constants = machine, geometry, constants
        self.shift = shift
        self.parts: list[Part] = []
        self.joints: list[Joint] = []
        self.closing: list[Joint] = []
        self.blocks: list[tuple[int, ...]] = []
        self.spans: list[tuple[int, int, int]] = []

    def run(self) -> Assembly:
        for placed in self.geometry.blocks:
            kind = library()[placed.type]
            if kind.linear:
                self._two_ended(placed, kind)
            else:
                self._standard(placed, kind)
        for link in self.geometry.auto_connections:
            self._auto_connection(link.block, link.partner, link.face_id)
        joints = (*self.joints, *self.closing)
        devices = devices_of(self.geometry.blocks, self.blocks, joints, self.constants)
        return Assembly(
            parts=tuple(self.parts),
            joints=joints,
            blocks=tuple(self.blocks),
            origins=tuple(
                add(b.center if b.two_ended else b.origin, self.shift) for b in self.geometry.blocks
            ),
            centres=tuple(add(b.center, self.shift) for b in self.geometry.blocks),
            rotations=tuple(b.quaternion for b in self.geometry.blocks),
            spans=tuple(self.spans),
            devices=control_devices(devices, self.parts) if self.machine.controlled else devices,
        )

    def _add(self, parts: list[Part]) -> tuple[int, ...]:
        indices = tuple(range(len(self.parts), len(self.parts) + len(parts)))
        self.parts += parts
        self.blocks.append(indices)
        return indices

    def _standard(self, placed: Placed, kind: BlockType) -> None:
        first, *wheel = self._add(block_parts(placed, kind, self.constants, self.shift))
        parent, joint = self.machine[placed.id].parent, kind.joint
        if parent < 0 or joint.kind == "loose":
            return
        self.joints.append(
            Joint(
                block=placed.id,
                partner=parent,
                a=self.blocks[parent][-1],
                b=first,
                kind=joint.kind,
                pivot=add(placed.origin, self.shift),
                axis=placed.direction(joint.axis),
                drive=self._drive(placed, kind),
                strength=self._strength(kind.type),
            )
        )
        for second in wheel:
            self.joints.append(self._axle(placed, first, second))

    def _drive(self, placed: Placed, kind: BlockType) -> Drive:
        drive = joint_drive(placed, kind, self.constants)
        controlled = self.machine.controlled and kind.group is not None
        return replace(drive, starts=placed.id) if controlled else drive

    def _axle(self, placed: Placed, fork: int, wheel: int) -> Joint:
        """The joint about which the wheel of a caster rolls."""
        return Joint(
            placed.id,
            placed.id,
            fork,
            wheel,
            kind="revolute",
            pivot=self.parts[wheel].centre,
            axis=placed.right,
            drive=Drive(friction=self.constants["axle_friction"]),
        )

    def _two_ended(self, placed: Placed, kind: BlockType) -> None:
        step = self.machine[placed.id]
        ends = end_parts(placed, kind, self.constants, self.shift)
        first, second = self._add(ends)
        self.spans.append((placed.id, first, second))
        strength = self._strength(kind.type)
        closing = self.closing if kind.connector == "rod" else self.joints
        for partner, end, part, joints in (
            (step.parents[0], ends[0], first, self.joints),
            # the second end of a brace closes a loop, that of a spring or a rope does not
            (step.parents[1], ends[1], second, closing),
        ):
            carrier = self.blocks[partner][0]
            joints.append(
                Joint(placed.id, partner, carrier, part, pivot=end.centre, strength=strength)
            )
        if kind.connector == "rod":
            self.joints.append(Joint(placed.id, placed.id, first, second, pivot=ends[1].centre))

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
