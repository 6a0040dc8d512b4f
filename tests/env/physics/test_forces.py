"""Drag and wind summed per cluster agree with the sum over parts."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.laws.air import DragForce, WindForce
from agentflow.env.physics.laws.forces import PartLocations, Wrench
from agentflow.env.physics.model import Part
from agentflow.env.physics.structure.layout import drag_locations
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.rollout import Array
from agentflow.env.rotations import matrices
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import BALLASTED, CAR
from tests.env.physics.rig import RATE, Rig

DRAGS = [(0.2, 0.1), (0.0, 0.05), (0.5, 0.3), (0.2, 0.2), (0.2, 0.0)]
ROW = np.array([0, 0, 1, 0, 2])
PARTS = [
    Part(i, (0, 0, 0), 1.0 + i, (0, 0, 0), (), linear_drag=linear, angular_drag=angular)
    for i, (linear, angular) in enumerate(DRAGS)
]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def rows_of(rng: np.random.Generator, count: int) -> Array:
    rows = rng.normal(size=(count, 13))
    rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1)[:, None]
    return rows


def in_world(wrenches: list[Wrench], rows: Array) -> Array:
    total = np.zeros((len(rows), 6))
    rotation = matrices(rows[:, 3:7])
    for row, local, force, torque in wrenches:
        turned = rotation[row] if local else np.eye(3)
        total[row] += [*(turned @ force), *(turned @ (torque or (0.0, 0.0, 0.0)))]
    return total


def test_clusters_feel_the_drag_of_their_parts(rng: np.random.Generator) -> None:
    offset, inertia = rng.normal(size=(5, 3)), rng.uniform(0.1, 1.0, size=(5, 3))
    offset[[2, 4]] = 0.0
    inertia[2] = 0.7
    rows = rows_of(rng, 3)
    wrenches = DragForce(PARTS, PartLocations(ROW, offset), inertia)(
        [tuple(row) for row in rows.tolist()]
    )
    assert {row: local for row, local, _, _ in wrenches} == {0: True, 1: False, 2: False}
    expected = np.zeros((3, 6))
    for i, part in enumerate(PARTS):
        turned = matrices(rows[:, 3:7])[ROW[i]]
        arm, spin = turned @ offset[i], rows[ROW[i], 10:13]
        force = -part.mass * part.linear_drag * (rows[ROW[i], 7:10] + np.cross(spin, arm))
        torque = np.cross(arm, force)
        torque -= part.angular_drag * turned @ (inertia[i] * (turned.T @ spin))
        expected[ROW[i]] += [*force, *torque]
    assert in_world(wrenches, rows) == pytest.approx(expected)


def test_every_part_feels_the_wind(rng: np.random.Generator) -> None:
    offset, extents = rng.normal(size=(5, 3)), rng.uniform(0.5, 3.0, size=(5, 3))
    wind, rows = np.array([1.0, -3.0, 6.0]), rows_of(rng, 3)
    pushes = WindForce(PartLocations(ROW, offset), extents, wind, 0.6)(rows)
    assert [part for part, _, _ in pushes] == list(range(5))
    for i, push, at in pushes:
        turned = matrices(rows[:, 3:7])[ROW[i]]
        arm = turned @ offset[i]
        air = wind - rows[ROW[i], 7:10] - np.cross(rows[ROW[i], 10:13], arm)
        x, y, z = extents[i]
        area = np.dot([y * z, x * z, x * y], np.abs(turned.T @ wind)) / np.linalg.norm(wind)
        assert push == pytest.approx(0.6 * area * np.linalg.norm(wind) * air)
        assert at == pytest.approx(rows[ROW[i], :3] + arm)


@pytest.mark.parametrize(("tree", "level"), [(CAR, 1.0), (BALLASTED, 0.0)], ids=["wheels", "arm"])
def test_what_falls_loses_what_the_drag_of_its_parts_takes(
    tree: Machine, level: float, make_engine: MakeEngine
) -> None:
    """Of every part, also of wheels, whose drag acts where their axles are."""
    engine = make_engine()
    rig = Rig(engine, tree, anchored=False)
    rig.world.switch("motors", level)
    rig.run(0.5)
    parts = rig.assembly.parts
    before, velocity = rig.world.momentum()["linear"], rig.world.state().velocity
    rig.world.step()
    weight = 32.81 * sum(part.mass for part in parts)
    drag = [part.mass * part.linear_drag * velocity[part.block] for part in parts]
    change = (rig.world.momentum()["linear"] - before) * RATE
    assert change == pytest.approx([0.0, -weight, 0.0] - np.sum(drag, axis=0), rel=1e-3, abs=0.05)
    assert abs(np.sum(drag, axis=0)[1]) > 10.0


def test_the_drag_of_wheels_acts_on_what_holds_their_axles() -> None:
    assembly = assemble(CAR, place(CAR), constants())
    plan = skeleton(len(assembly.parts), assembly.joints)
    own = PartLocations(np.array(plan.cluster), np.zeros((len(assembly.parts), 3)))
    wheels = [i for i, part in enumerate(assembly.parts) if plan.cluster[i] == i and i]
    held = drag_locations(assembly, plan, own)
    assert len(wheels) == 4
    assert held.row[wheels].tolist() == [0] * 4
    assert [held.offset[i].tolist() for i in range(len(assembly.parts)) if i not in wheels] == [
        [0.0] * 3
    ] * (len(assembly.parts) - 4)
