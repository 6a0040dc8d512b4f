"""Feedback shared by all families: orientation, breakages, loads, stalled motors, paths.

Text and data hold the same facts, and programs can parse the text.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any, TypeVar

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.rollout import Array, Broken, Feedback, RolloutEvent, Trace, Verdict
from agentflow.env.rotations import rotate
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

V = TypeVar("V")

MAX_SAMPLES = 26
"""Most samples of a series."""
MAX_LINES = 8
"""Most breakages that get their own line of text; the data holds all."""
MAX_STALLS = 4
"""Most stalled motors that get their own line of text."""
STALL_SPEED = 0.5
"""Speed relative to its parent below which a motor counts as stalled, rad/s: a twentieth of a
wheel's speed, above the jitter of a loaded joint."""
STALL_TIME = 1.0
"""Shortest stall to report, s."""
EPSILON = 1e-9
"""Tolerance when comparing sample times, s."""
AXES = ("x+", "x-", "y+", "y-", "z+", "z-")


@dataclass(frozen=True)
class Series:
    """Positions over time, thinned to at most 26 samples."""

    label: str
    times: list[float]
    values: list[list[float]]

    @property
    def text(self) -> str:
        """One line: label, interval, start and the points in brackets."""
        step = _interval(self.times)
        points = " ".join(map(point_text, self.values))
        return f"{self.label} every {step:.3g} s from t = {self.times[0]:.3g} s (x, y, z): {points}"


def _interval(times: Sequence[float] | Array) -> float:
    """Time between samples, s; the default interval if there is only one sample."""
    return float(times[1] - times[0]) if len(times) > 1 else constants()["sample_interval"]


