"""Which laws act on a machine in a scene, besides drag, and what they do in a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from agentflow.env.physics.engine import Power
from agentflow.env.physics.frames import swap, swap_all
from agentflow.env.physics.laws.air import WindForce
from agentflow.env.physics.laws.flight import BladeForce, ThrustForce
from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, power_of
from agentflow.env.physics.laws.tension import SpringForce, WinchForce
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.rows import Row
from agentflow.env.physics.structure.layout import RowLayout
from agentflow.env.scene import Scene

Law = Callable[[Sequence[Row]], list[PartForce]]
"""From all rows to the forces in this step."""


def device_laws(
    assembly: Assembly,
    locations: PartLocations,
    levels: Mapping[Entry, float],
    winches: WinchForce,
) -> list[Law]:
    """Springs, thrusters, blades and winches, where there are any."""
    devices = assembly.devices
    laws: list[Law] = []
    if devices.springs:
        laws.append(SpringForce(devices.springs, locations, levels))
    if devices.thrusters:
        laws.append(ThrustForce(devices.thrusters, levels, devices.flames, locations))
    if devices.blades:
        laws.append(BladeForce(devices.blades, locations))
    if winches:
        winches.locate_parts(locations)
        laws.append(winches)
    return laws


def wind_laws(
    assembly: Assembly,
    layout: RowLayout,
    scene: Scene,
    drag: float,
    strength: Callable[[], float],
) -> list[Law]:
    """The scene's wind on every part and moving thing; no law in still air.

    Args:
        assembly: The machine.
        layout: The rows.
        scene: Gives the mean wind and the moving things.
        drag: Force over area times squared speed, kg/m3.
        strength: Wind in this step as a share of the mean wind; called once per step.
    """
    if not any(scene.wind):
        return []
    locations = layout.locations
    boxes = [part.extents for part in assembly.parts] + [thing.size for thing in scene.moving]
    rows = np.arange(layout.thing_rows.start, layout.thing_rows.stop, dtype=np.intp)
    wind = WindForce(
        PartLocations(
            np.concatenate([locations.row, rows]),
            np.concatenate([locations.offset, layout.thing_arms]),
        ),
        swap_all(np.array(boxes)),
        np.array(swap(scene.wind)),
        drag,
    )
    return [lambda rows: wind(np.array(rows), share) if (share := strength()) else []]


class LawForces:
    """The forces of several laws, and the power of those of devices."""

    def __init__(self, laws: Sequence[Law], locations: PartLocations) -> None:
        self.laws, self._locations = laws, locations
        self._before: Sequence[Row] = ()
        self._exerted: list[list[PartForce]] = []
        """Rows before the last step, and the forces of each law in it."""

    def __call__(self, rows: Sequence[Row]) -> list[list[PartForce]]:
        """The forces of each law in this step."""
        if self.laws:
            self._before, self._exerted = rows, [law(rows) for law in self.laws]
        return self._exerted

    def power(self, rows: Sequence[Row]) -> Power:
        """Mean power of springs, and of thrusters and winches, in the step that led to `rows`."""
        springs = motors = 0.0
        for law, forces in zip(self.laws, self._exerted, strict=False):
            if isinstance(law, SpringForce | ThrustForce | WinchForce) and forces:
                begin = power_of(forces, self._before, self._locations)
                end = power_of(forces, rows, self._locations)
                if isinstance(law, SpringForce):
                    springs += (begin + end) / 2
                else:
                    motors += (begin + end) / 2
        return Power(springs, motors)
