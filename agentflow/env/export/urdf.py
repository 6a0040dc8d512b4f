"""A machine alone as URDF, the format in which robotics tools exchange robots.

Metres, kilograms and radians, in the right-handed frame with z up (`physics.frames`): the machine's
front is y+. The frame of the root's link is on the ground below the middle of the machine, those of
the others are at their joints; at rest all are aligned. Joints have the axes and positions that
they have in physics engines.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

from agentflow.env.constants import constants
from agentflow.env.export.cog_trains import train_leaders
from agentflow.env.export.losses import name_blocks, urdf_losses
from agentflow.env.export.xml_text import add_origin, number, numbers, size_of
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.frames import swap, swap_quaternion, swap_turn
from agentflow.env.physics.model import Assembly, Drive, Joint, Part
from agentflow.env.physics.structure.drives import merge_drives
from agentflow.env.physics.structure.spanning_tree import Link, Piece, Skeleton, skeleton
from agentflow.errors import UsageError
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Vec3, add, scale, subtract
from agentflow.machine.tree import Machine

GROUND: Vec3 = (0.0, 0.0, 0.0)
BALL_AXES = {"_x": (1.0, 0.0, 0.0), "_y": (0.0, 1.0, 0.0), "": (0.0, 0.0, 1.0)}
"""Ends of the names of the links that the three hinges of a ball joint carry, and their axes."""
CARRIER = 1e-6
"""Share of a part's mass and inertia in each of the two links between such hinges. A link without
mass would have 1 kg in PyBullet, and MuJoCo refuses it."""


def machine_urdf(machine: Machine) -> tuple[bytes, tuple[str, ...]]:
    """The file of a valid machine, and what it cannot hold, one sentence each.

    Raises:
        UsageError: The machine consists of several pieces.
    """
    assembly = assemble(machine, place(machine), constants())
    plan = skeleton(len(assembly.parts), assembly.joints)
    if len(plan.pieces) > 1:
        loose = [assembly.parts[part].block for piece in plan.pieces[1:] for part in piece.parts]
        raise UsageError(
            f"URDF holds one connected machine, but no joint connects {name_blocks(loose)} to "
            "block 0; remove what is loose, or convert to .xml"
        )
    notes = urdf_losses(assembly, plan)
    robot = Element("robot", name="machine")
    robot.extend(Comment(f" {note} ") for note in notes)
    _Robot(robot, machine, assembly, plan).add(plan.pieces[0])
    indent(robot)
    return tostring(robot, encoding="utf-8", xml_declaration=True) + b"\n", notes


class _Robot:
    """Writes links and joints; a joint and its link are named after their block."""

    def __init__(self, xml: Element, machine: Machine, assembly: Assembly, plan: Skeleton) -> None:
        self._xml, self._parts, self._joints = xml, assembly.parts, assembly.joints
        self._names: dict[int, str] = {}
        for step, parts in zip(machine, assembly.blocks, strict=True):
            name = f"block {step.id} {library()[step.type].name}".lower().replace(" ", "_")
            self._names |= {part: f"{name}_{n}" if n else name for n, part in enumerate(parts)}
        self._leaders = train_leaders(assembly, plan)
        self._child = {link.joint: self._names[link.part] for link in plan.links}

    def add(self, piece: Piece) -> None:
        """Add the root, then each joint with its link."""
        frames = {piece.root: GROUND}
        self._add_link(piece.root, GROUND)
        for link in piece.links:
            frames[link.part] = self._joints[link.joint].pivot
            ball = self._add_joint(link, subtract(frames[link.part], frames[link.parent]))
            self._add_link(link.part, frames[link.part], 1.0 - 2 * CARRIER if ball else 1.0)

    def _add_link(self, index: int, frame: Vec3, share: float = 1.0) -> None:
        """Add the shapes of a part, and this share of its mass and inertia."""
        name, part = self._names[index], self._parts[index]
        arm = subtract(part.centre, frame)
        link = self._add_body(name, part, arm, share)
        for shape in part.shapes:
            for use in ("visual", "collision") if shape.solid else ("visual",):
                element = SubElement(link, use)
                add_origin(element, swap(add(arm, shape.offset)), swap_quaternion(shape.rotation))
                SubElement(SubElement(element, "geometry"), shape.kind, size_of(shape))
                if use == "visual":
                    material = SubElement(element, "material", name=f"colour_of_{name}")
                    SubElement(material, "color", rgba=numbers(part.color))

    def _add_body(self, name: str, part: Part, arm: Vec3, share: float) -> Element:
        link = SubElement(self._xml, "link", name=name)
        inertial = SubElement(link, "inertial")
        add_origin(inertial, swap(arm))
        SubElement(inertial, "mass", value=number(share * part.mass))
        inertia = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        for name, moment in zip(("ixx", "iyy", "izz"), swap(part.inertia), strict=True):
            inertia[name] = number(share * moment)
        SubElement(inertial, "inertia", inertia)
        return link

    def _add_joint(self, link: Link, at: Vec3) -> bool:
        """Add a link's joint at this place in its parent's frame; returns whether it is a ball
        joint."""
        joint, end = self._joints[link.joint], self._names[link.part]
        parent = self._names[link.parent]
        if link.rigid or joint.kind == "fixed":
            self._connect("fixed", parent, end, at)
        elif joint.kind == "spherical":
            for suffix, axis in BALL_AXES.items():
                element = self._connect("continuous", parent, end + suffix, at, axis)
                _add_drive(element, [joint.drive], None)
                if suffix:
                    self._add_body(end + suffix, self._parts[link.part], GROUND, CARRIER)
                parent, at = end + suffix, GROUND
            return True
        else:
            self._add_driven(link, at)
        return False

    def _add_driven(self, link: Link, at: Vec3) -> None:
        """Add a joint with one axis, its drive, and the cog that it follows."""
        joint = self._joints[link.joint]
        drive = merge_drives(self._joints, link.joint, link.parallel)
        kind: str = joint.kind if joint.kind == "prismatic" or drive.stops else "continuous"
        ends = self._names[link.parent], self._names[link.part]
        element = self._connect(kind, *ends, at, _axis(joint, link))
        own = [(joint.drive, 1.0)]
        own += [(self._joints[other.joint].drive, other.sign) for other in link.parallel]
        _add_drive(element, [member for member, _ in own], drive.stops)
        for member, sign in own:
            if member.torque:
                text = f"motor: {sign * member.speed:+g} rad/s, at most {member.torque:g} N m"
                element.append(Comment(f" {text} "))
        leader, ratio = self._leaders.get(link.joint, (link.joint, 1.0))
        if leader != link.joint:
            name = f"{self._child[leader]}_joint"
            SubElement(element, "mimic", joint=name, multiplier=number(ratio), offset="0")

    def _connect(
        self, kind: str, parent: str, child: str, at: Vec3, axis: Vec3 | None = None
    ) -> Element:
        joint = SubElement(self._xml, "joint", name=f"{child}_joint", type=kind)
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        add_origin(joint, swap(at))
        if axis is not None:
            SubElement(joint, "axis", xyz=numbers(axis))
        return joint


def _add_drive(
    element: Element, drives: Sequence[Drive], stops: tuple[float, float] | None
) -> None:
    """Add limits and friction of a joint with these drives.

    A joint with stops must have an effort and a velocity. Without a motor they are 0 N m and the
    speed at which simulations count as diverged.
    """
    motors = [drive for drive in drives if drive.torque]
    fastest = max((abs(drive.speed) for drive in motors), default=constants()["speed_limit"])
    effort = sum(drive.torque for drive in motors)
    limit = {"effort": number(effort), "velocity": number(fastest)}
    if stops is not None:
        limit |= {"lower": number(stops[0]), "upper": number(stops[1])}
    if motors or stops is not None:
        SubElement(element, "limit", limit)
    damping = sum(drive.damping for drive in drives)
    friction = sum(drive.friction for drive in drives if not drive.torque)
    if damping or friction:
        SubElement(element, "dynamics", damping=number(damping), friction=number(friction))


def _axis(joint: Joint, link: Link) -> Vec3:
    """A link that hangs the other way round turns about the opposite axis."""
    image = swap(joint.axis) if joint.kind == "prismatic" else swap_turn(joint.axis)
    return scale(image, -1.0) if link.reversed else image
