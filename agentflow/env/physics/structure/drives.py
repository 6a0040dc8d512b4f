"""What drives a joint of an engine: its own drive together with those of joints parallel to it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Assembly, CogMesh, Joint
from agentflow.env.physics.structure.spanning_tree import Link, Skeleton

HOLD = 6.0
"""1/s: how fast motors that hold an angle come back to it. Those that only aimed at speed 0 would
creep under load: PyBullet's solver leaves a little speed in every step, and MuJoCo's constraints
give way a little."""
STILL = 0.05
"""rad/s: motors that turn faster, as they brake or are overcome, hold no angle yet."""


class Motor(NamedTuple):
    """A motor of limited torque (N m), or dry friction, which is one that always aims at speed 0.

    Its entry `starts` gives the level, at 1 of which it aims at `speed` of the joint, rad/s.
    """

    speed: float
    torque: float
    starts: Entry


class MotorCommand(NamedTuple):
    """What an engine's velocity motor does in one step: it aims at the speed `target` (rad/s) with
    at most `limit`, and pushes constantly with `push` besides (N m)."""

    target: float
    limit: float
    push: float = 0.0


Carrier = tuple[int, float]
"""A joint of a tree that moves another joint, and the sign of that one's position over its own."""


@dataclass(frozen=True)
class JointDrive:
    """Motors, spring-damper and stops that act on one joint, as in `model.Drive`."""

    motors: tuple[Motor, ...]
    stiffness: float
    damping: float
    stops: tuple[float, float] | None

    @property
    def turns(self) -> bool:
        """Whether a motor turns it once it is switched on."""
        return any(motor.speed for motor in self.motors)

    @property
    def mixed(self) -> bool:
        """Whether its motors may aim at different speeds at once."""
        return len({motor[::2] for motor in self.motors}) > 1

    def command(self, levels: Mapping[Entry, float], speed: float = 0.0) -> MotorCommand:
        """The motors as one, at a speed of the joint.

        Together they exert a torque that falls by twice the torque of a motor where the joint
        passes that motor's target. The result aims at the weighted median of the targets, at which
        no other motors overcome those that aim there. Motors that the joint passes on the way to it
        help to get there, the others push constantly.
        """
        if len(self.motors) == 1:
            ((own, torque, starts),) = self.motors
            return MotorCommand(own * levels.get(starts, 0.0), torque)
        limits: dict[float, float] = {}
        for motor in self.motors:
            target = motor.speed * levels.get(motor.starts, 0.0)
            limits[target] = limits.get(target, 0.0) + motor.torque
        if len(limits) == 1:
            return MotorCommand(*limits.popitem())

        def push(target: float, others: Mapping[float, float]) -> float:
            return sum(torque if aim > target else -torque for aim, torque in others.items())

        rest = {aim: {k: v for k, v in limits.items() if k != aim} for aim in limits}
        medians = [aim for aim in limits if abs(push(aim, rest[aim])) <= limits[aim] * (1.0 + 1e-9)]
        target = min(medians, key=lambda aim: abs(aim - speed))
        low, high = sorted((speed, target))
        passed = {aim for aim in rest[target] if low < aim < high}
        beside = {aim: torque for aim, torque in rest[target].items() if aim not in passed}
        limit = limits[target] + sum(limits[aim] for aim in passed)
        return MotorCommand(target, limit, push(target, beside))


def merge_drives(joints: Sequence[Joint], link: Link) -> JointDrive:
    """The drive of a link's joint and of those parallel to it."""
    members = [(joints[i].drive, sign) for i, sign in link.joints]
    motors = [
        Motor(sign * drive.speed, drive.torque, drive.starts)
        if drive.torque
        else Motor(0.0, drive.friction, drive.starts)
        for drive, sign in members
    ]
    acting = tuple(motor for motor in motors if motor.torque) or (motors[0],)
    stops = [
        drive.stops if sign > 0.0 else (-drive.stops[1], -drive.stops[0])
        for drive, sign in members
        if drive.stops is not None
    ]
    return JointDrive(
        acting,
        sum(drive.stiffness for drive, _ in members),
        sum(drive.damping for drive, _ in members),
        (max(low for low, _ in stops), min(high for _, high in stops)) if stops else None,
    )


def has_motor(joints: Sequence[Joint], link: Link) -> bool:
    """Whether a motor drives a link's joint or one parallel to it."""
    return any(joints[i].drive.torque for i, _ in link.joints)


def idle(levels: Mapping[Entry, float]) -> bool:
    """Whether no device is on: only the wind may be."""
    return not any(level for entry, level in levels.items() if entry != "wind")


def joint_motions(
    states: Iterable[tuple[Link, tuple[float, float]]],
) -> dict[int, tuple[float, float]]:
    """Position and velocity of joints and of those parallel to them.

    Args:
        states: Links, and position and velocity of the joint of each.
    """
    return {
        joint: (sign * position, sign * velocity)
        for link, (position, velocity) in states
        for joint, sign in link.joints
    }


def meshing_cogs(
    assembly: Assembly, plan: Skeleton, links: Iterable[Link]
) -> Iterator[tuple[CogMesh, Carrier, Carrier]]:
    """Cogs that mesh, with the joint that moves each; both sit on one cluster.

    Args:
        assembly: The machine.
        plan: Its spanning trees.
        links: Those whose joints move cogs.
    """
    carried = {joint: (link.joint, sign) for link in links for joint, sign in link.joints}
    for mesh in assembly.devices.cog_meshes:
        seats = {plan.cluster[assembly.joints[i].a] for i in (mesh.a, mesh.b)}
        if mesh.a in carried and mesh.b in carried and len(seats) == 1:
            yield mesh, carried[mesh.a], carried[mesh.b]
