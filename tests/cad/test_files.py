"""Files of CAD programs and 3D printers measure what the block library says, for two readers."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import pytest

from agentflow.env.drawing.glb import linear
from agentflow.env.physics.frames import swap
from agentflow.errors import UsageError
from agentflow.machine import Machine, Problem, library, place
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.edits.random import random_machine
from agentflow.machine.geometry.pieces import build_order, parent_bonds
from agentflow.making.parts import Making, making
from tests.cad.reading import expected, read_3mf, read_mesh, read_step
from tests.machine.builders import CAR, CATAPULT, build

pytestmark = [pytest.mark.cad, pytest.mark.slow]

CLOSE = 1e-3
"""Greatest relative difference of volumes, and of centroids in m."""
MACHINES = Path(__file__).parents[1] / "machines"
SPRUNG = build((63, 0, 4), (9, 1, 0, 0, 2), (7, 1, 0, 0, 3), (5, 0, 0), (15, 4, 0))
"""With a spring, a brace and a hinge."""
SOME = [
    CAR,
    CATAPULT,
    SPRUNG,
    *(build((kind, 0, face)) for face, kind in enumerate((30, 50, 86, 44, 28, 26))),
    Machine.from_file(MACHINES / "bridge" / "king_post.json"),
    Machine.from_file(MACHINES / "gearing" / "around_the_holes.json"),
]


def name_of(machine: Machine, block: int) -> str:
    return f"block_{block}_{library()[machine[block].type].name.lower().replace(' ', '_')}"


@pytest.mark.parametrize("machine", SOME)
def test_a_step_file_holds_every_block_and_every_axis(machine: Machine, tmp_path: Path) -> None:
    from agentflow.making.step import machine_step

    data, _ = machine_step(machine, Making())
    bodies, axes = read_step(data, tmp_path, 1000)
    assert set(bodies) == {name_of(machine, step.id) for step in machine}
    for name, body in expected(machine).items():
        assert bodies[name].volume == pytest.approx(body.volume, rel=CLOSE)
        assert bodies[name].centre == pytest.approx(body.centre, abs=CLOSE)
    for step in machine:
        color = tuple(map(linear, library()[step.type].color[:3]))
        assert bodies[name_of(machine, step.id)].color == pytest.approx(color, abs=CLOSE)
    moving = [block for block in machine if library()[block.type].joint.moves]
    assert len(axes) == len(moving)
    for placed in place(machine).blocks:
        joint = library()[placed.type].joint
        if joint.moves:
            ends = axes[f"{name_of(machine, placed.id)}_{joint.kind}_axis"]
            axis = swap(placed.orientation.turn(DIRECTIONS[joint.axis]))
            assert ends[1] - ends[0] == pytest.approx(np.array(axis), abs=1e-6)
    assert data.count(b"PRODUCT_DEFINITION(") == 1 + len(axes) + kinds(machine)


def kinds(machine: Machine) -> int:
    """Number of different parts: types, and lengths of two-ended blocks."""
    return len(
        {
            (placed.type, placed.shape is None and round(float(np.linalg.norm(line)), 6))
            for placed in place(machine).blocks
            for line in [np.subtract(placed.end_b or 0.0, placed.end_a or 0.0)]
        }
    )


@pytest.mark.parametrize("machine", SOME)
def test_printed_parts_are_watertight_and_two_readers_measure_the_same(machine: Machine) -> None:
    from agentflow.making.printing import machine_3mf, machine_stl

    settings = making(10, parts=True)
    data, notes = machine_3mf(machine, settings)
    meshes, volumes = read_mesh(data, "3mf"), read_3mf(data)
    printed = {
        name_of(machine, step.id)
        for step in machine
        if library()[step.type].connector in (None, "rod")
    }
    assert set(meshes) == set(volumes) == printed
    springs = [step.id for step in machine if step.type in (9, 45)]
    assert any(note.startswith("springs and winches are left out") for note in notes) == bool(
        springs
    )
    for name, mesh in meshes.items():
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(volumes[name], rel=1e-6)
    for name, body in expected(machine).items():
        kind = library()[machine[int(name.split("_")[1])].type]
        if name in meshes and not kind.linear:
            assert meshes[name].volume == pytest.approx(1e6 * body.volume, rel=CLOSE)
    [solid] = read_mesh(machine_stl(machine, settings)[0], "stl").values()
    assert solid.is_watertight
    assert solid.volume == pytest.approx(sum(mesh.volume for mesh in meshes.values()), rel=1e-4)
    assert solid.bounds[0] == pytest.approx(np.zeros(3), abs=1e-3)


def test_a_merged_car_is_one_watertight_body_of_the_same_volume() -> None:
    from agentflow.making.printing import machine_3mf, machine_stl

    volume = sum(body.volume for body in expected(CAR).values())
    middle = sum(body.volume * body.centre for body in expected(CAR).values()) / volume
    for write, form in ((machine_stl, "stl"), (machine_3mf, "3mf")):
        data, notes = write(CAR, Making())
        [mesh] = read_mesh(data, form).values()
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(50**3 * volume, rel=CLOSE)
        assert mesh.center_mass == pytest.approx(50 * middle, abs=0.05)
        assert notes[:2] == (
            "moving joints are rigid: blocks 3, 4, 5, 6",
            "the scale is 1 : 20, and all of it takes 100 x 250 x 100 mm",
        )


def test_what_is_lost_is_listed() -> None:
    from agentflow.making.printing import machine_3mf, machine_stl
    from agentflow.making.step import machine_step
    from agentflow.making.usd import machine_usd

    lost = "springs and winches are left out: block 2"
    assert lost in machine_stl(SPRUNG, Making())[1]
    assert {lost, "braces have no pegs and need glue: block 3"} < {
        *machine_3mf(SPRUNG, making(parts=True))[1]
    }
    for write in (machine_step, machine_usd):
        assert any("rods: block 2" in note for note in write(SPRUNG, Making())[1])
    reaching = build((63, 0, 4), (63, 0, 0), (86, 1, 10))  # a wheel that reaches out of its box
    through = "what passes through other blocks does not fit as it is: block 3"
    assert through in machine_3mf(reaching, making(parts=True))[1]
    assert not [note for note in machine_3mf(CAR, making(parts=True))[1] if "passes" in note]
    apart = build((44, 0, 4), (7, 0, 0, 0, 2), (36, 1, 0))
    assert not [note for note in machine_stl(apart, Making())[1] if "touch" in note]


@pytest.mark.parametrize("machine", SOME)
def test_a_usd_file_holds_every_block_where_it_is(machine: Machine) -> None:
    from pxr import Sdf, Usd, UsdGeom, UsdPhysics

    from agentflow.making.usd import machine_usd

    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(machine_usd(machine, making(2))[0].decode())
    stage = Usd.Stage.Open(layer)
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (1.0, "Z")
    geometry, root = place(machine), stage.GetDefaultPrim()
    blocks = [prim for prim in root.GetChildren() if prim.GetName() != "joints"]
    assert [prim.GetName() for prim in blocks] == [name_of(machine, step.id) for step in machine]
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    shift = np.array((geometry.middle[0], geometry.middle[2], geometry.box_min[1]))
    for placed, prim in zip(geometry.blocks, blocks, strict=True):
        if library()[placed.type].connector in (None, "rod"):
            mass = UsdPhysics.MassAPI(prim).GetMassAttr().Get()
            assert mass == pytest.approx(library()[placed.type].mass)
        if placed.two_ended or library()[placed.type].shape == "caster":
            continue
        box = cache.ComputeWorldBound(prim).ComputeAlignedRange()
        assert np.array(box.GetMin()) == pytest.approx(
            (np.array(swap(placed.box_min)) - shift) / 2, abs=CLOSE
        )
        assert np.array(box.GetMax()) == pytest.approx(
            (np.array(swap(placed.box_max)) - shift) / 2, abs=CLOSE
        )


@pytest.mark.parametrize("machine", SOME)
def test_usd_joints_are_where_both_of_their_bodies_say(machine: Machine) -> None:
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

    from agentflow.making.usd import machine_usd

    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(machine_usd(machine, making(2))[0].decode())
    stage, geometry, moving = Usd.Stage.Open(layer), place(machine), []
    bonds = {f"block_{bond.block}_": bond for bond in parent_bonds(geometry)}
    shift = np.array((geometry.middle[0], geometry.middle[2], geometry.box_min[1]))
    for prim in stage.GetPrimAtPath("/machine/joints").GetChildren():
        joint, frames = UsdPhysics.Joint(prim), []
        for body, place_of, turn_of in (
            (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
            (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
        ):
            (target,) = body.GetTargets()
            cache = UsdGeom.XformCache(Usd.TimeCode.Default())
            world = cache.GetLocalToWorldTransform(stage.GetPrimAtPath(target))
            axis = Gf.Rotation(turn_of.Get()).TransformDir(Gf.Vec3d(0, 1, 0))
            frames.append((*world.Transform(Gf.Vec3d(place_of.Get())), *world.TransformDir(axis)))
        assert frames[0] == pytest.approx(frames[1], abs=1e-5)
        if not prim.IsA(UsdPhysics.FixedJoint):
            name = next(start for start in bonds if target.name.startswith(start))
            pivot = (np.array(swap(bonds[name].pivot)) - shift) / 2
            assert frames[0] == pytest.approx((*pivot, *swap(bonds[name].axis)), abs=1e-5)
            moving.append(name)
    assert len(moving) == sum(bond.kind != "fixed" for bond in bonds.values())


def test_random_machines_come_back_as_they_were(tmp_path: Path) -> None:
    from agentflow.making.printing import machine_stl
    from agentflow.making.step import machine_step

    for seed in range(6):
        machine = random_machine(Random(f"made {seed}"), size=(5, 25))
        bodies, _ = read_step(machine_step(machine, Making())[0], tmp_path, 1000)
        for name, body in expected(machine).items():
            assert bodies[name].volume == pytest.approx(body.volume, rel=CLOSE)
            assert bodies[name].centre == pytest.approx(body.centre, abs=CLOSE)
        [mesh] = read_mesh(machine_stl(machine, Making())[0], "stl").values()
        assert mesh.is_watertight, seed


def test_parts_that_could_not_be_put_together_get_no_pegs() -> None:
    from agentflow.making.printing import machine_stl

    clamp = Machine.from_file(MACHINES / "bridge" / "clamp.json")
    problem = build_order(place(clamp))
    assert isinstance(problem, Problem)
    with pytest.raises(UsageError) as error:
        machine_stl(clamp, making(pegs="5mm"))
    assert str(error.value) == f"its parts could not be put together: {problem.message}"
