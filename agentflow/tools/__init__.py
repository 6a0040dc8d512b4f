"""The bench where agents work on a machine, and its tools; they know no transport and no engine."""

from agentflow.tools.bench import READING, Bench
from agentflow.tools.host import BenchHost, Shot, ViewDirection
from agentflow.tools.results import ToolResult, ToolSpec

__all__ = [
    "READING",
    "Bench",
    "BenchHost",
    "Shot",
    "ToolResult",
    "ToolSpec",
    "ViewDirection",
]
