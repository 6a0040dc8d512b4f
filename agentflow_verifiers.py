"""Where verifiers finds the task set `agentflow-verifiers` and its harness."""

from agentflow.integrations.verifiers.harness import ReplyHarness
from agentflow.integrations.verifiers.tasks import DesignTaskset, load_environment

__all__ = ["DesignTaskset", "ReplyHarness", "load_environment"]
