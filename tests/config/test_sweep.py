"""The runs of a sweep, errors in sweeps, and all shipped sweeps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from agentflow.app.sweeps.plan import plan_sweep
from agentflow.config.run import load_document
from agentflow.config.sweep import axis_of_key, list_runs, read_sweep
from agentflow.errors import ConfigError
from agentflow.metrics.published import published

CONFIGS = Path(__file__).parents[2] / "configs"
SWEEPS = [
    path
    for path in sorted(CONFIGS.glob("*.yaml"))
    if path.stem != "objectives" and "table" in load_document(path)
]
TABLE = {"metrics": ["mean"]}


def sweep(**document: Any) -> Any:
    return read_sweep({"title": "x", "table": TABLE, **document}, "x.yaml")


UNPUBLISHED = ("benchmark", "search_budget", "search_ablations")


@pytest.mark.parametrize("path", SWEEPS, ids=lambda path: path.stem)
def test_every_shipped_sweep_is_valid(path: Path) -> None:
    plan = plan_sweep(path, (), {})
    assert plan.name == path.stem
    assert len(plan.runs) == len(plan.plans) * len(plan.sweep.seeds) >= 2
    assert plan.sweep.about


@pytest.mark.parametrize(
    "path",
    [path for path in SWEEPS if path.stem not in UNPUBLISHED],
    ids=lambda path: path.stem,
)
def test_every_shipped_sweep_has_the_published_columns(path: Path) -> None:
    """All conditions and metrics taken from a published table exist in the sweep."""
    plan = plan_sweep(path, (), {})
    table = plan.sweep.table
    stages = {"initial", "blind_refinement", "env_feedback"}
    own = {
        "axes": {run.variant for run in plan.runs},
        "stages": stages,
        "rounds": {f"rounds_{count}" for count in table.rounds},
        "none": {""},
    }[table.conditions]
    assert table.published
    for source in table.published:
        rows = [item for item in published() if item.table == source.table]
        taken = {
            source.conditions.get(item.condition, item.condition)
            for item in rows
            if not source.conditions or item.condition in source.conditions
        }
        metrics = {
            item.metric
            for item in rows
            if not source.conditions or item.condition in source.conditions
        }
        assert taken <= own
        assert metrics <= set(table.metrics)


def test_every_published_table_of_the_agents_has_a_sweep() -> None:
    """All but those on training and on shape statistics, which need no sweep."""
    taken = {s.table for p in SWEEPS for s in plan_sweep(p, (), {}).sweep.table.published}
    left = {item.table for item in published()} - taken
    assert left == {"overlap_qa", "post_training", "post_training_ci", "diversity"}


def test_the_product_of_axes_and_seeds() -> None:
    found = list_runs(
        sweep(
            base={"settings": {"trajectories": 3}},
            seeds=[4, 5],
            axes={
                "task": ["throwing", "throwing/3"],
                "condition": {"on": {"inspector": True}, "off!": {"inspector": False}},
            },
        )
    )
    assert [run.name for run in found] == [
        f"{task}.{condition}.seed-{seed}"
        for task in ("throwing", "throwing-3")
        for condition in ("on", "off")
        for seed in (4, 5)
    ]
    last = found[-1]
    assert (last.config.task, last.config.seed) == ("throwing/3", 5)
    assert (last.config.settings.inspector, last.config.settings.trajectories) == (False, 3)
    assert last.labels == {"task": "throwing/3", "condition": "off!"}
    assert last.variant == "off!"


def test_numbers_and_truth_values_are_named_with_their_axis() -> None:
    axes = {"settings.inspector": [False], "search.rounds": [5], "condition": {"x2": {}}}
    [run] = list_runs(sweep(seeds=[0], axes=axes))
    assert run.variant == "inspector=false, search.rounds=5, x2"
    assert run.name == "False.5.x2.seed-0"


def test_without_axes_there_is_a_run_per_seed() -> None:
    assert [run.name for run in list_runs(sweep(seeds=[7]))] == ["seed-7"]


def test_labels_can_be_any_plain_value() -> None:
    found = list_runs(sweep(axes={"c": {1: {}, 2.5: {}, "../x": {}, "..": {}}}))
    assert [run.name for run in found] == ["1.seed-0", "2-5.seed-0", "x.seed-0", "-.seed-0"]


def test_keys_and_the_axes_that_set_them() -> None:
    axes = {"task": ["throwing"], "condition": {"a": {"search.rounds": 1}}}
    assert axis_of_key(sweep(axes=axes)) == {
        "task": "task",
        "search.rounds": "condition",
        "seed": "seeds",
    }


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"titel": "x"}, "x.yaml: unknown key 'titel'; known: title, about"),
        ({"table": {"metric": ["mean"]}}, "x.yaml: unknown key 'table.metric'; known: table.metr"),
        ({"table": {"metrics": []}}, "x.yaml: table.metrics: must not be empty"),
        ({"axes": {"task": []}}, "x.yaml: axes: axis task has no values"),
        (
            {"axes": {"seed": [1]}},
            "x.yaml: axes: axis seed sets seed; use the list of seeds",
        ),
        ({"axes": {"task": "throwing"}}, "x.yaml: axes.task: expected a group of keys"),
        ({"axes": [1]}, "x.yaml: axes: expected a group of keys"),
        (
            {"table": {"metrics": ["mean"], "conditions": "rounds"}},
            "x.yaml: table: rounds must be listed if conditions is 'rounds', and must be "
            "left out otherwise",
        ),
        ({"seeds": []}, "x.yaml: seeds: must not be empty"),
        ({"seeds": ["a"]}, "x.yaml: seeds.0: expected a whole number"),
        ({"seeds": [0, 3, 3]}, "x.yaml: seeds: 3 is duplicated"),
        ({"seeds": [0, True]}, "x.yaml: seeds.1: expected a number, not true or false"),
        ({"axes": {"workflow": ["single", "single"]}}, "x.yaml: axes: axis workflow has single tw"),
    ],
)
def test_wrong_sweeps_are_refused(document: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        sweep(**document)
    assert str(caught.value).startswith(message)


def test_a_run_configuration_is_not_a_sweep() -> None:
    with pytest.raises(ConfigError) as caught:
        read_sweep({"task": "throwing"}, "x.yaml")
    assert str(caught.value) == (
        "x.yaml is not a sweep: it has neither axes nor a table; start a single run with "
        "agentflow design --config x.yaml"
    )


def test_runs_with_the_same_name_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"two runs of the sweep would be named a.seed-0"):
        list_runs(sweep(axes={"c": {"a": {}, "a!": {}}}))


def test_an_invalid_value_in_an_axis_is_reported_by_key() -> None:
    with pytest.raises(
        ConfigError, match=r"run a.seed-0: settings.search.rounds: must be at least 0"
    ):
        list_runs(sweep(axes={"c": {"a": {"search.rounds": -1}}}))


def test_a_seed_in_the_base_is_refused_since_the_list_of_seeds_would_override_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "x.yaml").write_text("title: x\nbase: {seed: 3}\ntable: {metrics: [mean]}\n")
    with pytest.raises(ConfigError) as caught:
        plan_sweep(tmp_path / "x.yaml", (), {})
    assert str(caught.value) == (
        f"{tmp_path / 'x.yaml'}: base.seed: list seeds under seeds, for example seeds: [0]"
    )
