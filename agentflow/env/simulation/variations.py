"""Variations of a simulation: a finer step, and slightly different masses, friction and motors.

A machine that works scores about the same under all of them. One that scores only under the default
conditions is about to fail, or profits from an error of the simulation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from agentflow.env.physics.engine import Engine, EngineIdentity, World
from agentflow.env.physics.model import Assembly
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import scale


@dataclass(frozen=True)
class Variation:
    """Factors by which a simulation differs from the default one."""

    name: str
    rate: float = 1.0
    """Of the number of steps per second."""
    masses: float = 1.0
    """Of the mass and inertia of every block and thing."""
    friction: float = 1.0
    """Of all friction: of surfaces, rolling, and dry in joints."""
    motor_torque: float = 1.0
    """Of the greatest torque of every motor."""

    @property
    def varies_bodies(self) -> bool:
        """Whether it changes the machine or the scene, not only the rate."""
        return (self.masses, self.friction, self.motor_torque) != (1.0, 1.0, 1.0)


DEFAULT = Variation("default")
LITTLE = 0.02
"""Relative change of a quantity; chosen."""
VARIATIONS = (
    DEFAULT,
    Variation("4 x step rate", rate=4.0),
    Variation("masses +2 %", masses=1 + LITTLE),
    Variation("masses -2 %", masses=1 - LITTLE),
    Variation("friction +2 %", friction=1 + LITTLE),
    Variation("friction -2 %", friction=1 - LITTLE),
    Variation("motor torque +2 %", motor_torque=1 + LITTLE),
    Variation("motor torque -2 %", motor_torque=1 - LITTLE),
)
"""The default conditions, then those that a score is verified under."""


@dataclass(frozen=True)
class VariedEngine:
    """An engine that builds every world with changed masses, friction and motors."""

    engine: Engine
    variation: Variation
    usual_friction: float
    """Friction coefficient of the ground and things that have none of their own."""

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
                joint,
                drive=replace(
                    joint.drive,
                    torque=joint.drive.torque * by.motor_torque,
                    friction=joint.drive.friction * by.friction,
                ),
            )
            for joint in assembly.joints
        )
        return replace(assembly, parts=parts, joints=joints)

    def _vary_scene(self, scene: Scene) -> Scene:
        things = tuple(
            replace(
                thing,
                mass=thing.mass * self.variation.masses,
                friction=self._vary_friction(thing.friction),
            )
            for thing in scene.things
        )
        return replace(scene, things=things, friction=self._vary_friction(scene.friction))

    def _vary_friction(self, value: float | None) -> float:
        return (self.usual_friction if value is None else value) * self.variation.friction
