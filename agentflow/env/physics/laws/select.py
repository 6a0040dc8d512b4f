"""Which laws act on a machine in a scene, and what they and drag do in a step."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from agentflow.env.physics.frames import swap, swap_all
from agentflow.env.physics.laws.air import DragForce, GustClock, WindForce
from agentflow.env.physics.laws.flight import ThrustForce
from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, power_of
from agentflow.env.physics.laws.motion import MotionForce
from agentflow.env.physics.laws.tension import SpringForce, WinchForce
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.rows import Row, Rows
from agentflow.env.physics.structure.layout import RowLayout, drag_locations
from agentflow.env.physics.structure.spanning_tree import Skeleton
from agentflow.env.scene import Scene

Law = Callable[[Sequence[Row]], list[PartForce]]
"""From all rows to the forces in this step."""


def device_laws(
    assembly: Assembly,
    locations: PartLocations,
    levels: Mapping[Entry, float],
    springs: SpringForce,
    winches: WinchForce,
) -> list[Law]:
    """Springs, thrusters, devices that motion makes push, and winches, where there are any."""
    devices = assembly.devices
    laws: list[Law] = []
    if springs:
        springs.locate_parts(locations)
        laws.append(springs)
    if devices.thrusters:
        laws.append(ThrustForce(devices.thrusters, levels, devices.flames, locations))
    if devices.moved:
        laws.append(MotionForce(devices.moved, locations))
    if winches:
        winches.locate_parts(locations)
        laws.append(winches)
    return laws


def wind_laws(
    assembly: Assembly,
    layout: RowLayout,
    scene: Scene,
    drag: float,
    clock: GustClock,
) -> list[Law]:
    """The scene's wind on every part and moving object; no law in still air.

    Args:
        assembly: The machine.
        layout: The rows.
        scene: Gives the mean wind and the moving objects.
        drag: Force over area times squared speed, kg/m3.
        clock: Gives the strength of the wind, and adds up its work.
    """
    if not any(scene.wind):
        return []
    boxes = [part.extents for part in assembly.parts] + [item.size for item in scene.moving]
    wind = WindForce(
        layout.all_locations,
        swap_all(np.array(boxes)),
        np.array(swap(scene.wind)),
        drag,
        len(assembly.parts),
    )

    def blow(rows: Sequence[Row]) -> list[PartForce]:
        share = clock()
        if not share:
            return []
        forces = wind(np.array(rows), share)
        clock.work += clock.step * wind.power
        return forces

    return [blow]


class Power(NamedTuple):
    """Rate at which forces did work on the blocks in the last step, W: thrust, and air, which is
    drag and what motion pushes."""

    thrust: float
    air: float


class Forces(ABC):
    """All forces on the bodies of one skeleton; engines apply them in every step."""

    def __init__(
        self, assembly: Assembly, plan: Skeleton, layout: RowLayout, rows: Rows, laws: Sequence[Law]
    ) -> None:
        """Collect all forces: drag and `laws`."""
        self._rows, self.laws, self._locations = rows, laws, layout.locations
        inertia = swap_all(np.array([part.inertia for part in assembly.parts]).reshape(-1, 3))
        locations = drag_locations(assembly, plan, layout.locations)
        self.drag = DragForce(assembly.parts, locations, inertia)
        self._before: Sequence[Row] = ()
        self._exerted: list[list[PartForce]] = []
        """Rows before the last step, and the forces of each law in it."""

    @abstractmethod
    def __call__(self) -> None:
        """Apply everything for one step."""

    @property
    def _read(self) -> Sequence[Row]:
        """The rows after the last step, at least those on which drag acts."""
        return self._rows.all

    def _of_laws(self, rows: Sequence[Row]) -> list[list[PartForce]]:
        """The forces of each law in this step."""
        if self.laws:
            self._before, self._exerted = rows, [law(rows) for law in self.laws]
        return self._exerted

    def power(self) -> Power:
        """Mean power in the last step; that of drag at its end."""
        rows = self._rows
        thrust, air = 0.0, self.drag.power(self._read)
        for law, forces in zip(self.laws, self._exerted, strict=False):
            if forces and isinstance(law, ThrustForce | MotionForce):
                begin = power_of(forces, self._before, self._locations)
                mean = (begin + power_of(forces, rows, self._locations)) / 2
                if isinstance(law, ThrustForce):
                    thrust += mean
                else:
                    air += mean
        return Power(thrust, air)
