"""Requirements that a rollout tells: safety factors against calculations by hand, tolerance."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import pytest

from agentflow.env.archive import read_npz, write_npz
from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import World
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.model import Assembly
from agentflow.env.pool.store import rollout_key
from agentflow.env.rollout import Rollout
from agentflow.env.scene import Scene
from agentflow.env.simulation.requirements import DRAWS, SCORE_IF_MET, search_value
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import DEFAULT, VARIATIONS, displace
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.placement import place
from agentflow.machine.requirements import Judged
from agentflow.machine.tree import Machine
from tests.env.machines import CAR, CRADLE, machine, task_of
from tests.env.test_statics import ARM, BRACE, FOOT, METAL, POST, WOOD, G, plane_frame

LOGS = (*FOOT, (63, 0, 4), (63, 5, 0))
ARMS = (*LOGS, (63, 6, 6), (63, 6, 3))
BALLASTS = (*FOOT, (35, 0, 4), (35, 5, 0), (35, 6, 0), (63, 7, 2), (63, 7, 1))


def standing(engine: str) -> Task:
    """A task where the machine stands alone on the ground."""
    knobs = {"requirements.wanted": "safety >= 1", "requirements.mode": "report"}
    return get_task("jumping", knobs, engine).trials(0)[0]


def safety(rows: tuple[tuple[int, ...], ...], engine: str = "auto") -> Judged:
    return simulate(machine(*rows), standing(engine)).requirements[0]


def braced_factor() -> float:
    """Arms on both sides, each held by a brace over the post: the post does not bend."""
    joints = {
        (8, 7): ((0.5, 3.0), WOOD, ARM, POST),
        (12, 7): ((0.0, 3.5), METAL, BRACE, POST),
        (12, 8): ((2.0, 3.5), METAL, BRACE, ARM),
    }
    weights = [(ARM, 1.0, 2.0), (ARM, 3.0, 4.0), (BRACE, 0.25, 0.0), (BRACE, 0.25, 2.0)]
    found = plane_frame(joints, weights)
    return 1.0 / max(
        share / strength
        for pair, both in found.items()
        for share, strength in zip(both, joints[pair][1], strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
@pytest.mark.parametrize(
    ("name", "rows", "factor", "kind"),
    [
        ("column", (*LOGS, (35, 6, 0), (35, 7, 0)), 15000 / (8 * G), "5 on block 0, push"),
        (
            "cantilever",
            (*ARMS, (35, 7, 0), (35, 8, 0)),
            5000 / ((1 * 1.5 + 3 * 3.5) * G),
            "on block 6, bending",
        ),
        (
            "hanging load",
            (*ARMS, (5, 7, 12), (5, 8, 12), (35, 9, 0), (35, 10, 0)),
            5000 / ((1 * 1.5 + (0.5 + 3) * 2.5) * G),
            "on block 6, bending",
        ),
        (
            "braced cantilever",
            (*BALLASTS, (35, 8, 0), (35, 9, 0), (7, 7, 0, 8, 8), (7, 7, 0, 9, 8)),
            braced_factor(),
            "on block 7, bending",
        ),
    ],
)
def test_safety_factors_are_those_calculated_by_hand(
    engine: str, name: str, rows: tuple[tuple[int, ...], ...], factor: float, kind: str
) -> None:
    found = safety(rows, engine)
    assert found.value == pytest.approx(factor, rel=0.01), name
    where, _, how = kind.partition(", ")
    assert where in found.cause
    assert how in found.cause


@pytest.mark.slow
def test_a_heavier_load_never_raises_a_factor() -> None:
    """One ballast after the other at the ends of both arms."""
    rows, factors = (*ARMS, (35, 7, 0), (35, 8, 0)), []
    for face in range(5):
        factors.append(safety(rows).value)
        rows = (*rows, (35, 9, face), (35, 10, face))
    assert factors == sorted(factors, reverse=True)
    assert len(set(factors)) == 5


def demanding(tree: Machine, *texts: str, mode: str = "must") -> Rollout:
    knobs = {"requirements.wanted": list(texts), "requirements.mode": mode}
    return simulate(tree, task_of(tree, window=1.0, **knobs))


def test_the_score_counts_only_if_all_are_met() -> None:
    plain = simulate(CAR, task_of(CAR, window=1.0))
    met = demanding(CAR, "mass <= 9 kg", "tilt <= 30 degrees", "broken <= 0")
    missed = demanding(CAR, "mass <= 3 kg", "tilt <= 30 degrees")
    told = demanding(CAR, "mass <= 3 kg", "tilt <= 30 degrees", mode="report")
    assert plain.score
    assert met.score == told.score == missed.terms[SCORE_IF_MET] == plain.score
    assert missed.score == 0.0
    assert plain.digest == met.digest == missed.digest
    assert (missed.terms["met"], missed.terms["required"]) == (1.0, 2.0)
    first, second, third, *_ = missed.feedback.text.splitlines()
    assert first.startswith("Score: 0.00, as requirements are not met; without them it would be ")
    assert second == "Requirements: met 1 of 2"
    assert third == "- NOT MET: mass 5.25 of at most 3 kg (missed by 2.25)"
    assert missed.feedback.data["requirements"][0]["margin"] == -2.25
    assert "Requirements" not in plain.feedback.text


def test_power_and_energy_are_those_of_the_motors() -> None:
    found = demanding(CAR, "power <= 1 W", "energy <= 1 J", mode="report")
    power, energy = (item.value for item in found.requirements)
    given = found.trace.measured.energy.motors  # type: ignore[union-attr]
    assert power > energy / 5.0  # type: ignore[operator]
    assert energy == pytest.approx(given, rel=0.05)


@pytest.mark.slow
def test_tolerance_is_the_same_for_a_seed_and_smaller_for_larger_displacements() -> None:
    texts = ("tolerance of 0.01 m >= 80 %", "tolerance of 0.2 m >= 80 %")
    found = demanding(CAR, *texts, mode="report")
    again = demanding(CAR, *texts, mode="report")
    assert found.requirements == again.requirements
    little, much = (item.value for item in found.requirements)
    assert little != much
    assert 80.0 < little < 120.0  # type: ignore[operator]
    wanted = {"requirements.wanted": texts[0]}
    other = simulate(CAR, task_of(CAR, window=1.0, **wanted), seed=1)
    assert other.requirements[0] != found.requirements[0]


class Counted:
    """An engine that counts the worlds it builds."""

    def __init__(self) -> None:
        self.engine, self.builds = default_engine().start(), 0
        self.identity, self.close = self.engine.identity, self.engine.close

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:
        self.builds += 1
        return self.engine.build(assembly, scene, rate)


def test_blocks_are_displaced_in_variations_only_if_the_score_can_count() -> None:
    wanted = ["tolerance of 0.01 m >= 80 %", "mass <= 3 kg"]
    lost = task_of(CAR, window=1.0, **{"requirements.wanted": wanted})
    other = task_of(CAR, window=1.0, **{"requirements.wanted": wanted[:1]})
    engine = Counted()
    for task, variation, builds in (
        (lost, DEFAULT, 1 + DRAWS),
        (lost, VARIATIONS["4 x step rate"], 1),
        (other, VARIATIONS["4 x step rate"], 1 + DRAWS),
    ):
        engine.builds = 0
        rollout = simulate(CAR, task, engine=engine, variation=variation)
        assert (rollout.score == 0.0) == (task is lost)
        assert engine.builds == builds
    engine.close()


def test_blocks_are_displaced_by_at_most_the_distance() -> None:
    usual = assemble(CAR, place(CAR), constants())
    moved = displace(usual, 0.1, "seed")
    raised = [(x, y + 0.1, z) for x, y, z in usual.centres]
    away = [
        sum((a - b) ** 2 for a, b in zip(one, other, strict=True)) ** 0.5
        for one, other in zip(moved.centres, raised, strict=True)
    ]
    assert min(away) > 0.0
    assert max(away) <= 0.1
    assert len(set(away)) == len(CAR)
    assert all(
        one.pivot != other.pivot for one, other in zip(usual.joints, moved.joints, strict=True)
    )


@pytest.mark.slow
def test_of_several_trials_the_worst_counts() -> None:
    texts = ["tilt <= 1 degrees", "mass <= 9 kg"]
    task = get_task("jumping", {"requirements.wanted": texts})
    found = simulate(CAR, task)
    tilts = [simulate(CAR, trial).requirements[0].value for trial in task.trials(0)]
    assert found.requirements[0].value == max(tilts)  # type: ignore[type-var]
    assert found.requirements[0].cause.endswith(f"trial {tilts.index(max(tilts)) + 1}")  # type: ignore[type-var]
    assert found.requirements[1].met


def test_stored_rollouts_keep_requirements_and_have_their_own_key() -> None:
    found = demanding(CAR, "mass <= 3 kg", "safety >= 1")
    file = BytesIO()
    write_npz(found, file)
    file.seek(0)
    assert read_npz(file).requirements == found.requirements
    plain = task_of(CAR)
    demands = task_of(CAR, **{"requirements.wanted": ["mass <= 3 kg"]})
    assert rollout_key(CAR, plain, 0) != rollout_key(CAR, demands, 0)


@pytest.mark.parametrize(
    ("texts", "value"),
    [
        (("mass <= 9 kg",), None),
        (("mass <= 5 kg", "width <= 1.6 m"), -0.05 - 0.25),
        (("mass <= 5 kg", "power <= 0.1 W"), -0.05 - 1.0),
    ],
)
def test_searches_climb_towards_meeting_all(texts: tuple[str, ...], value: float | None) -> None:
    found = search_value(demanding(CAR, *texts), "must")
    assert found is value if value is None else found == pytest.approx(value, abs=0.01)


def test_a_machine_that_would_not_score_comes_last() -> None:
    assert search_value(demanding(CRADLE, "mass <= 0.1 kg", "width <= 9 m"), "must") == -2.0
    assert search_value(demanding(CRADLE, "mass <= 0.1 kg", mode="report"), "report") is None
    lost = replace(demanding(CAR, "mass <= 9 kg"), status="diverged", score=0.0, terms={})
    assert search_value(lost, "must") == -1.0
