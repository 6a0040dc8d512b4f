"""Controllers in rollouts: sensors on both engines, laws, breakage, noise, what is told."""

from __future__ import annotations

import random
import textwrap
from bisect import bisect_right
from dataclasses import replace
from math import atan2, degrees, inf, sqrt
from typing import Any

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.controllers.laws import law_lines, spans_of
from agentflow.env.controllers.pilot import ROUNDING, Pilot
from agentflow.env.controllers.rays import Rays, meet_box, ray_lines
from agentflow.env.controllers.telling import _rounded
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import World
from agentflow.env.physics.engines import choose_engine
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Rollout
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import (
    PERTURBATIONS,
    SENSING,
    perturbations_of,
)
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine.controllers.model import QUANTITIES, RANGE, Controllers, Sensor
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import (
    Vec3,
    about_axis,
    dot,
    inverse,
    rotate_vector,
    scale,
    subtract,
)
from agentflow.machine.tree import Machine
from benchmarks.shelf import load
from tests.machine.builders import CAR
from tests.machine.controllers import sensing_car

ENGINES = ("pybullet", "mujoco")
ALL: dict[str, Any] = {
    "time": {"kind": "time"},
    "height": {"kind": "height"},
    "lean": {"kind": "tilt", "axis": "z"},
    "heading": {"kind": "heading"},
    "speed": {"kind": "velocity", "axis": "z"},
    "yaw": {"kind": "spin", "axis": "y"},
    "goal": {"kind": "target", "axis": "z"},
    "wheel": {"kind": "angle", "block": 3},
    "turning": {"kind": "turning", "block": 3},
    "opposite": {"kind": "turning", "block": 4},
    "touch": {"kind": "contact", "block": 3},
    "load": {"kind": "load", "block": 3},
    "below": {"kind": "distance", "axis": "y-"},
}
AHEAD: dict[str, Vec3] = {
    "x+": (1.0, 0.0, 0.0),
    "y+": (0.0, 1.0, 0.0),
    "z+": (0.0, 0.0, 1.0),
    "x-": (-1.0, 0.0, 0.0),
    "y-": (0.0, -1.0, 0.0),
    "z-": (0.0, 0.0, -1.0),
}
KEEP_SPEED = {"kind": "pd", "sensor": "speed", "target": 4, "p": 0.5, "bias": 0.2}


def drive(engine: str, sensors: dict[str, Any], laws: dict[str, Any], **options: Any) -> Rollout:
    """The car with its wheels driven by the last of these laws."""
    outputs = [{"group": "motors", "law": [*laws][-1]}]
    machine = sensing_car({"sensors": sensors, "laws": laws, "outputs": outputs})
    knobs = {"controls": "sensed", "window": 2, **options.pop("knobs", {})}
    return simulate(machine, get_task("movement", knobs, engine), **options)


@pytest.mark.parametrize("engine", ENGINES)
def test_sensors_read_what_the_trace_records(engine: str) -> None:
    assert {sensor["kind"] for sensor in ALL.values()} == set(QUANTITIES), "no other can be sensed"
    found = drive(engine, ALL, {"go": KEEP_SPEED}, interval=0.1)
    again = drive(engine, ALL, {"go": KEEP_SPEED}, interval=0.1)
    assert found.digest == again.digest, "the same bits on replay"
    told, trace = found.feedback.data["controllers"], found.trace
    assert trace is not None
    even = trace.even
    read = {name: np.array(values[:20]) for name, values in told["sensors"].items()}
    assert told["times"][:3] == [0.0, 0.1, 0.2]
    assert read["time"] == pytest.approx(even.times[:20], abs=1e-3)
    assert read["height"] == pytest.approx(even.centre[:20, 0, 1], abs=1e-3)
    assert read["below"] == pytest.approx(even.centre[:20, 0, 1], abs=1e-3)
    assert read["goal"] == pytest.approx(-even.centre[:20, 0, 2], abs=1e-3)
    assert read["speed"] == pytest.approx(even.velocity[:20, 0, 2], abs=1e-3)
    assert read["yaw"] == pytest.approx(np.degrees(even.angular_velocity[:20, 0, 1]), abs=1e-2)
    assert abs(read["lean"]).max() < 5
    assert abs(read["heading"]).max() < 5
    spin = np.degrees(even.angular_velocity[:20, 3] - even.angular_velocity[:20, CAR[3].parent])
    assert read["turning"] == pytest.approx(np.linalg.norm(spin, axis=1), rel=0.05, abs=5)
    assert read["opposite"].min() > -5, "wheels on either side turn as level 1 turns them"
    assert read["wheel"][0] == pytest.approx(0, abs=1)
    assert read["touch"].max() < 0.3
    assert 0 < read["load"].max() < 1
    assert read["speed"][-1] == pytest.approx(4, abs=1), "the law keeps the speed"


