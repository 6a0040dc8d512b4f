"""Owns rollouts outside memory: the JSON result of spec 2.6, and .npz files."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

import numpy as np

from agentflow.env.trace import Broken, Event, Feedback, Rollout, Trace
from agentflow.errors import UsageError

UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    BadZipFile,
    zlib.error,
)
"""What reading a file that is empty, cut short, damaged or none of ours raises."""


def rollout_json(rollout: Rollout) -> dict[str, Any]:
    """A rollout as JSON data with exactly the keys of spec 2.6; null what was not simulated."""
    simulated = rollout.status != "invalid"
    return {
        "status": rollout.status,
        "score": rollout.score,
        "terms": dict(rollout.terms) if simulated else None,
        "problems": [dict(problem) for problem in rollout.problems],
        "broken": [asdict(item) for item in rollout.broken] if simulated else None,
        "events": (
            [asdict(item) | {"blocks": list(item.blocks)} for item in rollout.events]
            if simulated
            else None
        ),
        "feedback": rollout.feedback.text if simulated else None,
        "digest": rollout.digest,
        "sim_seconds": rollout.sim_seconds,
        "wall_seconds": rollout.wall_seconds,
        "constants": rollout.constants,
    }


def save_npz(rollout: Rollout, path: Path) -> None:
    """Write a rollout: the trace's arrays by name, the rest as JSON text under `result`.

    Raises:
        OSError: The file cannot be written.
    """
    arrays: dict[str, Any] = {}
    result = rollout_json(rollout) | {"feedback_data": rollout.feedback.data}
    if rollout.trace is not None:
        trace = vars(rollout.trace)
        arrays = {name: value for name, value in trace.items() if isinstance(value, np.ndarray)}
        result["trace"] = {name: value for name, value in trace.items() if name not in arrays}
    with path.open("wb") as file:
        _write(file, {"result": np.array(json.dumps(result)), **arrays})


def _write(file: BinaryIO, arrays: Mapping[str, Any]) -> None:
    """As `numpy.savez_compressed`, in half the time: states hardly get smaller at higher levels."""
    with ZipFile(file, "w", ZIP_DEFLATED, compresslevel=1) as archive:
        for name, value in arrays.items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, value, allow_pickle=False)


def load_npz(path: Path) -> Rollout:
    """Read what `save_npz` wrote.

    Raises:
        UsageError: The file is not there or is none of ours.
    """
    try:
        with path.open("rb") as raw, np.load(raw) as file:
            result = json.loads(str(file["result"]))
            arrays = {name: file[name] for name in file.files if name != "result"}
        return _restored(result, arrays)
    except UNREADABLE as error:
        raise UsageError(f"{path} is no saved rollout: {error}") from None


def _restored(result: dict[str, Any], arrays: Mapping[str, Any]) -> Rollout:
    """The rollout of these parts; what is missing or is something else raises one of UNREADABLE."""
    named = result.pop("trace", None)
    trace = None
    if named is not None:
        trace = Trace(
            **arrays,
            linear=tuple(named["linear"]),
            connections=tuple((block, partner) for block, partner in named["connections"]),
            things=tuple(named["things"]),
        )
    feedback = Feedback(result.pop("feedback"), result.pop("feedback_data"))
    result["problems"] = tuple(result["problems"])
    result["broken"] = tuple(Broken(**item) for item in result["broken"])
    result["events"] = tuple(
        Event(**(item | {"blocks": tuple(item["blocks"])})) for item in result["events"]
    )
    return Rollout(**result, trace=trace, feedback=feedback)
