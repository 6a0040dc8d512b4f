"""Answers to queries about blocks and objects of a rollout: tables, or why there are none."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from operator import attrgetter
from typing import Any

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback.text import body_name, number, spacing
from agentflow.env.properties import PROPERTIES
from agentflow.env.rollout import Array, Flags, Indices, Rollout, Trace
from agentflow.env.scene import Body
from agentflow.machine.tree import Machine

MAX_QUERIES = 12
CONTROLLERS = "controllers"
"""Key of what controllers read and gave in the data of feedback, and their id in queries."""
STEP = 1 / 120
"""Shortest time between samples, s."""
CONNECTIONS, LOAD = "connections", "load"
"""Id in queries of all connections, and the property that they have."""
MAX_ROWS = 30
"""Most rows of a table; longer intervals are shown without the samples between regular ones."""
MOST_ROWS = 240
"""Most rows of a table whose interval between rows was asked for."""
EPSILON = 1e-6


@dataclass(frozen=True)
class Answers:
    """Answers to the queries of one call, in order, as text and as data."""

    text: str
    data: list[dict[str, Any]]


@dataclass(frozen=True)
class _Query:
    """A valid query."""

    body: Body
    start: float
    end: float
    properties: tuple[str, ...]
    problems: tuple[str, ...]
    """Why there are no others, of which some were asked for."""
    every: float | None
    """Seconds between rows; None: as usual."""


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
            wrote them; invalid items are answered with what is wrong. With "interval", they say
            how many seconds are between rows.
        interval: Seconds between rows; the constants' by default. Rollouts with coarser samples are
            shown sample by sample, and around events all samples are shown.
    """
    return answer_each(machine, [(item, rollout) for item in queries], interval)


def answer_each(
    machine: Machine, asked: Sequence[tuple[object, Rollout | str]], interval: float | None = None
) -> Answers:
    """Answer each query about a rollout of its own, or say why there is none."""
    every = constants()["sample_interval"] if interval is None else interval
    texts, data = [], []
    for index, (item, rollout) in enumerate(asked):
        try:
            if index >= MAX_QUERIES:
                raise _InvalidQuery(f"only the first {MAX_QUERIES} queries of a call are answered")
            if isinstance(rollout, str):
                raise _InvalidQuery(rollout)
            if isinstance(item, Mapping) and item.get("id") == CONTROLLERS:
                text, answered = _answer_controllers(rollout, item, every)
            elif isinstance(item, Mapping) and item.get("id") == CONNECTIONS:
                text, answered = _answer_connections(rollout, item)
            else:
                objects = rollout.trace.objects if rollout.trace is not None else ()
                text, answered = _answer(machine, rollout, _read(machine, objects, item), every)
        except _InvalidQuery as refusal:
            text = f"Query {index + 1}: no answer: {refusal}"
            answered = {"query": item, "problem": str(refusal)}
        texts.append(text)
        data.append(answered)
    return Answers("\n\n".join(texts), data)


def wanted_interval(item: object) -> float | None:
    """The seconds between samples that a query asks for; None if it names no such number, except
    about all connections, whose loads rise within a few steps before a break."""
    asked = item if isinstance(item, Mapping) else {}
    value = _number(asked.get("interval"))
    if value is not None and value > 0.0:
        return value
    return STEP if asked.get("id") == CONNECTIONS else None


def wanted_trial(item: object) -> int | None:
    """The trial that a query asks about; None if it names none, 0 if there can be none such."""
    value = item.get("trial") if isinstance(item, Mapping) else None
    number = _number(value)
    return None if value is None else int(number) if number is not None and number >= 1 else 0


def _read(machine: Machine, objects: Sequence[str], item: object) -> _Query:
    if not isinstance(item, Mapping):
        raise _InvalidQuery('a query is an object with "id", "duration" and "properties"')
    for key in ("id", "duration", "properties"):
        if key not in item:
            raise _InvalidQuery(f'"{key}" is missing')
    start, end = _read_duration(item["duration"])
    body = item["id"] if item["id"] in objects else _read_block(machine, item["id"], objects)
    every = wanted_interval(item)
    if every is None and (wrong := item.get("interval")) is not None:
        raise _InvalidQuery(f'"interval" must be a number of seconds above 0, not {wrong!r}')
    return _Query(body, start, end, *_read_properties(machine, body, item["properties"]), every)


def _number(value: object) -> float | None:
    """Read a finite number, which may be written as a string."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        result = float(value)
    except ValueError:
        return None
    return result if isfinite(result) else None


def _read_block(machine: Machine, value: object, objects: Sequence[str]) -> int:
    block = _number(value)
    if block is None or block != int(block):
        names = " or ".join(map(repr, objects))
        raise _InvalidQuery(f'"id" must be a block id{f" or {names}" * bool(names)}, not {value!r}')
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


def _read_properties(
    machine: Machine, body: Body, value: object
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The properties to show, and why others cannot be shown."""
    names = [value] if isinstance(value, str) else value
    known = ", ".join(PROPERTIES)
    if not isinstance(names, list | tuple) or not names:
        raise _InvalidQuery(f'"properties" must list some of {known}')
    found, problems = dict[str, None](), []
    for name in names:
        if not isinstance(name, str) or name not in PROPERTIES:
            problems.append(f"unknown property {name!r}; known: {known}")
        elif lacking := PROPERTIES[name].lacking(machine, body):
            problems.append(lacking)
        else:
            found[name] = None
    if not found:
        raise _InvalidQuery(problems[0])
    return tuple(found), tuple(problems)


