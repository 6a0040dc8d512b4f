"""Variations of a simulation: a finer step, and different masses, friction, drives or strength.

A machine that works scores about the same under all of them. One that scores only under the default
conditions is about to fail, or profits from an error of the simulation.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from math import sqrt
from typing import Any

from agentflow.env.constants import constants
from agentflow.env.physics.engine import Engine, EngineIdentity, World
from agentflow.env.physics.model import Assembly, Devices, Joint, Strength
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Switch, Task, drives_blocks
from agentflow.machine.blocks.library import library
from agentflow.machine.controls import driven_blocks
from agentflow.machine.geometry.vectors import Vec3, add, scale
from agentflow.machine.tree import Machine


@dataclass(frozen=True)
class Variation:
    """Factors by which a simulation differs from the default one."""

    name: str
    rate: float = 1.0
    """Of the number of steps per second."""
    masses: float = 1.0
    """Of the mass and inertia of every block and object."""
    friction: float = 1.0
    """Of all friction: of surfaces, rolling, and dry in joints."""
    motor_torque: float = 1.0
    """Of the greatest torque of every motor."""
    motor_speed: float = 1.0
    """Of the target speed of every motor, and of winches."""
    strength: float = 1.0
    """Of the greatest load of every connection, and of what grabbers hold."""
    thrust: float = 1.0
    """Of the force of every thruster, and of the lift of every propeller blade."""
    pull: float = 1.0
    """Of the force of every spring, and of the greatest force of every winch."""
    times: float = 1.0
    """Of the time at which each block of the machine is switched, from t = 0."""
    noise: float = 0.0
    """Noise of sensors besides that of the level, as a share of what they read."""
    delay: float = 0
    """By how many readings they are late besides."""
    displacement: float = 0.0
    """How far each block is displaced at most, m."""
    draw: str = ""
    """Random seed of the displacements."""

    @property
    def varies_bodies(self) -> bool:
        """Whether it changes the machine or the scene, not only the rate, when it is driven, or
        what it senses."""
        usual = replace(self, name=DEFAULT.name, rate=1.0, times=1.0, noise=0.0, delay=0, draw="")
        return usual != DEFAULT

    def vary_switches(self, switches: Iterable[Switch]) -> list[Switch]:
        """The switches at other times, in order; those of the scene, such as wind, stay."""
        return sorted(
            (
                (time * self.times if drives_blocks(entry) else time, entry, level)
                for time, entry, level in switches
            ),
            key=lambda switch: switch[0],
        )

    def vary_strength(self, joint: Joint) -> Joint:
        """A connection that bears another load; one that cannot break stays."""
        own, by = joint.strength, self.strength
        if own is None or by == 1.0:
            return joint
        return replace(joint, strength=Strength(own.force * by, own.torque * by))

    @property
    def key(self) -> dict[str, str | float]:
        """What names it in keys of stored rollouts: factors that variations did not have from the
        start are left out where they are 1, so that older rollouts are still found."""
        usual = asdict(DEFAULT)
        always = ("name", "rate", "masses", "friction", "motor_torque")
        return {
            name: value
            for name, value in asdict(self).items()
            if name in always or value != usual[name]
        }


DEFAULT = Variation("default")
LITTLE = 0.02
"""Relative change of a quantity; chosen."""


def _both(quantity: str, *names: str) -> tuple[Variation, Variation]:
    """A little more of a quantity, and a little less; `names` are the factors."""

    def changed(sign: int) -> Variation:
        factors: dict[str, Any] = dict.fromkeys(names, 1 + sign * LITTLE)
        return Variation(f"{quantity} {100 * sign * LITTLE:+g} %", **factors)

    return changed(1), changed(-1)


FRICTION = _both("friction", "friction")
TIMES = _both("start times", "times")
GENERAL = (
    DEFAULT,
    Variation("4 x step rate", rate=4.0),
    *_both("masses", "masses"),
    *FRICTION,
)
"""The default conditions, then variations that can change what any machine does."""
MOTORS = _both("motor torque", "motor_torque")
THRUST = _both("thrust", "thrust")
PULL = _both("pull of springs and winches", "pull")
VARIATIONS = {one.name: one for one in (*GENERAL, *MOTORS, *THRUST, *PULL, *TIMES)}
"""All that a score can be verified under, by name. Finished runs name theirs, so a name keeps its
meaning."""
PERHAPS_IDLE = frozenset(one.name for one in (*FRICTION, *TIMES))
"""Variations that change nothing for some machines, which only a simulation shows."""


def variations_of(machine: Machine, task: Task) -> tuple[Variation, ...]:
    """The default conditions, then what the score of a machine is verified under.

    Left out is what cannot change anything: for example thrust, of a machine without thrusters and
    blades. If everything starts at t = 0, so are start times: a common delay would only move the
    whole rollout.
    """
    groups = set(driven_blocks(machine).values())
    later = bool(machine.controllers) or any(
        time and (isinstance(entry, int) or entry in groups)
        for time, entry, _ in task.switches(machine)
    )
    return _variations({step.type for step in machine}, later)


def most_variations_of(task: Task) -> tuple[Variation, ...]:
    """Those of a machine with all blocks that a task allows: no other has more."""
    switches, brief = task.schedule.switches(), task.brief
    later = any(time and drives_blocks(entry) for time, entry, _ in switches)
    types = {*brief.blocks, *(step.type for step in brief.given)}
    return _variations(types, later or task.schedule.designed)


def _variations(types: Collection[int], later: bool) -> tuple[Variation, ...]:
    """Those of a machine with these types of blocks; whether some are switched after t = 0."""
    kinds, value = [library()[kind] for kind in types], constants()
    has = {
        MOTORS: any(value.of("motor_torque", kind.type) for kind in kinds),
        THRUST: any(kind.thrust or kind.blade for kind in kinds),
        PULL: any(kind.connector in ("spring", "rope") for kind in kinds),
        TIMES: later,
    }
    return (*GENERAL, *(one for both, varied in has.items() if varied for one in both))


MUCH = 0.1
"""Relative change of a quantity that a robust machine bears; chosen."""
PERTURBATIONS = (
    DEFAULT,
    Variation("2 x step rate", rate=2.0),
    Variation("masses +10 %", masses=1 + MUCH),
    Variation("masses -10 %", masses=1 - MUCH),
    Variation("friction +10 %", friction=1 + MUCH),
    Variation("friction -10 %", friction=1 - MUCH),
    Variation("motor speed +10 %", motor_speed=1 + MUCH),
    Variation("motor speed -10 %", motor_speed=1 - MUCH),
    Variation("strength +10 %", strength=1 + MUCH),
    Variation("strength -10 %", strength=1 - MUCH),
)
"""The default conditions, then those that show whether a design is robust."""
SENSING = Variation("readings +-2 % and late", noise=LITTLE, delay=1)
"""What a robust machine with controllers bears besides."""


def perturbations_of(machine: Machine) -> tuple[Variation, ...]:
    """The default conditions, then those that show whether this machine is robust."""
    return (*PERTURBATIONS, SENSING) if machine.controllers else PERTURBATIONS


@dataclass(frozen=True)
class VariedEngine:
    """An engine that builds every world with changed masses, friction, drives and strength."""

    engine: Engine
    variation: Variation
    usual_friction: float
    """Friction coefficient of the ground and objects that have none of their own."""

    @property
    def identity(self) -> EngineIdentity:
        """That of the engine, which is the same."""
        return self.engine.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:
        """Build a world of the changed machine in the changed scene."""
        return self.engine.build(self._vary_machine(assembly), self._vary_scene(scene), rate)

    def close(self) -> None:
        """Close the engine."""
        self.engine.close()

    def _vary_machine(self, assembly: Assembly) -> Assembly:
        by = self.variation
        assembly = displace(assembly, by.displacement, by.draw) if by.displacement else assembly
        parts = tuple(
            replace(
                part,
                mass=part.mass * by.masses,
                inertia=scale(part.inertia, by.masses),
                friction=part.friction * by.friction,
                rolling_friction=part.rolling_friction * by.friction,
            )
            for part in assembly.parts
        )
        joints = tuple(
            replace(
                self.variation.vary_strength(joint),
                drive=replace(
                    joint.drive,
                    speed=joint.drive.speed * by.motor_speed,
                    torque=joint.drive.torque * by.motor_torque,
                    friction=joint.drive.friction * by.friction,
                ),
            )
            for joint in assembly.joints
        )
        return replace(
            assembly, parts=parts, joints=joints, devices=self._vary_devices(assembly.devices)
        )

    def _vary_devices(self, devices: Devices) -> Devices:
        by = self.variation
        return replace(
            devices,
            springs=tuple(replace(each, force=each.force * by.pull) for each in devices.springs),
            thrusters=tuple(
                replace(each, force=scale(each.force, by.thrust)) for each in devices.thrusters
            ),
            moved=tuple(each.scaled(by.thrust) for each in devices.moved),
            winches=tuple(
                replace(each, speed=each.speed * by.motor_speed, force=each.force * by.pull)
                for each in devices.winches
            ),
            grippers=tuple(
                replace(each, force=each.force * by.strength) for each in devices.grippers
            ),
        )

    def _vary_scene(self, scene: Scene) -> Scene:
        objects = tuple(
            replace(
                item,
                mass=item.mass * self.variation.masses,
                load=item.load * self.variation.masses,
                friction=self._vary_friction(item.friction),
            )
            for item in scene.objects
        )
        return replace(scene, objects=objects, friction=self._vary_friction(scene.friction))

    def _vary_friction(self, value: float | None) -> float:
        return (self.usual_friction if value is None else value) * self.variation.friction


def displace(assembly: Assembly, most: float, seed: str) -> Assembly:
    """The machine with each block, and its own joints, up to `most` metres from its place.

    All directions are as likely, and so is every place within reach. The whole machine is raised as
    far, so that no block begins in the ground.
    """
    rng, moves = random.Random(seed), []
    for _ in assembly.blocks:
        way = [rng.gauss(0.0, 1.0) for _ in range(3)]
        far = most * rng.random() ** (1 / 3) / sqrt(sum(one * one for one in way))
        moves.append((way[0] * far, way[1] * far + most, way[2] * far))

    def moved(places: Sequence[Vec3]) -> tuple[Vec3, ...]:
        return tuple(map(add, places, moves))

    return replace(
        assembly,
        parts=tuple(replace(p, centre=add(p.centre, moves[p.block])) for p in assembly.parts),
        joints=tuple(replace(j, pivot=add(j.pivot, moves[j.block])) for j in assembly.joints),
        origins=moved(assembly.origins),
        centres=moved(assembly.centres),
    )
