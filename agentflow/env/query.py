"""Answers to queries about single blocks of a rollout: tables, or the reason for having none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback import block_name, number
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.machine.tree import Machine

MAX_QUERIES = 12
PROPERTIES = {
    "position": "position (x, y, z) m",
    "rotation": "rotation (x, y, z, w)",
    "velocity": "velocity (x, y, z) m/s",
    "length": "length m",
}
"""Properties and their column headings. Position is the block's building point."""
EPSILON = 1e-6


@dataclass(frozen=True)
class Answers:
    """Answers to the queries of one call, in order, as text and as data."""

    text: str
    data: list[dict[str, Any]]


@dataclass(frozen=True)
class _Query:
    """A valid query."""

    block: int
    start: float
    end: float
    properties: tuple[str, ...]


class _InvalidQuery(Exception):
    """Reason why a query cannot be answered."""


def answer_queries(
    machine: Machine, rollout: Rollout, queries: Sequence[object], interval: float | None = None
) -> Answers:
    """Answer queries about a rollout.

    Args:
        machine: The simulated machine.
        rollout: Its rollout.
        queries: Items like {"id": 3, "duration": [0, 1], "properties": ["position"]}, as a model
            wrote them; invalid items are answered with what is wrong.
        interval: Seconds between rows; the constants' by default. Rollouts with coarser samples
            are told sample by sample.
    """
    step = constants()["sample_interval"] if interval is None else interval
    texts, data = [], []
    for index, item in enumerate(queries):
        try:
            if index >= MAX_QUERIES:
                raise _InvalidQuery(f"only the first {MAX_QUERIES} queries of a call are answered")
            text, answered = _answer(machine, rollout, _read(machine, item), step)
        except _InvalidQuery as refusal:
            text = f"Query {index + 1}: no answer: {refusal}"
            answered = {"query": item, "problem": str(refusal)}
        texts.append(text)
        data.append(answered)
    return Answers("\n\n".join(texts), data)


def _read(machine: Machine, item: object) -> _Query:
    if not isinstance(item, Mapping):
        raise _InvalidQuery('a query is an object with "id", "duration" and "properties"')
    for key in ("id", "duration", "properties"):
        if key not in item:
            raise _InvalidQuery(f'"{key}" is missing')
    start, end = _read_duration(item["duration"])
    block = _read_block(machine, item["id"])
    return _Query(block, start, end, _read_properties(machine, block, item["properties"]))


def _number(value: object) -> float | None:
    """Read a finite number, which may be written as a string."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        result = float(value)
    except ValueError:
        return None
    return result if isfinite(result) else None


def _read_block(machine: Machine, value: object) -> int:
    block = _number(value)
    if block is None or block != int(block):
        raise _InvalidQuery(f'"id" must be a block id, not {value!r}')
    if not 0 <= block < len(machine):
        raise _InvalidQuery(f"there is no block {int(block)}; ids go from 0 to {len(machine) - 1}")
    return int(block)


def _read_duration(value: object) -> tuple[float, float]:
    pair = [_number(part) for part in value] if isinstance(value, list | tuple) else []
    if len(pair) != 2 or pair[0] is None or pair[1] is None:
        raise _InvalidQuery(f'"duration" must be [from, to] in seconds, not {value!r}')
    if pair[0] > pair[1]:
        raise _InvalidQuery(f"the interval {pair[0]:g} to {pair[1]:g} s is empty")
    return pair[0], pair[1]


def _read_properties(machine: Machine, block: int, value: object) -> tuple[str, ...]:
    names = [value] if isinstance(value, str) else value
    known = ", ".join(PROPERTIES)
    if not isinstance(names, list | tuple) or not names:
        raise _InvalidQuery(f'"properties" must list some of {known}')
    for name in names:
        if not isinstance(name, str) or name not in PROPERTIES:
            raise _InvalidQuery(f"unknown property {name!r}; known: {known}")
    if "length" in names and not machine[block].two_ended:
        raise _InvalidQuery(
            f"{block_name(machine, block)} has no length; only two-ended blocks have one"
        )
    return tuple(dict.fromkeys(names))


def _answer(
    machine: Machine, rollout: Rollout, query: _Query, step: float
) -> tuple[str, dict[str, Any]]:
    trace = rollout.trace
    if trace is None:
        raise _InvalidQuery(
            f"nothing was recorded because the rollout ended with status {rollout.status}"
        )
    times = trace.times
    title = "B" + block_name(machine, query.block)[1:]
    broke = _breakage_time(machine, rollout, query)
    if broke < 0.0:
        raise _InvalidQuery(
            f"{title} broke off at {number(broke)} s, while the machine settled; states before "
            "t = 0 are not recorded"
        )
    inside = (times >= query.start - EPSILON) & (times <= query.end + EPSILON)
    inside &= _on_grid(times, step)
    if not inside.any():
        last = float(times[-1])
        raise _InvalidQuery(
            f"no sample lies between {query.start:g} and {query.end:g} s; samples go from 0 to "
            f"{last:g} s, one every {step:g} s"
        )
    kept = np.flatnonzero(inside & (times < broke))
    columns = {name: _column(trace, query.block, name)[kept] for name in query.properties}
    lines = [f"{title}, {query.start:g} to {query.end:g} s:", *_table(times[kept], columns)]
    if isfinite(broke):
        lines.append(f"{title} broke off at {number(broke)} s; its table ends there.")
    data = {
        "id": query.block,
        "type": machine[query.block].type,
        "duration": [query.start, query.end],
        "times": times[kept].tolist(),
        **{name: values.tolist() for name, values in columns.items()},
        "broke": broke if isfinite(broke) else None,
    }
    return "\n".join(lines), data


def _on_grid(times: Array, step: float) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Mask of the samples at multiples of a step, s; all samples if they are coarser."""
    if len(times) > 1 and times[1] - times[0] > step - EPSILON:
        return np.ones(len(times), dtype=bool)
    off = np.abs(times / step - np.round(times / step))
    grid: np.ndarray[Any, np.dtype[np.bool_]] = off < EPSILON
    return grid


def _breakage_time(machine: Machine, rollout: Rollout, query: _Query) -> float:
    """Time at which the block broke off; infinite if it did not before the query's end."""
    block, parents = query.block, machine[query.block].parents
    times = [b.time for b in rollout.broken if b.block == block and b.partner in parents]
    return min((time for time in times if time <= query.end), default=inf)


def _column(trace: Trace, block: int, name: str) -> Array:
    """Values of one property of a block, (T, K)."""
    if name == "length":
        return trace.length[:, trace.linear.index(block)][:, None]
    column: Array = getattr(trace, name)[:, block]
    return column


def _table(times: Array, columns: Mapping[str, Array]) -> list[str]:
    """Rows by time; what stays the same to the shown digits is told once, above them."""
    digits = 1 if np.allclose(times, np.round(times, 1), atol=EPSILON) else 3
    cells = {name: [", ".join(map(number, row)) for row in rows] for name, rows in columns.items()}
    fixed = [name for name, column in cells.items() if len(column) > 1 and len(set(column)) == 1]
    shown = [name for name in columns if name not in fixed]
    lines = [f"{PROPERTIES[name]}: {cells[name][0]} throughout" for name in fixed]
    if not shown:
        return lines
    lines.append(" | ".join(["t s", *(PROPERTIES[name] for name in shown)]))
    for row, time in enumerate(times):
        lines.append(" | ".join([f"{time:.{digits}f}", *(cells[name][row] for name in shown)]))
    return lines
