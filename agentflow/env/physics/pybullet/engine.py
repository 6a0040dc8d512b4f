"""Owns the PyBullet engine: one client, one world at a time, behind the interface of base.py.

Its frame is right-handed with z up. Bodies are made in bodies.py and put in place in restoring.py;
rows are named in layout.py, read in rows.py and understood in readings.py; joints are driven in
motors.py and felt in sensing.py; pushes.py applies the forces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from operator import itemgetter

import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import EngineIdentity
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.kinematics import Row
from agentflow.env.physics.laws.ropes import Ropes
from agentflow.env.physics.model import Assembly, State
from agentflow.env.physics.pybullet import PYBULLET
from agentflow.env.physics.pybullet.bodies import Workshop
from agentflow.env.physics.pybullet.contacts import Contacts, group, stand
from agentflow.env.physics.pybullet.couplings import Couplings
from agentflow.env.physics.pybullet.grip import Grips
from agentflow.env.physics.pybullet.layout import Built, lay_out
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.motors import Motors
from agentflow.env.physics.pybullet.pushes import Pushes, actors_of, wind_of
from agentflow.env.physics.pybullet.readings import Readings
from agentflow.env.physics.pybullet.restoring import put, restore
from agentflow.env.physics.pybullet.rows import Rows, top_speeds
from agentflow.env.physics.pybullet.sensing import Sensors
from agentflow.env.physics.spanning_tree import Skeleton, skeleton
from agentflow.env.physics.vectors import subtract, turned
from agentflow.env.rollout import Array
from agentflow.env.scene import Quat, Scene, Vec3
from agentflow.env.tasks.base import Body


class PyBulletEngine:
    """The default engine; see `base.Engine` for what each method promises."""

    def __init__(self, physics: Constants | None = None) -> None:
        self._constants = physics or constants()
        self.client = pybullet.connect(pybullet.DIRECT)
        # It makes pictures of every body that nobody looks at, half of the time that a build takes;
        # loading what is there already only tells its number.
        renderer = pybullet.loadPlugin("tinyRendererPlugin", physicsClientId=self.client)
        pybullet.unloadPlugin(renderer, physicsClientId=self.client)

    @property
    def identity(self) -> EngineIdentity:
        """What rollouts of this engine record."""
        return PYBULLET.identity

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
        self._rate, self._interval, self._blown = rate, 1.0 / rate, 0.0
        self._finer = max(1, round(self._constants["start_rate"] / rate))
        self._careful = 0
        """Steps that are yet to be taken in finer ones."""
        self._broken: set[int] = set()
        self._on = dict.fromkeys(("motors", "steering_hinges", "springs", "winches", "gusts"), 0.0)
        self._workshop = Workshop(self.client, self._constants)
        self._ground = self._workshop.ground(scene.friction)
        self._things = {thing.name: self._workshop.thing(thing) for thing in scene.things}
        self._balance = {thing.name: thing.balance for thing in scene.things}
        self._moving = tuple(thing for thing in scene.things if thing.mass > 0)
        moving = {thing.name: self._things[thing.name] for thing in self._moving}
        still = [uid for name, uid in self._things.items() if name not in moving]
        stand(self.client, (self._ground, *still), tuple(moving.values()))
        self.reactions = np.zeros((len(assembly.joints), 6))
        self._built: tuple[Built, ...] = ()
        self._kept: list[tuple[Readings, list[Row]]] = []
        self._couplings = Couplings(self.client)
        self._motors = Motors(self.client, self._on)
        self._ropes = Ropes(assembly.actors.ropes, self._on, self._interval)
        self._grips = Grips(self.client, assembly.actors.grips, moving)
        self._raise(skeleton(len(assembly.parts), assembly.joints))
        put(self.client, self._built, scene.start)
        self._read()

    def switch(self, entry: str, level: float) -> None:
        """Set motors, steering_hinges, springs, winches, grabbers or gusts."""
        self._on[entry] = float(level)
        if entry == "grabbers":
            self._grips.switch(level > 0)
        elif self._motors.moves(entry):
            self._careful = round(self._constants["start_time"] * self._rate)
            self._pace(self._finer)

    def step(self) -> None:
        """Advance by one step, then read everything once."""
        if not self._careful:
            self._advance()
            return
        total = np.zeros_like(self.reactions)
        for _ in range(self._finer):
            self._advance()
            total += self.reactions
        self.reactions[:] = total / self._finer
        self._careful -= 1
        if not self._careful:
            self._pace(1)

    def split(self, broken: Sequence[int]) -> None:
        """Remove joints and rebuild what they held, in place."""
        self._broken |= set(broken)
        plan = skeleton(len(self._assembly.parts), self._assembly.joints, self._broken)
        kept = set(plan.bodies)
        motions, parts = self._sensors.motions(), self._readings.parts(self._rows.table)
        for built in self._built:
            if built.body not in kept:
                pybullet.removeBody(built.uid, physicsClientId=self.client)
        self._built = tuple(built for built in self._built if built.body in kept)
        standing = {built.uid for built in self._built}
        self.reactions[:] = 0.0
        self._raise(plan)
        for built in self._built:
            if built.uid not in standing:
                restore(self.client, built, self._assembly, parts, motions)
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
    def head_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed of the pieces' roots and of things."""
        return self._rows.head_speeds

    @property
    def top_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed, m/s and rad/s."""
        return top_speeds(self._rows.all)

    def state(self) -> State:
        """Everything that a record holds."""
        return self._readings.state(self._rows.table)

    def centres(self) -> Array:
        """(N, 3) block centres, as in `state`."""
        return self._readings.centres(self._rows.table)

    def keep(self) -> None:
        """Keep the present state for `kept`."""
        self._kept.append((self._readings, self._rows.all))

    def kept(self) -> State:
        """All states kept since `build`; those between two splits are worked out at once."""
        stretches = []
        for readings, stretch in groupby(self._kept, key=itemgetter(0)):
            tables = np.array([rows for _, rows in stretch])
            stretches.append(vars(readings.states(tables)))
        return State(
            **{name: np.concatenate([each[name] for each in stretches]) for name in stretches[0]}
        )

    def centre(self, body: Body) -> Vec3:
        """Centre of a block or a thing."""
        if isinstance(body, int):
            return self._readings.centre(self._row(body), body)
        uid = self._things[body]
        place, turn = pybullet.getBasePositionAndOrientation(uid, self.client)
        return swap(subtract(place, turned(turn, swap(self._balance[body]))))

    def rotation(self, body: Body) -> Quat:
        """Orientation of a block or a thing."""
        if isinstance(body, int):
            return self._readings.rotation(self._row(body), body)
        uid = self._things[body]
        return swap_quaternion(pybullet.getBasePositionAndOrientation(uid, self.client)[1])

    def origin(self, block: int) -> Vec3:
        """Building point of a block."""
        return self._readings.origin(self._row(block), block)

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step."""
        return self._contacts.touching(body)

    def momentum(self) -> Mapping[str, Array]:
        """Total momentum and kinetic energy of the machine."""
        return self._readings.momentum(self._rows.table)

    # --- within -----------------------------------------------------------------------------

    def _raise(self, plan: Skeleton) -> None:
        """Make the bodies of `plan` that do not stand yet, then index everything anew."""
        client, assembly = self.client, self._assembly
        standing = {built.body: built for built in self._built}
        self._built = tuple(
            standing.get(body) or self._workshop.machine(body, assembly.parts, assembly.joints)
            for body in plan.bodies
        )
        self._plan = plan
        layout = lay_out(assembly, plan, self._built, self._moving, self._things)
        self._layout, self._readings = layout, Readings(assembly, layout)
        self._contacts = Contacts(client, assembly, self._built, self._ground, self._things)
        self._sensors = Sensors(client, self._built, len(assembly.joints))
        drag = self._constants["wind_drag"]
        laws = actors_of(assembly, plan, layout.members, self._on, self._ropes)
        laws += wind_of(assembly, layout, self._scene, self._moving, drag, self._strength)
        self._pushes = Pushes(client, assembly, plan, self._built, layout, laws)
        group(client, plan, self._built)
        self._couplings.renew(assembly, plan, self._built)
        if self._grips:
            self._grips.bind(self._built)
        self._motors.bind(self._built, assembly.joints)
        self._rows = Rows(client, layout, self._things)

    def _advance(self) -> None:
        """Push, step, read."""
        self._pushes(self._rows)
        self._motors.cushion()
        pybullet.stepSimulation(self.client)
        self._read()
        if self._grips:
            self._grips.watch()

    def _read(self) -> None:
        """Where the heads are, and what every joint bears."""
        self._rows.read()
        self._sensors.read(self.reactions)
        for joint, load in self._couplings.loads(self._rotation):
            self.reactions[joint] = load

    def _row(self, block: int) -> Row:
        return self._rows[self._readings.row_of[block]]

    def _rotation(self, part: int) -> Quat:
        """Of a part, in the engine's frame."""
        _, _, _, x, y, z, w, *_ = self._rows[self._layout.members.row[part]]
        return (x, y, z, w)

    def _pace(self, finer: int) -> None:
        """Take so many steps for one from now on."""
        self._interval = 1.0 / (self._rate * finer)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._interval, physicsClientId=self.client
        )
        self._ropes.step = self._interval
        self._motors.set()
        self._grips.tighten()

    def _strength(self) -> float:
        """Share of the mean wind that blows in this step."""
        if not self._on["gusts"]:
            return 1.0
        self._blown += self._interval
        return self._scene.strength(self._blown - self._interval)
