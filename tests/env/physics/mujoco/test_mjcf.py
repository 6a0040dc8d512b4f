"""MJCF files, opened and stepped by MuJoCo alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import fromstring

import mujoco
import numpy as np
import pytest

from agentflow.app.machines.files import read_one
from agentflow.cli import main
from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.frames import swap_all
from agentflow.env.physics.mujoco.engine import MuJoCoEngine
from agentflow.env.physics.mujoco.export.mjcf import RATE, machine_mjcf
from agentflow.env.rollout import Array
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.env.urdf import link_names, machine_urdf
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.machines import CAR, FOLDER, machine
from tests.processes import run_python

SAME = ("body_mass", "body_inertia", "body_pos", "body_ipos", "geom_size", "geom_pos")
SAME += ("geom_friction", "geom_solref", "geom_solimp", "geom_priority", "geom_condim")
SAME += ("jnt_type", "jnt_axis", "jnt_pos", "jnt_range", "jnt_stiffness", "dof_damping")
SAME += ("dof_solref", "dof_solimp", "eq_type", "eq_solref", "pair_friction")
SAME += ("exclude_signature", "body_parentid", "geom_bodyid", "mesh_vert")


def case(name: str, task: str) -> tuple[Machine, Task]:
    """A shipped machine, and the only or first trial of a task."""
    return read_one(str(FOLDER / f"{name}.json")), get_task(task).trials(0)[0]


def opened(tree: Machine, task: Task, folder: Path) -> tuple[Any, Any]:
    """The model in the file, and its state at rest."""
    (folder / "machine.xml").write_bytes(machine_mjcf(tree, task)[0])
    model = mujoco.MjModel.from_xml_path(str(folder / "machine.xml"))
    return model, mujoco.MjData(model)


def run(model: Any, data: Any, seconds: float) -> None:
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)


def centres(data: Any, tree: Machine) -> Array:
    """(N, 3) block centres, game frame; those of two-ended blocks are nan."""
    assembly = assemble(tree, place(tree), constants())
    found = np.full((len(tree), 3), np.nan)
    names = link_names(tree, assembly)
    for step, parts in zip(tree, assembly.blocks, strict=True):
        if not step.two_ended:
            body = data.body(names[parts[0]])
            arm = np.array(assembly.centres[step.id]) - assembly.parts[parts[0]].centre
            found[step.id] = swap_all(body.xipos + body.xmat.reshape(3, 3) @ swap_all(arm))
    return found


def distance(one: Array, other: Array) -> float:
    return float(np.nanmax(np.linalg.norm(one - other, axis=1)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "task", "moved"),
    [
        ("plain_car", "movement", 6.0),
        ("sprung_car", "movement", 5.0),
        ("framed_car", "movement/3", 6.0),
        ("lifting/turntable", "lifting", 2.5),
        ("lifting/wide_drawbridge", "lifting", 2.0),
    ],
)
def test_plain_steps_from_the_keyframe_move_as_the_rollout(
    name: str, task: str, moved: float, tmp_path: Path
) -> None:
    tree, trial = case(name, task)
    rollout = simulate(tree, trial, engine=MuJoCoEngine(), rate=RATE, interval=0.5)
    assert rollout.trace is not None
    trace = rollout.trace.even
    model, data = opened(tree, trial, tmp_path)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    run(model, data, 1.0)
    assert trace.times[2] == pytest.approx(1.0)
    assert distance(centres(data, tree), trace.centre[2]) < 0.01
    assert distance(trace.centre[2], trace.centre[0]) > moved


def test_with_all_controls_at_0_the_machine_settles(tmp_path: Path) -> None:
    tree, trial = case("sprung_car", "movement")
    rollout = simulate(tree, trial, engine=MuJoCoEngine(), power=False)
    assert rollout.trace is not None
    model, data = opened(tree, trial, tmp_path)
    run(model, data, 1.0)
    assert distance(centres(data, tree), rollout.trace.centre[0]) < 0.001
    assert np.abs(data.qvel).max() < 0.01


MODELS = {
    "suspensions and a rough road": case("sprung_car", "movement/4"),
    "braces, a boulder and a rolling surface": case("braced_throw", "throwing"),
    "cogs": case("gearing/fork", "gearing/5"),
    "springs": case("lifting/wide_drawbridge", "lifting/2"),
    "a loop": (
        machine((0, -1, -1), (44, 0, 0), (44, 0, 1), (7, 1, 0, 2, 0)),
        get_task("movement"),
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_file_holds_the_model_of_the_engine(name: str, tmp_path: Path) -> None:
    tree, trial = MODELS[name]
    assembly = assemble(tree, place(tree), constants())
    engine = MuJoCoEngine().build(assembly, trial.scene(tree), RATE).now.built.model
    model, _ = opened(tree, trial, tmp_path)
    braces = model.ngeom - engine.ngeom
    assert braces == sum(step.type == 7 for step in tree)
    solid = (model.geom_contype > 0) & (model.geom_conaffinity > 0)
    assert solid.sum() == engine.ngeom
    for field in SAME:
        ours, theirs = getattr(engine, field), getattr(model, field)
        if field.startswith("geom_"):
            theirs = theirs[solid]
        assert theirs == pytest.approx(ours, rel=2e-5, abs=1e-6), field
    used = 5 if (engine.eq_type == mujoco.mjtEq.mjEQ_JOINT).all() else 11
    assert model.eq_data[:, :used] == pytest.approx(engine.eq_data[:, :used], rel=2e-5, abs=1e-6)
    for option in ("gravity", "cone", "impratio", "disableflags", "solver", "iterations"):
        assert getattr(model.opt, option) == pytest.approx(getattr(engine.opt, option))


def test_motors_are_servos_of_limited_torque(tmp_path: Path) -> None:
    model, data = opened(CAR, get_task("movement"), tmp_path)
    names = [model.actuator(i).name for i in range(model.nu)]
    motors = [i for i, name in enumerate(names) if name.startswith("motors ")]
    assert [names[i].split()[-1] for i in motors] == ["3", "4", "5", "6"]
    assert model.actuator_forcerange[motors].tolist() == [[-40.0, 40.0]] * 4
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert data.ctrl[motors].tolist() == [1.0] * 4
    run(model, data, 0.1)
    assert np.abs(data.actuator_force[motors]) == pytest.approx([40.0] * 4)
    run(model, data, 2.0)
    hinges = model.jnt_dofadr[model.actuator_trnid[motors, 0]]
    assert np.abs(data.qvel[hinges]) == pytest.approx([10.0] * 4, rel=0.01)
    data.ctrl[:] = -1.0
    run(model, data, 3.0)
    assert data.qvel[1] < -3.0


def test_thrust_and_drag_are_those_of_the_engine(tmp_path: Path) -> None:
    """A flying machine that is thrown off, spinning, high up."""
    tree, task = machine((0, -1, -1), (1, 0, 4), (14, 0, 0), (14, 1, 1)), get_task("flying")
    model, data = opened(tree, task, tmp_path)
    assembly = assemble(tree, place(tree), constants())
    world = MuJoCoEngine().build(assembly, task.scene(tree), RATE)
    for state in (data, world.now.built.data):
        state.qpos[2] += 100.0
        state.qvel[:6] = 10.0, 20.0, 5.0, 3.0, -2.0, 1.0
    world.switch("motors", 1.0)
    data.ctrl[[model.actuator(i).name.startswith("motors ") for i in range(model.nu)]] = 1.0
    start = centres(data, tree)
    for _ in range(250):
        world.step()
    run(model, data, 0.5)
    assert distance(centres(data, tree), world.centres()) < 1e-5
    assert distance(world.centres(), start) > 5.0


def test_what_the_file_cannot_hold_is_said_in_it() -> None:
    data, notes = machine_mjcf(*case("jumping/tossing_arm", "jumping"))
    assert notes == (
        "MJCF does not hold the strength of connections: nothing breaks",
        "MJCF does not hold the later switches of the task: springs to 1 at 1 s, winches to 1 at "
        "1 s, steering_hinges to 1 at 1 s",
    )
    text = data.decode()
    assert all(f"* {note}\n" in text for note in notes)
    assert "\nBodies and joints are named after their blocks, as in a .urdf file.\n" in text
    assert "A machine and the scene of the task jumping, as the physics engine mujoco " in text
    windy = get_task("movement/4", {"wind.speed": 5})
    assert "MJCF does not hold the wind of the task" in machine_mjcf(CAR, windy)[1]
    assert machine_mjcf(CAR, get_task("movement")) == machine_mjcf(CAR, get_task("movement"))


def test_the_command_writes_a_file_that_mujoco_opens(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "car.xml"
    car = str(FOLDER / "plain_car.json")
    assert main(["convert", car, str(out), "--task", "movement", "--set", "wind.speed=3"]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        "note: MJCF does not hold the strength of connections: nothing breaks",
        "note: MJCF does not hold the wind of the task",
    ]
    assert mujoco.MjModel.from_xml_path(str(out)).nkey == 1


@pytest.mark.slow
def test_without_mujoco_the_command_says_what_to_install(tmp_path: Path) -> None:
    code = f"""
