"""The PyBullet engine."""

from agentflow.env.physics.engine import EngineSpec

PYBULLET = EngineSpec(
    "pybullet",
    ("pybullet",),
    "agentflow.env.physics.pybullet.engine:PyBulletEngine",
    most_parts=128,  # a root and 127 links; it truncates larger bodies without an error
)
