"""A running world in MuJoCo, whose own frame is right-handed with z up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, NamedTuple

import mujoco
import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Watch
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco.bodies import (
    CompiledModel,
    JointAddress,
    begin_again,
    build,
    inertia_of,
    set_step_length,
    weigh_objects,
)
from agentflow.env.physics.mujoco.couplings import align_cogs
from agentflow.env.physics.mujoco.forces import AppliedForces
from agentflow.env.physics.mujoco.grip import Grippers
from agentflow.env.physics.mujoco.motors import Motors
from agentflow.env.physics.mujoco.sensing import Contacts, Reactions, Rows, motions
from agentflow.env.physics.mujoco.shapes import wxyz
from agentflow.env.physics.mujoco.surfaces import Calming, Yielding
from agentflow.env.physics.readings import Readings, joint_motion, relative_motion
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY
from agentflow.env.physics.structure.layout import RowLayout, lay_out
from agentflow.env.physics.structure.spanning_tree import Skeleton
from agentflow.env.physics.world import BaseWorld, UnsplitMachine
from agentflow.env.rollout import Array
from agentflow.env.rotations import matrices, turn_back
from agentflow.env.scene import Body, Scene, SceneObject, Start
from agentflow.machine.geometry.vectors import Vec3, add, rotate_vector

LEAST = 3
"""Fewer steps are taken one by one."""
KEPT = 12
"""Structures that an engine keeps for worlds with the same machine, enough for the scenes of ten
trials; each takes 1 to 2 MB."""


class Structure(NamedTuple):
    """What depends on the machine, the scene's objects and what broke alone."""

    of: tuple[object, ...]
    plan: Skeleton
    layout: RowLayout
    built: CompiledModel
    readings: Readings
    reactions: Reactions


@dataclass(frozen=True)
class Model(UnsplitMachine):
    """The model until the next split, and the objects that read and drive it."""

    built: CompiledModel
    contacts: Contacts
    reactions: Reactions
    motors: Motors
    forces: AppliedForces
    calming: Calming | None
    """None if no surface is lively."""
    yielding: Yielding | None
    """None if nothing is soft."""
    rows: Rows
    ahead: Any
    """An `ahead.Ahead`, which takes several steps at once; None where steps are taken singly."""


