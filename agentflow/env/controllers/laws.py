"""Laws as functions: made once for a rollout, they read and write lists of plain numbers."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from graphlib import TopologicalSorter

from agentflow.machine.controllers.model import (
    Constant,
    Law,
    Proportional,
    Schedule,
    Sensor,
    States,
    Sum,
    Switch,
)

Evaluate = Callable[[float], None]
"""Evaluates a law at a time, s since t = 0, and writes its output."""


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
        self._laws, self._sensors, self._readings = laws, sensors, readings
        self._interval, self._pace = interval, pace
        self._number = {name: number for number, name in enumerate(laws)}
        self._sensor = {name: number for number, name in enumerate(sensors)}
        self.outputs = [0.0] * len(laws)
        """Of each law, in their order."""
        self.edges: dict[str, list[float]] = {name: [] for name in laws}
        """Times at which each law came to a limit and left it again, in turns."""
        self.entered: dict[str, list[tuple[float, str]]] = {
            name: [(0.0, law.states[0].name)] for name, law in laws.items() if law.kind == "states"
        }
        """When each state machine entered which state."""
        order = TopologicalSorter({name: law.laws for name, law in laws.items()}).static_order()
        self._evaluate: list[Evaluate] = [
            self._limited(name, laws[name]) for name in order if not self._steady(name, laws[name])
        ]

    def __call__(self, time: float) -> None:
        """Evaluate all laws; steady ones have their outputs from the start."""
        for evaluate in self._evaluate:
            evaluate(time)

    def _steady(self, name: str, law: Law) -> bool:
        """Whether a law has the same output at all times; writes it."""
        low, high = law.limits
        steady = isinstance(law, Constant) and law.rate is None and low <= law.level <= high
        if isinstance(law, Constant) and steady:
            self.outputs[self._number[name]] = law.level
        return steady

    def _limited(self, name: str, law: Law) -> Evaluate:
        """The function of a law with its limits and its rate limit."""
        raw: Callable[[float], float] = getattr(self, f"_{law.kind}")(law, name)
        outputs, number, edges = self.outputs, self._number[name], self.edges[name]
        (low, high), most = law.limits, law.rate and law.rate * self._interval
        held, at_limit = 0.0, False

        def evaluate(time: float) -> None:
            nonlocal held, at_limit
            output = wanted = raw(time)
            if at_limit or not low <= wanted <= high:
                output = low if wanted < low else high if wanted > high else wanted
                if (output != wanted) != at_limit:
                    at_limit = not at_limit
                    edges.append(time)
            if most is not None:
                output = max(held - most, min(held + most, output))
                held = output
            outputs[number] = output

        return evaluate

    def _constant(self, law: Constant, _: str) -> Callable[[float], float]:
        level = law.level
        return lambda _: level

    def _schedule(self, law: Schedule, _: str) -> Callable[[float], float]:
        times = [time * self._pace - 1e-9 for time, _ in law.points]
        levels = [0.0, *(level for _, level in law.points)]
        return lambda time: levels[bisect_right(times, time)]

    def _pd(self, law: Proportional, _: str) -> Callable[[float], float]:
        readings, sensor = self._readings, self._sensor[law.sensor]
        circular = self._sensors[law.sensor].quantity.circular
        target, p, d, bias = law.target, law.p, law.d / self._interval, law.bias
        last: float | None = None

        def evaluate(_: float) -> float:
            nonlocal last
            reading = readings[sensor]
            error = target - reading
            change = 0.0 if last is None else reading - last
            last = reading
            if circular:
                error, change = (error + 180) % 360 - 180, (change + 180) % 360 - 180
            return bias + p * error - d * change

        return evaluate

    def _switch(self, law: Switch, _: str) -> Callable[[float], float]:
        readings, sensor = self._readings, self._sensor[law.sensor]
        over, under, levels = law.over, law.under, (law.off, law.on)
        is_on = False

        def evaluate(_: float) -> float:
            nonlocal is_on
            is_on = readings[sensor] >= under if is_on else readings[sensor] > over
            return levels[is_on]

        return evaluate

    def _sum(self, law: Sum, _: str) -> Callable[[float], float]:
        outputs = self.outputs
        terms = [(self._number[term.law], term.weight) for term in law.terms]
        return lambda _: sum([weight * outputs[number] for number, weight in terms])

    def _states(self, law: States, name: str) -> Callable[[float], float]:
        readings, outputs, entered = self._readings, self.outputs, self.entered[name]
        states = [state.name for state in law.states]
        used = [self._number[state.law] for state in law.states]
        leaves = [
            [
                (self._sensor[leave.sensor], leave.above, leave.below, states.index(leave.to))
                for leave in state.leave
            ]
            for state in law.states
        ]
        state = 0

        def evaluate(time: float) -> float:
            nonlocal state
            for sensor, above, below, to in leaves[state]:
                reading = readings[sensor]
                if (above is not None and reading > above) or (
                    below is not None and reading < below
                ):
                    state = to
                    entered.append((time, states[to]))
                    break
            return outputs[used[state]]

        return evaluate


def spans_of(edges: Sequence[float], end: float) -> list[tuple[float, float]]:
    """From when to when a law was at a limit, s; `end` is that of the rollout."""
    whole = [*edges, end] if len(edges) % 2 else edges
    return list(zip(whole[::2], whole[1::2], strict=True))
