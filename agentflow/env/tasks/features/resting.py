"""Where a machine starts, and where objects are set down on it."""

from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine


def highest_point_under(machine: Machine, x: float, z: float, reach: float) -> float:
    """Height of the highest point of a machine on the ground within a horizontal square, m.

    Args:
        machine: The machine; the centre of its bounding box is over x = z = 0.
        x: x of the square's middle, m.
        z: z of the square's middle, m.
        reach: Half of the square's side, m.
    """
    geometry = place(machine)
    low, high = geometry.box_min, geometry.box_max
    middle_x, middle_z = (low[0] + high[0]) / 2 + x, (low[2] + high[2]) / 2 + z
    tops = [
        block.box_max[1] - low[1]
        for block in geometry.blocks
        if not block.two_ended
        and block.box_min[0] < middle_x + reach
        and block.box_max[0] > middle_x - reach
        and block.box_min[2] < middle_z + reach
        and block.box_max[2] > middle_z - reach
    ]
    return max(tops, default=0.0)


def start_of_root(machine: Machine) -> tuple[float, float]:
    """x and z of the Starting Block's centre before t = 0, m."""
    geometry = place(machine)
    low, high, (x, _, z) = geometry.box_min, geometry.box_max, geometry[0].center
    return x - (low[0] + high[0]) / 2, z - (low[2] + high[2]) / 2
