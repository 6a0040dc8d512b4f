"""`agentflow diversity` as a user types it."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.metrics.tables import PUBLISHED
from tests.machine.builders import CAR, CATAPULT, build

Captured = pytest.CaptureFixture[str]

NAMES = ("chamfer", "hausdorff", "iou", "graph_similarity", "tree_edit_distance")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three machines, and a file that is none."""
    for name, machine in (("car", CAR), ("catapult", CATAPULT), ("log", build((63, 0, 0)))):
        (tmp_path / f"{name}.json").write_text(machine.to_text())
    (tmp_path / "notes.json").write_text("{}")
    return tmp_path


def ask(*arguments: object, capsys: Captured) -> str:
    assert main(["diversity", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_json_has_a_mean_and_an_interval_of_each_measure(folder: Path, capsys: Captured) -> None:
    (source,) = json.loads(ask(folder, "--json", capsys=capsys))["sources"]
    assert (source["source"], source["machines"], source["of"]) == (str(folder), 3, 3)
    assert list(source["left_out"]) == ["notes.json"]
    for name in NAMES:
        low, high = source[name]["interval"]
        assert low <= source[name]["mean"] <= high


def test_a_sample_is_drawn_from_many_machines(folder: Path, capsys: Captured) -> None:
    (one,) = json.loads(ask(folder, "--n", 2, "--json", capsys=capsys))["sources"]
    assert (one["machines"], one["of"]) == (2, 3)
    assert one["tree_edit_distance"]["interval"] is None
    assert f"{folder}: 2 of 3 machines, drawn at random." in ask(folder, "--n", 2, capsys=capsys)


def test_one_machine_has_dashes_and_a_note(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "car.json").write_text(CAR.to_text())
    lines = ask(tmp_path, capsys=capsys).splitlines()
    (row,) = (line for line in lines if line.startswith(f"{tmp_path} "))
    assert row.split() == [str(tmp_path), "1", *["-"] * 10]
    assert f"{tmp_path}: 1 machine, so no pairs." in lines


def test_text_names_what_is_left_out(folder: Path, capsys: Captured) -> None:
    out = ask(folder, capsys=capsys)
    assert f"{folder}/notes.json is left out: contains no machine: " in out
    assert PUBLISHED not in out


@pytest.mark.slow
def test_published_values_are_separate_and_labelled(folder: Path, capsys: Captured) -> None:
    out = ask(folder, "--published", "--format", "csv", capsys=capsys)
    rows = [row for row in csv.DictReader(io.StringIO(out)) if row["source"] == "published"]
    text = ask(folder, "--published", capsys=capsys).partition(PUBLISHED)[2]
    assert len(rows) == 14
    assert rows[3]["tree edit distance mean"] == "15.712"
    assert "Human, throwing" in text
    assert "rl_step_400, throwing" in text
    found = json.loads(ask(folder, "--published", "--json", capsys=capsys))["published"]
    assert len(found) == 14
    assert found[3] == {
        "source": "Human, throwing",
        "chamfer": {"mean": 0.275, "interval": None},
        "hausdorff": {"mean": 0.538, "interval": None},
        "iou": {"mean": 0.206, "interval": None},
        "graph_similarity": {"mean": 0.505, "interval": None},
        "tree_edit_distance": {"mean": 15.712, "interval": None},
    }


EXTRA = "'agentflow-machines[diversity]'"


@pytest.mark.parametrize(
    ("library", "what"), [("gensim", "gensim"), ("apted", EXTRA), ("scipy", EXTRA)]
)
def test_a_missing_library_is_named(
    library: str, what: str, folder: Path, without: Callable[[str], None], capsys: Captured
) -> None:
    without(library)
    assert main(["diversity", str(folder)]) == 2
    words = f"{library} is not installed; install it with: pip install {what}"
    assert capsys.readouterr() == ("", f"agentflow: {words}\n")
