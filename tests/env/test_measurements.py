"""What is measured in every step: contacts, loads, work; fine samples; how they are told."""

from __future__ import annotations

import json
import re
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from agentflow.env.archive import load_npz, save_npz
from agentflow.env.constants import constants
from agentflow.env.drawing.film import save_film
from agentflow.env.drawing.glb import rollout_glb
from agentflow.env.feedback.compose import contact_line, explanatory
from agentflow.env.feedback.text import rounded
from agentflow.env.measurements import Contact, Energy, Hit
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.laws.tension import Spring
from agentflow.env.physics.model import Assembly, Devices, Drive, Joint, Part
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Moment, Rollout, Trace
from agentflow.env.scene import Scene
from agentflow.env.simulation.logs import RECOIL, energy_until
from agentflow.env.simulation.recorder import MOST_FINE
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.vectors import IDENTITY
from agentflow.machine.tree import Machine
from benchmarks.shelf import load

RATE = 120.0


@cache
def thrown() -> tuple[Machine, Rollout]:
    """A throw of some 20 m."""
    machine = load("throwing/spring_arm.json")
    return machine, simulate(machine, get_task("throwing"))


@cache
def pushed() -> tuple[Machine, Rollout]:
    """A car that pushes the cargo for 3 s."""
    machine = load("delivery/paddle_car.json")
    return machine, simulate(machine, get_task("delivery", {"window": 3}))


def trace_of(rollout: Rollout) -> Trace:
    assert rollout.trace is not None
    return rollout.trace


def lines_of(rollout: Rollout, start: str) -> list[str]:
    return [line for line in rollout.feedback.text.splitlines() if line.startswith(start)]


# --- contacts ------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.pybullet
def test_the_landing_of_a_boulder_is_a_contact() -> None:
    _, rollout = thrown()
    trace, boulder = trace_of(rollout), rollout.feedback.data["boulder"]
    found = [c for c in trace.measured.contacts if (c.a, c.b) == (boulder, "ground")]
    assert [contact.standing for contact in found] == [False]
    first = found[0].first
    assert first.time == pytest.approx(rollout.terms["landing"], abs=0.01)
    x, y, z = (
        np.array(first.place) - trace.centre[np.abs(trace.times - first.time).argmin(), boulder]
    )
    assert abs(x) < 0.2
    assert -1.2 < y < -0.8
    assert abs(z) < 0.5
    assert (
        f"block {boulder} on the ground at {first.time:.2f} s" in lines_of(rollout, "Contacts")[0]
    )


def test_the_first_push_of_the_cargo_is_a_contact_of_the_block_that_pushed() -> None:
    machine, rollout = pushed()
    contacts = [c for c in trace_of(rollout).measured.contacts if c.b == "cargo"]
    first = min(contacts, key=lambda contact: contact.first.time)
    assert isinstance(first.a, int)
    assert first.a < len(machine)
    assert first.first.time == pytest.approx(rollout.terms["touched"], abs=1 / 60)
    gained = np.linalg.norm(trace_of(rollout).object_velocity[:, 0], axis=1).max() * 2.0
    assert 0.3 * gained < sum(c.hardest.impulse for c in contacts) < 3 * gained


def test_what_stands_from_the_start_is_known_but_not_told() -> None:
    _, rollout = pushed()
    standing = [c for c in trace_of(rollout).measured.contacts if c.standing]
    assert {c.b for c in standing} >= {"ground"}
    assert "on the ground" not in " ".join(lines_of(rollout, "Contacts"))


# --- samples -------------------------------------------------------------------------------


def test_samples_are_fine_before_and_after_a_release_and_regular_ones_stay() -> None:
    _, rollout = thrown()
    trace = trace_of(rollout)
    step = 1 / constants()["step_rate"]
    assert trace.even.times == pytest.approx(np.arange(26) * 0.2, abs=step)
    assert 0 < (~trace.regular).sum() <= MOST_FINE
    left = rollout.terms["left_holder"]
    assert isinstance(left, float)
    near = trace.times[(trace.times > left - 0.2) & (trace.times < left + 0.05)]
    assert np.diff(near).max() < 0.021
    assert (np.diff(trace.times) > 0.0).all()


