"""Laws in a rollout: one function computes them all, as a call for each would take longer than the
numbers."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from graphlib import TopologicalSorter
from typing import Any

from agentflow.machine.controllers.model import Constant, Law, Sensor


class Laws:
    """All laws of a machine; each is evaluated after those that it uses."""

    def __init__(
        self,
        laws: Mapping[str, Law],
        sensors: Mapping[str, Sensor],
        readings: list[float],
        interval: float,
        pace: float,
    ) -> None:
        """Make the functions.

        Args:
            laws: By name.
            sensors: By name.
            readings: Those of the sensors, in their order; read at every evaluation.
            interval: Time between evaluations, s.
            pace: By how much the machine's own clock is slow.
        """
        self._readings, self._interval, self._pace = readings, interval, pace
        self._number = {name: number for number, name in enumerate(laws)}
        self._sensor = {name: number for number, name in enumerate(sensors)}
        self._circular = [sensor.quantity.circular for sensor in sensors.values()]
        self.outputs = [0.0] * len(laws)
        """Of each law, in their order."""
        self.edges: dict[str, list[float]] = {name: [] for name in laws}
        """Times at which each law came to a limit and left it again, in turns."""
        self.entered: dict[str, list[tuple[float, str]]] = {
            name: [(0.0, law.states[0].name)] for name, law in laws.items() if law.kind == "states"
        }
        """When each state machine entered which state."""
        order = TopologicalSorter({name: law.laws for name, law in laws.items()}).static_order()
        self._order = [
            (self._number[name], law.kind, self._data(name, law), *law.limits, law.rate)
            for name, law in ((name, laws[name]) for name in order)
            if not self._steady(name, law)
        ]
        """Number, kind, what it computes with, and limits of each law that is not steady."""
        self._edges = [*self.edges.values()]
        self._at_limit = [False] * len(laws)
        self._state = [0] * len(laws)
        """Of switches and state machines."""
        self._last: list[float | None] = [None] * len(laws)
        """Reading of the sensor of each law at the last evaluation."""

    def __call__(self, time: float) -> None:
        """Evaluate all laws; steady ones have their outputs from the start."""
        readings, outputs, at_limit, state = (
            self._readings,
            self.outputs,
            self._at_limit,
            self._state,
        )
        for number, kind, data, low, high, rate in self._order:
            if kind == "pd":
                sensor, target, p, d, bias, circular = data
                reading = readings[sensor]
                error, last = target - reading, self._last[number]
                change = 0.0 if last is None else reading - last
                self._last[number] = reading
                if circular:
                    error, change = (error + 180) % 360 - 180, (change + 180) % 360 - 180
                wanted = bias + p * error - d * change
            elif kind == "sum":
                wanted = 0.0
                for law, weight in data:
                    wanted += weight * outputs[law]
            elif kind == "states":
                used, leaves, names, entered = data
                for sensor, above, below, to in leaves[state[number]]:
                    reading = readings[sensor]
                    if (above is not None and reading > above) or (
                        below is not None and reading < below
                    ):
                        state[number] = to
                        entered.append((time, names[to]))
                        break
                wanted = outputs[used[state[number]]]
            elif kind == "switch":
                sensor, over, under, levels = data
                reading = readings[sensor]
                state[number] = reading >= under if state[number] else reading > over
                wanted = levels[state[number]]
            else:
                times, levels = data
                wanted = levels[bisect_right(times, time)]
            output = wanted
            if at_limit[number] or not low <= wanted <= high:
                output = low if wanted < low else high if wanted > high else wanted
                if (output != wanted) != at_limit[number]:
                    at_limit[number] = not at_limit[number]
                    self._edges[number].append(time)
            if rate is not None:
                held, most = outputs[number], rate * self._interval
                output = max(held - most, min(held + most, output))
            outputs[number] = output

    def _steady(self, name: str, law: Law) -> bool:
        """Whether a law has the same output at all times; writes it."""
        low, high = law.limits
        steady = isinstance(law, Constant) and law.rate is None and low <= law.level <= high
        if isinstance(law, Constant) and steady:
            self.outputs[self._number[name]] = law.level
        return steady

    def _data(self, name: str, law: Law) -> tuple[Any, ...]:
        """What a law computes with; of its own name, where it is a state machine."""
        if law.kind == "pd":
            sensor, d = self._sensor[law.sensor], law.d / self._interval
            return sensor, law.target, law.p, d, law.bias, self._circular[sensor]
        if law.kind == "sum":
            return tuple((self._number[term.law], term.weight) for term in law.terms)
        if law.kind == "states":
            states = [state.name for state in law.states]
            leaves = [
                [
                    (self._sensor[leave.sensor], leave.above, leave.below, states.index(leave.to))
                    for leave in state.leave
                ]
                for state in law.states
            ]
            used = [self._number[state.law] for state in law.states]
            return used, leaves, states, self.entered[name]
        if law.kind == "switch":
            return self._sensor[law.sensor], law.over, law.under, (law.off, law.on)
        points = law.points if law.kind == "schedule" else ()
        before = 0.0 if law.kind == "schedule" else law.level
        times = [time * self._pace - 1e-9 for time, _ in points]
        return times, [before, *(level for _, level in points)]


def spans_of(edges: Sequence[float], end: float) -> list[tuple[float, float]]:
    """From when to when a law was at a limit, s; `end` is that of the rollout."""
    whole = [*edges, end] if len(edges) % 2 else edges
    return list(zip(whole[::2], whole[1::2], strict=True))
