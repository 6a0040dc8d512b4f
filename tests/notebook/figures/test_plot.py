"""Figures: their numbers against counts by hand, their files, and what is refused."""

from __future__ import annotations

import csv
import re
import shutil
import sys
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

import agentflow
from agentflow.cli import main
from agentflow.errors import AgentflowError, UsageError
from agentflow.metrics.intervals import bootstrap_band, bootstrap_mean
from agentflow.notebook.figures.data import Datum, read_rows
from agentflow.notebook.figures.plot import mean_ranks, pareto_front
from agentflow.notebook.figures.style import COLORS, looks
from tests.notebook.made import RECORDED, made_sweep

VIEWS = ("curve", "scores", "pareto", "ranks", "validity")


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_sweep(tmp_path_factory.mktemp("sweeps") / "made", seeds=3)


def test_the_numbers_are_those_of_the_runs(sweep: Path) -> None:
    runs = agentflow.Sweep(sweep).runs
    for view in ("scores", "ranks"):
        rows = read_rows([sweep], view, "simulations")  # type: ignore[arg-type]
        assert [row.y for row in rows] == [run.result.verified_score for run in runs]
        assert {row.measure for row in rows} == {"verified score"}
    curves = read_rows([sweep], "curve", "calls")
    for run, (_, its) in zip(runs, groupby(curves, lambda row: row.run), strict=True):
        points = [(row.x, row.y) for row in its]
        assert set(points) <= {(float(x), y) for x, y in run.curve("calls")}
        assert points[-1] == run.curve("calls")[-1]
    costs = read_rows([sweep], "pareto", "calls")
    assert {row.x for row in costs} == {float(runs[0].result.calls)}
    levels = read_rows([sweep], "validity", "calls")
    assert {(row.x, row.y) for row in levels} == {(2, 2)}
    assert {row.condition for row in curves} == {"mcts", "random"}


def test_a_curve_shows_the_mean_and_its_band(sweep: Path) -> None:
    figure = agentflow.plot(sweep, view="curve")
    [axis] = figure.axes
    assert axis.get_xlabel() == "simulations"
    lines = {line.get_label(): line for line in axis.lines}
    runs = [run for run in agentflow.Sweep(sweep).runs if run.labels["search"] == "mcts"]
    ends = np.array([[run.curve()[-1].best] for run in runs])
    assert lines["mcts"].get_ydata()[-1] == pytest.approx(ends.mean())
    band = bootstrap_band(ends)
    assert band is not None
    corners = axis.collections[0].get_paths()[0].vertices[:, 1]
    assert corners.min() < ends.mean() < corners.max()
    assert band[1][0] == pytest.approx(corners.max())
    assert figure._repr_png_().startswith(b"\x89PNG")  # what notebooks show


def test_bands_are_bootstrap_intervals_of_each_column() -> None:
    values = [1.0, 4.0, 2.0, 9.0]
    band, known = bootstrap_band(np.array([[v, 0.0] for v in values])), bootstrap_mean(values)
    assert band is not None
    assert known is not None
    assert band[0][0] == pytest.approx(known.low, abs=0.15)
    assert band[1][0] == pytest.approx(known.high, abs=0.15)
    assert (band[0][1], band[1][1]) == (0, 0)
    assert bootstrap_band(np.array([[1.0]])) is None


def test_ranks_and_fronts_by_hand() -> None:
    def row(condition: str, seed: int, score: float) -> Datum:
        return Datum("ranks", "t", condition, "r", seed, "score", None, score)

    rows = [row("a", 0, 3), row("b", 0, 5), row("c", 0, 3), row("a", 1, 9), row("b", 1, 1)]
    assert mean_ranks(rows, ["a", "b", "c"]).tolist() == [[2.5, 1, 2.5]]
    assert mean_ranks(rows, ["a", "b"]).tolist() == [[2, 1], [1, 2]]
    repeated = [*rows, row("a", 1, -7)]  # two runs with the same seed: their mean counts
    assert mean_ranks(repeated, ["a", "b"]).tolist() == [[2, 1], [1.5, 1.5]]
    points = [(1.0, 2.0), (1.0, 3.0), (2.0, 3.0), (3.0, 2.0), (4.0, 5.0)]
    assert pareto_front(points) == [(1, 3), (4, 5)]


def test_conditions_differ_without_colour_too() -> None:
    shown = looks([f"condition {number}" for number in range(len(COLORS))])
    for part in ("color", "mark"):
        assert len({getattr(look, part) for look in shown.values()}) == len(COLORS)
    assert len({str(look.dashes) for look in [*shown.values()][:4]}) == 4


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
def test_every_view_is_a_file_with_text_as_text(
    view: str, sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / f"figure{suffix}" for suffix in (".svg", ".pdf", ".png", ".csv")]
    for file in files:
        assert main(["plot", str(sweep), "--view", view, "--by", "calls", "--out", str(file)]) == 0
        assert capsys.readouterr().out == f"{file}\n"
    svg = files[0].read_text()
    assert ">random<" in svg.replace("\n", "")
    assert b"/Type3" not in files[1].read_bytes()
    assert files[2].read_bytes().startswith(b"\x89PNG")
    again = tmp_path / "again.svg"
    assert main(["plot", str(files[3]), "--view", view, "--out", str(again)]) == 0
    assert re.sub(r"\s", "", again.read_text()) == re.sub(r"\s", "", svg)


