"""A running world in PyBullet, whose own frame is right-handed with z up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Power, Touch
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.laws.air import GustClock
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.laws.select import device_laws, wind_laws
from agentflow.env.physics.laws.tension import WinchForce
from agentflow.env.physics.model import Assembly, State
from agentflow.env.physics.pybullet.bodies import BodyBuilder, Built
from agentflow.env.physics.pybullet.contacts import (
    Contacts,
    set_collisions_of_clusters,
    set_collisions_of_scene,
)
from agentflow.env.physics.pybullet.couplings import Couplings
from agentflow.env.physics.pybullet.forces import AppliedForces
from agentflow.env.physics.pybullet.grip import Grippers
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.motors import Motors, inner_iterations, longest_series
from agentflow.env.physics.pybullet.restoring import place_at_start, restore
from agentflow.env.physics.pybullet.sensing import Rows, Sensors
from agentflow.env.physics.readings import Readings, states_of
from agentflow.env.physics.rows import WIDTH, Row, top_speeds
from agentflow.env.physics.structure.layout import RowLayout, lay_out
from agentflow.env.physics.structure.spanning_tree import Piece, Skeleton, skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Body
from agentflow.machine.geometry.vectors import Quat, Vec3, rotate_vector, subtract

Snapshot = tuple[Readings, list[Row]]
"""Rows, and what reads them."""


@dataclass(frozen=True)
class Structure:
    """The machine's bodies until the next split, and the objects that read and drive them."""

    built: tuple[Built, ...]
    layout: RowLayout
    readings: Readings
    contacts: Contacts
    sensors: Sensors
    forces: AppliedForces
    motors: Motors
    rows: Rows


