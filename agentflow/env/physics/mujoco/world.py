"""A running world in MuJoCo, whose own frame is right-handed with z up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Power, Touch
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.laws.air import GustClock
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.laws.select import device_laws, wind_laws
from agentflow.env.physics.laws.tension import WinchForce
from agentflow.env.physics.model import Assembly, State
from agentflow.env.physics.mujoco.bodies import (
    Built,
    build,
    inertia_of,
    set_step_length,
    weigh_things,
)
from agentflow.env.physics.mujoco.contacts import Contacts
from agentflow.env.physics.mujoco.couplings import align_cogs
from agentflow.env.physics.mujoco.forces import AppliedForces
from agentflow.env.physics.mujoco.grip import Grippers
from agentflow.env.physics.mujoco.motors import Motors
from agentflow.env.physics.mujoco.restoring import place_at_start, restore
from agentflow.env.physics.mujoco.sensing import Reactions, Rows, motions
from agentflow.env.physics.mujoco.surfaces import Calming, Yielding
from agentflow.env.physics.readings import Readings, states_of
from agentflow.env.physics.rows import ROTATION, Row, top_speeds
from agentflow.env.physics.structure.layout import RowLayout, lay_out
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Body
from agentflow.machine.geometry.vectors import Quat, Vec3, rotate_vector, subtract

Snapshot = tuple[Readings, Array]
"""Rows, and what reads them."""


@dataclass(frozen=True)
class Structure:
    """The model until the next split, and the objects that read and drive it."""

    built: Built
    layout: RowLayout
    readings: Readings
    contacts: Contacts
    reactions: Reactions
    forces: AppliedForces
    motors: Motors
    calming: Calming | None
    """None if no surface is lively."""
    yielding: Yielding | None
    """None if nothing is soft."""
    rows: Rows


class MuJoCoWorld:
    """An `engine.World`; see there for its members."""

    def __init__(self, physics: Constants, assembly: Assembly, scene: Scene, rate: float) -> None:
        """Set everything up."""
        self._physics, self._assembly, self._scene = physics, assembly, scene
        self._unloaded = scene
        self._things = {thing.name: thing for thing in scene.things}
        self._rate, self._divisions = rate, 1
        self._broken: frozenset[int] = frozenset()
        self._levels: dict[Entry, float] = {"wind": 1.0}
        """Of entries that were switched; the others are at 0, and only the wind is on at first."""
        self.settle_rate = physics["step_rate"]
        """Settling four times as finely changes scores of cars by 0.0 %, of throwers by 1 %."""
        self.reactions = np.zeros((len(assembly.joints), 6))
        self._winches = WinchForce(assembly.devices.winches, self._levels, 1.0 / rate)
        self._wind = GustClock(scene, self._levels, 1.0 / rate)
        self.now = self._build_structure()
        """The model and what belongs to it."""
        self._grips = Grippers(assembly.devices.grippers, self.now.built)
        place_at_start(self.now.built, assembly, scene.start)
        self._refresh()

    def switch(self, entry: Entry, level: float) -> None:
        self._levels[entry] = float(level)
        if entry in self._grips.entries:
            self._grips.switch(entry, level > 0)
        elif entry == "loads":
            self._scene = self._unloaded.loaded(level)
            weigh_things(self.now.built, self._scene)
        self._refresh()

    def step(self, divisions: int = 1) -> None:
        """Apply forces, then take the second half of a step and the first half of the next one,
        after which poses and velocities are current."""
        if divisions != self._divisions:
            self._set_length(divisions)
        now = self.now
        model, data = now.built.model, now.built.data
        now.forces()
        now.motors.drive()
        if now.calming and data.ncon:
            now.calming()
        if now.yielding and data.ncon:
            now.yielding()
        mujoco.mj_step2(model, data)
        now.motors.read()
        now.motors.mix()
        now.contacts.read()
        self._grips.watch()
        mujoco.mj_step1(model, data)
        now.rows.read()
        now.reactions.read(self.reactions)

    def split(self, broken: Sequence[int]) -> None:
        """Remove joints and build the model again."""
        self._broken |= set(broken)
        old = self.now
        rows = old.rows.table
        parts, known = old.readings.parts(rows), motions(old.built)
        things = dict(zip(old.layout.things, rows[old.layout.thing_rows], strict=True))
        self.reactions[:] = 0.0
        self.now = self._build_structure()
        built = self.now.built
        restore(built, self._assembly, parts, things, known)
        align_cogs(built.model, built.data)
        self._grips.bind(built)
        self._refresh()

    # --- observation ------------------------------------------------------------------------

    def speeds(self, thorough: bool = True) -> tuple[float, float]:  # noqa: ARG002
        return top_speeds(self.now.rows.all)

    def state(self) -> State:
        return self.now.readings.state(self.now.rows.table)

    def centres(self) -> Array:
        return self.now.readings.centres(self.now.rows.table)

    def snapshot(self) -> Snapshot:
        return self.now.readings, self.now.rows.table

    def states(self, snapshots: Sequence[Any]) -> State:
        return states_of(snapshots)

    def centre(self, body: Body) -> Vec3:
        if isinstance(body, int):
            return self.now.readings.centre(self._row(body), body)
        thing = self._things[body]
        if not thing.mass:
            return thing.position
        px, py, pz, x, y, z, w, *_ = self._row(body)
        arm = rotate_vector((x, y, z, w), swap(thing.balance))
        return swap(subtract((px, py, pz), arm))

    def rotation(self, body: Body) -> Quat:
        if isinstance(body, int):
            return self.now.readings.rotation(self._row(body), body)
        thing = self._things[body]
        return swap_quaternion(self._row(body)[ROTATION]) if thing.mass else thing.rotation

    def origin(self, block: int) -> Vec3:
        return self.now.readings.origin(self._row(block), block)

    def touching(self, body: Body) -> frozenset[Body]:
        return self.now.contacts.touching(body)

    def contacts(self) -> list[Touch]:
        return self.now.contacts.all()

    def power(self) -> Power:
        devices = self.now.forces.power()
        return devices._replace(motors=devices.motors + self.now.motors.power())

    def energies(self, snapshot: Any) -> Array:
        readings, rows = snapshot
        moving = self._scene.moving
        masses, inertias = [thing.mass for thing in moving], [inertia_of(thing) for thing in moving]
        found: Array = readings.energies(rows, masses, inertias, self._physics["gravity"])
        return found

    def momentum(self) -> Mapping[str, Array]:
        return self.now.readings.momentum(self.now.rows.table)

    # --- internals --------------------------------------------------------------------------

    def _build_structure(self) -> Structure:
        """The model of what is whole, at rest, and everything that refers to it."""
        assembly, scene = self._assembly, self._scene
        plan = skeleton(len(assembly.parts), assembly.joints, self._broken)
        layout = lay_out(assembly, plan, scene.moving)
        built = build(self._physics, assembly, plan, layout, scene, self._interval)
        rows = Rows(built)
        laws = device_laws(assembly, layout.locations, self._levels, self._winches)
        laws += wind_laws(assembly, layout, scene, self._physics["wind_drag"], self._wind)
        calming = Calming(built.data, built.lively, self._physics["restitution"])
        soft: dict[Body, float] = {
            thing.name: thing.stiffness for thing in scene.things if thing.stiffness is not None
        }
        stiffness = [soft.get(owner, 0.0) for owner in built.owners]
        return Structure(
            built,
            layout,
            readings=Readings(assembly, layout),
            contacts=Contacts(built),
            reactions=Reactions(built, assembly.joints),
            forces=AppliedForces(built, assembly, plan, layout, rows, laws),
            motors=Motors(self._levels, built, assembly.joints, self._interval),
            calming=calming if any(built.lively) else None,
            yielding=Yielding(built.model, built.data, stiffness) if soft else None,
            rows=rows,
        )

    def _refresh(self) -> None:
        """Take the first half of a step again, after positions, motors or its length changed."""
        built = self.now.built
        self.now.motors.set()
        mujoco.mj_step1(built.model, built.data)
        self.now.rows.read()

    def _row(self, body: Body) -> Row:
        """The row of a block's cluster or of a moving thing."""
        now = self.now
        if isinstance(body, int):
            return now.rows.all[now.readings.row_of[body]]
        return now.rows.all[len(now.layout.leading) + now.layout.things.index(body)]

    def _set_length(self, divisions: int) -> None:
        """Take steps of 1 / (rate * divisions) seconds from now on."""
        self._divisions = divisions
        set_step_length(self.now.built.model, self._interval)
        self._winches.step = self._wind.step = self.now.motors.step = self._interval
        self._refresh()

    @property
    def _interval(self) -> float:
        """Length of a step, s."""
        return 1.0 / (self._rate * self._divisions)
