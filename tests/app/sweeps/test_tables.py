"""Tables of sweeps with hand-written runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import yaml

from agentflow.app.sweeps.folder import lock_folder, sweep_document
from agentflow.app.sweeps.plan import plan_sweep
from agentflow.app.sweeps.registry import VIEWS
from agentflow.app.sweeps.tables import layout_table, read_sweep_result
from agentflow.app.sweeps.views import simulation_speeds, view
from agentflow.env.tasks.records import record_of
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError, UnknownNameError, UsageError
from agentflow.metrics.intervals import Interval, Rate
from agentflow.metrics.published import SOURCES
from agentflow.metrics.tables import FORMATS, Row, Table
from agentflow.runs import Event, RunDirectory
from agentflow.runs.events import VariedScore, VerificationEvent
from agentflow.runs.locations import Location
from tests.metrics.events import candidate, evaluation, expansion, node
from tests.runs.results import a_result

MODEL = "procedural (no language model)"
CALL = {
    "schema_version": 1,
    "key": "k",
    "model": MODEL,
    "request": {"role": "refiner", "label": "refiner/blind/traj-1/attempt-1"},
    "reply": {
        "text": "",
        "usage": {"prompt": 3, "completion": 1, "reasoning": 0, "cached": 0},
        "latency_s": 0.5,
        "retries": 0,
    },
}
RESULT = a_result(rollouts=4, calls=1, tokens=4, simulated_seconds=20.0, worker_seconds=2.0)


def sweep(folder: Path, runs: dict[str, Sequence[Event]], **document: Any) -> Path:
    """A sweep folder in which these runs are finished."""
    file = folder / "hand.yaml"
    table = {"metrics": ["valid", "mean", "max"], **document.pop("table", {})}
    file.write_text(yaml.safe_dump({"title": "Hand", "table": table, **document}))
    plan = plan_sweep(file, (), {})
    path = folder / "hand"
    with lock_folder(path, sweep_document(plan.name, plan.sweep), resume=False):
        for name, events in runs.items():
            run = RunDirectory.create(path / "runs", name, {})
            for event in events:
                run.event(event)
            run.call_log.write_text(json.dumps(CALL) + "\n")
            scores = [e.data["score"] for e in events if e.data.get("score") is not None]
            found = {
                "model": MODEL if "random" not in name else "none (random edits)",
                "engine": "other 1" if "other" in name else "pybullet 3.2.7",
                "score": max(scores, default=None),
            }
            run.finish(RESULT.model_copy(update=found))
            run.close()
    return path


def verification(*scores: float | None) -> Event:
    """A verification with three variations."""
    found = [score for score in scores if score is not None]
    complete = len(found) == len(scores)
    listed = tuple(VariedScore(str(i), "ok", score) for i, score in enumerate(scores))
    low, middle, high = sorted(found) if complete else (None, None, None)
    return VerificationEvent(Location("best"), "0" * 16, middle, low, high, listed)


def values(table: Table) -> dict[tuple[str, ...], tuple[Any, ...]]:
    return {row.labels: row.values for row in table.rows}


CONDITION = {"condition": {"baseline": {"inspector": True}, "no_inspector": {"inspector": False}}}


def compared(folder: Path) -> Path:
    return sweep(
        folder,
        {
            "baseline.seed-0": [candidate("initial", 1, 2.0), candidate("initial", 2, 4.0)],
            "baseline.seed-1": [candidate("initial", 1, None, valid=False)],
            "no_inspector.seed-0": [candidate("initial", 1, 1.0)],
        },
        seeds=[0, 1],
        axes=CONDITION,
        table={"stage": "initial", "published": [{"table": "inspector"}]},
    )


def test_axes_are_columns_and_seeds_are_pooled(tmp_path: Path) -> None:
    table = layout_table(read_sweep_result(compared(tmp_path)))
    assert [(c.group, c.name) for c in table.columns] == [
        (group, name) for group in ("baseline", "no_inspector") for name in ("valid", "mean", "max")
    ]
    assert values(table) == {("throwing", MODEL): (Rate(2, 3), 3.0, 4.0, Rate(1, 1), 1.0, 1.0)}
    assert table.published == ()
    assert table.notes == (
        "3 runs; 2 seeds, pooled.",
        "INCOMPLETE: 1 of 4 runs are missing, 0 of them failed.",
        "Physics engine: pybullet 3.2.7.",
        "inspector changes nothing in the workflow hierarchical with search.strategy=halving.",
        "valid: trajectories (independent attempts) with a valid machine, after retries; mean: "
        "mean score over valid machines; max: best score.",
    )


def test_unfinished_runs_keep_their_columns_and_rows(tmp_path: Path) -> None:
    path = sweep(
        tmp_path,
        {"baseline.throwing.seed-0": [candidate("initial", 1, 2.0), candidate("initial", 2, 4.0)]},
        axes={"task": ["throwing", "movement"], **CONDITION},
        table={"stage": "initial", "metrics": ["valid", "mean"]},
    )
    swept = read_sweep_result(path)
    table = layout_table(swept)
    assert [c.full for c in table.columns] == [
        *("baseline valid", "baseline mean", "no_inspector valid", "no_inspector mean"),
    ]
    assert values(table) == {
        ("throwing", MODEL): (Rate(2, 2), 3.0, None, None),
        ("movement", MODEL): (None, None, None, None),
    }
    assert table.notes[0] == "1 run; 1 seed."
    lines = FORMATS["csv"](view(path)).splitlines()
    assert [line.split(",")[-5:] for line in lines[1:3]] == [["2", "2", "3.0", "", ""], [""] * 5]
    rows = FORMATS["text"](view(path, "scores")).splitlines()
    undone = [row.split() for row in rows if row.startswith(("movement", "throwing"))][1:]
    assert [row[-2:] for row in undone] == [["-", "-"]] * 3


def test_published_rows_are_separate_and_leave_measured_ones_unchanged(tmp_path: Path) -> None:
    swept = read_sweep_result(compared(tmp_path))
    table = layout_table(swept, published=True)
    assert table.rows == layout_table(swept).rows
    assert len(table.published) == 8
    assert table.published[0] == Row(
        ("throwing", "Gemini 2.5 Pro"), ("5", "8.18", "11.07", "5", "5.67", "9.37")
    )
    assert table.published[-1] == Row(
        ("throwing", "Llama 4 Scout 17B 16E"), ("0", None, None, "0", None, None)
    )


def test_stages_are_columns_and_other_axes_are_rows(tmp_path: Path) -> None:
    path = sweep(
        tmp_path,
        {
            "movement.hierarchical.seed-0": [
                candidate("initial", 1, 2.0),
                candidate("blind_refinement", 1, None, valid=False),
            ],
            "movement.random-dsl.seed-0": [candidate("initial", 1, 1.0)],
        },
        axes={"task": ["movement"], "workflow": ["hierarchical", "random-dsl"]},
        table={"conditions": "stages", "metrics": ["valid", "mean"]},
    )
    table = layout_table(read_sweep_result(path))
    assert [c.group for c in table.columns[::2]] == ["initial", "blind_refinement", "env_feedback"]
    assert values(table) == {
        ("movement", f"{MODEL}, hierarchical"): (Rate(1, 1), 2.0, Rate(0, 1), None, None, None),
        ("movement", "none (random edits), random-dsl"): (Rate(1, 1), 1.0, *[None] * 4),
    }


TREE = [
    candidate("blind_refinement", 1, 1.0),
    expansion(1, 1, "vv"),
    node(1, 1, 1, 3.0),
    node(1, 2, 1, 2.0),
    expansion(1, 2, "vx"),
    node(1, 3, 2, 7.0),
]


def test_a_search_is_cut_off_after_several_rounds(tmp_path: Path) -> None:
    path = sweep(
        tmp_path,
        {"seed-0": TREE},
        table={
            "conditions": "rounds",
            "rounds": [1, 2, 5],
            "metrics": ["mean"],
            "published": [{"table": "mcts_depth"}],
        },
    )
    table = layout_table(read_sweep_result(path), published=True)
    assert [c.group for c in table.columns] == ["rounds_1", "rounds_2", "rounds_5"]
    assert values(table) == {("throwing", MODEL): (3.0, 7.0, None)}
    assert table.published[0].values == (None, "15.04", "15.73")


def test_tasks_as_columns_can_have_different_metrics(tmp_path: Path) -> None:
    path = sweep(
        tmp_path,
        {
            "delivery.seed-0": [candidate("env_feedback", 1, 12.0)],
            "gearing.seed-0": [candidate("initial", 1, 1.0), candidate("initial", 2, 0.0)],
        },
        axes={"task": {"delivery": {"task": "delivery"}, "gearing": GEARING}},
        table={
            "columns": "task",
            "metrics": ["mean"],
            "task_metrics": {"gearing": ["valid"]},
            "published": [{"table": "additional_tasks", "conditions": {"hierarchical": ""}}],
        },
    )
    table = layout_table(read_sweep_result(path), published=True)
    assert [(c.group, c.name) for c in table.columns] == [
        ("delivery", "mean"),
        ("gearing", "valid"),
    ]
    assert values(table) == {(MODEL,): (12.0, None)}
    assert Row(("Human reference",), ("88.80", None)) in table.published


def test_success_rates_stand_beside_published_means_over_levels(tmp_path: Path) -> None:
    runs = {
        "rocket-1.seed-0": [
            evaluation("initial/traj-1", 700.0, success=True),
            candidate("initial", 1, 700.0),
            candidate("initial", 2, None, valid=False),
        ]
    }
    table = {
        "conditions": "none",
        "stage": "initial",
        "metrics": ["success", "success_95"],
        "published": [{"table": "buildarena"}],
    }
    axes = {"task": ["rocket/1", "rocket/4"]}
    path = sweep(tmp_path, runs, axes=axes, table=table)
    found = layout_table(read_sweep_result(path), published=True)
    assert values(found)["rocket/1", MODEL] == (Rate(1, 2), Rate(1, 2).interval)
    assert values(found)["rocket/4", MODEL] == (None, None)
    assert Row(("rocket/1-3", "Grok-4"), ("21.9%", "16.6% - 28.2%")) in found.published
    assert len(found.published) == 8
    source = SOURCES["buildarena"]
    assert source in found.notes
    assert source not in layout_table(read_sweep_result(path)).notes
    lines = FORMATS["csv"](view(path, published=True)).splitlines()
    assert [line.partition(",")[0] for line in lines[1:]] == ["measured"] * 2 + ["published"] * 8


GEARING = {"task": "gearing", "workflow": "placement"}


def test_scores_have_both_means_with_intervals(tmp_path: Path) -> None:
    table = view(compared(tmp_path), "scores")
    assert [column.full for column in table.columns] == [
        "valid share",
        "valid 95 %",
        "valid machines mean",
        "valid machines 95 %",
        "all machines (invalid scored 0) mean",
        "all machines (invalid scored 0) 95 %",
        "max",
        "std",
        "Best@N, N = 1",
        "Best@N, N = 2",
    ]
    assert values(table) == {
        ("throwing", MODEL, "baseline"): (
            Rate(2, 3),
            Rate(2, 3).interval,
            3.0,
            Interval(2.0, 4.0),
            2.0,
            Interval(0.0, 4.0),
            4.0,
            1.0,
            2.0,
            pytest.approx(10 / 3),
        ),
        ("throwing", MODEL, "no_inspector"): (
            Rate(1, 1),
            Rate(1, 1).interval,
            1.0,
            None,
            1.0,
            None,
            1.0,
            0.0,
            1.0,
            None,
        ),
    }


def test_usage_by_role_and_stage(tmp_path: Path) -> None:
    found = values(view(compared(tmp_path), "usage"))
    baseline = ("throwing", MODEL, "baseline")
    assert found[(*baseline, "all")] == (2, 8, None, 0, 0.0, 1.0, 0, 2.0, 10.0)
    assert found[(*baseline, "refiner")] == (2, 8, 1.0, 0, 0.0, 1.0, 0, None, None)
    assert found[(*baseline, "blind_refinement")] == (2, 8, None, 0, 0.0, 1.0, 0, None, None)


def test_best_scores_relative_to_players(tmp_path: Path) -> None:
    path = sweep(
        tmp_path,
        {
            "delivery.seed-0": [candidate("initial", 1, 22.2), candidate("initial", 2, 44.4)],
            "movement.seed-0": [candidate("initial", 1, 9.0)],
        },
        axes={"task": ["delivery", "movement"]},
    )
    assert values(view(path, "human")) == {
        ("delivery", MODEL): (44.4, 88.8, 0.5),
        ("movement", MODEL): (9.0, None, None),
    }


def test_engines_are_never_pooled(tmp_path: Path) -> None:
    runs = {
        "usual.seed-0": [candidate("initial", 1, 2.0)],
        "other.seed-0": [candidate("initial", 1, 4.0)],
    }
    axes = {"condition": {"usual": {}, "other": {}}}
    path = sweep(tmp_path, runs, base={"task": "delivery"}, axes=axes)
    assert values(view(path, "human")) == {
        ("delivery", f"{MODEL}, pybullet 3.2.7"): (2.0, 88.8, 2.0 / 88.8),
        ("delivery", f"{MODEL}, other 1"): (4.0, 88.8, 4.0 / 88.8),
    }
    for name in VIEWS:
        notes = view(path, name).notes
        assert "Physics engine: other 1, pybullet 3.2.7; no number is of more than one." in notes
    note = "Shares of records compare with machines that pybullet 3.2.7 simulated."
    assert note in view(path, "verified").notes


def test_seeds_with_different_engines_are_refused(tmp_path: Path) -> None:
    path = sweep(tmp_path, {"seed-0": [candidate("initial", 1, 2.0)]}, seeds=[0, 1])
    run = RunDirectory.create(path / "runs", "seed-1", {})
    run.finish(RESULT.model_copy(update={"model": MODEL, "engine": "other 1"}))
    run.close()
    with pytest.raises(RunError) as caught:
        read_sweep_result(path)
    assert str(caught.value) == (
        f"{path}: seed-0 was made with pybullet 3.2.7 but seed-1 with other 1, so they cannot be "
        "pooled: remove one of these runs and make it again with --resume"
    )


def test_score_against_expansions(tmp_path: Path) -> None:
    table = view(sweep(tmp_path, {"seed-0": TREE}), "expansions")
    assert [column.full for column in table.columns] == [
        *("N = 0 mean", "N = 0 95 %", "N = 1 mean", "N = 1 95 %", "N = 2 mean", "N = 2 95 %")
    ]
    assert values(table) == {("throwing", MODEL, ""): (1.0, None, 3.0, None, 3.0, None)}


def test_intervals_of_expansions_are_over_runs(tmp_path: Path) -> None:
    shifted = [candidate("blind_refinement", 1, 2.0), expansion(1, 1, "v"), node(1, 1, 1, 5.0)]
    path = sweep(tmp_path, {"seed-0": TREE, "seed-1": shifted}, seeds=[0, 1])
    assert values(view(path, "expansions")) == {
        ("throwing", MODEL, ""): (
            *(1.5, Interval(1.0, 2.0)),
            *(4.0, Interval(3.0, 5.0)),
            *(4.0, Interval(3.0, 5.0)),
        )
    }


def test_sweeps_that_do_not_search_have_no_curve(tmp_path: Path) -> None:
    table = view(compared(tmp_path), "expansions")
    assert table.columns == ()
    assert "No run of this sweep searches." in table.notes


@pytest.mark.slow
def test_every_view_has_every_format(tmp_path: Path) -> None:
    path = compared(tmp_path)
    starts = {"text": "Hand", "md": "**Hand", "csv": "source,", "latex": "% Hand", "json": "{"}
    for name, (form, start) in product(VIEWS, starts.items()):
        assert FORMATS[form](view(path, name)).startswith(start), (name, form)


def test_folders_without_a_sweep_or_finished_runs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a sweep directory: it has no readable sweep.yaml"):
        read_sweep_result(tmp_path)
    path = sweep(tmp_path, {})
    with pytest.raises(RunError, match=r"; unless it is running now, .*hand --resume"):
        read_sweep_result(path)
    (path / "sweep.yaml").write_text("[")
    with pytest.raises(RunError, match=r"sweep.yaml is damaged: expected a mapping with schema"):
        read_sweep_result(path)
    (path / "sweep.yaml").write_text("{schema: 7, name: x, sweep: {}}")
    with pytest.raises(RunError, match=r"hand has schema 7, but this version reads only schema 1"):
        read_sweep_result(path)


def test_only_one_view_has_published_rows(tmp_path: Path) -> None:
    path = compared(tmp_path)
    with pytest.raises(UsageError) as caught:
        view(path, "scores", published=True)
    assert str(caught.value) == ("only the view 'published' has published rows, not 'scores'")
    with pytest.raises(UnknownNameError, match="unknown view 'score'; known: scores"):
        view(path, "score")


def test_only_the_usage_view_reads_calls(tmp_path: Path) -> None:
    """A table over many runs must not read every prompt."""
    path = compared(tmp_path)
    for call_log in path.rglob("calls.jsonl"):
        call_log.unlink()
    assert layout_table(read_sweep_result(path)).rows


def test_speeds_are_those_of_one_worker() -> None:
    runs = [
        a_result(rollouts=8, simulated_seconds=40.0, worker_seconds=2.0),
        a_result(rollouts=2, simulated_seconds=10.0, worker_seconds=3.0),
    ]
    assert simulation_speeds(runs) == (2.0, 10.0)
    assert simulation_speeds([]) == (None, None)


def test_verified_scores_stand_beside_the_plain_ones(tmp_path: Path) -> None:
    runs = {
        "one.seed-0": [candidate("initial", 1, 20.0), verification(20.0, 10.0, 15.0)],
        "one.seed-1": [candidate("initial", 1, 30.0), verification(30.0, 28.0, 31.0)],
        "other.seed-0": [candidate("initial", 1, 40.0), verification(40.0, None, 15.0)],
        "other.seed-1": [candidate("initial", 1, 50.0)],
    }
    axes = {"condition": {"one": {"history": True}, "other": {"verify": False}}}
    table = {"metrics": ["max", "verified"], "stage": "initial"}
    path = sweep(tmp_path, runs, axes=axes, seeds=[0, 1], table=table)
    assert values(view(path)) == {("throwing", MODEL): (30.0, 22.5, 50.0, None)}
    record = record_of(get_task("throwing"))
    assert record is not None
    share = pytest.approx(22.5 / record.verified)
    assert values(view(path, "verified")) == {
        ("throwing", MODEL, "one"): (Rate(2, 2), 25.0, 22.5, 19.0, 25.5, 0, share),
        ("throwing", MODEL, "other"): (Rate(0, 2), None, None, None, None, None, None),
    }