@pytest.mark.parametrize("engine", ENGINES)
def test_sensors_read_the_same_bits_as_plain_formulas(engine: str) -> None:
    wall = SceneObject("wall", "box", (8.0, 9.0, 1.0), (0.0, 4.5, 30.0))
    crate = SceneObject("crate", "box", (2.0, 2.0, 2.0), (0.0, 6.0, 9.0), mass=5.0)
    ball = SceneObject("ball", "sphere", (2.0, 2.0, 2.0), (0.0, 9.0, 2.0))
    turned = about_axis((0.0, 1.0, 0.0), np.pi / 4)
    post = SceneObject("post", "box", (1.0, 9.0, 1.0), (-5.0, 4.5, 0.0), rotation=turned)
    scene = Scene((wall, crate, ball, post), target=(1.0, 2.0, 30.0))
    assembly = assemble(CAR, place(CAR), constants())
    world = choose_engine(engine).start().build(assembly, scene, 240.0)
    world.drive({3: 1.0, 5: 0.4}, True)
    loads = Loads(assembly.joints, 0.1, 1 / 240, 1 / 240)
    spots = [("height", None), ("heading", None), *(("tilt", axis) for axis in "xz")]
    spots += [(kind, axis) for kind in ("velocity", "target") for axis in "xyz"]
    spots += [("distance", axis) for axis in AHEAD]
    found = []
    for block in (0, 2, 6):
        made = [Sensor(kind=kind, axis=axis, block=block) for kind, axis in spots]
        own = {f"s{n}": sensor.to_json() for n, sensor in enumerate(made)}
        pilot = Pilot(_holding(own), assembly, world, scene, loads, 0.1, 1.0, (0.0, 0))
        assert not any(pilot.fly(None)), "as where a block breaks off before t = 0"
        found.append((made, pilot))
    for _ in range(60):
        for _ in range(8):
            world.step()
        for made, pilot in found:
            pilot.fly(0.0)
            assert [*pilot.fly(None)] == [_plain(world, scene, sensor) for sensor in made]


def _holding(sensors: dict[str, Any]) -> Machine:
    """The car with these sensors, and wheels that stand still."""
    still = {"still": {"kind": "constant", "level": 0}}
    outputs = [{"group": "motors", "law": "still"}]
    return sensing_car({"sensors": sensors, "laws": still, "outputs": outputs})


def _plain(world: World, scene: Scene, sensor: Sensor) -> float:
    """A reading by the formulas of everything that turns, and of every object."""
    row, axis = world.row(sensor.block), "xyz".index((sensor.axis or "y")[0])
    centre, turn = world.centre(sensor.block), swap_quaternion(row[ROTATION])
    up, ahead = (rotate_vector(turn, AHEAD[way]) for way in ("y+", "z+"))
    if sensor.kind == "distance":
        way = rotate_vector(turn, AHEAD[sensor.axis or ""])
        near = [centre[1] / -way[1] if way[1] < 0 < centre[1] else inf]
        for item in scene.objects:
            back = inverse(world.rotation(item.name))
            start = rotate_vector(back, subtract(centre, world.centre(item.name)))
            ahead = rotate_vector(back, way)
            if item.shape == "sphere":
                along = -dot(start, ahead)
                square = (item.size[0] / 2) ** 2 - dot(start, start) + along * along
                near.append(along - sqrt(square) if square >= 0 and along >= sqrt(square) else inf)
            else:
                near.append(meet_box(*start, *ahead, scale(item.size, 0.5)))
        return min(RANGE, *near)
    arm = swap(subtract(centre, swap(row[POSITION])))
    swung = (np.cross(row[SPIN], arm) + row[VELOCITY])[[0, 2, 1]]
    readings = {
        "height": centre[1],
        "heading": degrees(atan2(ahead[0], ahead[2])),
        "tilt": degrees(atan2(up[axis], up[1])),
        "velocity": swung[axis],
        "target": scene.target[axis] - centre[axis],
    }
    return float(readings[sensor.kind])


