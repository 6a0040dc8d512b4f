"""Drag and wind summed per cluster agree with the sum over parts."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.engines.base import Part
from agentflow.env.engines.forces import Members, Resistance
from agentflow.env.engines.kinematics import matrices, turn


def test_clusters_feel_the_sum_of_their_parts() -> None:
    rng = np.random.default_rng(5)
    drags = [(0.2, 0.1), (0.0, 0.05), (0.5, 0.0), (0.2, 0.2)]
    parts = [
        Part(i, (0, 0, 0), 1.0 + i, (0, 0, 0), (), linear_drag=a, angular_drag=b)
        for i, (a, b) in enumerate(drags)
    ]
    row = np.array([0, 0, 1, 0])
    offset = rng.normal(size=(4, 3))
    inertia = rng.uniform(0.1, 1.0, size=(4, 3))
    extents = rng.uniform(0.5, 3.0, size=(4, 3))
    wind = np.array([1.0, -3.0, 6.0])
    rows = rng.normal(size=(2, 13))
    rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1)[:, None]
    law = Resistance(parts, Members(row, offset), 2, inertia, extents, wind, 0.6)
    found = law(rows)
    rotation = matrices(rows[:, 3:7])
    expected = np.zeros((2, 6))
    for i, part in enumerate(parts):
        r = row[i]
        turned = rotation[r]
        arm, spin = turned @ offset[i], rows[r, 10:13]
        velocity = rows[r, 7:10] + np.cross(spin, arm)
        air = turned.T @ (wind - velocity)
        x, y, z = extents[i]
        area = np.dot([y * z, x * z, x * y], np.abs(air)) / np.linalg.norm(air)
        force = -part.mass * part.linear_drag * velocity
        force += 0.6 * area * np.linalg.norm(air) * (wind - velocity)
        torque = np.cross(arm, force)
        torque -= part.angular_drag * turned @ (inertia[i] * (turned.T @ spin))
        expected[r] += [*force, *torque]
    assert law.rows == [0, 1]
    assert turn(rotation, found[:, :3]) == pytest.approx(expected[:, :3])
    assert turn(rotation, found[:, 3:]) == pytest.approx(expected[:, 3:])
