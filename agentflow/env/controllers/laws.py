"""Laws in a rollout, as lines of the function that computes them all: a call for each would take
longer than the numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from graphlib import TopologicalSorter
from typing import Any

from agentflow.machine.controllers.model import Law, Sensor, States

Name = Callable[[Any], str]
"""Gives a value a name by which lines use it."""


def law_lines(
    laws: Mapping[str, Law],
    sensors: Mapping[str, Sensor],
    interval: float,
    pace: float,
    name: Name,
    kept: dict[str, Any],
) -> list[str]:
    """Lines that evaluate all laws, each after those that it uses.

    Lines read `s0` and so on, the readings of sensors, and `time`; they write the outputs, `o0` and
    so on. To `edges[0]` and so on, lists, they add the times at which that law came to a limit and
    left it again, in turns; to `entered[0]` and so on, when it entered which state.

    Args:
        laws: By name.
        sensors: By name.
        interval: Time between evaluations, s.
        pace: By how much the machine's own clock is slow.
        name: Names values.
        kept: What lines keep, by name; to add to.
    """
    numbers = {law: number for number, law in enumerate(laws)}
    reads = {sensor: f"s{number}" for number, sensor in enumerate(sensors)}
    lines: list[str] = []
    kept |= {f"o{number}": 0.0 for number in numbers.values()}
    for each in TopologicalSorter({own: law.laws for own, law in laws.items()}).static_order():
        law, own = laws[each], numbers[each]
        low, high = law.limits
        if law.kind == "constant" and law.rate is None and low <= law.level <= high:
            kept[f"o{own}"] = law.level
            continue
        if law.kind == "pd":
            reading = reads[law.sensor]
            wrap = sensors[law.sensor].quantity.circular
            lines += [
                f"e = {name(law.target)} - {reading}",
                *["e = (e + 180.0) % 360.0 - 180.0"] * wrap,
            ]
            wanted = f"{name(law.bias)} + {name(law.p)} * e"
            if law.d:
                kept[f"before{own}"] = None
                lines.append(f"c = 0.0 if before{own} is None else {reading} - before{own}")
                lines += [f"before{own} = {reading}", *["c = (c + 180.0) % 360.0 - 180.0"] * wrap]
                wanted += f" - {name(law.d / interval)} * c"
        elif law.kind == "sum":
            terms = (f"{name(term.weight)} * o{numbers[term.law]}" for term in law.terms)
            wanted = " + ".join(["0.0", *terms])
        elif law.kind == "states":
            kept[f"state{own}"] = 0
            lines += _leaving(law, own, reads, name)
            used = "".join(f"o{numbers[state.law]}, " for state in law.states)
            wanted = f"({used})[state{own}]"
        elif law.kind == "switch":
            kept[f"state{own}"], reading = False, reads[law.sensor]
            below, above = f"{reading} >= {name(law.under)}", f"{reading} > {name(law.over)}"
            lines.append(f"state{own} = {below} if state{own} else {above}")
            wanted = f"{name(law.on)} if state{own} else {name(law.off)}"
        elif law.kind == "schedule":
            times = [time * pace - 1e-9 for time, _ in law.points]
            levels = [0.0, *(level for _, level in law.points)]
            wanted = f"{name(levels)}[bisect_right({name(times)}, time)]"
        else:
            wanted = name(law.level)
        kept[f"limit{own}"], low_, high_ = False, name(low), name(high)
        lines += [
            f"v = {wanted}",
            f"if v < {low_} or v > {high_} or limit{own}:",
            f"    e = {low_} if v < {low_} else {high_} if v > {high_} else v",
            f"    if (e != v) != limit{own}:",
            f"        limit{own} = not limit{own}",
            f"        edges[{own}].append(time)",
            "    v = e",
        ]
        if law.rate is not None:
            most = name(law.rate * interval)
            lines.append(f"v = max(o{own} - {most}, min(o{own} + {most}, v))")
        lines.append(f"o{own} = v")
    return lines


def _leaving(law: States, own: int, reads: Mapping[str, str], name: Name) -> Iterator[str]:
    """Lines that change the state of a machine, the law with this number, and note it."""
    names = [each.name for each in law.states]
    word, state = "if", f"state{own}"
    for number, each in enumerate(law.states):
        if not each.leave:
            continue
        yield f"{word} {state} == {number}:"
        word, first = "elif", "if"
        for leave in each.leave:
            reading, to = reads[leave.sensor], names.index(leave.to)
            limits = ((">", leave.above), ("<", leave.below))
            when = [f"{reading} {sign} {name(at)}" for sign, at in limits if at is not None]
            yield f"    {first} {' or '.join(when)}:"
            yield f"        {state} = {to}"
            yield f"        entered[{own}].append((time, {name(leave.to)}))"
            first = "elif"


def spans_of(edges: Sequence[float], end: float) -> list[tuple[float, float]]:
    """From when to when a law was at a limit, s; `end` is that of the rollout."""
    whole = [*edges, end] if len(edges) % 2 else edges
    return list(zip(whole[::2], whole[1::2], strict=True))