class PyBulletWorld:
    """An `engine.World`; see there for its members."""

    def __init__(
        self, client: int, physics: Constants, assembly: Assembly, scene: Scene, rate: float
    ) -> None:
        """Clear the client and set everything up in it."""
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / rate,
            numSolverIterations=int(physics["solver_iterations"]),
            deterministicOverlappingPairs=1,
            jointFeedbackMode=pybullet.JOINT_FEEDBACK_IN_JOINT_FRAME,
            physicsClientId=client,
        )
        pybullet.setGravity(0.0, 0.0, -physics["gravity"], physicsClientId=client)
        self.client, self._physics = client, physics
        self._assembly, self._scene, self._unloaded = assembly, scene, scene
        self._rate, self._divisions = rate, 1
        self._broken: frozenset[int] = frozenset()
        self._levels: dict[Entry, float] = {"wind": 1.0}
        """Of entries that were switched; the others are at 0, and only the wind is on at first."""
        self._builder = BodyBuilder(client, physics)
        self._ground = self._builder.ground(scene.friction)
        self.things = {thing.name: self._builder.thing(thing) for thing in scene.things}
        """Body number of each thing."""
        self._balance = {thing.name: thing.balance for thing in scene.things}
        moving = {thing.name: self.things[thing.name] for thing in scene.moving}
        fixed = [uid for name, uid in self.things.items() if name not in moving]
        set_collisions_of_scene(client, (self._ground, *fixed), tuple(moving.values()))
        self.settle_rate = physics["settle_rate"]
        self.reactions = np.zeros((len(assembly.joints), 6))
        self._couplings = Couplings(client)
        self._winches = WinchForce(assembly.devices.winches, self._levels, 1.0 / rate)
        self._wind = GustClock(scene, self._levels, 1.0 / rate)
        self._grips = Grippers(client, assembly.devices.grippers, moving)
        self._now = self._build_structure(skeleton(len(assembly.parts), assembly.joints), {})
        place_at_start(client, self._now.built, scene.start)
        self._read()

    def switch(self, entry: Entry, level: float) -> None:
        self._levels[entry] = float(level)
        if entry in self._grips.entries:
            self._grips.switch(entry, level > 0)
        elif entry == "loads":
            self._load(level)
        else:
            self._now.motors.set()

    def step(self, divisions: int = 1) -> None:
        if divisions != self._divisions:
            self._set_length(divisions)
        now = self._now
        now.forces()
        now.motors.set_for_step()
        pybullet.stepSimulation(self.client)
        self._read()
        self._grips.watch()

    def split(self, broken: Sequence[int]) -> None:
        """Remove joints and rebuild the bodies that they were part of."""
        self._broken |= set(broken)
        plan = skeleton(len(self._assembly.parts), self._assembly.joints, self._broken)
        old, lasting = self._now, set(plan.pieces)
        motions, parts = old.sensors.motions(), old.readings.parts(old.rows.table)
        for built in old.built:
            if built.piece not in lasting:
                pybullet.removeBody(built.uid, physicsClientId=self.client)
        present = {built.piece: built for built in old.built if built.piece in lasting}
        self.reactions[:] = 0.0
        self._now = self._build_structure(plan, present)
        for built in self._now.built:
            if built.piece not in present:
                restore(self.client, built, self._assembly, parts, motions)
        self._now.motors.set()
        self._read()

    # --- observation ------------------------------------------------------------------------

    def speeds(self, thorough: bool = True) -> tuple[float, float]:
        """Greatest linear and angular speed; unless thorough, as far as pieces' roots, things and
        joints show: of the two parts that a joint turns, one spins at half its speed or more."""
        now = self._now
        if thorough:
            return top_speeds(now.rows.all)
        linear, angular = now.rows.head_speeds
        return linear, max(angular, 0.5 * now.sensors.spin)

    def state(self) -> State:
        return self._now.readings.state(self._now.rows.table)

    def centres(self) -> Array:
        return self._now.readings.centres(self._now.rows.table)

    def snapshot(self) -> Snapshot:
        return self._now.readings, self._now.rows.all

    def states(self, snapshots: Sequence[Any]) -> State:
        return states_of(snapshots)

    def centre(self, body: Body) -> Vec3:
        if isinstance(body, int):
            return self._now.readings.centre(self._row(body), body)
        place, turn = pybullet.getBasePositionAndOrientation(self.things[body], self.client)
        return swap(subtract(place, rotate_vector(turn, swap(self._balance[body]))))

    def rotation(self, body: Body) -> Quat:
        if isinstance(body, int):
            return self._now.readings.rotation(self._row(body), body)
        uid = self.things[body]
        return swap_quaternion(pybullet.getBasePositionAndOrientation(uid, self.client)[1])

    def origin(self, block: int) -> Vec3:
        return self._now.readings.origin(self._row(block), block)

    def touching(self, body: Body) -> frozenset[Body]:
        return self._now.contacts.touching(body)

    def contacts(self) -> list[Touch]:
        return self._now.contacts.all()

    def power(self) -> Power:
        devices = self._now.forces.power()
        return devices._replace(motors=devices.motors + self._now.sensors.power())

    def energies(self, snapshot: Any) -> Array:
        readings, rows = snapshot
        masses = [thing.mass for thing in self._scene.moving]
        inertias = [
            pybullet.getDynamicsInfo(self.things[thing.name], -1, self.client)[2]
            for thing in self._scene.moving
        ]
        table = np.array(rows).reshape(-1, WIDTH)
        gravity = self._physics["gravity"]
        found: Array = readings.energies(table, masses, inertias, gravity)
        return found

    def momentum(self) -> Mapping[str, Array]:
        return self._now.readings.momentum(self._now.rows.table)

    # --- internals --------------------------------------------------------------------------

    def _build_structure(self, plan: Skeleton, present: Mapping[Piece, Built]) -> Structure:
        """Build the missing bodies of `plan`, then everything that refers to bodies."""
        client, assembly = self.client, self._assembly
        built = tuple(
            present.get(piece) or self._builder.machine(piece, assembly.parts, assembly.joints)
            for piece in plan.pieces
        )
        handles = {part: (body.uid, index) for body in built for part, index in body.index.items()}
        layout = lay_out(assembly, plan, self._scene.moving)
        rows = Rows(client, layout, built, self.things)
        laws = device_laws(assembly, layout.locations, self._levels, self._winches)
        drag = self._physics["wind_drag"]
        laws += wind_laws(assembly, layout, self._scene, drag, self._wind)
        set_collisions_of_clusters(client, plan, handles)
        self._couplings.renew(assembly, plan, built, handles)
        series = longest_series(assembly, plan)
        pybullet.setPhysicsEngineParameter(
            numNonContactInnerIterations=inner_iterations(series, plan), physicsClientId=client
        )
        self._grips.bind(handles)
        return Structure(
            built,
            layout,
            readings=Readings(assembly, layout),
            contacts=Contacts(client, assembly, handles, self._ground, self.things),
            sensors=Sensors(client, built, assembly.joints),
            forces=AppliedForces(
                client, assembly, plan, built, handles, layout, rows, self.things, laws
            ),
            motors=Motors(client, self._levels, built, assembly.joints, self._interval, series > 1),
            rows=rows,
        )

    def _load(self, share: float) -> None:
        """Put a share of their loads on the things; PyBullet adapts their inertia."""
        self._scene = self._unloaded.loaded(share)
        for thing in self._scene.moving:
            if thing.load:
                uid = self.things[thing.name]
                pybullet.changeDynamics(uid, -1, mass=thing.mass, physicsClientId=self.client)

    def _read(self) -> None:
        """Read the rows of the heads and the reactions of all joints."""
        self._now.rows.read()
        self._now.sensors.read(self.reactions)

    def _row(self, block: int) -> Row:
        return self._now.rows[self._now.readings.row_of[block]]

    def _set_length(self, divisions: int) -> None:
        """Take steps of 1 / (rate * divisions) seconds from now on.

        Bullet stores the limits of motors and grips as impulses per step.
        """
        self._divisions = divisions
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._interval, physicsClientId=self.client
        )
        self._winches.step = self._wind.step = self._now.motors.step = self._interval
        self._now.motors.set()
        self._grips.tighten()

    @property
    def _interval(self) -> float:
        """Length of a step, s."""
        return 1.0 / (self._rate * self._divisions)
