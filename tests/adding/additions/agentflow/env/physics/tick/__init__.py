"""The default engine under another name."""

from dataclasses import replace

from agentflow.env.physics.engines import default_engine

TICK = replace(
    default_engine(), name="tick", factory="agentflow.env.physics.tick.engine:TickEngine"
)
