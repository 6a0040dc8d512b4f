"""A machine alone as URDF, the format in which robotics tools exchange robots; and the names and
losses in all files of other simulators.

Metres, kilograms and radians, in the right-handed frame with z up (`physics.frames`): the machine's
front is y+. The frame of the root's link is on the ground below the middle of the machine, those of
the others are at their joints; at rest all are aligned. Joints have the axes and positions that
they have in physics engines.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import asin, atan2, copysign, pi
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Assembly, Drive, Part, Shape
from agentflow.env.physics.solids import joint_axis
from agentflow.env.physics.structure.drives import merge_drives, meshing_cogs
from agentflow.env.physics.structure.spanning_tree import Link, Piece, Skeleton, skeleton
from agentflow.errors import UsageError
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import IDENTITY, Quat, Vec3, add, subtract
from agentflow.machine.tree import Machine


def urdf_losses(assembly: Assembly, plan: Skeleton) -> tuple[str, ...]:
    """What the file does not hold, or holds in another way, one sentence each."""
    parts, joints, devices = assembly.parts, assembly.joints, assembly.devices
    moving = [joints[link.joint] for link in plan.links if not link.rigid]
    lost = {
        "the pull of springs": [parts[spring.a].block for spring in devices.springs],
        "the pull of winches": [parts[winch.a].block for winch in devices.winches],
        "thrust": [parts[thruster.part].block for thruster in devices.thrusters],
        **motion_losses(assembly),
        "the grip of grabbers": [parts[gripper.part].block for gripper in devices.grippers],
        "the springs of suspensions": [joint.block for joint in moving if joint.drive.stiffness],
        "joints that close loops, which are open": [joints[i.joint].block for i in plan.loops],
    }
    notes = [
        "URDF does not hold air drag, friction between surfaces, or the strength of connections"
    ]
    notes += [f"URDF does not hold {what}: {name_blocks(ids)}" for what, ids in lost.items() if ids]
    if any(joint.drive.torque for joint in moving):
        notes.append("motors are limits of effort and velocity; comments say which way they turn")
    if balls := [joint.block for joint in moving if joint.kind == "spherical"]:
        notes.append(f"ball joints are hinges about x, y and z in series: {name_blocks(balls)}")
    return tuple(notes)


def motion_losses(assembly: Assembly) -> dict[str, list[int]]:
    """What is lost with devices that push their part as it moves -> their blocks."""
    lost: dict[str, list[int]] = {}
    for device in assembly.devices.moved:
        lost.setdefault(device.loss, []).append(assembly.parts[device.part].block)
    return lost


def name_blocks(ids: Iterable[int]) -> str:
    """Such as "blocks 2, 5"."""
    listed = sorted(set(ids))
    return f"block{'s' if len(listed) > 1 else ''} {', '.join(map(str, listed))}"


def link_names(machine: Machine, assembly: Assembly) -> list[str]:
    """The name of each part: id and type of its block, such as block_3_powered_wheel.

    The further parts of a block end with a number: block_5_spring_1.
    """
    names: dict[int, str] = {}
    for step, parts in zip(machine, assembly.blocks, strict=True):
        name = f"block {step.id} {library()[step.type].name}".lower().replace(" ", "_")
        names |= {part: f"{name}_{n}" if n else name for n, part in enumerate(parts)}
    return [names[part] for part in range(len(assembly.parts))]


def joint_names(links: list[str], plan: Skeleton) -> dict[int, str]:
    """The name of each joint, after the link that it carries; those that close loops come last."""
    names = {link.joint: joint_name(links[link.part]) for link in plan.links}
    return names | {loop.joint: f"{links[loop.part]}_loop_{loop.joint}" for loop in plan.loops}


def joint_name(link: str) -> str:
    """The name of the joint that carries a link."""
    return f"{link}_joint"


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
        self._names = link_names(machine, assembly)
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
                _add_origin(element, swap(add(arm, shape.offset)), swap_quaternion(shape.rotation))
                SubElement(SubElement(element, "geometry"), shape.kind, _size_of(shape))
                if use == "visual":
                    material = SubElement(element, "material", name=f"colour_of_{name}")
                    SubElement(material, "color", rgba=_numbers(part.color))

    def _add_body(self, name: str, part: Part, arm: Vec3, share: float) -> Element:
        link = SubElement(self._xml, "link", name=name)
        inertial = SubElement(link, "inertial")
        _add_origin(inertial, swap(arm))
        SubElement(inertial, "mass", value=_number(share * part.mass))
        inertia = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        for name, moment in zip(("ixx", "iyy", "izz"), swap(part.inertia), strict=True):
            inertia[name] = _number(share * moment)
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
        drive = merge_drives(self._joints, link)
        kind: str = joint.kind if joint.kind == "prismatic" or drive.stops else "continuous"
        ends = self._names[link.parent], self._names[link.part]
        element = self._connect(kind, *ends, at, joint_axis(joint, link))
        own = [(self._joints[i].drive, sign) for i, sign in link.joints]
        _add_drive(element, [member for member, _ in own], drive.stops)
        for member, sign in own:
            if member.torque:
                text = f"motor: {sign * member.speed:+g} rad/s, at most {member.torque:g} N m"
                element.append(Comment(f" {text} "))
        leader, ratio = self._leaders.get(link.joint, (link.joint, 1.0))
        if leader != link.joint:
            name = joint_name(self._child[leader])
            SubElement(element, "mimic", joint=name, multiplier=_number(ratio), offset="0")

    def _connect(
        self, kind: str, parent: str, child: str, at: Vec3, axis: Vec3 | None = None
    ) -> Element:
        joint = SubElement(self._xml, "joint", name=joint_name(child), type=kind)
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        _add_origin(joint, swap(at))
        if axis is not None:
            SubElement(joint, "axis", xyz=_numbers(axis))
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
    limit = {"effort": _number(effort), "velocity": _number(fastest)}
    if stops is not None:
        limit |= {"lower": _number(stops[0]), "upper": _number(stops[1])}
    if motors or stops is not None:
        SubElement(element, "limit", limit)
    damping = sum(drive.damping for drive in drives)
    friction = sum(drive.friction for drive in drives if not drive.torque)
    if damping or friction:
        SubElement(element, "dynamics", damping=_number(damping), friction=_number(friction))


def train_leaders(assembly: Assembly, plan: Skeleton) -> Mapping[int, tuple[int, float]]:
    """Joint of each cog that meshes -> the joint that leads its train, one with a motor if there
    is any, and its position over that joint's."""
    turning = [link for link in plan.links if not link.rigid]
    near: dict[int, list[tuple[int, float]]] = {}
    for mesh, (one, sign), (other, sign_other) in meshing_cogs(assembly, plan, turning):
        ratio = -mesh.ratio * sign * sign_other
        near.setdefault(other, []).append((one, ratio))
        near.setdefault(one, []).append((other, 1.0 / ratio))
    found: dict[int, tuple[int, float]] = {}
    for first in sorted(near, key=lambda i: not assembly.joints[i].drive.torque):
        train = [] if first in found else [first]
        found.setdefault(first, (first, 1.0))
        for i in train:
            for other, ratio in near[i]:
                if other not in found:
                    found[other] = first, ratio * found[i][1]
                    train.append(other)
    return found


