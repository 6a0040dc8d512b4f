"""Variations of a simulation: a finer step, and different masses, friction, motors or strength.

A machine that works scores about the same under all of them. One that scores only under the default
conditions is about to fail, or profits from an error of the simulation.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

from agentflow.env.physics.engine import Engine, EngineIdentity, World
from agentflow.env.physics.model import Assembly, Strength
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import scale


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

    @property
    def varies_bodies(self) -> bool:
        """Whether it changes the machine or the scene, not only the rate."""
        return replace(self, name=DEFAULT.name, rate=1.0) != DEFAULT

    @property
    def key(self) -> dict[str, str | float]:
        """What names it in keys of stored rollouts: factors that variations did not have from the
        start are left out where they are 1, so that older rollouts are still found."""
        usual = asdict(DEFAULT)
        later = ("motor_speed", "strength")
        return {
            name: value
            for name, value in asdict(self).items()
            if name not in later or value != usual[name]
        }


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


@dataclass(frozen=True)
class VariedEngine:
    """An engine that builds every world with changed masses, friction, motors and strength."""

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
                    speed=joint.drive.speed * by.motor_speed,
                    torque=joint.drive.torque * by.motor_torque,
                    friction=joint.drive.friction * by.friction,
                ),
                strength=joint.strength and self._vary_strength(joint.strength),
            )
            for joint in assembly.joints
        )
        devices = replace(
            assembly.devices,
            winches=tuple(
                replace(winch, speed=winch.speed * by.motor_speed)
                for winch in assembly.devices.winches
            ),
            grippers=tuple(
                replace(gripper, force=gripper.force * by.strength)
                for gripper in assembly.devices.grippers
            ),
        )
        return replace(assembly, parts=parts, joints=joints, devices=devices)

    def _vary_strength(self, value: Strength) -> Strength:
        by = self.variation.strength
        return Strength(value.force * by, value.torque * by)

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
