"""Differences between conditions: by hand, and as SciPy's paired bootstrap gives them."""

from __future__ import annotations

from itertools import product
from math import ceil
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import numpy as np
import pytest

from agentflow.app.sweeps.against import MEANING
from agentflow.app.sweeps.views import view
from agentflow.errors import UnknownNameError, UsageError
from agentflow.metrics.intervals import (
    Interval,
    Rate,
    bootstrap_clusters,
    bootstrap_mean,
    seeds_needed,
)
from agentflow.metrics.tables import FORMATS
from tests.app.sweeps.test_tables import CONDITION, sweep, values
from tests.metrics.events import candidate

BASELINE, OTHER = (2.0, 4.0, 6.0, 8.0, 3.0), (3.0, 4.5, 9.0, 7.5, 5.0)


def compared(folder: Path, **more: Any) -> Path:
    """Five pairs of runs, each with a machine that scores, one that scores 0, or only one."""
    runs = {
        f"{condition}.seed-{seed}": [
            candidate("initial", 1, score),
            *([candidate("initial", 2, 0.0)] * (seed % 2)),
        ]
        for condition, scores in (("baseline", BASELINE), ("no_inspector", OTHER))
        for seed, score in enumerate(scores)
    }
    table = {"stage": "initial", "metrics": ["max", "mean", "valid"]}
    return sweep(folder, runs, seeds=[0, 1, 2, 3, 4, 5], axes=CONDITION, table=table, **more)


def test_differences_by_hand(tmp_path: Path) -> None:
    table = view(compared(tmp_path), against="baseline")
    apart = [1.0, 0.5, 3.0, -0.5, 2.0]
    resamples = sorted(fmean(draw) for draw in product(apart, repeat=5))
    low, high = (resamples[round(share * 5**5)] for share in (0.025, 0.975))
    found = values(table)["throwing", "no_inspector", "max"]
    needed = ceil(((1.959964 + 0.841621) * stdev(apart) / 1.2) ** 2)
    assert found[:4] == (5, pytest.approx(4.6), pytest.approx(5.8), pytest.approx(1.2))
    assert found[4] == pytest.approx((low, high), abs=0.11)  # one step of the means is 0.1
    assert found[5:] == (Rate(4, 5), needed)
    means = values(table)["throwing", "no_inspector", "mean"]
    assert means[1:4] == (pytest.approx(3.4), pytest.approx(4.6), pytest.approx(1.2))
    assert values(table)["throwing", "no_inspector", "valid"] == (
        *(5, 1.0, 1.0, 0.0, Interval(0.0, 0.0), Rate(0, 5), None),
    )
    assert "2 of 12 runs are missing" in table.notes[0]
    assert table.notes[-1] == MEANING
    lines = FORMATS["csv"](view(tmp_path / "hand", against="baseline")).splitlines()
    assert lines[0] == (
        "source,task,condition,metric,pairs,mean baseline,mean condition,difference mean,"
        "difference 95 % low,difference 95 % high,higher count,higher of,seeds needed"
    )
    assert lines[1].endswith(f",4,5,{needed}")


def test_one_pair_has_no_interval(tmp_path: Path) -> None:
    runs = {
        "baseline.seed-0": [candidate("initial", 1, 2.0)],
        "no_inspector.seed-0": [candidate("initial", 1, 1.0)],
        "no_inspector.seed-1": [candidate("initial", 1, 9.0)],
    }
    table = {"stage": "initial", "metrics": ["max"]}
    path = sweep(tmp_path, runs, seeds=[0, 1], axes=CONDITION, table=table)
    found = view(path, against="no_inspector")
    assert values(found) == {
        ("throwing", "baseline", "max"): (1, 1.0, 2.0, 1.0, None, Rate(1, 1), None)
    }
    assert "Intervals of fewer than 5 pairs are too narrow." in found.notes


def test_stages_of_a_run_are_a_pair(tmp_path: Path) -> None:
    runs = {
        f"seed-{seed}": [candidate("initial", 1, 1.0 + seed), candidate("blind_refinement", 1, 4.0)]
        for seed in range(2)
    }
    table = {"conditions": "stages", "metrics": ["max"]}
    found = view(sweep(tmp_path, runs, seeds=[0, 1], table=table), against="initial")
    assert values(found)["throwing", "blind_refinement", "max"][:5] == (
        *(2, 1.5, 4.0, 2.5, Interval(2.0, 3.0)),
    )
    assert values(found)["throwing", "env_feedback", "max"][0] == 0


def test_conditions_that_cannot_be_compared(tmp_path: Path) -> None:
    path = compared(tmp_path)
    with pytest.raises(UnknownNameError, match=r"condition 'base'; known: baseline, no_inspector$"):
        view(path, against="base")
    with pytest.raises(UsageError, match="--against has a table of its own: remove --show and"):
        view(path, "scores", against="baseline")


@pytest.mark.slow
def test_intervals_are_those_of_scipys_paired_bootstrap() -> None:
    from scipy.stats import bootstrap

    found = bootstrap(
        (np.array(OTHER), np.array(BASELINE)),
        lambda one, other, axis: one.mean(axis=axis) - other.mean(axis=axis),
        n_resamples=10_000,
        method="percentile",
        paired=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    apart = [other - one for one, other in zip(BASELINE, OTHER, strict=True)]
    assert bootstrap_mean(apart) == pytest.approx(tuple(found), abs=1e-9)


def test_values_of_one_group_are_drawn_together() -> None:
    assert bootstrap_clusters([(1.0, 3.0), (5.0,), ()]) == Interval(2.0, 5.0)
    assert bootstrap_clusters([(1.0, 3.0)]) is None


def test_seeds_that_would_be_needed() -> None:
    assert seeds_needed([1.0, 2.0, 3.0]) == 2  # (2.80 / 2)^2
    assert seeds_needed([1.0, -0.8, 0.4]) == 165
    assert seeds_needed([1.0, -1.0]) is None
    assert seeds_needed([1.0]) is None
