"""Statics of a machine as text for models: balance, what joints carry, bending, thrust."""

from collections.abc import Iterable, Iterator

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.description.geometry_info import ranges
from agentflow.machine.geometry.balance import centre_of_mass, mass, stands, support_polygon
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.geometry.statics import GRAVITY, Load, thrust, tree_loads
from agentflow.machine.geometry.vectors import Vec3, cross, dot, length, scale, subtract
from agentflow.machine.tree import Machine

BENDING, MOST_BENT = 250.0, 3
"""Least moment of gravity at a connection that is reported, N m (5 % of what wood bears), and how
many connections are reported at most."""
LEGEND = (
    "Joints, ignoring springs and motors; loose blocks count with their parent. '8 to y+': block 8 "
    "first moves that way. Angles are measured from the machine as built."
)
AROUND = 360.0
"""degrees."""
ON_AXIS = 0.05
"""m from a joint's axis within which turning hardly moves the middle of a block."""


def statics_text(machine: Machine, brief: Brief | None = None) -> str:
    """Lines about a file-valid machine as built: balance, every joint that turns more than its
    own block, the connections that gravity bends most, thrust.

    Args:
        machine: The machine.
        brief: Its task, for what machines rest on; None: flat ground.
    """
    geometry = place(machine, brief.banks if brief else ())
    loads = list(tree_loads(geometry))
    joints = [load for load in loads if load.bond.kind == "revolute" and len(load.blocks) > 1]
    lines = [_balance_line(geometry)]
    lines += [LEGEND] if joints else []
    lines += [_joint_line(geometry, load) for load in joints]
    return "\n".join([*lines, *_bending_lines(loads), *_thrust_lines(geometry)])


def _balance_line(geometry: Geometry) -> str:
    x, y, z = centre_of_mass(geometry)
    height = y - geometry.box_min[1]
    margin = abs(_margin((x, z), support_polygon(geometry)))
    side = "inside" if stands(geometry) else "OUTSIDE"
    where = f"({_three(x)},{_three(height)},{_three(z)})"
    return f"Centre of mass {where}, {_three(margin)} m {side} the edge of the support polygon."


def _margin(point: tuple[float, float], polygon: tuple[tuple[float, float], ...]) -> float:
    """Distance of a point from the nearest edge."""
    edges = zip(polygon, [*polygon[1:], polygon[0]], strict=True)
    return min(_from_edge(point, start, end) for start, end in edges)


def _from_edge(
    point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]
) -> float:
    p, a, b = ((x, 0.0, z) for x, z in (point, start, end))
    along, arm = subtract(b, a), subtract(p, a)
    square = dot(along, along)
    share = min(1.0, max(0.0, dot(arm, along) / square)) if square else 0.0
    return length(subtract(arm, scale(along, share)))


def _joint_line(geometry: Geometry, load: Load) -> str:
    placed = geometry[load.bond.block]
    carried = ranges(sorted(load.blocks - {placed.id}))
    parts = [
        f"{placed.id} {placed.name} carries {carried}: {load.mass:.2f} kg including itself, "
        f"inertia {_three(load.inertia)} kg m2 about its axis, reach {_three(load.reach)} m "
        f"({load.farthest})"
    ]
    parts.append("partly on the ground" if load.standing else _gravity_text(geometry, load))
    return "; ".join([*parts, *_collisions(geometry, load)]) + "."


def _gravity_text(geometry: Geometry, load: Load) -> str:
    """The moment of gravity about a joint's axis as built, and the greatest while it turns."""
    now, most = load.turning, load.most_turning
    if most < 5e-4:
        return "gravity does not turn it"
    towards = f", {_motion(geometry, load, 1 if now > 0 else -1)}" if abs(now) > 5e-4 else ""
    return f"gravity {_three(abs(now))} N m{towards}, at most {most:.0f} while it turns"


def _collisions(geometry: Geometry, load: Load) -> Iterator[str]:
    """How far the joint can turn: as its motor turns it, or both ways."""
    from agentflow.machine.geometry.sweeps import first_collision  # numpy, which few prompts need

    kind = library()[geometry[load.bond.block].type]
    joint = kind.joint
    reverse = kind.powered_wheel and geometry[load.bond.block].facing == "x-"
    senses = (joint.motor_sense * (-1 if reverse else 1),) if kind.non_static else (1, -1)
    low, high = joint.stops_deg or (-AROUND, AROUND)
    end = "" if joint.stops_deg is None else f" to {high:g} degrees"
    found = [
        first_collision(geometry, load, sense, high if sense > 0 else -low) for sense in senses
    ]
    if not kind.non_static and found == [None, None]:
        yield f"free both ways{end}"
        return
    for sense, met in zip(senses, found, strict=True):
        how = "motor, " * kind.non_static + _motion(geometry, load, sense)
        if met is None:
            yield f"{how}: free{end}"
        else:
            other = "the ground" if met.other is None else str(met.other)
            yield f"{how}: {met.block} meets {other} after {met.angle:.1f} degrees"


def _motion(geometry: Geometry, load: Load, sense: int) -> str:
    """Where the block that is farthest from the axis first moves when the joint turns: "12 to y+";
    whatever is on the axis only turns."""
    arms = {block: subtract(geometry[block].center, load.bond.pivot) for block in load.blocks}
    moved = {block: cross(load.bond.axis, arm) for block, arm in arms.items()}
    block = max(sorted(moved), key=lambda each: round(length(moved[each]), 3))
    if length(moved[block]) < ON_AXIS:
        return "one way" if sense > 0 else "the other way"
    x, y, z = scale(moved[block], sense)
    _, axis, part = max((abs(x), "x", x), (abs(y), "y", y), (abs(z), "z", z))
    return f"{block} to {axis}{'+' if part > 0 else '-'}"


def _bending_lines(loads: Iterable[Load]) -> list[str]:
    bent = [(length(load.gravity), load) for load in loads if not load.standing]
    worst = sorted(bent, key=lambda item: -item[0])[:MOST_BENT]
    told = [
        f"{load.bond.block} on {load.bond.a // 2} by {moment:.0f} N m ({load.mass:.2f} kg)"
        for moment, load in worst
        if moment >= BENDING
    ]
    return [f"Greatest bending by gravity: {', '.join(told)}."] if told else []


def _thrust_lines(geometry: Geometry) -> list[str]:
    force, moment = thrust(geometry)
    if not length(force):
        return []
    weight = GRAVITY * mass(geometry)
    return [
        f"Thrust {_vector(force)} N, weight {weight:.0f} N; the thrust's moment about the centre "
        f"of mass is {_vector(moment)} N m, so its line passes "
        f"{_three(length(moment) / length(force))} m from it."
    ]


def _vector(values: Vec3) -> str:
    return f"({','.join(f'{value + 0.0:.0f}' for value in values)})"


def _three(value: float) -> str:
    return f"{value:.3f}"