def test_velocity_is_that_of_the_point_whose_position_is_told() -> None:
    machine, rollout = thrown()
    trace, boulder = trace_of(rollout), rollout.feedback.data["boulder"]
    left = float(rollout.terms["left_holder"] or 0.0)
    query = {"id": boulder, "duration": [left, left + 0.05], "properties": ["position", "velocity"]}
    answer = answer_queries(machine, rollout, [query]).data[0]
    times, places = np.array(answer["times"]), np.array(answer["position"])
    assert len(times) >= 2
    mean = (places[-1] - places[0]) / (times[-1] - times[0])
    assert mean == pytest.approx(np.mean(answer["velocity"], axis=0), abs=0.3)
    row = np.flatnonzero(trace.times == times[0])[0]
    assert (places[0] == trace.centre[row, boulder]).all()


def test_objects_are_asked_for_by_name() -> None:
    machine, rollout = pushed()
    properties = ["position", "velocity", "rotation"]
    query = {"id": "cargo", "duration": [2, 2.4], "properties": properties}
    given = answer_queries(machine, rollout, [query, {**query, "id": "crate"}])
    lines = given.text.splitlines()
    assert lines[0] == "The cargo, 2 to 2.4 s:"
    assert any(line.startswith("t s | position (x, y, z) m") for line in lines)
    assert set(given.data[0]) >= set(properties)
    assert {2.0, 2.2, 2.4} <= {round(time, 9) for time in given.data[0]["times"]}
    assert lines[-1] == ("Query 2: no answer: \"id\" must be a block id or 'cargo', not 'crate'")


def test_saved_rollouts_come_back_and_old_ones_stay_readable(tmp_path: Path) -> None:
    _, rollout = pushed()
    save_npz(rollout, tmp_path / "a.npz")
    back = trace_of(load_npz(tmp_path / "a.npz"))
    assert back.measured == trace_of(rollout).measured
    assert (back.regular == trace_of(rollout).regular).all()
    with np.load(tmp_path / "a.npz") as file:
        result, states = json.loads(file["result"].item()), file["states"]
    del result["trace"]["measured"]
    result["broken"] = [
        {"block": 1, "type": 2, "partner": 0, "time": 1.0, "load": 1.2},
    ]
    names = [name for name in states.dtype.names if name not in ("regular", "pull", "work")]
    np.savez(tmp_path / "b.npz", result=np.array(json.dumps(result).encode()), states=states[names])
    old = load_npz(tmp_path / "b.npz")
    assert trace_of(old).regular.all()
    assert trace_of(old).measured.contacts == ()
    assert trace_of(old).pull.shape == trace_of(old).length.shape
    assert old.broken[0].force == (0.0, 0.0, 0.0)


# --- loads ---------------------------------------------------------------------------------


@pytest.mark.pybullet
def test_peaks_are_those_of_every_step() -> None:
    """No sample shows more than the peak, and the peak of what broke is the load that broke it."""
    machine = load("flying/copter.json")
    rollout = simulate(machine, get_task("flying"))
    trace = trace_of(rollout)
    peaks = trace.measured.peaks
    assert Counter(peak.after for peak in peaks) == {False: 5, True: 5}
    greatest = dict(zip(trace.connections, np.nanmax(trace.utilisation, axis=0), strict=True))
    broken = {(item.block, item.partner): item for item in rollout.broken}
    assert broken
    for peak in peaks:
        item = broken.get((peak.block, peak.partner))
        if peak.after and item:
            assert (peak.load, peak.time, peak.force) == (item.load, item.time, item.force)
        else:
            assert peak.load <= greatest[peak.block, peak.partner] + 1e-12
    held = [p for p in peaks if p.after and (p.block, p.partner) not in broken]
    assert all(p.load == pytest.approx(greatest[p.block, p.partner]) for p in held)
    first = rollout.broken[0]
    line = lines_of(rollout, "Broken: ")[0]
    force = rounded(float(np.linalg.norm(first.force)))
    assert f"load {first.load:.2f} (force, moment: {force} " in line


# --- energy --------------------------------------------------------------------------------

TOLERANCE = 0.01
"""Share of the energy by which the balance may be wrong where nothing is lost."""


def balanced(assembly: Assembly, switch: str, gravity: float, time: float) -> Energy:
    """The energy after a time in a world without friction and air."""
    engine = default_engine().start(constants().changed({"gravity": gravity}))
    world = engine.build(assembly, Scene(), RATE)
    start = world.energies(world.snapshot())
    world.switch(switch, 1.0)
    for _ in range(round(time * RATE)):
        world.step()
    energies = start, world.energies(world.snapshot())
    energy = energy_until(time, world.works()[-1], energies, 1, ())
    engine.close()
    return energy


