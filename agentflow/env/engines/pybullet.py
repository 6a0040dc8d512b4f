"""Owns the PyBullet engine: one client, one world at a time, behind the interface of base.py.

Making bodies is bodies.py's, forces are forces.py's, cameras picture.py's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.engines.base import Assembly, Camera, Image, Part, State
from agentflow.env.engines.bodies import Built, Workshop
from agentflow.env.engines.bullet import pybullet
from agentflow.env.engines.forces import Members, Resistance, Springs
from agentflow.env.engines.frames import (
    swap,
    swap_all,
    swap_quaternion,
    swap_quaternions,
    swap_turns,
)
from agentflow.env.engines.kinematics import (
    POSITION,
    ROTATION,
    SPIN,
    VELOCITY,
    WIDTH,
    carried,
    compose,
    conjugate,
    cross,
    matrices,
    turn,
    turn_back,
)
from agentflow.env.engines.picture import take_picture
from agentflow.env.engines.tree import Skeleton, skeleton
from agentflow.env.engines.vectors import add, product, subtract, turned
from agentflow.env.scene import Quat, Scene, Vec3
from agentflow.env.tasks.base import Body
from agentflow.env.trace import Array

TOUCH = 0.005
"""Bodies no further apart than this touch, m."""
STANDING_GROUP = 2
LOOSE_GROUP = 1
"""Clusters of one part need no group of their own."""
FIRST_BIT, LAST_BIT = 2, 30
"""Group bits for rigid clusters of several parts; the 30th and later clusters share the last."""


class PyBulletEngine:
    """The default engine. Its frame is right-handed with z up."""

    def __init__(self, physics: Constants | None = None) -> None:
        self._constants = physics or constants()
        self.client = pybullet.connect(pybullet.DIRECT)
        self._assembly: Assembly

    def close(self) -> None:
        """Give the client back."""
        pybullet.disconnect(self.client)

    # --- building ---------------------------------------------------------------------------

    def build(self, assembly: Assembly, scene: Scene, rate: float, visible: bool = False) -> None:
        """Make a fresh world; see `Engine.build`."""
        pybullet.resetSimulation(physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / rate,
            numSolverIterations=int(self._constants["solver_iterations"]),
            deterministicOverlappingPairs=1,
            jointFeedbackMode=pybullet.JOINT_FEEDBACK_IN_JOINT_FRAME,
            physicsClientId=self.client,
        )
        pybullet.setGravity(0.0, 0.0, -self._constants["gravity"], physicsClientId=self.client)
        self._assembly, self._scene = assembly, scene
        self._broken: set[int] = set()
        self._on = {"motors": False, "steering_hinges": False, "springs": False}
        self._workshop = Workshop(self.client, visible)
        self._ground = self._workshop.ground()
        self._things = {thing.name: self._workshop.thing(thing) for thing in scene.things}
        for uid in (self._ground, *self._things.values()):
            pybullet.setCollisionFilterGroupMask(
                uid, -1, STANDING_GROUP, -1, physicsClientId=self.client
            )
        self._moving = tuple(thing for thing in scene.things if thing.mass > 0)
        self.reactions = np.zeros((len(assembly.joints), 6))
        self._built: tuple[Built, ...] = ()
        self._raise(skeleton(len(assembly.parts), assembly.joints))
        self._read()

    def _raise(self, plan: Skeleton) -> None:
        """Make the bodies of `plan` that do not stand yet, then index everything anew."""
        standing = {built.body: built for built in self._built}
        parts, joints = self._assembly.parts, self._assembly.joints
        self._built = tuple(
            standing.get(body) or self._workshop.machine(body, parts, joints)
            for body in plan.bodies
        )
        self._plan = plan
        self.below = plan.below(len(joints))
        self._index_rows()
        self._group()
        self._bind_loops()
        for entry in ("motors", "steering_hinges"):
            self._drive(entry)

    def _index_rows(self) -> None:
        """Give every rigid cluster and every moving thing a row, and every part its place in it."""
        parts, plan = self._assembly.parts, self._plan
        self._leaders: list[tuple[Built, list[int]]] = []
        self._handles: list[tuple[int, int]] = []
        row_of: dict[int, int] = {}
        leader: dict[int, int] = {}
        for built in self._built:
            links = []
            for part, index in built.index.items():
                cluster = plan.cluster[part]
                if cluster not in row_of:
                    row_of[cluster] = len(self._handles)
                    leader[cluster] = part
                    self._handles.append((built.uid, index))
                    if index >= 0:
                        links.append(index)
            self._leaders.append((built, links))
        rows = [row_of[cluster] for cluster in plan.cluster]
        offsets = [
            swap(subtract(part.centre, parts[leader[cluster]].centre))
            for part, cluster in zip(parts, plan.cluster, strict=True)
        ]
        first_thing = len(self._handles)
        self._handles += [(self._things[thing.name], -1) for thing in self._moving]
        self._members = Members(np.array(rows, dtype=np.intp), np.array(offsets).reshape(-1, 3))
        self._leading = [parts[part].centre for part in leader.values()]
        self._thing_rows = slice(first_thing, len(self._handles))
        self._carriers = [
            (
                built.uid,
                [built.index[link.part] for link in built.body.links],
                [link.joint for link in built.body.links],
            )
            for built in self._built
            if built.body.links
        ]
        carried_by = [joint for _, _, joints in self._carriers for joint in joints]
        self._carrying = np.array(carried_by, dtype=np.intp)
        self._sign = np.array(
            [[-1.0 if link.reversed else 1.0] for built in self._built for link in built.body.links]
        )
        self._buffers = [
            (built.uid, built.index[link.part], self._assembly.joints[link.joint].drive)
            for built in self._built
            for link in built.body.links
            if self._assembly.joints[link.joint].drive.stiffness
        ]
        self._index_forces()
        self._index_contacts()

    def _index_forces(self) -> None:
        loads = [Part(-1, t.position, t.mass, (0, 0, 0), extents=t.size) for t in self._moving]
        parts = [*self._assembly.parts, *loads]
        thing_rows = np.arange(self._thing_rows.start, self._thing_rows.stop, dtype=np.intp)
        members = Members(
            np.concatenate([self._members.row, thing_rows]),
            np.concatenate([self._members.offset, np.zeros((len(loads), 3))]),
        )
        self._resistance = Resistance(
            parts,
            members,
            len(self._handles),
            inertia=np.array([(p.inertia[0], p.inertia[2], p.inertia[1]) for p in parts]),
            extents=np.array([swap(p.extents) for p in parts]),
            wind=np.array(swap(self._scene.wind)),
            wind_drag=self._constants["wind_drag"],
        )
        self._springs = Springs(self._assembly.pulls, self._members)

    def _index_contacts(self) -> None:
        self._who: dict[tuple[int, int], Body] = {(self._ground, -1): "ground"}
        self._who |= {(uid, -1): name for name, uid in self._things.items()}
        for built in self._built:
            for part, index in built.index.items():
                self._who[built.uid, index] = self._assembly.parts[part].block
        self._where: dict[Body, list[tuple[int, int]]] = {}
        for handle, body in self._who.items():
            self._where.setdefault(body, []).append(handle)

    def _group(self) -> None:
        """Parts of one rigid cluster never collide with each other, everything else does."""
        plan = self._plan
        sizes: dict[int, int] = {}
        for cluster in plan.cluster:
            sizes[cluster] = sizes.get(cluster, 0) + 1
        bits: dict[int, int] = {}
        for cluster, size in sizes.items():
            if size > 1:
                bits[cluster] = 1 << min(FIRST_BIT + len(bits), LAST_BIT)
        for built in self._built:
            for part, index in built.index.items():
                bit = bits.get(plan.cluster[part], LOOSE_GROUP)
                mask = -1 if bit == LOOSE_GROUP else ~bit
                pybullet.setCollisionFilterGroupMask(
                    built.uid, index, bit, mask, physicsClientId=self.client
                )

    def _bind_loops(self) -> None:
        """Moving joints that close a loop hold their two parts together at the pivot."""
        at = {part: built for built in self._built for part in built.index}
        parts = self._assembly.parts
        for i in self._plan.loops:
            joint = self._assembly.joints[i]
            pybullet.createConstraint(
                at[joint.a].uid,
                at[joint.a].index[joint.a],
                at[joint.b].uid,
                at[joint.b].index[joint.b],
                pybullet.JOINT_POINT2POINT,
                (0.0, 0.0, 0.0),
                swap(subtract(joint.pivot, parts[joint.a].centre)),
                swap(subtract(joint.pivot, parts[joint.b].centre)),
                physicsClientId=self.client,
            )

    # --- running ----------------------------------------------------------------------------

    def switch(self, entry: str, on: bool) -> None:
        """Start or hold motors, steering_hinges or springs."""
        self._on[entry] = on
        if entry != "springs":
            self._drive(entry)

    def _drive(self, entry: str) -> None:
        for built in self._built:
            for link in built.body.links:
                joint = self._assembly.joints[link.joint]
                if joint.kind in ("revolute", "prismatic") and joint.drive.starts == entry:
                    pybullet.setJointMotorControl2(
                        built.uid,
                        built.index[link.part],
                        pybullet.VELOCITY_CONTROL,
                        targetVelocity=joint.drive.speed if self._on[entry] else 0.0,
                        force=joint.drive.torque,
                        physicsClientId=self.client,
                    )

    def step(self) -> None:
        """Advance by one step, then read everything once."""
        self._push()
        pybullet.stepSimulation(physicsClientId=self.client)
        self._read()

    def _push(self) -> None:
        """Apply the forces of the present state; PyBullet forgets them after every step."""
        client = self.client
        wrenches = self._resistance(self._rows).tolist()
        for row in self._resistance.rows:
            uid, index = self._handles[row]
            wrench = wrenches[row]
            pybullet.applyExternalForce(
                uid, index, wrench[:3], (0.0, 0.0, 0.0), pybullet.LINK_FRAME, client
            )
            pybullet.applyExternalTorque(uid, index, wrench[3:], pybullet.LINK_FRAME, client)
        if self._on["springs"] and self._assembly.pulls:
            self._pull()
        for uid, index, drive in self._buffers:
            position, velocity = pybullet.getJointState(uid, index, client)[:2]
            force = -drive.stiffness * position - drive.damping * velocity
            pybullet.setJointMotorControl2(
                uid, index, pybullet.TORQUE_CONTROL, force=force, physicsClientId=client
            )

    def _pull(self) -> None:
        force, at_a, at_b = (array.tolist() for array in self._springs(self._rows))
        for i, pull in enumerate(self._assembly.pulls):
            x, y, z = force[i]
            for part, push, place in (
                (pull.a, (x, y, z), at_a[i]),
                (pull.b, (-x, -y, -z), at_b[i]),
            ):
                uid, index = self._handles[self._members.row[part]]
                pybullet.applyExternalForce(
                    uid, index, push, place, pybullet.WORLD_FRAME, self.client
                )

    def _read(self) -> None:
        """One row per cluster and moving thing; forces through every joint."""
        client = self.client
        rows: list[tuple[float, ...]] = []
        for built, links in self._leaders:
            rows.append(self._base(built.uid))
            if links:
                rows += [
                    state[0] + state[1] + state[6] + state[7]
                    for state in pybullet.getLinkStates(built.uid, links, 1, 1, client)
                ]
        rows += [self._base(self._things[thing.name]) for thing in self._moving]
        self._rows: Array = np.array(rows).reshape(-1, WIDTH)
        if self._carriers:
            sensed = [
                state[2]
                for uid, links, _ in self._carriers
                for state in pybullet.getJointStates(uid, links, client)
            ]
            self.reactions[self._carrying] = np.array(sensed) * self._sign

    def _base(self, uid: int) -> tuple[float, ...]:
        position, rotation = pybullet.getBasePositionAndOrientation(uid, self.client)
        velocity, spin = pybullet.getBaseVelocity(uid, self.client)
        return (*position, *rotation, *velocity, *spin)

    # --- breaking ---------------------------------------------------------------------------

    def split(self, broken: Sequence[int]) -> None:
        """Remove joints and rebuild what they held, in place; see `Engine.split`."""
        self._broken |= set(broken)
        assembly = self._assembly
        plan = skeleton(len(assembly.parts), assembly.joints, self._broken)
        kept = set(plan.bodies)
        motions = self._joint_motions()
        parts = self._part_rows()
        for built in self._built:
            if built.body not in kept:
                pybullet.removeBody(built.uid, physicsClientId=self.client)
        old = {built.body for built in self._built}
        self._built = tuple(built for built in self._built if built.body in kept)
        self.reactions[:] = 0.0
        self._raise(plan)
        for built in self._built:
            if built.body not in old:
                self._restore(built, parts, motions)
        self._read()

    def _joint_motions(self) -> dict[int, tuple[float, float]]:
        """Position and velocity of every joint with one degree of freedom."""
        return {
            joint: (state[0], state[1])
            for uid, links, joints in self._carriers
            for joint, state in zip(
                joints, pybullet.getJointStates(uid, links, self.client), strict=True
            )
        }

    def _restore(
        self, built: Built, parts: Array, motions: Mapping[int, tuple[float, float]]
    ) -> None:
        """Put a rebuilt body where its parts were, moving as they moved."""
        client = self.client
        root = parts[built.body.root]
        pybullet.resetBasePositionAndOrientation(
            built.uid, root[POSITION].tolist(), root[ROTATION].tolist(), physicsClientId=client
        )
        pybullet.resetBaseVelocity(
            built.uid, root[VELOCITY].tolist(), root[SPIN].tolist(), physicsClientId=client
        )
        for link in built.body.links:
            kind = self._assembly.joints[link.joint].kind
            index = built.index[link.part]
            if kind == "spherical":
                turned, spin = _relative(parts[link.parent], parts[link.part])
                pybullet.resetJointStateMultiDof(
                    built.uid, index, turned, spin, physicsClientId=client
                )
            elif kind != "fixed":
                position, velocity = motions.get(link.joint, (0.0, 0.0))
                pybullet.resetJointState(
                    built.uid, index, position, velocity, physicsClientId=client
                )

    # --- reading ----------------------------------------------------------------------------

    @property
    def moving_things(self) -> tuple[str, ...]:
        """Names of the scene's things that can move."""
        return tuple(thing.name for thing in self._moving)

    @property
    def locked(self) -> tuple[int, ...]:
        """Moving joints that rigid connections bridge."""
        return self._plan.locked

    @property
    def top_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed, m/s and rad/s."""
        square = self._rows[:, 7:13].reshape(-1, 2, 3)
        square = square * square
        linear, angular = (square[:, :, 0] + square[:, :, 1] + square[:, :, 2]).max(axis=0)
        return float(np.sqrt(linear)), float(np.sqrt(angular))

    def _part_rows(self) -> Array:
        """(P, 13) one row per part."""
        return carried(self._rows[self._members.row], self._members.offset)

    def state(self) -> State:
        """Everything that a record holds, in the game frame."""
        assembly = self._assembly
        leaders = [parts[0] for parts in assembly.blocks]
        rows = self._rows[self._members.row[leaders]]
        offset = self._members.offset[leaders]
        centre_of_mass = np.array([swap(assembly.parts[part].centre) for part in leaders])
        centre = carried(rows, offset + _swapped(assembly.centres) - centre_of_mass)
        origin = carried(rows, offset + _swapped(assembly.origins) - centre_of_mass)
        position, middle = swap_all(origin[:, POSITION]), swap_all(centre[:, POSITION])
        velocity, spin = swap_all(centre[:, VELOCITY]), swap_turns(centre[:, SPIN])
        rotation = _game_compose(swap_quaternions(rows[:, ROTATION]), assembly.rotations)
        spans = self._spans()
        for block, (a, b) in spans.items():
            position[block] = middle[block] = (a[:3] + b[:3]) * 0.5
            velocity[block] = (a[3:] + b[3:]) * 0.5
        lines = np.array([a[:3] - b[:3] for a, b in spans.values()]).reshape(-1, 3)
        square = lines * lines
        things = self._rows[self._thing_rows]
        return State(
            position=position,
            centre=middle,
            rotation=rotation,
            velocity=velocity,
            angular_velocity=spin,
            length=np.sqrt(square[:, 0] + square[:, 1] + square[:, 2]),
            thing_position=swap_all(things[:, POSITION]),
            thing_rotation=swap_quaternions(things[:, ROTATION]),
            thing_velocity=swap_all(things[:, VELOCITY]),
        )

    def _spans(self) -> dict[int, tuple[Array, Array]]:
        """Place and velocity (6,) of both ends of every two-ended block, game frame."""
        parts, assembly = self._part_rows(), self._assembly
        ends = np.concatenate([swap_all(parts[:, POSITION]), swap_all(parts[:, VELOCITY])], axis=1)
        return {block: (ends[a], ends[b]) for block, a, b in assembly.spans}

    def pose(self, body: Body) -> tuple[Vec3, Quat]:
        """Centre and orientation of a block or a thing, game frame."""
        if isinstance(body, str):
            return self._thing_pose(body)
        place, rotation = self._block_pose(body, self._assembly.centres[body])
        return place, product(swap_quaternion(rotation), self._assembly.rotations[body])

    def origin(self, block: int) -> Vec3:
        """Building point of a block, game frame."""
        return self._block_pose(block, self._assembly.origins[block])[0]

    def _block_pose(self, block: int, point: Vec3) -> tuple[Vec3, Quat]:
        """Where a point of a block at rest is now, game frame, and its part's turn since."""
        row = self._members.row[self._assembly.blocks[block][0]]
        x, y, z, a, b, c, w = self._rows[row, :7].tolist()
        arm = swap(subtract(point, self._leading[row]))
        return swap(add((x, y, z), turned((a, b, c, w), arm))), (a, b, c, w)

    def _thing_pose(self, name: str) -> tuple[Vec3, Quat]:
        position, rotation = pybullet.getBasePositionAndOrientation(self._things[name], self.client)
        return swap(position), swap_quaternion(rotation)

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step."""
        return frozenset(
            self._who[contact[2], contact[4]]
            for handle in self._where[body]
            for contact in self._contacts(*handle)
        ) - {body}

    def _contacts(self, uid: int, index: int) -> Iterator[Sequence[int]]:
        """Contacts in which bodies meet, not only come near, with this body named first."""
        for contact in pybullet.getContactPoints(
            bodyA=uid, linkIndexA=index, physicsClientId=self.client
        ):
            if contact[8] <= TOUCH:
                yield contact

    def momentum(self) -> Mapping[str, Array]:
        """Total momentum (about the world's origin) and kinetic energy of the machine."""
        rows = self._part_rows()
        mass = np.array([[part.mass] for part in self._assembly.parts])
        inertia = np.array([part.inertia for part in self._assembly.parts])[:, [0, 2, 1]]
        rotation = matrices(rows[:, ROTATION])
        linear = mass * rows[:, VELOCITY]
        own_spin = turn_back(rotation, rows[:, SPIN])
        angular = cross(rows[:, POSITION], linear) + turn(rotation, inertia * own_spin)
        energy = linear * rows[:, VELOCITY] + inertia * own_spin * own_spin
        return {
            "linear": swap_all(linear.sum(axis=0)),
            "angular": swap_turns(angular.sum(axis=0)),
            "energy": np.array([energy.sum() / 2]),
        }

    def render(self, camera: Camera) -> Image:
        """(height, width, 3) picture of the world as it is."""
        return take_picture(self.client, camera)


def _swapped(points: Sequence[Vec3]) -> Array:
    return np.array([swap(point) for point in points]).reshape(-1, 3)


def _game_compose(turned: Array, rest: Sequence[Quat]) -> Array:
    """Orientation of blocks: what the part has turned since rest, on top of the rest pose."""
    return compose(turned, np.array(rest).reshape(-1, 4))


def _relative(parent: Array, child: Array) -> tuple[list[float], list[float]]:
    """Orientation and spin of a child row against its parent's, in the joint's frame."""
    turned = compose(conjugate(parent[None, ROTATION]), child[None, ROTATION])
    spin = turn_back(matrices(child[None, ROTATION]), (child[SPIN] - parent[SPIN])[None])
    return turned[0].tolist(), spin[0].tolist()