def number(value: float, digits: int = 2) -> str:
    """Format with fixed decimals; never "-0.00"."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def point_text(point: Iterable[float]) -> str:
    """Format a position: "(0.00, 1.50, 3.00)"."""
    return f"({', '.join(map(number, point))})"


def landing_text(sample: object) -> str:
    """Sample in which something landed after free flight, as an item of a line."""
    return "no landing after free flight" if sample is None else f"landed in sample {sample}"


def thing_name(name: str) -> str:
    """A thing of the scene in a sentence: "the far wall", "wall 1", "ring 2"."""
    whole = name.partition(",")[0]
    return whole if whole[-1].isdigit() else f"the {whole}"


def term_number(terms: Mapping[str, Any], name: str) -> float:
    """A term of a verdict; 0 if it does not apply."""
    return float(terms.get(name) or 0.0)


def block_name(machine: Machine, block: int) -> str:
    """Id and type of a block: "block 8 (Wooden Block)"."""
    return f"block {block} ({library()[machine[block].type].name})"


def sample_indices(count: int, most: int = MAX_SAMPLES) -> range:
    """At most `most` evenly spaced indices into `count` samples, starting at 0."""
    return range(0, count, max(1, -(-(count - 1) // (most - 1))))


def series(label: str, times: Array, values: Array) -> Series:
    """Thin out (T,) times and (T, K) values to a series."""
    picks = sample_indices(len(times))
    return Series(label, times[picks].tolist(), values[picks].tolist())


def _axis(vector: Sequence[float]) -> str:
    index = max(range(3), key=lambda i: abs(vector[i]))
    return AXES[2 * index + (vector[index] < 0)]


def orientation_runs(trace: Trace) -> list[tuple[str, float, float]]:
    """Periods in which the root roughly faces one axis: (text, start, end), in seconds.

    The text names the axis that its Front faces and, unless its top points up, that of its top.
    """
    turn = trace.rotation[:, 0]
    fronts, tops = rotate(turn, (0.0, 0.0, 1.0)), rotate(turn, (0.0, 1.0, 0.0))
    words = [
        _axis(front) + ("" if (up := _axis(top)) == "y+" else f" with its top towards {up}")
        for front, top in zip(fronts.tolist(), tops.tolist(), strict=True)
    ]
    return list(_runs(words, trace.times))


def _runs(values: Sequence[V], times: Array) -> Iterator[tuple[V, float, float]]:
    """Each run of equal values with the times of its first and last sample, s."""
    for value, group in groupby(range(len(values)), key=values.__getitem__):
        members = list(group)
        yield value, float(times[members[0]]), float(times[members[-1]])


def _orientation_text(runs: Sequence[tuple[str, float, float]], interval: float) -> str:
    if len(runs) <= 4:
        return "facing " + "; ".join(
            f"{word} " + (f"from {start:.1f} to {end:.1f} s" if end > start else f"at {end:.1f} s")
            for word, start, end in runs
        )
    held: dict[str, float] = defaultdict(float)
    for word, start, end in runs:
        held[word] += end - start + interval
    total = sum(held.values())
    shares = [
        f"{word} {time / total:.0%}"
        for word, time in sorted(held.items(), key=lambda item: -item[1])[:4]
    ]
    return f"changes {len(runs) - 1} times, facing " + "; ".join(
        [f"{shares[0]} of the time", *shares[1:]]
    )


def stalled_motors(machine: Machine, trace: Trace, start: float) -> tuple[RolloutEvent, ...]:
    """Find motors that stall for a second or more after they are switched on.

    A motor is stalled in a sample if its angular velocity differs from its parent's by less than
    0.5 rad/s.

    Args:
        machine: The simulated machine.
        trace: Its trace.
        start: Time at which motors are switched on, s.
    """
    events = []
    for step in machine:
        kind = library()[step.type]
        joint = kind.joint
        turns = kind.non_static and (joint.kind, joint.axis) == ("revolute", "Front")
        if not turns or step.parent < 0:
            continue
        relative = trace.angular_velocity[:, step.id] - trace.angular_velocity[:, step.parent]
        still = np.linalg.norm(relative, axis=1) < STALL_SPEED
        still &= trace.alive[:, step.id]
        still &= trace.times > start + EPSILON  # every motor stands still when switched on
        for stalled, begin, end in _runs(still.tolist(), trace.times):
            if stalled and end - begin >= STALL_TIME:
                name = block_name(machine, step.id)
                text = f"{name} from {begin:.1f} to {end:.1f} s"
                events.append(RolloutEvent(begin, "motor_stalled", (step.id,), text))
    return tuple(events)


def most_loaded(trace: Trace) -> list[dict[str, Any]]:
    """The most loaded connection of each sample: time, blocks, load as a share of its strength."""
    loads = []
    for index in sample_indices(len(trace.times)) if trace.connections else ():
        shares = np.nan_to_num(trace.utilisation[index], nan=-1.0)  # nan: broken connections
        edge = int(shares.argmax())
        if shares[edge] >= 0.0:
            block, partner = trace.connections[edge]
            time, load = float(trace.times[index]), float(shares[edge])
            loads.append({"time": time, "block": block, "partner": partner, "load": load})
    return loads


def _loads_text(loads: Sequence[Mapping[str, Any]]) -> str:
    """Connections that were ever the most loaded: the five with the highest peaks.

    The number in brackets is that of samples in which the connection was the most loaded.
    """
    peaks: dict[tuple[int, int], Mapping[str, Any]] = {}
    for load in sorted(loads, key=lambda load: -load["load"]):
        peaks.setdefault((load["block"], load["partner"]), load)
    counts = Counter((load["block"], load["partner"]) for load in loads)
    order = sorted(counts, key=lambda edge: -peaks[edge]["load"])[:5]
    parts = [
        f"{block}-{partner}: {number(peaks[block, partner]['load'])} at "
        f"{peaks[block, partner]['time']:.1f} s (in {counts[block, partner]})"
        for block, partner in order
    ]
    if not parts:
        return "none"
    parts[0] = parts[0].replace("(in", "(most loaded in")[:-1] + f" of {len(loads)} samples)"
    return "blocks " + "; ".join(parts)


_SETTLING = " (while it settled, before t = 0)"


def _broken_lines(machine: Machine, broken: Sequence[Broken]) -> list[str]:
    if not broken:
        return ["Broken: none"]
    lines = [
        f"Broken: {block_name(machine, item.block)} off block {item.partner} at "
        f"{number(item.time)} s{_SETTLING if item.time < 0.0 else ''}, load {number(item.load)}"
        for item in broken[:MAX_LINES]
    ]
    rest = broken[MAX_LINES:]
    if rest:
        names = ", ".join(f"{item.block} off {item.partner}" for item in rest)
        lines.append(f"Broken later: {names}")
    return lines


def _stall_lines(stalls: Sequence[RolloutEvent]) -> list[str]:
    lines = [f"Motor stalled: {event.text}" for event in stalls[:MAX_STALLS]]
    rest = sorted({block for event in stalls[MAX_STALLS:] for block in event.blocks})
    if rest:
        lines.append(f"Other stalled motors: blocks {', '.join(map(str, rest))}")
    return lines


def compose(
    machine: Machine,
    trace: Trace,
    broken: Sequence[Broken],
    verdict: Verdict,
    unit: str,
    lines: Sequence[str],
    data: Mapping[str, Any],
    paths: Sequence[Series],
) -> Feedback:
    """Compose a family's feedback: score, its own lines, the shared lines, then paths.

    Args:
        machine: The simulated machine.
        trace: Its trace.
        broken: Broken connections in order of time.
        verdict: Score, terms and events.
        unit: Unit of the score; "" for none.
        lines: The family's own lines, each "Key: ...".
        data: The family's own data; overrides shared keys.
        paths: Series at the end of the text.
    """
    runs, loads = orientation_runs(trace), most_loaded(trace)
    interval = _interval(trace.times)
    stalls = [event for event in verdict.events if event.kind == "motor_stalled"]
    text = [
        f"Score: {number(verdict.score)} {unit}".rstrip(),
        *lines,
        *_broken_lines(machine, broken),
        "Orientation of block 0: " + _orientation_text(runs, interval),
        "Most loaded connections (load / strength, breaks at 1): " + _loads_text(loads),
        *_stall_lines(stalls),
        *(path.text for path in paths),
    ]
    shared = {
        "score": verdict.score,
        "terms": dict(verdict.terms),
        "seconds": float(trace.times[-1]),
        "broken": [asdict(item) for item in broken],
        "orientation": [{"faces": word, "from": start, "to": end} for word, start, end in runs],
        "most_loaded": loads,
        "events": [asdict(event) | {"blocks": list(event.blocks)} for event in verdict.events],
        "series": [asdict(path) for path in paths],
    }
    return Feedback("\n".join(text), {**shared, **data})
