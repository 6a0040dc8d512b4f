"""Plans of benchmarks: what is fixed, what users may set, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from agentflow.app.benchmark.make import content
from agentflow.app.benchmark.plan import conditions, plan_benchmark
from agentflow.config.run import DesignConfig
from agentflow.errors import AgentflowError
from agentflow.workflows.registry import WORKFLOWS
from tests.app.benchmark.boards import PARS, SMALL, write


def test_every_item_is_done_in_both_parts(tmp_path: Path) -> None:
    plan = plan_benchmark(write(tmp_path), (), {})
    assert [run.name for run in plan.runs] == [
        f"{part}.gearing-{level}.seed-0" for part in ("first", "refined") for level in (1, 2)
    ]
    assert {run.config.workflow for run in plan.runs} == {"placement"}


def test_lite_keeps_the_first_item_of_each_family_and_is_another_plan(tmp_path: Path) -> None:
    file = write(tmp_path)
    whole, lite = plan_benchmark(file, (), {}), plan_benchmark(file, (), {}, lite=True)
    assert [run.labels["task"] for run in lite.runs] == ["gearing-1"] * 2
    assert (whole.name, lite.name) == ("small", "small-lite")
    differing = {
        key
        for key, value in conditions(whole.sweep).items()
        if conditions(lite.sweep)[key] != value
    }
    assert differing == {"lite", "plan", "pars"}


def test_without_a_model_the_plan_is_the_same(tmp_path: Path) -> None:
    """Random machines get as many simulations, and their card can be compared."""
    file = write(tmp_path)
    usual, random = plan_benchmark(file, (), {}), plan_benchmark(file, (), {}, random=True)
    assert {run.config.workflow for run in random.runs} == {"random-placement"}
    assert not any(WORKFLOWS[run.config.workflow].asks_models for run in random.runs)
    assert conditions(random.sweep) == conditions(usual.sweep)
    model = plan_benchmark(file, ["model.sampling.temperature=0"], {"model.name": "m"})
    assert conditions(model.sweep) == conditions(usual.sweep)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"benchmark": None},
            "'Small' is not a benchmark but an ordinary sweep; run it with",
        ),
        ({"benchmark": {}}, "benchmark.version is missing"),
        (
            {"base": {"settings": {"known_lessons": ["+1 Log: +2.00"]}}},
            "known_lessons: a benchmark shows no lessons of other runs",
        ),
        (
            {"benchmark": {"version": 2, "pars": PARS, "lowest": ["x"]}},
            "lowest: there is no item x",
        ),
        (
            {"axes": {"task": SMALL["axes"]["task"]}},
            "a benchmark has the axis part, which begins wi",
        ),
        ({"seeds": [0, 1]}, "seeds: a benchmark has one seed, for example seeds: [0]; for more"),
        (
            {"benchmark": {"version": 3}},
            "benchmark.version: it is 3, and this agentflow knows versions up to 2: use a later",
        ),
        (
            {"axes": {**SMALL["axes"], "task": {"a": {"task": "gearing/5", "plate.holes": 900}}}},
            "the item a cannot be built: ",
        ),
        (
            {"axes": {**SMALL["axes"], "task": {"a": {"workflow": "placement"}}}},
            "axes.task.a: name the level with task",
        ),
        (
            {"benchmark": {"version": 2, "pars": {"gearing-1": PARS["gearing-1"]}}},
            "benchmark.pars: gearing-2 needs a par above its floor",
        ),
    ],
)
def test_files_that_are_no_benchmark_are_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(AgentflowError) as caught:
        plan_benchmark(write(tmp_path, **changes), (), {})
    assert message in str(caught.value)


def test_parts_and_seeds_are_chosen_without_another_plan(tmp_path: Path) -> None:
    axes = {**SMALL["axes"], "part": {**SMALL["axes"]["part"], "third": {"max_simulations": 5}}}
    file = write(tmp_path, axes=axes)
    usual = plan_benchmark(file, (), {})
    assert {run.labels["part"] for run in usual.runs} == {"first", "refined"}, "the first two"
    more = plan_benchmark(file, (), {}, parts=["third"], seeds=3)
    assert [run.name for run in more.runs] == [
        f"third.gearing-{level}.seed-{seed}" for level in (1, 2) for seed in range(3)
    ]
    assert more.name == "small-third-3-seeds"
    assert conditions(more.sweep) == conditions(usual.sweep)
    with pytest.raises(AgentflowError, match="has no part x: choose from first, refined, third"):
        plan_benchmark(file, (), {}, parts=["x"])


@pytest.mark.parametrize("random", [False, True])
def test_all_parts_of_a_new_benchmark_can_be_planned(tmp_path: Path, random: bool) -> None:
    """With the budgets that the documentation names."""
    parts = content()["parts"]
    file = write(
        tmp_path,
        axes={"part": parts, "task": {"a": {"task": "throwing"}}},
        benchmark={"version": 2, "pars": {"a": {"floor": 0.0, "par": 50.0}}},
    )
    plan = plan_benchmark(file, (), {}, parts=[*parts], random=random)
    found = {run.labels["part"]: run.config for run in plan.runs}
    most = {name: config.settings.max_simulations for name, config in found.items()}
    assert most == {"first": 4, "search": 64, "agent": 24, "long": 200}
    assert found["search"].model.budget.calls == 24
    assert found["search"].settings.search.strategy == DesignConfig().settings.search.strategy


def test_only_the_model_can_be_set(tmp_path: Path) -> None:
    with pytest.raises(AgentflowError) as caught:
        plan_benchmark(write(tmp_path), ["search.rounds=9"], {})
    assert str(caught.value) == (
        "a benchmark has a fixed plan, so --set takes only keys of the model such as "
        "model.sampling.temperature=0.5, not 'search.rounds=9'"
    )