def _trace_of(rollout: Rollout) -> Trace:
    if rollout.trace is None:
        why = f"the rollout ended with status {rollout.status}"
        raise _InvalidQuery(f"nothing was recorded because {why}")
    return rollout.trace


def _answer(
    machine: Machine, rollout: Rollout, query: _Query, usual: float
) -> tuple[str, dict[str, Any]]:
    trace = _trace_of(rollout)
    times = trace.times
    name = body_name(machine, query.body)
    title = name[0].upper() + name[1:]
    broke = _breakage_time(machine, rollout, query)
    if broke < 0.0:
        raise _InvalidQuery(
            f"{title} broke off at {number(broke)} s, while the machine settled; states before "
            "t = 0 are not recorded"
        )
    kept = _rows(trace, query, usual)
    kept = kept[times[kept] < broke]
    asked = (machine, trace, query.body)
    columns = {name: _column(*asked, name, kept) for name in query.properties}
    headings = {name: PROPERTIES[name].heading(*asked) for name in query.properties}
    shown = rollout.terms.get("shown_trial")
    trial = int(shown) if isinstance(shown, float) else None
    head = title if trial is None else f"{title}, trial {trial}"
    lines = [
        f"{head}, {query.start:g} to {query.end:g} s:",
        *_table(times[kept], columns, headings),
    ]
    if isfinite(broke):
        lines.append(f"{title} broke off at {number(broke)} s; its table ends there.")
    lines += [f"Not shown: {problem}" for problem in query.problems]
    data = {
        "id": query.body,
        "type": machine[query.body].type if isinstance(query.body, int) else None,
        "duration": [query.start, query.end],
        "times": times[kept].tolist(),
        **{name: _plain(values) for name, values in columns.items()},
        "headings": headings,
        "trial": trial,
        "broke": broke if isfinite(broke) else None,
        **({"problems": list(query.problems)} if query.problems else {}),
    }
    return "\n".join(lines), data


def _answer_connections(rollout: Rollout, item: Mapping[str, object]) -> tuple[str, dict[str, Any]]:
    """The loads of all connections in an interval, and just before the first break there."""
    if item.get("properties") not in ([LOAD], LOAD):
        raise _InvalidQuery(f'"properties" of {CONNECTIONS!r} must be ["{LOAD}"]')
    trace, (start, end) = _trace_of(rollout), _read_duration(item.get("duration"))
    times = trace.times
    within = (broken for broken in rollout.broken if start <= broken.time <= end)
    first = min(within, key=attrgetter("time"), default=None)
    last = end if first is None else first.time - EPSILON
    kept = np.flatnonzero((times >= start - EPSILON) & (times <= last + EPSILON))
    if not len(kept):
        raise _InvalidQuery(f"no sample lies between {start:g} and {last:g} s")
    loads = np.nan_to_num(trace.utilisation[kept])
    for broken in rollout.broken:
        if first is not None and first.time <= broken.time < first.time + STEP:
            loads[-1, trace.connections.index((broken.block, broken.partner))] = broken.load
    now, peaks, at = loads[-1], loads.max(axis=0), times[kept][loads.argmax(axis=0)]
    order = np.lexsort((-peaks, -now))
    held = [index for index in order if peaks[index] > 0.0]
    why = ""
    if first is not None:
        why = f", then {first.block}-{first.partner} broke off at {number(first.time, 3)} s"
    lines = [
        f"All connections (block-partner), {start:g} to {times[kept[-1]]:.3f} s{why}:",
        "connection | load (share of strength; breaks at 1) at the end | greatest | at s",
        *(
            f"{'-'.join(map(str, trace.connections[i]))} | {number(now[i])} | {number(peaks[i])} | "
            f"{at[i]:.3f}"
            for i in held[:MAX_ROWS]
        ),
    ]
    if rest := held[MAX_ROWS:]:
        lines.append(f"and {len(rest)} more, at most {number(peaks[rest].max())}")
    data = {
        "id": CONNECTIONS,
        "duration": [start, end],
        "time": float(times[kept[-1]]),
        "broke": None if first is None else [first.block, first.partner, first.time],
        "connections": [list(trace.connections[i]) for i in order],
        LOAD: now[order].tolist(),
        "peak": peaks[order].tolist(),
        "peak_at": at[order].tolist(),
    }
    return "\n".join(lines), data