import importlib.metadata as metadata
known = metadata.version
def version(name):
    if name.startswith("mujoco"):
        raise metadata.PackageNotFoundError(name)
    return known(name)
metadata.version = version
from agentflow.cli import main
main(["convert", {str(FOLDER / "plain_car.json")!r}, "car.xml", "--task", "movement"])
"""
    done = run_python("-c", code, cwd=tmp_path)
    needs = "agentflow: the physics engine 'mujoco' needs mujoco-core or mujoco; install it"
    assert done.stderr.startswith(needs)
    assert not (tmp_path / "car.xml").exists()


@pytest.mark.parametrize("name", ["plain_car", "sprung_car"])
def test_bodies_and_joints_have_the_names_of_links_and_joints_in_urdf(
    name: str, tmp_path: Path
) -> None:
    tree, task = case(name, "movement")
    robot = fromstring(machine_urdf(tree)[0])
    model, _ = opened(tree, task, tmp_path)
    links = {str(link.get("name")) for link in robot.iter("link")}
    bodies = {model.body(i).name for i in range(model.nbody)}
    assert {link for link in links if not link.endswith(("_x", "_y"))} <= bodies
    assert all(f"block_{step.id}_" in str(sorted(bodies)) for step in tree)
    moving = {joint.get("name") for joint in robot.iter("joint") if joint.get("type") != "fixed"}
    joints = {model.joint(i).name for i in range(model.njnt)} - {""}
    assert len(joints) > 3
    assert {joint for joint in joints if "_loop_" not in joint} <= moving
