"""URDF files as other libraries read them: links at some positions of the joints above them."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agentflow.env.rollout import Array
from tests.llm.foreign import foreign_python

READER = Path(__file__).with_name("read_urdf.py")


@dataclass(frozen=True)
class Link:
    """What a library knows of one link and the joint above it; world frame with z up."""

    mass: float
    inertia: tuple[float, float, float]
    centre: Array
    """Of mass."""
    rotation: Array
    """Quaternion x, y, z, w."""
    kind: str = ""
    """Of the joint; "" for the root."""
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)


def read_by_yourdfpy(file: Path, positions: Mapping[str, float]) -> dict[str, Link]:
    """Every link by name."""
    command = [str(foreign_python(".venv-urdf")), str(READER), str(file), json.dumps(positions)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={})
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, Any]] = json.loads(done.stdout)
    for link in found.values():
        link |= {key: np.array(link[key]) for key in ("centre", "rotation")}
    return {name: Link(**link) for name, link in found.items()}


def read_by_pybullet(file: Path, positions: Mapping[str, float]) -> dict[str, Link]:
    """Every link by name."""
    from agentflow.env.physics.pybullet.library import pybullet as b

    kinds = {b.JOINT_REVOLUTE: "revolute", b.JOINT_PRISMATIC: "prismatic", b.JOINT_FIXED: "fixed"}
    client = b.connect(b.DIRECT)
    body = b.loadURDF(str(file), flags=b.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
    try:
        joints = [b.getJointInfo(body, i, client) for i in range(b.getNumJoints(body, client))]
        for joint in joints:
            b.resetJointState(body, joint[0], positions.get(joint[12].decode(), 0.0), 0.0, client)

        def link(index: int, centre: Any, rotation: Any, *above: Any) -> Link:
            mass, _, inertia, *_ = b.getDynamicsInfo(body, index, client)
            return Link(mass, inertia, np.array(centre), np.array(rotation), *above)

        root = b.getBodyInfo(body, client)[0].decode()
        links = {root: link(-1, *b.getBasePositionAndOrientation(body, client))}
        for joint in joints:
            state = b.getLinkState(body, joint[0], False, True, client)
            kind = kinds[joint[2]]
            if kind == "revolute" and joint[8] > joint[9]:
                kind = "continuous"
            links[joint[12].decode()] = link(joint[0], state[0], state[1], kind, joint[13])
    finally:
        b.disconnect(client)
    return links