def _add_origin(element: Element, place: Vec3, rotation: Quat = IDENTITY) -> None:
    """Add a place and an orientation in the file's frame."""
    SubElement(element, "origin", xyz=_numbers(place), rpy=_numbers(roll_pitch_yaw(rotation)))


def roll_pitch_yaw(rotation: Quat) -> Vec3:
    """Angles of turns about x, then y, then z, all fixed axes, rad."""
    x, y, z, w = rotation
    sine = 2.0 * (w * y - z * x)
    if abs(sine) > 1.0 - 1e-12:  # roll and yaw turn about the same axis
        return 0.0, copysign(pi / 2, sine), -copysign(2.0, sine) * atan2(x, w)
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(sine),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def _size_of(shape: Shape) -> dict[str, str]:
    """Attributes of a shape; cylinders lie along z, the game's y."""
    radius = _number(shape.size[0] / 2)
    if shape.kind == "sphere":
        return {"radius": radius}
    if shape.kind == "cylinder":
        return {"radius": radius, "length": _number(shape.size[1])}
    return {"size": _numbers(swap(shape.size))}


def _numbers(values: Iterable[float]) -> str:
    """Such as "0 0.5 1"."""
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    """To 12 digits, which is more than the library and the constants have."""
    return f"{value + 0.0:.12g}"  # + 0.0 turns -0 to 0