def test_levels_are_rounded_as_python_rounds() -> None:
    rng = random.Random(0)
    half = [count / 2000 + shift for count in range(-2000, 2001) for shift in (0.0, 1e-16, -1e-16)]
    rounding = compile(textwrap.dedent(ROUNDING), "rounding", "exec")
    for level in [*half, *(rng.uniform(-1, 1) for _ in range(20_000))]:
        names = {"v": level}
        exec(rounding, names)
        assert repr(names["v"]) == repr(round(level, 3)), level
    many = np.array([[*half, 1e13 + 0.3, inf, *np.random.default_rng(0).normal(0, 99, 20_000)]])
    assert _rounded(many, [3]) == [[round(each, 3) for each in many[0].tolist()]]


def test_levels_change_at_once_where_a_law_jumps_and_little_by_little_under_a_rate() -> None:
    full = drive("pybullet", {}, {"go": {"kind": "constant", "level": 1}})
    slow = drive("pybullet", {}, {"go": {"kind": "constant", "level": 1, "rate": 0.2}})
    programmed = simulate(CAR, get_task("movement", {"window": 2}, "pybullet"))
    assert full.score == pytest.approx(programmed.score, rel=0.02)
    assert slow.score is not None
    assert full.score is not None
    assert slow.score < 0.5 * full.score


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sensor_that_breaks_off_keeps_its_last_reading(engine: str) -> None:
    sensors = {"h": {"kind": "height", "block": 5}, "root": {"kind": "height"}}
    law = {"kind": "pd", "sensor": "h", "p": 0, "bias": 1}
    brittle = constants().changed({"strength_torque": 50.0, "strength_force": 250.0})
    found = drive(engine, sensors, {"go": law}, physics=brittle)
    assert found.broken[0].block == 2, "which carries block 5"
    assert "- sensor h: block 5 broke off at 0.1" in found.feedback.text
    assert len(set(found.feedback.data["controllers"]["sensors"]["h"][3:])) == 1


def test_noise_and_delay_are_those_of_the_level_and_the_variation() -> None:
    laws, sensors = {"go": KEEP_SPEED}, {"speed": ALL["speed"]}

    def speeds(**options: Any) -> list[float]:
        found = drive("pybullet", sensors, laws, **options).feedback.data["controllers"]
        return list(found["sensors"]["speed"])

    exact, late = speeds(), speeds(knobs={"sensing.delay": 6})
    noisy = speeds(knobs={"sensing.noise": 0.1})
    assert late[:2] == [0.0, 0.0] or abs(late[1]) < abs(exact[1])
    assert noisy[-5:] != exact[-5:]
    assert noisy == speeds(knobs={"sensing.noise": 0.1})
    assert speeds(variation=SENSING) != exact
    assert perturbations_of(sensing_car()) == (*PERTURBATIONS, SENSING)
    assert perturbations_of(CAR) == PERTURBATIONS
    assert not SENSING.varies_bodies
    told = get_task("movement", {"controls": "sensed", "sensing.noise": 0.1}).brief.schedule
    assert told[-1] == "What sensors read have noise of 10 %."


def test_feedback_tells_readings_outputs_and_times_at_a_limit() -> None:
    laws = {
        "slow": KEEP_SPEED,
        "full": {"kind": "constant", "level": 1},
        "go": {
            "kind": "states",
            "states": [
                {
                    "name": "run",
                    "law": "full",
                    "leave": [{"sensor": "t", "above": 1, "to": "keep"}],
                },
                {"name": "keep", "law": "slow"},
            ],
        },
    }
    found = drive("pybullet", {"t": ALL["time"], "speed": ALL["speed"]}, laws).feedback
    lines = found.text.partition("over time):\n")[2].splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("- law slow (speed, target 4.00): 0.00 -> 1.00 at 0.00 s, ")
    assert "; at its limit from " in lines[0]
    assert "; state run from 0.00 s, keep from 1.03 s" in lines[1]