class MuJoCoWorld(BaseWorld[Model]):
    """An `engine.World`; see there for its members."""

    def __init__(
        self,
        physics: Constants,
        assembly: Assembly,
        scene: Scene,
        rate: float,
        kept: list[Structure],
        compiled: ModuleType | None = None,
    ) -> None:
        """Set everything up.

        Args:
            physics: The constants.
            assembly: The machine.
            scene: Where it is.
            rate: Steps per second.
            kept: Structures of earlier worlds, the last one first, of which none is in use.
            compiled: The module `ahead`, if steps may be taken with it.
        """
        super().__init__(physics, assembly, scene, rate)
        self._kept, self._compiled = kept, compiled
        self.settle_rate = physics["step_rate"]
        """Settling four times as finely changes scores of cars by 0.0 %, of throwers by 1 %."""
        self.now = self._build_structure()
        self._grips: Grippers = Grippers(assembly.devices.grippers, self.now.built)
        _place_at_start(self.now.built, assembly, scene.start)
        self._refresh()

    def switch(self, entry: Entry, level: float) -> None:
        self._rewind()
        super().switch(entry, level)
        self._refresh()

    def drive(self, levels: Mapping[Entry, float], sudden: bool) -> None:
        self._rewind()
        super().drive(levels, sudden)
        if sudden or self.now.motors.mixed:  # else only the aims of motors change
            self._refresh()

    @property
    def calm(self) -> int:
        ahead = self.now.ahead
        return ahead.calm if ahead else 0

    def _advance(self, ahead: int, watch: Watch | None) -> None:
        """Apply forces, then take the second half of a step and the first half of the next one,
        after which poses and velocities are current."""
        now, taken = self.now, self.now.ahead
        if taken is not None:
            if not taken.left and ahead >= LEAST:
                taken.run(ahead, self._interval, self._divisions, watch)
            if taken.left:
                self.reactions = taken.show(now.rows, now.contacts)
                return
            taken.note()
        model, data = now.built.model, now.built.data
        now.forces()
        now.motors.drive()
        if now.calming and data.ncon:
            now.calming()
        if now.yielding and data.ncon:
            now.yielding()
        mujoco.mj_step2(model, data)
        efforts = data.efc_force.copy()
        now.motors.note(efforts)
        now.motors.mix()
        now.contacts.read(efforts)
        self._grips.watch()
        mujoco.mj_step1(model, data)
        now.rows.read()
        now.reactions.read(self.reactions)

    def _rewind(self) -> None:
        """Take back steps that nothing has seen yet, before something else happens to the model."""
        ahead = self.now.ahead
        if ahead:
            if ahead.left:
                self.reactions = self.reactions.copy()
            ahead.rewind()

    def _split(self, broken: Sequence[int]) -> None:
        """Build the model again."""
        old = self.now
        rows = old.rows.table
        parts, known = old.readings.parts(rows), motions(old.built)
        objects = dict(zip(old.layout.objects, rows[old.layout.object_rows], strict=True))
        self.reactions[:] = 0.0
        self.now = self._build_structure(broken)
        built = self.now.built
        _restore(built, self._assembly, parts, objects, known)
        align_cogs(built.model, built.data)
        self._grips.bind(built)
        self._refresh()

    def speeds(self, thorough: bool = True) -> tuple[float, float]:  # noqa: ARG002
        return self.now.rows.top_speeds

    # --- internals --------------------------------------------------------------------------

    def _build_structure(self, broken: Sequence[int] = ()) -> Model:
        """The model of what is whole, at rest, and everything that refers to it."""
        assembly, scene = self._assembly, self._scene
        _, plan, layout, built, readings, reactions = self._structure(broken)
        rows = Rows(built)
        calming = Calming(built.data, built.lively, self._physics["restitution"])
        soft: dict[Body, float] = {
            item.name: item.stiffness for item in scene.objects if item.stiffness is not None
        }
        stiffness = [soft.get(owner, 0.0) for owner in built.owners]
        model = Model(
            layout,
            built=built,
            readings=readings,
            contacts=Contacts(built),
            reactions=reactions,
            forces=AppliedForces(built, assembly, plan, layout, rows, self._laws(layout)),
            motors=Motors(self._levels, built, assembly.joints, self._interval),
            calming=calming if any(built.lively) else None,
            yielding=Yielding(built.model, built.data, stiffness) if soft else None,
            rows=rows,
            ahead=None,
        )
        if self._compiled and self._compiled.can_run(model):
            model = replace(model, ahead=self._compiled.Ahead(model, self._springs))
        return model

    def _structure(self, broken: Sequence[int]) -> Structure:
        """The structure of what is whole: one that is kept, as it was, or a new one."""
        assembly, scene, kept = self._assembly, self._scene, self._kept
        self._broken |= set(broken)
        of = self._broken, scene.friction, scene.objects, assembly
        for number, one in enumerate(kept):
            if one.of == of:
                begin_again(one.built, self._interval)
                kept.insert(0, kept.pop(number))
                return one
        del kept[KEPT - 1 :]
        plan = self._plan()
        layout = lay_out(assembly, plan, scene.moving)
        built = build(self._physics, assembly, plan, layout, scene, self._interval)
        reactions = Reactions(built, assembly.joints)
        kept.insert(0, Structure(of, plan, layout, built, Readings(assembly, layout), reactions))
        return kept[0]

    def _refresh(self) -> None:
        """Take the first half of a step again, after positions, motors or its length changed."""
        built = self.now.built
        self.now.motors.set()
        mujoco.mj_step1(built.model, built.data)
        self.now.rows.read()

    def _weigh_objects(self) -> None:
        weigh_objects(self.now.built, self._scene)

    def _inertia(self, item: SceneObject) -> Vec3:
        return inertia_of(item)

    def _change_interval(self) -> None:
        self._rewind()
        set_step_length(self.now.built.model, self._interval)
        self._refresh()

    def pulls(self) -> Mapping[int, tuple[Array, Array]]:
        self._rewind()
        return super().pulls()

    def _take_works(self) -> Array:
        self._rewind()
        return self.now.motors.take_works()


def _place_at_start(built: CompiledModel, assembly: Assembly, start: Start) -> None:
    """Move the machine from the ground to the start of the scene."""
    for part, address in built.roots.items():
        centre = add(
            rotate_vector(start.rotation, assembly.parts[part].centre), (0, start.height, 0)
        )
        built.data.qpos[address.position : address.position + 7] = (
            *swap(centre),
            *wxyz(swap_quaternion(start.rotation)),
        )


def _restore(
    built: CompiledModel,
    assembly: Assembly,
    parts: Array,
    objects: Mapping[str, Array],
    motions: Mapping[int, tuple[float, float]],
) -> None:
    """Give a new model the positions and velocities of the one before.

    Args:
        built: The new model.
        assembly: The machine.
        parts: (P, 13) rows of the parts.
        objects: (13,) row of each moving object.
        motions: Position and velocity of joints that were in trees or parallel to those.
    """
    position, velocity = built.data.qpos, built.data.qvel
    for part, address in built.roots.items():
        _set_free(built, address, parts[part])
    for name, address in built.loose.items():
        _set_free(built, address, objects[name])
    for link in built.links:
        if link.joint not in built.joints:
            continue
        address = built.joints[link.joint]
        joint = assembly.joints[link.joint]
        at, speed = address.position, address.velocity
        if joint.kind == "spherical":
            rotation, spin = relative_motion(parts[link.parent], parts[link.part])
            position[at : at + 4], velocity[speed : speed + 3] = wxyz(rotation), spin
        else:
            known = motions.get(link.joint)
            position[at], velocity[speed] = known or joint_motion(joint, assembly.parts, parts)


def _set_free(built: CompiledModel, address: JointAddress, row: Array) -> None:
    """Set a free joint; MuJoCo has its angular velocity in the body's own axes."""
    spin = turn_back(matrices(row[None, ROTATION]), row[None, SPIN])[0]
    at, speed = address.position, address.velocity
    built.data.qpos[at : at + 7] = [*row[POSITION], *wxyz(row[ROTATION].tolist())]
    built.data.qvel[speed : speed + 6] = np.concatenate([row[VELOCITY], spin])