def floating(spring: Spring | None, drive: Drive | None) -> Assembly:
    """A heavy and a light part high above the ground, with a spring or a motor between them."""
    places = ((0.0, 50.0, 0.0), (1.0, 52.0, 0.5))
    parts = (
        Part(0, places[0], 10.0, (4.0, 4.0, 4.0)),
        Part(1, places[1], 2.0, (1.0, 1.0, 1.0)),
    )
    joints: tuple[Joint, ...] = ()
    if drive is not None:
        joints = (Joint(1, 0, 0, 1, "revolute", places[1], (0.0, 1.0, 0.0), drive=drive),)
    devices = Devices(springs=() if spring is None else (spring,))
    upright = (IDENTITY, IDENTITY)
    return Assembly(parts, joints, ((0,), (1,)), places, places, upright, devices=devices)


def test_the_work_of_a_spring_is_what_it_sets_in_motion() -> None:
    spring = Spring(0, 1, natural=0.5, ramp=1.0, force=100.0, damping=0.0)
    energy = balanced(floating(spring, None), "springs", 0.0, 0.2)
    assert energy.springs > 20.0
    assert energy.thrown > energy.machine > 0.0
    assert abs(energy.lost) < TOLERANCE * energy.springs


def test_each_spring_has_work_and_greatest_pull_and_loads_just_after_a_release_are_kept() -> None:
    machine, rollout = thrown()
    trace = trace_of(rollout)
    pulls, energy, moment = (
        trace.measured.pulls,
        trace.measured.energy,
        rollout.feedback.data["moment"],
    )
    assert energy is not None
    assert {pull.block for pull in pulls} == set(trace.linear)
    assert sum(pull.work for pull in pulls) == pytest.approx(energy.springs)
    assert rollout.feedback.data["pulls"] == [vars(pull) for pull in pulls]
    block, row = trace.linear[0], int(np.abs(trace.times - energy.time).argmin())
    assert trace.work[row, 0] == pytest.approx(pulls[0].work)
    assert 0.0 < np.max(trace.pull[: row + 1, 0]) <= pulls[0].force <= 600.0 * 1.1
    asked = {"id": block, "duration": [0, energy.time], "properties": ["pull", "work"]}
    (answer,) = answer_queries(machine, rollout, [asked]).data
    assert answer["work"][-1] == pytest.approx(pulls[0].work)
    recoil = rollout.feedback.data["recoil"]
    assert recoil
    assert all(moment["time"] < peak["time"] <= moment["time"] + RECOIL for peak in recoil)


def test_the_work_of_a_motor_is_what_it_sets_in_motion() -> None:
    energy = balanced(floating(None, Drive(50.0, 20.0)), "motors", 0.0, 0.5)
    assert energy.motors > 20.0
    assert abs(energy.lost) < TOLERANCE * energy.motors


def test_the_work_of_gravity_is_what_falls() -> None:
    energy = balanced(floating(None, None), "motors", 10.0, 1.0)
    assert energy.gravity == pytest.approx(12.0 * 10.0 * 5.0, rel=0.02)
    assert abs(energy.lost) < TOLERANCE * energy.gravity


def test_of_a_throw_most_energy_is_accounted_for() -> None:
    """Springs lose some of their work to damping, and the air takes a little."""
    _, rollout = thrown()
    energy = trace_of(rollout).measured.energy
    assert energy is not None
    given = energy.springs + energy.motors + energy.gravity
    assert 0.0 < energy.lost < 0.3 * given
    boulder = rollout.feedback.data["boulder"]
    row = int(np.abs(trace_of(rollout).times - energy.time).argmin())
    speed = float(np.linalg.norm(trace_of(rollout).velocity[row, boulder]))
    assert energy.thrown == pytest.approx(library()[36].mass / 2 * speed**2, rel=0.05)
    assert lines_of(rollout, f"Energy until release at {energy.time:.2f} s (J): work of springs ")


# --- release -------------------------------------------------------------------------------


