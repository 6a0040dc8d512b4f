"""Robustness: what each condition changes, and what is made of the scores."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import DEFAULT, PERTURBATIONS, VariedEngine
from agentflow.env.tasks.registry import get_task
from agentflow.env.verification import Perturbation, Spread, perturb
from agentflow.machine import place
from agentflow.machine.edits.random import Neighbour, sample_neighbours
from tests.env.test_verification import CAR, Built, Drawer
from tests.machine.builders import build

BY_NAME = {variation.name: variation for variation in PERTURBATIONS}
LIFTER = build((27, 0, 0), (45, 0, 3, 1, 0))
"""A grabber, and a winch."""


def scored(score: float | None) -> Rollout:
    return Rollout("crashed" if score is None else "ok", score, Feedback("", {}))


def edit(
    block: int | None, face: tuple[int, int], score: float | None
) -> tuple[Neighbour, Rollout]:
    return Neighbour(CAR, block, (face,)), scored(score)


def test_names_are_unique_and_the_default_comes_first() -> None:
    assert len(BY_NAME) == len(PERTURBATIONS) == 10
    assert PERTURBATIONS[0] is DEFAULT
    assert [one.name for one in PERTURBATIONS if not one.varies_bodies] == [
        "default", "2 x step rate",
    ]  # fmt: skip


def test_a_weaker_machine_breaks() -> None:
    short = get_task("movement", {"window": 1})
    weak = replace(BY_NAME["strength -10 %"], strength=0.01)
    assert simulate(CAR, short).broken == ()
    assert simulate(CAR, short, variation=weak).broken


@pytest.mark.parametrize("name", ["motor speed +10 %", "motor speed -10 %"])
def test_motors_and_winches_get_another_speed(name: str) -> None:
    by = BY_NAME[name].motor_speed
    for machine in (CAR, LIFTER):
        before = assemble(machine, place(machine), constants())
        drawer = Drawer()
        with pytest.raises(Built):
            VariedEngine(drawer, BY_NAME[name], 0.8).build(before, Scene(()), 120)
        after = drawer.assembly
        assert [j.drive.speed for j in after.joints] == [j.drive.speed * by for j in before.joints]
        assert [w.speed for w in after.devices.winches] == [
            w.speed * by for w in before.devices.winches
        ]
        assert [j.strength for j in after.joints] == [j.strength for j in before.joints]
    assert after.devices.winches


@pytest.mark.parametrize("name", ["strength +10 %", "strength -10 %"])
def test_connections_and_grabbers_get_another_strength(name: str) -> None:
    drawer, by = Drawer(), BY_NAME[name].strength
    before = assemble(LIFTER, place(LIFTER), constants())
    with pytest.raises(Built):
        VariedEngine(drawer, BY_NAME[name], 0.8).build(before, Scene(()), 120)
    after = drawer.assembly
    for old, new in zip(before.joints, after.joints, strict=True):
        if old.strength is None:
            assert new.strength is None
        else:
            assert new.strength == replace(
                old.strength, force=old.strength.force * by, torque=old.strength.torque * by
            )
    assert after.devices.grippers
    assert [g.force for g in after.devices.grippers] == [
        g.force * by for g in before.devices.grippers
    ]


def test_the_robust_score_is_a_low_quantile() -> None:
    world = {one.name: scored(float(10 * i)) for i, one in enumerate(PERTURBATIONS)}
    found = Perturbation(world, ())
    assert found.robust == pytest.approx(9.0)  # between the lowest two of ten
    assert found.edits_spread.quantile(0.1) is None


def test_half_of_the_score_must_be_kept() -> None:
    assert Spread(10.0, (4.9, 5.0, 12.0)).kept == pytest.approx(2 / 3)
    assert Spread(0.0, (0.0, 1.0)).kept is None
    assert Spread(None, (1.0,)).kept is None


def test_a_missing_score_leaves_quantiles_unknown() -> None:
    found = Spread.of(10.0, [scored(10.0), scored(None)])
    assert (found.missing, found.quantile(0.1), found.kept) == (1, None, 1.0)


def test_the_most_sensitive_block_and_face_have_the_lowest_mean() -> None:
    edits = (
        edit(1, (0, 3), 4.0),
        edit(1, (0, 3), 6.0),
        edit(2, (0, 4), 1.0),
        edit(2, (0, 4), None),
        edit(None, (0, 5), 9.0),
    )
    found = Perturbation({"default": scored(10.0)}, edits)
    assert list(found.blocks.items()) == [(2, 1.0), (1, 5.0)]
    assert list(found.faces.items()) == [((0, 4), 1.0), ((0, 3), 5.0), ((0, 5), 9.0)]


@pytest.mark.slow
async def test_a_car_is_robust_in_its_world_and_not_in_its_design() -> None:
    task = get_task("movement")
    neighbours = sample_neighbours(CAR, task.brief, Random(0), 12)
    said: list[tuple[int, int]] = []
    async with RolloutPool(2) as pool:
        run = partial(pool.run, task=task)
        found = await perturb(CAR, neighbours, run, lambda *count: said.append(count))
    plain = simulate(CAR, task)
    assert found.default.digest == plain.digest
    assert said[-1] == (22, 22)
    assert plain.score is not None
    assert found.robust is not None
    assert 0.9 * plain.score < found.robust < plain.score
    assert found.world_spread.kept == 1.0
    assert min(found.edits_spread.scores) < 0.5 * plain.score