def outputs(laws: dict[str, Any], readings: list[list[float]], kind: str = "height") -> list[float]:
    """Outputs of the last law at 0.1 s intervals, while the only sensor reads these values."""
    data = {"sensors": {"s": {"kind": kind}}, "laws": laws}
    model = Controllers.model_validate({**data, "outputs": [{"blocks": [1], "law": [*laws][-1]}]})
    found: list[float] = []
    names: dict[str, Any] = {"bisect_right": bisect_right}

    def name(value: Any) -> str:
        names[f"n{len(names)}"] = value
        return f"n{len(names) - 1}"

    kept: dict[str, Any] = {}
    lines = law_lines(model.laws, model.sensors, 0.1, 1.0, name, kept)
    names |= kept | {"edges": [[] for _ in laws], "entered": [[] for _ in laws]}
    for step, (names["s0"],) in enumerate(readings):
        names["time"] = step * 0.1
        exec("\n".join(lines), names)
        found.append(names[f"o{len(laws) - 1}"])
    return found


def test_laws_compute_what_they_say() -> None:
    pd = {"kind": "pd", "sensor": "s", "target": 1, "p": 0.5, "d": 0.1, "bias": 0.1}
    assert outputs({"l": pd}, [[0], [0.2], [5]]) == pytest.approx([0.6, 0.3, -1])
    turned = {"kind": "pd", "sensor": "s", "target": 170, "p": 0.01}
    assert outputs({"l": turned}, [[-170]], "heading") == pytest.approx([-0.2])
    switch = {"kind": "switch", "sensor": "s", "over": 2, "under": 1, "on": 0.5, "off": -0.5}
    switched = outputs({"l": switch}, [[0], [1.5], [2.1], [1.5], [0.9]])
    assert switched == [-0.5, -0.5, 0.5, 0.5, -0.5]
    schedule = {"kind": "schedule", "points": [[0.1, 1], [0.2, 0.3]], "rate": 5}
    assert outputs({"l": schedule}, [[0]] * 4) == pytest.approx([0, 0.5, 0.3, 0.3])
    terms = [{"law": "a", "weight": 2}, {"law": "b"}]
    parts = {"a": {"kind": "constant", "level": 0.2}, "b": {"kind": "constant", "level": 0.1}}
    assert outputs({"l": {"kind": "sum", "terms": terms}, **parts, "m": pd}, [[0]]) == [0.6]
    assert outputs({**parts, "l": {"kind": "sum", "terms": terms}}, [[0]]) == pytest.approx([0.5])
    assert spans_of([1.0, 2.0, 3.0], 5.0) == [(1.0, 2.0), (3.0, 5.0)]


def test_rays_meet_the_first_surface() -> None:
    turned = about_axis((0.0, 1.0, 0.0), np.pi / 4)
    items = (
        SceneObject("wall", "box", (4.0, 2.0, 1.0), (0.0, 1.0, 10.0)),
        SceneObject("ball", "sphere", (2.0, 2.0, 2.0), (5.0, 1.0, 5.0)),
        SceneObject("post", "box", (1.0, 2.0, 1.0), (-5.0, 1.0, 5.0), rotation=turned),
    )
    many = tuple(replace(items[0], name=f"w{n}", position=(90.0, 1.0, n)) for n in range(20))
    rays = (
        ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 9.5),
        ((0.0, 1.0, 5.0), (0.0, 0.0, 1.0), 4.5),
        ((0.0, 3.0, 0.0), (0.0, 0.0, 1.0), RANGE),
        ((0.0, 1.0, 10.0), (0.0, 0.0, 1.0), RANGE),  # from the inside
        ((5.0, 1.0, 0.0), (0.0, 0.0, 1.0), 4.0),
        ((-5.0, 1.0, 0.0), (0.0, 0.0, 1.0), 5 - sqrt(0.5)),
        ((0.0, 3.0, 0.0), (0.0, -1.0, 0.0), 3.0),  # the ground
    )
    for objects in (items, (*items, *many), ()):
        look = Rays(Scene(objects), None).look  # type: ignore[arg-type]
        names: dict[str, Any] = {"meet_box": meet_box, "look": look}
        lines = "\n".join(ray_lines(0, names))  # they keep the room of one ray for the next
        for start, way, distance in rays:
            names |= zip(("cx", "cy", "cz", "i", "j", "k"), (*start, *way), strict=True)
            exec(lines, names)
            expected = distance if objects or way[1] < 0 else RANGE
            assert names["e"] == pytest.approx(expected), (start, way)


