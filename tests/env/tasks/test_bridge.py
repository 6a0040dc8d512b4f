"""Bridges: where they are set down, when a load counts as carried, and what loads do to objects."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import EngineSpec
from agentflow.env.physics.engines import installed_engines
from agentflow.env.rollout import Verdict
from agentflow.env.scene import Body, Scene, SceneObject
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.bridge import BANKS, CARGO
from agentflow.env.tasks.registry import get_task
from agentflow.machine.description.geometry_info import describe, describe_text
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.geometry.balance import support_polygon
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import ROOT, Machine, Step
from benchmarks.shelf import load
from tests.env.fakes import LONE_ROOT, FakeWorld, make_trace

BEAM = Machine((ROOT, Step(1, 63, 0, 0), Step(2, 63, 0, 1)))
"""7 m long."""
HANGING = Machine((*BEAM, Step(3, 63, 0, 5)))
"""With a log below the root."""
GRAVITY = constants()["gravity"]


def height(machine: Machine, level: str, **knobs: float) -> float:
    return get_task(level, knobs).scene(machine).start.height


def test_a_machine_is_set_down_as_low_as_banks_and_floor_allow() -> None:
    assert height(BEAM, "bridge") == 5.0
    assert height(HANGING, "bridge") == pytest.approx(5.0 - 3.0)
    assert height(LONE_ROOT, "bridge") == 0.0
    assert height(BEAM, "bridge", **{"banks.rise": 1}) == 6.0
    assert height(HANGING, "bridge", **{"gap.depth": 2}) == 0.0


def test_the_cargo_is_put_on_the_middle_and_grows_to_the_end_load() -> None:
    scene = get_task("bridge").scene(HANGING)
    (cargo,) = scene.moving
    assert (cargo.name, cargo.mass, cargo.load) == (CARGO, 1.0, 6000.0)
    assert cargo.position == pytest.approx((0.0, 5.0 + 1.0 + 0.75, 0.0))
    assert [item.mass for item in scene.loaded(0.5).moving] == [3001.0]
    assert tuple(item.name for item in scene.objects if not item.mass) == BANKS


def test_the_load_grows_evenly_until_it_is_whole() -> None:
    switches = [item for item in get_task("bridge").schedule.switches() if item[1] == "loads"]
    assert len(switches) == 85
    assert all(level == pytest.approx(time / 17) for time, _, level in switches)
    assert switches[-1] == (17.0, "loads", 1.0)


def judge(
    *steps: tuple[float, Vec3], touching: dict[Body, frozenset[Body]] | None = None
) -> Verdict:
    """The verdict over these shares of the load and places of the cargo, 1 s each.

    The cargo begins at y = 6.7 on the root, whose centre is at y = 5.5; what it and the floor touch
    later is `touching`.
    """
    referee = get_task("bridge").referee(BEAM)
    world = FakeWorld(centres={CARGO: (0.0, 6.7, 0.0), 0: (0.0, 5.5, 0.0), 1: (0.0, 7.0, 1.5)})
    world.contacts[CARGO] = frozenset({0})
    referee.start(world)
    world.contacts |= touching or {}
    for share, spot in steps:
        world.time += 1.0
        world.levels["loads"], world.centres[CARGO] = share, spot
        referee.watch(world)
    return referee.verdict(make_trace(3))


def test_the_greatest_load_counts_until_the_cargo_is_a_metre_below_the_bank() -> None:
    verdict = judge((0.25, (0.0, 6.6, 0.0)), (0.5, (0.0, 4.1, 0.0)), (0.75, (0.0, 3.9, 0.0)))
    assert verdict.score == 3000.0
    assert verdict.terms == {
        "load": 3000.0,
        "share": 0.5,
        "success": True,
        "held": 3.0,
        "lost_at": 3.0,
        "sunk": pytest.approx(2.6),
        "blocks": 3.0,
        "result": "carried 3000 of 6000 kg; at 3.00 s the cargo's centre sank below y = 4 m",
    }
    assert verdict.moment is not None
    assert verdict.moment.time == 3.0


def test_two_seconds_are_a_success_as_in_the_other_benchmark() -> None:
    verdict = judge((1.0, (0.0, 6.6, 0.0)))
    assert (verdict.score, verdict.terms["success"], verdict.terms["held"]) == (6000.0, True, 19.0)
    assert judge((0.1, (0.0, 3.0, 0.0))).terms["success"] is False
    assert judge((0.1, (0.0, 6.6, 0.0)), (0.2, (0.0, 3.0, 0.0))).terms["success"] is True


@pytest.mark.parametrize(
    ("spot", "touching", "why"),
    [
        ((0.0, 6.6, 1.1), {}, "the cargo moved more than 1 m from the middle of the gap"),
        (
            (0.0, 6.6, 0.0),
            {CARGO: frozenset({0, "far bank"})},
            "the cargo touched the far bank",
        ),
        (
            (0.0, 6.6, 0.0),
            {"ground": frozenset({2})},
            "block 2 (Log) touched the floor of the gap",
        ),
    ],
)
def test_what_rests_on_anything_but_the_bridge_is_not_carried(
    spot: Vec3, touching: dict[Body, frozenset[Body]], why: str
) -> None:
    verdict = judge((0.5, spot), touching=touching)
    assert verdict.score == 0.0
    assert verdict.terms["result"] == f"carried 0 of 6000 kg; at 1.00 s {why}"


def test_a_cargo_that_is_held_from_the_side_earns_nothing() -> None:
    referee = get_task("bridge").referee(BEAM)
    world = FakeWorld(centres={CARGO: (0.0, 6.7, 0.0), 0: (0.0, 5.5, 0.0), 1: (0.0, 7.0, 1.5)})
    world.contacts[CARGO] = frozenset({0, 1})
    referee.start(world)
    world.levels["loads"] = 1.0
    referee.watch(world)
    verdict = referee.verdict(make_trace(3))
    assert verdict.score == 0.0
    assert "block 1 (Log) held the cargo from the side" in str(verdict.terms["result"])


@pytest.mark.parametrize("spec", installed_engines(), ids=lambda spec: spec.name)
@pytest.mark.slow
def test_soft_objects_give_way_in_proportion_to_what_is_on_them(spec: EngineSpec) -> None:
    """A box presses with four corners; its mass grows tenfold."""
    engine = spec.start()
    bank = SceneObject("bank", "box", (20.0, 2.0, 20.0), (0.0, 1.0, 0.0), stiffness=10_000.0)
    box = SceneObject(CARGO, "box", (2.5, 1.5, 2.5), (5.0, 2.75, 0.0), mass=20.0, load=180.0)
    world = engine.build(
        assemble(LONE_ROOT, place(LONE_ROOT), constants()), Scene((bank, box)), 120.0
    )
    for share, mass in ((0.0, 20.0), (1.0, 200.0)):
        world.switch("loads", share)
        for _ in range(240):
            world.step()
        sunk = 2.75 - world.centre(CARGO)[1]
        assert sunk == pytest.approx(mass * GRAVITY / 40_000, abs=0.012)
        force = sum(touch.force for touch in world.contacts() if touch.b == CARGO)
        assert force == pytest.approx(mass * GRAVITY, rel=0.01)
    engine.close()


@pytest.mark.parametrize("spec", installed_engines(), ids=lambda spec: spec.name)
@pytest.mark.slow
def test_a_beam_breaks_where_statics_says(spec: EngineSpec) -> None:
    """Two logs on the root: each of its connections bears 5000 N m.

    With the beam on the edges of the gap, 5 m apart, and all of the load on the root it would break
    at 122 kg; its ends rest farther out, and the load is spread over 2.5 m.
    """
    task = replace(get_task("bridge", {"load.most": 800}), engine=spec.name)
    rollout = simulate(BEAM, task)
    assert rollout.broken[0].load == pytest.approx(1.0, abs=0.05)
    assert 800 * rollout.broken[0].time / 17 == pytest.approx(135.0, rel=0.1)
    assert rollout.score is not None
    assert rollout.sim_seconds == pytest.approx(rollout.terms["lost_at"], abs=1 / 60)
    braced = simulate(load("bridge/braced_beam.json"), task)
    assert (braced.score, braced.terms["success"], braced.broken) == (800.0, True, ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("level", "name"),
    [
        ("bridge", "braced_beam"),
        ("bridge/3", "deep_truss"),
        ("bridge/4", "truss_on_feet"),
        ("bridge/5", "flat_truss"),
    ],
)
def test_described_on_a_bank_is_what_touches_one(level: str, name: str) -> None:
    machine, task = load(f"bridge/{name}.json"), get_task(level)
    rollout = simulate(machine, task)
    assert rollout.trace is not None
    touching = {
        contact.a
        for contact in rollout.trace.measured.contacts
        if contact.b in BANKS and contact.first.time < 0.5
    }
    blocks: list[dict[str, object]] = describe(machine, task.brief)["blocks"]  # type: ignore[assignment]
    assert {block["id"] for block in blocks if block.get("on_ground")} == touching


def test_what_hangs_over_the_gap_has_faces_below_and_supports_nothing() -> None:
    """A beam of 21 m over a gap of 20 m rests on half a metre at either end."""
    logs = (Step(1, 63, 0, 0), Step(2, 63, 1, 0), Step(3, 63, 2, 0))
    others = (Step(4, 63, 0, 1), Step(5, 63, 4, 0), Step(6, 63, 5, 0))
    long = Machine((ROOT, *logs, *others, Step(7, 15, 3, 0), Step(8, 15, 6, 0)))
    brief = get_task("bridge/5").brief
    lines = describe_text(long, brief).splitlines()
    resting = {line.split()[0]: line for line in lines if re.search("on (near|far) bank", line)}
    assert set(resting) == {"7", "8"}
    assert not any("on ground" in line for line in lines)
    assert "y- " not in resting["7"]
    assert all("y- " in line for line in lines if re.match("[1-6] Log", line))
    geometry = place(long, brief.banks)
    assert geometry.height == 5.0
    z = [corner[1] for corner in support_polygon(geometry)]
    assert (min(z), max(z)) == (geometry.box_min[2], geometry.box_max[2])
    assert "0.500 m inside the edge of the support polygon" in statics_text(long, brief)