def _answer_controllers(
    rollout: Rollout, item: Mapping[str, object], usual: float
) -> tuple[str, dict[str, Any]]:
    """What sensors read and laws gave, which the properties name; all of them by default."""
    told = rollout.feedback.data.get(CONTROLLERS)
    if told is None:
        raise _InvalidQuery("nothing was sensed: the machine has no controllers, or did not run")
    known = {**told["laws"], **told["sensors"]}  # a sensor with the name of a law comes first
    wanted = item.get("properties") or [*known]
    asked = wanted if isinstance(wanted, list) else [wanted]
    names = [name for name in asked if isinstance(name, str) and name in known]
    if not names:
        raise _InvalidQuery(f"unknown property in {wanted!r}; known: {', '.join(known)}")
    start, end = _read_duration(item.get("duration"))
    step = max(usual, wanted_interval(item) or 0.0, (end - start) / MAX_ROWS)
    times, kept, due = told["times"], [], start - EPSILON
    for row, time in enumerate(times):
        if due <= time <= end + EPSILON:
            kept.append(row)
            due = time + step - EPSILON
    if not kept:
        raise _InvalidQuery(f"nothing was sensed from {start:g} to {end:g} s")
    columns = {name: np.array(known[name])[kept, None] for name in names}
    rows = _table(np.array(times)[kept], columns, {name: name for name in names})
    unknown = [name for name in asked if name not in names]
    rows += [f"Not shown: unknown property {name!r}; known: {', '.join(known)}" for name in unknown]
    shown = [times[row] for row in kept]
    data: dict[str, Any] = {"id": CONTROLLERS, "duration": [start, end], "times": shown}
    data |= {name: _plain(column) for name, column in columns.items()}
    return "\n".join([f"Controllers, {start:g} to {end:g} s:", *rows]), data


def _rows(trace: Trace, query: _Query, usual: float) -> Indices:
    """Which samples a table shows."""
    times, step = trace.times, query.every or usual
    inside = (times >= query.start - EPSILON) & (times <= query.end + EPSILON)
    fine = inside & ~trace.regular
    inside &= trace.regular & _on_grid(trace, step)
    if inside.sum() + fine.sum() <= MAX_ROWS:
        inside |= fine
    if not inside.any():
        last = float(times[-1])
        raise _InvalidQuery(
            f"no sample lies between {query.start:g} and {query.end:g} s; samples go from 0 to "
            f"{last:g} s, one every {step:g} s"
        )
    if query.every is not None and inside.sum() > MOST_ROWS:
        raise _InvalidQuery(
            f"these are {inside.sum()} rows; a table has at most {MOST_ROWS}, so ask for a shorter "
            '"duration" or a longer "interval"'
        )
    return np.flatnonzero(inside)


def _on_grid(trace: Trace, step: float) -> Flags:
    """Mask of the samples at multiples of a step, s; all if the regular ones are coarser."""
    if spacing(trace.times[trace.regular]) > step - EPSILON:
        return np.ones(len(trace.times), dtype=bool)
    steps = trace.times / step
    return np.asarray(np.abs(steps - np.round(steps)) < EPSILON)


def _breakage_time(machine: Machine, rollout: Rollout, query: _Query) -> float:
    """Time at which a block broke off; infinite if it did not before the query's end."""
    if isinstance(query.body, str):
        return inf
    own = [(query.body, parent) for parent in machine[query.body].parents]
    times = (b.time for b in rollout.broken if (b.block, b.partner) in own)
    return min((time for time in times if time <= query.end), default=inf)


def _column(machine: Machine, trace: Trace, body: Body, name: str, kept: Indices) -> Array:
    """(R, K) values of one property in the rows."""
    values = PROPERTIES[name].read(machine, trace, body)
    if not (PROPERTIES[name].peak and len(kept)):
        return values[kept]
    starts = np.concatenate([kept[:1], kept[:-1] + 1])
    return np.asarray(np.fmax.reduceat(values[: kept[-1] + 1], starts))


def _plain(values: Array) -> list[Any]:
    """Values as JSON data: single ones without a list around each, null for what there is not."""
    rows = values[:, 0] if values.shape[1] == 1 else values
    plain: list[Any] = np.where(np.isnan(rows), np.array(None), rows).tolist()
    return plain


def _cell(row: Array) -> str:
    return ", ".join("-" if np.isnan(value) else number(value) for value in row)


def _table(times: Array, columns: Mapping[str, Array], headings: Mapping[str, str]) -> list[str]:
    """Rows by time; what stays the same to the shown digits is stated once, above them."""
    digits = 1 if np.allclose(times, np.round(times, 1), atol=EPSILON) else 3
    cells = {name: list(map(_cell, rows)) for name, rows in columns.items()}
    fixed = [name for name, column in cells.items() if len(column) > 1 and len(set(column)) == 1]
    shown = [name for name in columns if name not in fixed]
    lines = [f"{headings[name]}: {cells[name][0]} throughout" for name in fixed]
    if not shown:
        return lines
    lines.append(" | ".join(["t s", *(headings[name] for name in shown)]))
    for row, time in enumerate(times):
        lines.append(" | ".join([f"{time:.{digits}f}", *(cells[name][row] for name in shown)]))
    return lines
