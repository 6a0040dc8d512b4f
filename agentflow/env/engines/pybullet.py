"""Owns the PyBullet engine: one client, one world at a time, behind the interface of base.py.

Its frame is right-handed with z up. Bodies are made in bodies.py, rows named in layout.py and read
in readings.py, forces computed in forces.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain, groupby
from math import sqrt
from operator import itemgetter

import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.engines.base import Assembly, Drive, State
from agentflow.env.engines.bodies import Workshop
from agentflow.env.engines.bullet import pybullet
from agentflow.env.engines.contacts import Contacts, group, stand
from agentflow.env.engines.couplings import Couplings
from agentflow.env.engines.flight import Blades, Thrusters
from agentflow.env.engines.forces import Drag, Members, Push, Wind, Wrench
from agentflow.env.engines.frames import swap, swap_all, swap_quaternion
from agentflow.env.engines.grip import Grips
from agentflow.env.engines.kinematics import (
    POSITION,
    ROTATION,
    SPIN,
    VELOCITY,
    WIDTH,
    Row,
)
from agentflow.env.engines.layout import Built, lay_out
from agentflow.env.engines.readings import Readings
from agentflow.env.engines.restoring import motion, relative
from agentflow.env.engines.ropes import Ropes
from agentflow.env.engines.springs import Springs
from agentflow.env.engines.struts import Struts
from agentflow.env.engines.tree import Skeleton, skeleton
from agentflow.env.engines.vectors import add, turned
from agentflow.env.scene import Quat, Scene, Start, Vec3
from agentflow.env.tasks.base import Body
from agentflow.env.trace import Array

CENTRE = (0.0, 0.0, 0.0)
_FORCES = itemgetter(2)
"""Force and torque in what PyBullet tells of a joint."""


class PyBulletEngine:
    """The default engine; see `base.Engine` for what each method promises."""

    def __init__(self, physics: Constants | None = None) -> None:
        self._constants = physics or constants()
        self.client = pybullet.connect(pybullet.DIRECT)

    def close(self) -> None:
        """Give the client back."""
        pybullet.disconnect(self.client)

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> None:
        """Make a fresh world."""
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
        self._on = dict.fromkeys(("motors", "steering_hinges", "springs", "winches", "gusts"), 0.0)
        self._interval, self._blown = 1.0 / rate, 0
        self._workshop = Workshop(self.client, self._constants)
        self._ground = self._workshop.ground(scene.friction)
        self._things = {thing.name: self._workshop.thing(thing) for thing in scene.things}
        self._moving = tuple(thing for thing in scene.things if thing.mass > 0)
        moving = {thing.name: self._things[thing.name] for thing in self._moving}
        still = [uid for name, uid in self._things.items() if name not in moving]
        stand(self.client, (self._ground, *still), tuple(moving.values()))
        self.reactions = np.zeros((len(assembly.joints), 6))
        self._built: tuple[Built, ...] = ()
        self._kept: list[tuple[Readings, list[Row]]] = []
        self._couplings = Couplings(self.client)
        self._ropes = Ropes(assembly.actors.ropes, self._on, 1.0 / rate)
        self._grips = Grips(self.client, assembly.actors.grips, moving)
        self._raise(skeleton(len(assembly.parts), assembly.joints))
        self._put(scene.start)
        self._read()

    def switch(self, entry: str, level: float) -> None:
        """Set motors, steering_hinges, springs, winches, grabbers or gusts."""
        self._on[entry] = float(level)
        if entry == "grabbers":
            self._grips.switch(level > 0)
        elif entry not in ("springs", "winches", "gusts"):
            self._drive(entry)

    def step(self) -> None:
        """Advance by one step, then read everything once."""
        self._push(self._drag(self._rows))
        for uid in self._stale:
            pybullet.getLinkState(uid, 0, 0, 1, self.client)
        for act in self._acting:
            self._shove(act(self._rows))
        if self._wind is not None:
            self._shove(self._wind(self._table, self._strength()))
        for uid, index, drive in self._buffers:
            self._cushion(uid, index, drive)
        pybullet.stepSimulation(self.client)
        self._read()
        if self._grips:
            self._grips.watch()

    def split(self, broken: Sequence[int]) -> None:
        """Remove joints and rebuild what they held, in place."""
        self._broken |= set(broken)
        plan = skeleton(len(self._assembly.parts), self._assembly.joints, self._broken)
        kept = set(plan.bodies)
        motions, parts = self._motions(), self._readings.parts(self._table)
        for built in self._built:
            if built.body not in kept:
                pybullet.removeBody(built.uid, physicsClientId=self.client)
        self._built = tuple(built for built in self._built if built.body in kept)
        standing = {built.uid for built in self._built}
        self.reactions[:] = 0.0
        self._raise(plan)
        for built in self._built:
            if built.uid not in standing:
                self._restore(built, parts, motions)
        self._read()

    # --- what can be seen -------------------------------------------------------------------

    @property
    def moving_things(self) -> tuple[str, ...]:
        """Names of the scene's things that can move."""
        return self._layout.things

    @property
    def locked(self) -> tuple[int, ...]:
        """Moving joints that rigid connections bridge."""
        return self._plan.locked

    @property
    def top_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed, m/s and rad/s."""
        linear = angular = 0.0
        for _, _, _, _, _, _, _, vx, vy, vz, wx, wy, wz in self._rows:
            speed, spin = vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
            # written so that not-a-number wins
            linear = linear if speed <= linear else speed
            angular = angular if spin <= angular else spin
        return sqrt(linear), sqrt(angular)

    @property
    def _table(self) -> Array:
        """The rows as an array."""
        return np.array(self._rows).reshape(-1, WIDTH)

    def state(self) -> State:
        """Everything that a record holds."""
        return self._readings.state(self._table)

    def keep(self) -> None:
        """Keep the present state for `kept`."""
        self._kept.append((self._readings, self._rows))

    def kept(self) -> State:
        """All states kept since `build`; those between two splits are worked out at once."""
        stretches = []
        for readings, stretch in groupby(self._kept, key=itemgetter(0)):
            tables = np.array([rows for _, rows in stretch])
            stretches.append(vars(readings.states(tables)))
        return State(
            **{name: np.concatenate([each[name] for each in stretches]) for name in stretches[0]}
        )

    def pose(self, body: Body) -> tuple[Vec3, Quat]:
        """Centre and orientation of a block or a thing."""
        if isinstance(body, int):
            return self._readings.pose(self._rows, body)
        uid = self._things[body]
        position, rotation = pybullet.getBasePositionAndOrientation(uid, self.client)
        return swap(position), swap_quaternion(rotation)

    def origin(self, block: int) -> Vec3:
        """Building point of a block."""
        return self._readings.origin(self._rows, block)

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step."""
        return self._contacts.touching(body)

    def momentum(self) -> Mapping[str, Array]:
        """Total momentum and kinetic energy of the machine."""
        return self._readings.momentum(self._table)

    # --- building ---------------------------------------------------------------------------

    def _raise(self, plan: Skeleton) -> None:
        """Make the bodies of `plan` that do not stand yet, then index everything anew."""
        standing = {built.body: built for built in self._built}
        parts, joints = self._assembly.parts, self._assembly.joints
        self._built = tuple(
            standing.get(body) or self._workshop.machine(body, parts, joints)
            for body in plan.bodies
        )
        self._plan = plan
        self._layout = lay_out(self._assembly, plan, self._built, self._moving, self._things)
        self._readings = Readings(self._assembly, self._layout)
        self._contacts = Contacts(
            self.client, self._assembly, self._built, self._ground, self._things
        )
        self._index_joints()
        self._index_forces()
        group(self.client, plan, self._built)
        self._couplings.renew(self._assembly, plan, self._built)
        if self._grips:
            self._grips.bind(self._built)
        for entry in ("motors", "steering_hinges"):
            self._drive(entry)

    def _put(self, start: Start) -> None:
        """Turn and raise what has just been raised on the ground."""
        if start == Start():
            return
        rotation = start.rotation
        for uid in (built.uid for built in self._built):
            position, _ = pybullet.getBasePositionAndOrientation(uid, self.client)
            place = add(turned(rotation, swap(position)), (0.0, start.height, 0.0))
            pybullet.resetBasePositionAndOrientation(
                uid, swap(place), swap_quaternion(rotation), self.client
            )

    def _strength(self) -> float:
        """Share of the mean wind that blows in this step."""
        if not self._on["gusts"]:
            return 1.0
        self._blown += 1
        return self._scene.strength((self._blown - 1) * self._interval)

    def _index_joints(self) -> None:
        """Which links sense which joints, and which of them are spring-dampers."""
        joints = self._assembly.joints
        links = [
            (built, link)
            for built in self._built
            for link in sorted(built.body.links, key=lambda link: link.joint)
        ]
        self._sensors = [
            (built.uid, [built.index[link.part] for owner, link in links if owner is built])
            for built in self._built
            if built.body.links
        ]
        self._carrying = [link.joint for _, link in links]
        in_order = self._carrying == list(range(len(joints)))
        self._sensed = slice(None) if in_order else np.array(self._carrying, dtype=np.intp)
        self._sign = np.array([[-1.0 if link.reversed else 1.0] for _, link in links])
        self._turned = any(link.reversed for _, link in links)
        self._buffers = [
            (built.uid, built.index[link.part], joints[link.joint].drive)
            for built, link in links
            if joints[link.joint].drive.stiffness
        ]

    def _index_forces(self) -> None:
        parts, members, layout = self._assembly.parts, self._layout.members, self._layout
        inertia = swap_all(np.array([part.inertia for part in parts]).reshape(-1, 3))
        self._drag = Drag(parts, members, inertia)
        self._index_actors()
        self._wind: Wind | None = None
        if any(self._scene.wind):
            boxes = [part.extents for part in parts] + [thing.size for thing in self._moving]
            thing_rows = np.arange(len(layout.leading), len(layout.handles), dtype=np.intp)
            offsets = np.zeros((len(thing_rows), 3))
            self._wind = Wind(
                Members(
                    np.concatenate([members.row, thing_rows]),
                    np.concatenate([members.offset, offsets]),
                ),
                swap_all(np.array(boxes)),
                np.array(swap(self._scene.wind)),
                self._constants["wind_drag"],
            )

    def _index_actors(self) -> None:
        """Springs, thrusters, blades, winches and struts, where there are any."""
        actors, members = self._assembly.actors, self._layout.members
        acting: list[Callable[[Sequence[Row]], list[Push]]] = []
        if self._assembly.pulls:
            acting.append(Springs(self._assembly.pulls, members, self._on))
        if actors.thrusts:
            acting.append(Thrusters(actors.thrusts, self._on))
        if actors.lifts:
            acting.append(Blades(actors.lifts, members))
        if self._ropes:
            self._ropes.place(members)
            acting.append(self._ropes)
        struts = Struts(self._assembly, self._plan.loops, members)
        if struts:
            acting.append(struts)
        self._acting = acting
        self._at = {
            part: (built.uid, index) for built in self._built for part, index in built.index.items()
        }
        for i, name in enumerate(self._layout.things, len(self._assembly.parts)):
            self._at[i] = (self._things[name], -1)
        acts = bool(acting) or any(self._scene.wind)
        whole = {uid for uid, links in self._layout.bodies if not links}
        self._stale = [uid for uid, _ in self._sensors if acts and uid in whole]
        """Bodies whose links nobody reads; PyBullet then pushes them where they were a step ago."""

    # --- forces -----------------------------------------------------------------------------

    def _drive(self, entry: str) -> None:
        """Set the motors of a schedule entry; joints without one turn freely."""
        for built in self._built:
            for link in built.body.links:
                joint = self._assembly.joints[link.joint]
                if joint.kind in ("revolute", "prismatic") and joint.drive.starts == entry:
                    pybullet.setJointMotorControl2(
                        built.uid,
                        built.index[link.part],
                        pybullet.VELOCITY_CONTROL,
                        targetVelocity=joint.drive.speed * self._on[entry],
                        force=joint.drive.torque or joint.drive.friction,
                        physicsClientId=self.client,
                    )

    def _push(self, wrenches: Sequence[Wrench]) -> None:
        """Apply forces for one step; PyBullet forgets them after it."""
        client, handles = self.client, self._layout.handles
        for row, local, force, torque in wrenches:
            uid, index = handles[row]
            frame = pybullet.LINK_FRAME if local else pybullet.WORLD_FRAME
            at = CENTRE if local else self._rows[row][POSITION]
            pybullet.applyExternalForce(uid, index, force, at, frame, client)
            if torque is not None:
                pybullet.applyExternalTorque(uid, index, torque, frame, client)

    def _shove(self, pushes: Sequence[Push]) -> None:
        """Apply forces at the centres of parts for one step."""
        client = self.client
        for part, force, at in pushes:
            uid, index = self._at[part]
            if at is None:
                pybullet.applyExternalForce(uid, index, force, CENTRE, pybullet.LINK_FRAME, client)
            else:
                pybullet.applyExternalForce(uid, index, force, at, pybullet.WORLD_FRAME, client)

    def _cushion(self, uid: int, index: int, drive: Drive) -> None:
        """Apply one suspension; its damper is a brake, which light blocks cannot set swinging."""
        client = self.client
        position, velocity = pybullet.getJointState(uid, index, client)[:2]
        pybullet.setJointMotorControl2(
            uid,
            index,
            pybullet.VELOCITY_CONTROL,
            targetVelocity=0.0,
            force=drive.damping * abs(velocity),
            physicsClientId=client,
        )
        pybullet.setJointMotorControl2(
            uid,
            index,
            pybullet.TORQUE_CONTROL,
            force=-drive.stiffness * position,
            physicsClientId=client,
        )

    # --- reading ----------------------------------------------------------------------------

    def _read(self) -> None:
        """One row per cluster and moving thing; forces through every joint."""
        client = self.client
        rows: list[Row] = []
        sensed: list[Row] = []
        for uid, links in self._layout.bodies:
            rows.append(self._base(uid))
            if links:
                rows += [
                    state[0] + state[1] + state[6] + state[7]
                    for state in pybullet.getLinkStates(uid, links, 1, 1, client)
                ]
        rows += [self._base(self._things[name]) for name in self._layout.things]
        self._rows = rows
        for uid, sensors in self._sensors:
            sensed += map(_FORCES, pybullet.getJointStates(uid, sensors, client))
        flat = np.fromiter(chain.from_iterable(sensed), float, 6 * len(sensed)).reshape(-1, 6)
        if self._turned:
            flat *= self._sign
        self.reactions[self._sensed] = flat
        for joint, load in self._couplings.loads(self._rotation):
            self.reactions[joint] = load

    def _rotation(self, part: int) -> Quat:
        """Of a part, in the engine's frame."""
        _, _, _, x, y, z, w, *_ = self._rows[self._layout.members.row[part]]
        return (x, y, z, w)

    def _base(self, uid: int) -> Row:
        position, rotation = pybullet.getBasePositionAndOrientation(uid, self.client)
        velocity, spin = pybullet.getBaseVelocity(uid, self.client)
        row: Row = position + rotation + velocity + spin
        return row

    # --- restoring --------------------------------------------------------------------------

    def _motions(self) -> dict[int, tuple[float, float]]:
        """Position and velocity of every joint with one degree of freedom."""
        states = [
            state[:2]
            for uid, links in self._sensors
            for state in pybullet.getJointStates(uid, links, self.client)
        ]
        return dict(zip(self._carrying, states, strict=True))

    def _restore(
        self, built: Built, parts: Array, motions: Mapping[int, tuple[float, float]]
    ) -> None:
        """Put a rebuilt body where its parts were, moving as they moved."""
        client, uid, root = self.client, built.uid, parts[built.body.root]
        pybullet.resetBasePositionAndOrientation(
            uid, root[POSITION].tolist(), root[ROTATION].tolist(), client
        )
        pybullet.resetBaseVelocity(uid, root[VELOCITY].tolist(), root[SPIN].tolist(), client)
        for link in built.body.links:
            joint = self._assembly.joints[link.joint]
            index = built.index[link.part]
            if joint.kind == "spherical":
                turned, spin = relative(parts[link.parent], parts[link.part])
                pybullet.resetJointStateMultiDof(uid, index, turned, spin, physicsClientId=client)
            elif joint.kind != "fixed":
                position, velocity = motions.get(link.joint) or motion(
                    joint, self._assembly.parts, parts
                )
                pybullet.resetJointState(uid, index, position, velocity, physicsClientId=client)