def test_numbers_are_one_a_line(sweep: Path, tmp_path: Path) -> None:
    agentflow.plot(sweep, view="scores", out=tmp_path / "scores.csv")
    with (tmp_path / "scores.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [*rows[0]] == ["view", "task", "condition", "run", "seed", "measure", "x", "y"]
    assert len(rows) == 6
    assert read_rows([tmp_path / "scores.csv"], "scores", "calls") == read_rows(
        [sweep], "scores", "calls"
    )


def test_several_sources_are_named(sweep: Path, tmp_path: Path) -> None:
    runs = sweep / "runs"
    folder = tmp_path / "folder"
    for name in ("throwing.mcts.seed-0", "throwing.random.seed-0", "throwing.random.seed-1"):
        shutil.copytree(runs / name, folder / name)
    rows = read_rows([folder], "scores", "calls")
    assert [row.condition for row in rows] == ["mcts", "random", "random"]
    rows = read_rows([str(folder), agentflow.Run(RECORDED)], "scores", "calls")
    assert [row.condition for row in rows][:2] == ["folder: mcts", "folder: random"]
    assert rows[-1].condition.startswith("recorded-throwing")
    assert read_rows([RECORDED], "scores", "calls")[0].condition == "recorded-throwing"
    single = [agentflow.Run(folder / name) for name in sorted(p.name for p in folder.iterdir())]
    assert [row.condition for row in read_rows(single, "scores", "calls")] == [
        "mcts",
        "random",
        "random",
    ]
    rows = read_rows(single[1:], "scores", "calls")
    assert [row.condition for row in rows] == ["hierarchical", "hierarchical"]
    other = shutil.copytree(folder, tmp_path / "others" / "folder")
    rows = read_rows([folder, other], "scores", "calls")
    assert {row.condition.partition(": ")[0] for row in rows} == {
        f"{tmp_path.name}/folder",
        "others/folder",
    }


def test_runs_with_the_same_name_stay_apart(tmp_path: Path) -> None:
    places = [tmp_path / parent / "run" for parent in ("mine", "theirs")]
    for place in places:
        shutil.copytree(RECORDED, place)
    for sources in (places, [tmp_path]):
        rows = read_rows(sources, "curve", "calls")
        assert {row.run for row in rows} == {"mine/run", "theirs/run"}


def test_a_table_may_lack_a_level(sweep: Path, tmp_path: Path) -> None:
    table = tmp_path / "levels.csv"
    agentflow.plot(sweep, view="validity", out=table)
    lines = table.read_text().splitlines(keepends=True)
    kept = [line for line in lines if not (",mcts," in line and "without overlaps" in line)]
    assert 1 < len(kept) < len(lines)
    table.write_text("".join(kept))
    [axis] = agentflow.plot(table, view="validity").axes
    assert len(axis.containers) == 7


def test_what_cannot_be_plotted_is_said_in_one_sentence(sweep: Path, tmp_path: Path) -> None:
    growing = shutil.copytree(RECORDED, tmp_path / "growing")
    (growing / "result.json").unlink()
    empty = made_sweep(tmp_path / "empty", seeds=1)
    shutil.rmtree(empty / "runs")
    unscored = shutil.copytree(growing, tmp_path / "unscored")
    lines = (unscored / "events.jsonl").read_text().splitlines(keepends=True)
    (unscored / "events.jsonl").write_text("".join(lines[:4]))
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    (tmp_path / "none.csv").write_text("view,task,condition,run,seed,measure,x,y\n")
    agentflow.plot(sweep, view="scores", out=tmp_path / "scores.csv")
    cases: list[tuple[list[object], dict[str, str], str]] = [
        ([], {}, "there is nothing to plot: name a run, a sweep, or a folder with runs"),
        ([[sweep]], {}, "cannot plot a list: name each run, sweep or folder on its own"),
        ([tmp_path / "gone"], {}, "no such file or directory"),
        ([empty], {}, r"no run of .*empty is finished, so there is nothing to plot"),
        ([unscored], {}, "there is nothing to plot: no machine of these runs has a score"),
        ([unscored], {"view": "validity"}, "these runs have no finished trajectories"),
        ([growing], {"view": "scores"}, r"has no result.json: the run is unfinished"),
        ([sweep], {"by": "tokens"}, "the runs report no tokens; choose another --by"),
        ([RECORDED], {"view": "ranks"}, "ranks compare conditions: name a sweep with an axis"),
        ([tmp_path / "other.csv"], {}, r"other.csv is not a table of a figure: it needs the col"),
        ([tmp_path / "none.csv"], {}, r"there is nothing to plot: .*none.csv has no rows"),
        ([tmp_path / "scores.csv"], {}, "has rows of the view scores, not curve: add --view sc"),
        ([sweep], {"view": "curves"}, "unknown view of figures 'curves'; known: curve"),
        ([sweep], {"out": "a.jpg"}, r"unknown kind of figure '.jpg'; known: .png"),
        ([sweep], {"out": "pdf"}, "unknown kind of figure 'pdf'"),
    ]
    for sources, options, message in cases:
        with pytest.raises(AgentflowError, match=message) as refused:
            agentflow.plot(*sources, **{"out": str(tmp_path / "x.csv"), **options})  # type: ignore[arg-type]
        assert "\n" not in str(refused.value)
    assert agentflow.plot(growing) is not None


def test_a_figure_without_matplotlib_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["plot", str(RECORDED)]) == 2
    assert capsys.readouterr().err == (
        "agentflow: matplotlib is not installed; install it with: "
        "pip install 'agentflow-machines[plot]'\n"
    )


def test_a_scorecard_is_no_source() -> None:
    card = Path(__file__).parents[3] / "docs" / "cards" / "procedural.json"
    with pytest.raises(UsageError, match="is not a run, a sweep, or a folder with runs"):
        agentflow.plot(card)
