"""Rollouts as JSON data and as .npz files."""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, fields
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from agentflow.env.rollout import Broken, Feedback, Marginal, Rollout, RolloutEvent, Trace
from agentflow.errors import UsageError

UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    RuntimeError,
    SyntaxError,
    MemoryError,
    BadZipFile,
    TokenError,
    zlib.error,
)
"""Errors from files that are empty, truncated, damaged or in another format."""


def rollout_json(rollout: Rollout) -> dict[str, Any]:
    """A rollout as JSON data; the problems of an invalid machine take the place of feedback."""
    return {
        "status": rollout.status,
        "score": rollout.score,
        "terms": dict(rollout.terms),
        "problems": [dict(problem) for problem in rollout.problems],
        "broken": [asdict(item) for item in rollout.broken],
        "marginal": [asdict(item) for item in rollout.marginal],
        "events": [asdict(item) | {"blocks": list(item.blocks)} for item in rollout.events],
        "feedback": None if rollout.status == "invalid" else rollout.feedback.text,
        "digest": rollout.digest,
        "sim_seconds": rollout.sim_seconds,
        "wall_seconds": rollout.wall_seconds,
        "constants": rollout.constants,
        "engine": rollout.engine,
    }


def save_npz(rollout: Rollout, path: Path) -> None:
    """Write a rollout: `states`, a record per sample whose fields are the trace's arrays, and
    `result`, the rest as JSON text.

    One array of records, not compressed: twelve compressed arrays took three times as long to write
    and twice as long to read, for files a quarter smaller.

    Raises:
        OSError: The file cannot be written.
    """
    arrays: dict[str, Any] = {}
    result = rollout_json(rollout) | {"feedback_data": rollout.feedback.data}
    if (trace := rollout.trace) is not None:
        fields = {
            name: value for name, value in vars(trace).items() if isinstance(value, np.ndarray)
        }
        columns = [(name, value.dtype, value.shape[1:]) for name, value in fields.items()]
        states = np.empty(len(trace.times), columns)
        for name, value in fields.items():
            states[name] = value
        arrays["states"] = states
        result["trace"] = {name: value for name, value in vars(trace).items() if name not in fields}
    with path.open("wb") as file:
        np.savez(file, result=np.array(json.dumps(result).encode()), **arrays)


def load_npz(path: Path) -> Rollout:
    """Read what `save_npz` wrote.

    Raises:
        UsageError: The file does not exist or is not a saved rollout.
    """
    try:
        with path.open("rb") as raw, np.load(raw) as file:
            result = json.loads(file["result"].item())
            states = file["states"] if result.get("trace") else None
        return _restored(result, states)
    except UNREADABLE as error:
        raise UsageError(f"{path} is not a saved rollout: {error}") from None


def _restored(result: dict[str, Any], states: NDArray[Any] | None) -> Rollout:
    for field in fields(Rollout):
        optional = "trace", "scene", "engine", "marginal"  # old files lack the last two
        if field.name not in (*result, *optional):
            raise KeyError(field.name)
    trace = None
    if states is not None:
        named = result.pop("trace")
        trace = Trace(
            **{name: np.ascontiguousarray(states[name]) for name in states.dtype.names or ()},
            linear=tuple(named["linear"]),
            connections=tuple((block, partner) for block, partner in named["connections"]),
            things=tuple(named["things"]),
        )
    feedback = Feedback(result.pop("feedback"), result.pop("feedback_data"))
    result["problems"] = tuple(result["problems"])
    result["broken"] = tuple(Broken(**item) for item in result["broken"])
    result["marginal"] = tuple(Marginal(**item) for item in result.get("marginal") or ())
    result["events"] = tuple(
        RolloutEvent(**(item | {"blocks": tuple(item["blocks"])})) for item in result["events"]
    )
    return Rollout(**result, trace=trace, feedback=feedback)
