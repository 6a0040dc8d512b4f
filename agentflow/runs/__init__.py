"""Run directories: written by one process at a time, readable by others at any moment."""

from agentflow.runs.reading import (
    SCHEMA,
    Event,
    State,
    find_runs,
    read_calls,
    read_document,
    read_events,
    state_of,
)
from agentflow.runs.result import RunResult, read_result
from agentflow.runs.writing import Listener, Notify, RunDirectory

__all__ = [
    "SCHEMA",
    "Event",
    "Listener",
    "Notify",
    "RunDirectory",
    "RunResult",
    "State",
    "find_runs",
    "read_calls",
    "read_document",
    "read_events",
    "read_result",
    "state_of",
]
