"""One trial: settling, then stepping, breakage, refereeing and recording until the end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil, inf, isfinite
from sys import maxsize
from time import perf_counter, thread_time

from agentflow.env.constants import Constants
from agentflow.env.controllers.pilot import Pilot
from agentflow.env.controllers.rate import RATE
from agentflow.env.controllers.telling import tell_controllers
from agentflow.env.feedback.compose import broken_lines
from agentflow.env.feedback.stalls import stalled_motors
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, Watch, World
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.laws.holding import HOLDS
from agentflow.env.physics.loads import NEAR, Loads
from agentflow.env.physics.stepping import Stepping
from agentflow.env.rollout import (
    Array,
    Broken,
    Feedback,
    Marginal,
    Rollout,
    RolloutEvent,
    Status,
    Trace,
    Verdict,
)
from agentflow.env.simulation.logs import split_wrench
from agentflow.env.simulation.monitor import Monitor
from agentflow.env.simulation.recorder import digest
from agentflow.env.simulation.settling import Settling
from agentflow.env.simulation.variations import Variation
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine


class RefereeView:
    """What referees see of a running world: a `tasks.base.WorldView`."""

    def __init__(self, world: World) -> None:
        self.centre, self.rotation = world.centre, world.rotation
        self.origin, self.touching = world.origin, world.touching
        self.time = 0.0
        """Seconds since t = 0."""
        self.levels: dict[Entry, float] = {}
        """Level of each entry that was switched."""


class Trial:
    """One trial in progress."""

    def __init__(
        self,
        machine: Machine,
        task: Task,
        engine: Engine,
        rate: float,
        power: bool,
        interval: float,
        cpu_limit: float,
        physics: Constants,
        variation: Variation,
    ) -> None:
        self._began, self._started = perf_counter(), thread_time()
        self._machine, self._task, self._identity = machine, task, str(engine.identity)
        self._rate, self._power, self._cpu_limit = rate, power, cpu_limit
        self._switches = variation.vary_switches(task.switches(machine))
        self._sample_every = max(1.0, interval * rate)
        self._constants = physics
        self._fastest = physics["speed_limit"]
        self._still, self._calm = physics["rest_speed"], physics["rest_spin"]
        """Greatest linear and angular speed of what rests, m/s and rad/s."""
        self._check_every = max(1, round(physics["rest_interval"] * rate))
        """Steps between checks of the speed of every part."""
        self._assembly = assemble(machine, place(machine), self._constants)
        self._scene = task.scene(machine)
        self._world = engine.build(self._assembly, self._scene, rate)
        joints = [variation.vary_strength(joint) for joint in self._assembly.joints]
        window, usual = physics["load_window"], 1.0 / physics["step_rate"]
        self._loads = Loads(joints, window, 1.0 / rate, usual, len(self._assembly.parts))
        self._every = max(1, round(rate / RATE))
        """Steps between calls of the pilot."""
        self._pilot = self._make_pilot(variation) if machine.controllers and power else None
        self._stepping = Stepping(physics, rate, self._world.settle_rate)
        objects = tuple(item.name for item in self._scene.moving)
        self._monitor = Monitor(self._world, self._assembly, self._loads, objects, rate)
        self._history = self._monitor.history
        speeds = self._still, self._calm, self._fastest
        self._watch = Watch(self._loads, self._monitor.change, speeds)
        self._view = RefereeView(self._world)
        self._referee = task.referee(machine)
        self._divisions = self._stepping.settling
        """Of the last step."""
        self._over = False
        """Whether the referee has seen all that counts."""
        self._speeds = 0.0, 0.0
        """Greatest linear and angular speed seen in the last step."""
        self._steps = 0
        self._time = 0.0
        """The same with parts of a step."""
        self._settled = False
        self._start_step = 0
        """Steps that settling took; 0 until it is over."""
        self._broken: list[tuple[float, int, float]] = []
        """Step, joint and load of each breakage."""
        self._wrenches: dict[int, Array] = {}
        """Force and moment of each joint that broke, as it broke."""
        self._near: dict[int, tuple[float, float]] = {}
        """Load and step of the greatest load of each joint that nearly broke."""
        self._released: list[int] = []
        """Joints that decouplers have released."""
        self._to_split: tuple[int, ...] = ()
        """Joints that broke in the last step."""
        self._events: list[RolloutEvent] = []

    def _make_pilot(self, variation: Variation) -> Pilot:
        (noise, delay), interval = self._task.sensing, self._every / self._rate
        sensing = noise + variation.noise, delay + round(variation.delay)
        world, scene, pace = self._world, self._scene, variation.times
        return Pilot(
            self._machine, self._assembly, world, scene, self._loads, interval, pace, sensing
        )

    def run(self) -> Rollout:
        """Settle, run the window and score it."""
        status = self._settle()
        if status == "ok":
            self._start()
            status = self._window()
        return self._result(status)

    def _settle(self) -> Status:
        """Step with power off until everything rests."""
        value = self._constants
        least, most = value["settle_least"] * self._rate, value["settle_most"] * self._rate
        settling = Settling(self._machine, self._world, self._rate, value)
        self._world.switch("wind", 0.0)  # it would blow machines on wheels away before t = 0
        while True:
            until = settling.interval - self._steps % settling.interval
            status = self._step(max(until, ceil(least) - self._steps))
            if status != "ok":
                return status
            if settling.step(self._resting()) and self._steps >= least:
                return "ok"
            if self._steps >= most:
                text = f"still moving after {value['settle_most']:g} s"
                self._events.append(RolloutEvent(0.0, "unsettled", (), text))
                return "ok"

    def _start(self) -> None:
        """t = 0: start the referee and take the first sample."""
        self._settled, self._start_step = True, self._steps
        for i, reason in self._loads.locked.items():
            joint = self._assembly.joints[i]
            text = f"the moving joint of block {joint.block} cannot move: {reason}"
            self._events.append(RolloutEvent(0.0, "locked", (joint.block,), text))
        self._referee.start(self._view)
        self._world.switch("wind", 1.0)
        self._monitor.start()

    def _window(self) -> Status:
        """Run the scored window."""
        rest = 0
        due = self._schedule()
        last = round(self._task.window * self._rate)
        long = self._constants["rest_time"] * self._rate
        samples, start = 1, self._start_step
        while not self._over and (elapsed := self._steps - start) < last:
            while due and due[0][0] <= elapsed:
                self._switch(*due.pop(0)[1:])
                rest = 0
            if self._pilot and elapsed % self._every == 0:
                self._fly(self._pilot, elapsed / self._rate)
            ahead = (due[0][0] if due else last) - elapsed
            if self._pilot:
                ahead = min(ahead, self._every - elapsed % self._every)
            elif rest and not due:
                ahead = min(ahead, ceil(long) - rest)
            status = self._step(ahead)
            if status != "ok":
                return status
            if elapsed + 1 >= samples * self._sample_every - 1e-6:
                samples += 1
                self._monitor.recorder.sample((elapsed + 1) / self._rate)
            rest = rest + 1 if self._resting() else 0
            # what senses may wait for something, so a rollout goes on
            if rest >= long and not (due or self._pilot):
                break
            if not (rest or self._over) and self._stepping.alike == maxsize:
                sample = ceil(samples * self._sample_every - 1e-6)
                calm = min(self._world.calm, ahead - 1, sample - elapsed - 2, self._monitor.idle)
                if calm > 0:
                    self._pass_over(calm)
        return "ok"

    def _pass_over(self, steps: int) -> None:
        """Go on by so many steps that were taken already and are calm: only the referee has to look
        at them."""
        world, view, watch, times = self._world, self._view, self._referee.watch, []
        first = self._elapsed + 1
        for elapsed in range(first, first + steps):
            world.step()
            view.time = seconds = elapsed / self._rate
            times.append(seconds)
            if watch(view):
                self._over = True
                break
        self._steps += len(times)
        self._speeds = world.speeds()
        self._monitor.pass_over(times, self._speeds)

    def _fly(self, pilot: Pilot, time: float) -> None:
        """Let blocks follow the controllers."""
        sudden, changes = pilot.fly(time), pilot.changes
        for block in pilot.decouplers & changes.keys() if pilot.decouplers else ():
            self._switch(block, changes.pop(block))
        if changes:
            if sudden:
                self._stepping.switch()
                self._monitor.look_closely()
            self._view.levels.update(changes)
            self._world.drive(changes, sudden)

    def _schedule(self) -> list[tuple[int, Entry, float]]:
        """Step since t = 0, entry and level of each switch, in order; with power off, only of
        what lets go of what is held."""
        due = (item for item in self._switches if self._power or item[1] == HOLDS)
        return [(round(time * self._rate), entry, level) for time, entry, level in due]

    def _switch(self, entry: Entry, level: float) -> None:
        """Apply a switch; decouplers release their parents, once and for all."""
        self._stepping.switch()
        self._monitor.look_closely()
        self._view.levels[entry] = level
        group = library()[self._machine[entry].type].group if isinstance(entry, int) else entry
        if group != "decouplers":
            self._world.switch(entry, level)
            return
        if level <= 0:
            return
        gone = {*self._released, *(joint for _, joint, _ in self._broken)}
        loose = [
            i
            for i, joint in enumerate(self._assembly.joints)
            if joint.drive.starts == entry and i not in gone
        ]
        if self._pilot:
            self._pilot.lose(self._elapsed / self._rate, gone.union(loose))
        self._released += loose
        self._loads.release(loose)
        self._to_split = (*self._to_split, *loose)
        for i in loose:
            joint = self._assembly.joints[i]
            self._monitor.recorder.lose(i, (self._elapsed + 0.5) / self._rate)
            text = f"block {joint.block} let go of block {joint.partner}"
            self._events.append(
                RolloutEvent(self._elapsed / self._rate, "released", (joint.block,), text)
            )

    def _step(self, ahead: int) -> Status:
        """Take one step, which may be divided into finer ones; before as many as `ahead`, this one
        included, nothing is switched or driven."""
        settled, stepping = self._settled, self._stepping
        divisions = stepping.advance(self._loads.peak) if settled else stepping.settling
        if divisions != self._divisions and settled and self._resting():
            self._history.disturb(self._elapsed / self._rate)
        self._divisions = divisions
        thorough = self._steps % self._check_every == 0
        alike = divisions * (min(ahead, stepping.alike) if settled else ahead)
        world, loads = self._world, self._loads
        for part in range(1, divisions + 1):
            self._time = self._steps + part / divisions
            if self._to_split:  # broken joints stay until now, so contacts can be read
                world.split(self._to_split)
            world.step(divisions, alike - part + 1, self._watch)
            self._speeds = linear, angular = world.speeds(thorough)
            if not (linear <= self._fastest and isfinite(angular)):
                return "diverged"
            broken = loads.update(world.reactions, divisions)
            if not loads.finite:
                return "diverged"
            self._to_split = tuple(broken) if broken else ()
            if settled:
                self._view.time = seconds = (self._time - self._start_step) / self._rate
                self._history.add(seconds)
            if loads.near or broken:
                self._note_loads(broken)
            if settled and not self._over and self._referee.watch(self._view):
                self._over = True
        self._steps += 1
        if settled:
            speeds = world.speeds(thorough=False) if thorough else self._speeds
            self._monitor.add_step((self._steps - self._start_step) / self._rate, speeds)
        # CPU time is slow to read, so it is read only once that much wall time has passed
        late = perf_counter() - self._began > self._cpu_limit
        return "timeout" if late and thread_time() - self._started > self._cpu_limit else "ok"

    def _note_loads(self, broken: Mapping[int, float]) -> None:
        """Keep which joints nearly broke, and which broke under what load."""
        for joint, load in self._loads.near.items():
            self._near[joint] = max(self._near.get(joint, (0.0, 0.0)), (load, self._time))
        for joint, load in broken.items():
            self._broken.append((self._time, joint, load))
            self._wrenches[joint] = self._loads.wrench(self._loads.failed[joint], joint)
            self._monitor.recorder.lose(joint, self._view.time if self._settled else -inf)
            self._monitor.look_closely()
        if broken and self._pilot:
            gone = {*self._released, *(joint for _, joint, _ in self._broken)}
            self._pilot.lose(max(0.0, self._view.time), gone)

    @property
    def _elapsed(self) -> int:
        """Steps since t = 0."""
        return self._steps - self._start_step

    def _resting(self) -> bool:
        """Whether everything is slow; most of the time a check of few parts rules that out."""
        linear, angular = self._speeds
        if not (linear < self._still and angular < self._calm):
            return False
        linear, angular = self._world.speeds()
        return linear < self._still and angular < self._calm

    def _result(self, status: Status) -> Rollout:
        broken = tuple(
            Broken(*self._connection(*item), *split_wrench(self._wrenches[item[1]]))
            for item in self._broken
        )
        marginal = tuple(Marginal(*self._connection(*item)) for item in self._nearly_broken())
        status, trace, verdict, feedback = self._judge(status, broken)
        events = sorted((*self._events, *verdict.events), key=lambda event: event.time)
        return Rollout(
            status=status,
            score=None if status == "timeout" else verdict.score,
            terms=verdict.terms,
            problems=(),
            broken=broken,
            marginal=marginal,
            events=tuple(events),
            feedback=feedback,
            trace=trace,
            digest=None if trace is None else digest(trace, broken),
            sim_seconds=self._elapsed / self._rate,
            wall_seconds=perf_counter() - self._began,
            constants=self._constants.digest,
            scene=self._scene,
            engine=self._identity,
        )

    def _connection(
        self, step: float, joint: int, load: float
    ) -> tuple[int, int, int, float, float]:
        """Block, type, partner, time and load of a connection."""
        own = self._assembly.joints[joint]
        time = (step - self._start_step) / self._rate
        return own.block, self._machine[own.block].type, own.partner, time, load

    def _nearly_broken(self) -> list[tuple[float, int, float]]:
        """Step, joint and load where the load was nearest to the strength, in order of time."""
        broken = {joint for _, joint, _ in self._broken}
        spared = [(step, i, load) for i, (load, step) in self._near.items() if i not in broken]
        return sorted([*spared, *(item for item in self._broken if item[2] <= 1.0 + NEAR)])

    def _judge(
        self, status: Status, broken: tuple[Broken, ...]
    ) -> tuple[Status, Trace | None, Verdict, Feedback]:
        """Status, trace, score and feedback: the task's after a whole window in which no energy
        came from nothing, else why the trial ended or does not count."""
        if status == "ok":
            whole = self._monitor.trace()
            verdict = self._referee.verdict(whole)
            measured = self._monitor.measure(verdict.moment, broken)
            trace = self._monitor.thin_out(whole, verdict.moment, broken)
            trace = replace(trace, measured=measured)
            excess = self._monitor.unexplained
            if excess and not any(item.load for item in self._scene.objects):  # those grow
                text = (
                    f"The simulation gained {excess:.0f} J that no motor, spring, fall or wind "
                    "gave: something hit faster than steps can follow"
                )
                return self._diverged(trace, text, broken)
            if self._power:
                stalls = stalled_motors(self._machine, trace.even, self._switches)
                verdict = replace(verdict, events=(*verdict.events, *stalls))
            feedback = self._task.feedback(self._machine, trace, broken, verdict)
            if self._pilot:
                end = self._elapsed / self._rate
                feedback = tell_controllers(feedback, self._pilot, verdict.moment, end)
            return status, trace, verdict, feedback
        recorded = self._settled and status != "timeout"
        states = self._monitor.trace() if recorded else None
        seconds = self._elapsed / self._rate
        if status == "diverged":
            return self._diverged(states, f"The simulation diverged after {seconds:.2f} s", broken)
        text = f"The simulation was cut off after {self._cpu_limit:g} s of computing time."
        return status, states, Verdict(0.0, {}), Feedback(text, {"status": status, "time": seconds})

    def _diverged(
        self, trace: Trace | None, text: str, broken: tuple[Broken, ...]
    ) -> tuple[Status, Trace | None, Verdict, Feedback]:
        """What counts as score 0, with what broke before."""
        lines = [f"{text}; this counts as score 0.", *broken_lines(self._machine, broken)]
        data = {"status": "diverged", "time": self._elapsed / self._rate}
        return "diverged", trace, Verdict(0.0, {}), Feedback("\n".join(lines), data)
