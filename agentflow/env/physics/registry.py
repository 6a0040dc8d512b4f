"""The registry of physics engines. Importing it loads no engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agentflow.registry import Registry, instance_of

if TYPE_CHECKING:
    from agentflow.env.physics.engine import EngineSpec

ENGINES: Registry[EngineSpec] = Registry(
    "physics engine",
    "agentflow.engines",
    {
        "pybullet": "agentflow.env.physics.pybullet:PYBULLET",
        "mujoco": "agentflow.env.physics.mujoco:MUJOCO",
    },
    instance_of("agentflow.env.physics.engine:EngineSpec"),
)
"""All engines, the preferred one first."""
