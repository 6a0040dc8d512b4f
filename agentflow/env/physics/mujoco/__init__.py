"""The MuJoCo engine."""

from agentflow.env.physics.engine import EngineSpec

MUJOCO = EngineSpec(
    "mujoco",
    ("mujoco-core", "mujoco"),
    "agentflow.env.physics.mujoco.engine:MuJoCoEngine",
)
