"""Several sweeps in one table, and runs that belong to none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from agentflow.app.inspect.overview import run_list
from agentflow.app.sweeps.views import view
from agentflow.cli import main
from agentflow.config.run import build_config, changed_keys, differing_text
from agentflow.errors import RunError, UsageError
from agentflow.metrics.intervals import Rate
from agentflow.runs import RunDirectory
from tests.app.sweeps.test_tables import CONDITION, MODEL, RESULT, sweep, values
from tests.metrics.events import candidate


def runs(folder: Path, **scores: tuple[float | None, dict[str, Any]]) -> Path:
    """Runs with a score, or unfinished ones, and a configuration."""
    for name, (score, config) in scores.items():
        run = RunDirectory.create(folder, name, {"config": {"engine": "pybullet", **config}})
        run.event(candidate("initial", 1, score))
        if score is not None:
            found = {"model": MODEL, "engine": "pybullet 3.2.7", "score": score}
            run.finish(RESULT.model_copy(update=found))
        run.close()
    return folder


SEVERAL: dict[str, tuple[float | None, dict[str, Any]]] = {
    "one": (2.0, {}),
    "two": (4.0, {"seed": 1, "settings": {"search": {"rounds": 2}}}),
    "three": (6.0, {"settings": {"search": {"rounds": 2}, "history": False}}),
    "four": (None, {"task": "movement"}),
}


def test_a_folder_of_runs_is_compared_by_what_differs(tmp_path: Path) -> None:
    table = view(runs(tmp_path / "mine", **SEVERAL), "scores")
    assert table.title == "mine: scores"
    found = {labels: row[2] for labels, row in values(table).items()}
    assert found == {
        ("throwing", MODEL, ""): 2.0,
        ("throwing", MODEL, "search.rounds=2"): 4.0,
        ("throwing", MODEL, "history=False, search.rounds=2"): 6.0,
        ("movement", MODEL, ""): None,
    }
    assert table.notes[:2] == (
        "3 runs; 2 seeds, pooled.",
        "INCOMPLETE: 1 of 4 runs are missing, 0 of them failed.",
    )
    with pytest.raises(RunError, match=r"no run in .*four is finished"):
        view(tmp_path / "mine" / "four")


def test_the_list_of_runs_says_what_differs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = runs(tmp_path / "mine", **SEVERAL)
    settings = {Path(row["run"]).name: row["settings"] for row in run_list(folder)}
    assert settings["three"] == {"search.rounds": 2, "history": False}
    assert main(["runs", str(folder)]) == 0
    out = capsys.readouterr().out.splitlines()
    lines = {Path(line.split()[0]).name: line.rstrip() for line in out}
    assert lines["run"].endswith(" differs")
    assert lines["three"].endswith(" history=False, search.rounds=2")
    assert lines["one"].endswith(" -")


def test_settings_that_all_runs_share_do_not_differ() -> None:
    changed = [
        changed_keys(build_config({"settings": {"history": False}, "knobs": {"window": 3}})),
        changed_keys(build_config({"settings": {"history": False}, "model": {"name": "x" * 50}})),
    ]
    assert differing_text(changed) == ["knobs.window=3", ""]
    assert differing_text([{"start": "a" * 50}, {}]) == [f"start={'a' * 37}...", ""]
    assert differing_text([]) == []


def two(tmp_path: Path, **other: Any) -> list[Path]:
    found = []
    for name, score in (("a", 2.0), ("b", 6.0)):
        (tmp_path / name).mkdir()
        events = {"baseline.seed-0": [candidate("initial", 1, score)]}
        table = {"stage": "initial", "metrics": ["valid", "mean"]}
        found.append(sweep(tmp_path / name, events, axes=CONDITION, table=table, **other))
        found[-1] = found[-1].rename(tmp_path / name / f"hand-{name}")
    return found


def test_sweeps_stand_side_by_side_and_are_never_pooled(tmp_path: Path) -> None:
    table = view(two(tmp_path))
    assert [column.full for column in table.columns] == [
        f"{folder}, {condition} {metric}"
        for folder in ("hand-a", "hand-b")
        for condition in ("baseline", "no_inspector")
        for metric in ("valid", "mean")
    ]
    assert values(table)["throwing", MODEL] == (
        *(Rate(1, 1), 2.0, None, None),
        *(Rate(1, 1), 6.0, None, None),
    )
    folders = [tmp_path / "a/hand-a", tmp_path / "b/hand-b"]
    apart = values(view(folders, against="hand-a, baseline"))
    assert apart["throwing", "hand-b, baseline", "mean"][:4] == (1, 2.0, 6.0, 4.0)


def test_folders_of_one_name_are_told_apart_and_one_given_twice_counts_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in two(tmp_path):
        path.rename(path.with_name("hand"))
    monkeypatch.chdir(tmp_path)
    table = view([Path("a/hand"), Path("b/hand"), Path("a/hand")])
    assert [column.group for column in table.columns[::2]] == [
        f"{folder}, {condition}"
        for folder in ("a/hand", "b/hand")
        for condition in ("baseline", "no_inspector")
    ]
    assert table.rows[0].values[1::2] == (2.0, None, 6.0, None)


def test_sweeps_of_other_variants_share_the_columns(tmp_path: Path) -> None:
    first = two(tmp_path)[0]
    mine = runs(tmp_path / "mine", one=(3.0, {"task": "movement"}))
    table = view([first, mine])
    assert [column.group for column in table.columns[::2]] == ["baseline", "no_inspector", ""]
    assert values(table)["movement", MODEL][-2:] == (Rate(1, 1), 3.0)
    assert table.title == "Hand and mine"


def test_two_runs_of_one_condition_and_seed_are_no_pair(tmp_path: Path) -> None:
    twins = {"one": SEVERAL["one"], "again": SEVERAL["one"], "three": SEVERAL["three"]}
    folder = runs(tmp_path / "mine", **twins)
    with pytest.raises(UsageError, match="again and one have the same task, condition and seed"):
        view(folder, against="history=False, search.rounds=2")
