"""From blocks to bodies: the parts, joints and devices of a machine, for any engine."""

from agentflow.env.physics.assembly.assemble import assemble

__all__ = ["assemble"]