def test_every_level_can_be_sensed() -> None:
    for name in task_names():
        task = get_task(name, {"controls": "sensed"})
        assert task.brief.limits.senses
        assert task.brief.limits.controls == task.window
        assert not get_task(name, {"controls": "schedule"}).brief.limits.senses


def test_the_scene_goes_on_as_the_level_says() -> None:
    task = get_task("bridge", {"controls": "sensed"})
    scene = [entry for _, entry, _ in task.schedule.switches() if entry == "loads"]
    assert scene
    assert scene == [entry for _, entry, _ in task.switches(sensing_car()) if entry == "loads"]


def test_queries_show_readings_and_outputs() -> None:
    found = drive("pybullet", {"speed": ALL["speed"]}, {"go": KEEP_SPEED})
    asked = [
        {"id": "controllers", "duration": [0, 1], "properties": ["speed", "go"]},
        {"id": "controllers", "duration": [0, 2], "interval": 0.5},
        {"id": "controllers", "duration": [0, 1], "properties": ["height"]},
        {"id": "controllers", "duration": [7, 8]},
        {"id": "controllers", "duration": [0, 1], "properties": {"speed": 1}},
        {"id": "controllers"},
    ]
    answers = answer_queries(CAR, found, asked)
    table, whole, *refused = answers.text.split("\n\n")
    assert table.splitlines()[:2] == ["Controllers, 0 to 1 s:", "t s | speed | go"]
    assert len(table.splitlines()) == 8
    assert len(whole.splitlines()) == 6
    assert answers.data[0]["go"][0] == 1
    assert "unknown property in ['height']; known: go, speed" in refused[0]
    assert "nothing was sensed from 7 to 8 s" in refused[1]
    assert "no answer: " in refused[2]
    assert "no answer: " in refused[3]
    plain = simulate(CAR, get_task("movement", {"window": 1}, "pybullet"))
    assert "nothing was sensed" in answer_queries(CAR, plain, asked[:1]).text


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("right", [8, -8])
def test_a_car_steers_to_the_target_that_it_senses(engine: str, right: float) -> None:
    car = load("transport/steered_car.json")
    hinge = next(step.id for step in car if step.type == 28)
    wide = {"limits": [-6, 6]}
    data = {
        "sensors": {
            "aside": {"kind": "target", "axis": "x"},
            "course": {"kind": "heading"},
            "swing": {"kind": "angle", "block": hinge},
        },
        "laws": {
            "aim": {"kind": "pd", "sensor": "aside", "p": 0.6, **wide},
            "straighten": {"kind": "pd", "sensor": "course", "p": -0.03, **wide},
            "bend": {"kind": "sum", "terms": [{"law": "aim"}, {"law": "straighten"}]},
            "centre": {"kind": "pd", "sensor": "swing", "p": 0.03, **wide},
            "steer": {"kind": "sum", "terms": [{"law": "bend"}, {"law": "centre"}]},
            "drive": {"kind": "pd", "sensor": "aside", "p": -1.6 / right, "limits": [0, 0.4]},
        },
        "outputs": [
            {"group": "steering_hinges", "law": "steer"},
            {"group": "motors", "law": "drive"},
        ],
    }
    machine = replace(car, controls=(), controllers=Controllers.model_validate(data))
    knobs = {"controls": "sensed", "target.right": right}
    found = simulate(machine, get_task("transport", knobs, engine))
    assert found.trace is not None
    ended = found.trace.centre[-1, 0, 0]
    assert ended == pytest.approx(right, abs=1), "it stops beside the target, on either side"
