"""The environment `agentflow-design` of verifiers: agentflow has it."""

from agentflow_verifiers import DesignTaskset, ReplyHarness, load_environment

__all__ = ["DesignTaskset", "ReplyHarness", "load_environment"]
