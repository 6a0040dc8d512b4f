"""Rollouts as JSON data and as .npz files."""

import json
import zlib
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_jsonable_python

from agentflow.env.measurements import Measured
from agentflow.env.rollout import Broken, Feedback, Marginal, Rollout, RolloutEvent, Trace
from agentflow.errors import UsageError
from agentflow.files.faults import tell_fault
from agentflow.machine.requirements import Judged

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
STORED = {
    "objects": "things",
    "object_position": "thing_position",
    "object_rotation": "thing_rotation",
    "object_velocity": "thing_velocity",
}
"""Field of a trace -> its name in files, where it differs: recorded runs hold such files."""
FIELDS = {stored: name for name, stored in STORED.items()}


def rollout_json(rollout: Rollout) -> dict[str, Any]:
    """A rollout as JSON data; the problems of an invalid machine take the place of feedback."""
    judged = [item.to_json() for item in rollout.requirements]
    return {
        "status": rollout.status,
        "score": rollout.score,
        "terms": dict(rollout.terms),
        "problems": [dict(problem) for problem in rollout.problems],
        "broken": to_jsonable_python(rollout.broken),
        "marginal": to_jsonable_python(rollout.marginal),
        "events": to_jsonable_python(rollout.events),
        "feedback": None if rollout.status == "invalid" else rollout.feedback.text,
        "digest": rollout.digest,
        "sim_seconds": rollout.sim_seconds,
        "wall_seconds": rollout.wall_seconds,
        "constants": rollout.constants,
        "engine": rollout.engine,
        **({"requirements": judged} if judged else {}),
    }


def save_npz(rollout: Rollout, path: Path) -> None:
    """Write a rollout to a file; see `write_npz`.

    Raises:
        OSError: The file cannot be written.
    """
    with path.open("wb") as file:
        write_npz(rollout, file)


def write_npz(rollout: Rollout, file: BinaryIO) -> None:
    """Write a rollout: `states`, a record per sample whose fields are the trace's arrays, and
    `result`, the rest as JSON text.

    One array of records, not compressed: twelve compressed arrays took three times as long to write
    and twice as long to read, for files a quarter smaller.
    """
    arrays: dict[str, Any] = {}
    result = rollout_json(rollout) | {"feedback_data": rollout.feedback.data}
    if (trace := rollout.trace) is not None:
        stored = {STORED.get(name, name): value for name, value in vars(trace).items()}
        fields = {name: value for name, value in stored.items() if isinstance(value, np.ndarray)}
        columns = [(name, value.dtype, value.shape[1:]) for name, value in fields.items()]
        states = np.empty(len(trace.times), columns)
        for name, value in fields.items():
            states[name] = value
        arrays["states"] = states
        named = {name: value for name, value in stored.items() if name not in fields}
        result["trace"] = named | {"measured": asdict(trace.measured)}
    np.savez(file, result=np.array(json.dumps(result).encode()), **arrays)


def load_npz(path: Path) -> Rollout:
    """Read what `save_npz` wrote.

    Raises:
        UsageError: The file does not exist or is not a saved rollout.
    """
    try:
        with path.open("rb") as file:
            return read_npz(file)
    except UNREADABLE as error:
        raise UsageError(f"{path} is not a saved rollout: {error}") from None


def read_npz(file: BinaryIO) -> Rollout:
    """Read what `write_npz` wrote; raises one of `UNREADABLE` if it is something else."""
    with np.load(file) as content:
        result = json.loads(content["result"].item())
        states = content["states"] if result.get("trace") else None
    return _restored(result, states)


def _restored(result: dict[str, Any], states: NDArray[Any] | None) -> Rollout:
    for field in fields(Rollout):
        # old files lack engine and marginal, and those without requirements have none
        optional = "trace", "scene", "machine", "requirements", "engine", "marginal"
        if field.name not in (*result, *optional):
            raise KeyError(field.name)
    trace = None
    if states is not None:
        named = result.pop("trace")
        names = states.dtype.names or ()
        unknown = np.full((len(states), len(named["linear"])), np.nan)
        since = {"regular": np.ones(len(states), dtype=bool), "pull": unknown, "work": unknown}
        older = {name: value for name, value in since.items() if name not in names}
        trace = Trace(
            **{FIELDS.get(name, name): np.ascontiguousarray(states[name]) for name in names},
            linear=tuple(named["linear"]),
            connections=tuple((block, partner) for block, partner in named["connections"]),
            objects=tuple(named[STORED["objects"]]),
            measured=_read(Measured, named.get("measured") or {}),
            **older,
        )
    feedback = Feedback(result.pop("feedback"), result.pop("feedback_data"))
    result["requirements"] = tuple(map(Judged.from_json, result.get("requirements", ())))
    result["problems"] = tuple(result["problems"])
    result["broken"] = _read(tuple[Broken, ...], result["broken"])
    result["marginal"] = _read(tuple[Marginal, ...], result.get("marginal") or ())
    result["events"] = _read(tuple[RolloutEvent, ...], result["events"])
    return Rollout(**result, trace=trace, feedback=feedback)


def _read(kind: Any, found: Any) -> Any:
    """An object of this kind from JSON data; fields that older files lack have their defaults."""
    try:
        return _reader(kind).validate_python(found)
    except ValidationError as error:
        raise ValueError(tell_fault(error, "the list")) from None


@cache
def _reader(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
