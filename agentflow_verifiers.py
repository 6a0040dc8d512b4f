"""Where verifiers finds agentflow's task set and its harness: the id `agentflow-verifiers`."""

from agentflow.integrations.verifiers import DesignTaskset, ReplyHarness

__all__ = ["DesignTaskset", "ReplyHarness"]
