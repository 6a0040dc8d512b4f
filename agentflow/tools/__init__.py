"""The bench where agents work on a machine, and its tools; they know no transport and no engine."""

from agentflow.tools.bench import Bench
from agentflow.tools.results import ToolResult, ToolSpec
from agentflow.tools.world import Simulation, View, World

__all__ = ["Bench", "Simulation", "ToolResult", "ToolSpec", "View", "World"]