def test_the_release_line_tells_the_flight_that_followed() -> None:
    """From speed, elevation and height at release follows where the boulder lands."""
    _, rollout = thrown()
    (line,) = lines_of(rollout, "Release at ")
    found = re.fullmatch(
        r"Release at (.+) s: speed (.+) m/s, elevation (.+) degrees, block \d+ \(.+\) has turned "
        r"(\d+) degrees, now at (.+) rad/s, lengths of springs .+ m.*",
        line,
    )
    assert found is not None, line
    time, speed, elevation, turned, rate = map(float, found.groups())
    assert rollout.feedback.data["release"] == {
        "speed": pytest.approx(speed, abs=0.05),
        "elevation": pytest.approx(elevation, abs=0.5),
    }
    assert turned > 20.0
    assert rate > 1.0
    trace, boulder = trace_of(rollout), rollout.feedback.data["boulder"]
    row = int(np.searchsorted(trace.times, time))
    angle = np.radians(elevation)
    rise = speed * np.sin(angle)
    gravity = constants()["gravity"]
    height = trace.centre[row, boulder, 1] - 0.9
    flown = (rise + np.sqrt(rise**2 + 2 * gravity * height)) / gravity * speed * np.cos(angle)
    landed = float(rollout.terms["landing"] or 0.0)
    end = trace.centre[np.abs(trace.times - landed).argmin(), boulder, 2]
    assert end - trace.centre[row, boulder, 2] == pytest.approx(flown, rel=0.1)


@pytest.mark.slow
def test_the_take_off_of_a_jump_and_the_forces_of_a_flight_are_told() -> None:
    jumper = load("jumping/tossing_arm.json")
    jump = simulate(jumper, get_task("jumping").trials(0)[0])
    (line,) = lines_of(jump, "Take-off ")  # a rod breaks as designed, before
    told = (
        r"Take-off of the root's fragment at 1\.\d\d s: speed \d+\.\d m/s, elevation \d+ degrees, "
    )
    assert re.match(told, line)
    flyer = load("flying/copter.json")
    flight = simulate(flyer, get_task("flying", {"window": 2}))
    (line,) = lines_of(flight, "Flight ")
    weight = constants()["gravity"] * sum(library()[step.type].mass for step in flyer)
    assert f"weight {weight:.3g}: 0.2 s lift " in line
    assert line.count("drag") == line.count("pitch ") - 1 == 3


# --- what is told --------------------------------------------------------------------------


def contact(a: int, b: int | str, time: float, impulse: float, last: float) -> Contact:
    hit = Hit(time, (0.0, 0.0, time), impulse)
    return Contact(a, b, hit, hit, standing=False, last=last)


def test_contacts_of_what_is_thrown_and_what_stops_a_machine_are_told_before_harder_ones() -> None:
    hard = [contact(i, i + 1, 0.1 * i, 100.0 + i, 0.1 * i) for i in range(1, 6)]
    stopped = contact(8, "wall 1", 2.0, 1.0, 5.0)
    thrown_by = contact(3, "cargo", 1.0, 20.0, 1.1)
    lying = contact(9, "ground", 1.0, 5.0, 5.0)
    moment = Moment(1.0, "the cargo's top speed", "cargo")
    told = explanatory([*hard, stopped, thrown_by, lying], moment, 5.0)
    assert told == [hard[3], hard[4], thrown_by, stopped]
    assert contact_line(told, 5.0) == [
        "Contacts (impulse in N s, place): block 4 on block 5 at 0.40 s: 104 (0.0, 0.0, 0.4); "
        "block 5 on block 6 at 0.50 s: 105 (0.0, 0.0, 0.5); "
        "block 3 on the cargo at 1.00 s: 20 (0.0, 0.0, 1.0); "
        "block 8 on wall 1 at 2.00 s, until the end: 1 (0.0, 0.0, 2.0)"
    ]


def test_a_film_shows_equal_intervals_and_a_3d_file_every_sample(tmp_path: Path) -> None:
    machine, rollout = pushed()
    trace = trace_of(rollout)
    assert len(trace.times) > len(trace.even.times) == 16
    save_film(machine, get_task("delivery"), rollout, tmp_path / "a.gif", size=(80, 60))
    with Image.open(tmp_path / "a.gif") as film:
        assert getattr(film, "n_frames", 0) == 16
        assert film.info["duration"] == 200
    content = rollout_glb(machine, rollout)
    document = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    sampler = document["animations"][0]["samplers"][0]
    times = document["accessors"][sampler["input"]]
    assert times["count"] == len(trace.times)
    assert times["max"] == pytest.approx([3.0])
