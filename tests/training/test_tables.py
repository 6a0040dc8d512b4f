"""Tables of evaluations and training runs."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
from itertools import combinations
from pathlib import Path
from statistics import fmean

import pytest

from agentflow.cli import main
from agentflow.metrics.tables import FORMATS, PUBLISHED
from tests.training.folders import LABEL, drives, throws, write_evaluation, write_training

Captured = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as learning leaves it: two seeds of one model, another model, a training run."""
    folder = tmp_path_factory.mktemp("learned")
    both = [*throws()[2:], *drives()]
    write_evaluation(folder / "evaluations" / "cold-0", "Cold-start", both)
    write_evaluation(folder / "evaluations" / "cold-1", "Cold-start", both, seed=1)
    write_evaluation(
        folder / "evaluations" / "rl", "Cold-start + RL", throws(), trained_on=("throwing",)
    )
    write_training(folder / "trainings" / "no-kl")
    return folder


def table(capsys: Captured, *arguments: str) -> dict[str, list[dict[str, object]]]:
    assert main(["table", *arguments, "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


@pytest.mark.slow
def test_the_general_table_has_a_row_for_each_name(learned: Path, capsys: Captured) -> None:
    found = table(capsys, str(learned))
    assert found["columns"] == [
        {"group": task, "name": name}
        for task in ("throwing", "movement")
        for name in ("valid count", "valid of", "mean", "max")
    ]
    good, car = throws()[2].score, drives()[0].score
    assert good is not None
    assert car is not None
    cold, tuned = found["measured"]
    assert (cold["name"], cold["model"]) == ("Cold-start", LABEL)
    assert cold["values"] == [2, 4, good / 2, good, 2, 4, car / 2, car]
    scores = [reply.score or 0.0 for reply in throws()]
    assert tuned["values"] == [
        *(3, 4),
        pytest.approx(fmean(scores)),
        max(scores),
        *(None, None, None, None),
    ]
    assert "Cold-start: 2 evaluations, pooled." in found["notes"]


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    ("view", "published"),
    [
        ("published", ["Qwen2.5-14B-Instruct", "0.14", "45.72"]),
        ("scores", ["RL from Base", "12/50", "0.83", "2.36, 5.09"]),
        ("transfer", ["Throwing to Movement", "28/50", "43.70"]),
    ],
)
def test_published_rows_are_labelled_in_every_format(
    learned: Path, view: str, published: list[str], form: str, capsys: Captured
) -> None:
    asked = ["table", str(learned), "--show", view, "--format", form]
    assert main(asked) == 0
    assert published[0] not in capsys.readouterr().out
    assert main([*asked, "--published"]) == 0
    out = capsys.readouterr().out
    apart = {"csv": ",", "json": '", "'}.get(form)
    texts = [re.sub("/|, ", apart, text) if apart else text for text in published]
    for text in texts:
        assert text in out
    label = {"csv": "\npublished,", "json": '"published": [{'}.get(form, PUBLISHED)
    assert out.index(label) < out.index(texts[1])


def test_uncertainty_has_intervals(learned: Path, capsys: Captured) -> None:
    pytest.importorskip("scipy")
    cold, tuned, drive = table(capsys, str(learned), "--show", "scores")["measured"]
    assert (cold["task"], tuned["task"], drive["task"]) == ("throwing", "throwing", "movement")
    values = tuned["values"]
    assert isinstance(values, list)
    assert values[:4] == pytest.approx([3, 4, 0.3006, 0.9544], abs=1e-4)
    mean, low, high = values[4:7]
    assert low < mean < high


def test_transfer_says_what_a_model_was_trained_on(learned: Path, capsys: Captured) -> None:
    rows = table(capsys, str(learned), "--show", "transfer", "--published")
    assert [
        (row["trained on"], row["evaluated on"]) for row in rows["measured"] + rows["published"]
    ] == [
        *(("-", "throwing"), ("throwing", "throwing"), ("-", "movement")),
        *(("movement", "throwing"), ("throwing", "movement")),
    ]


def test_best_of_n_over_steps_of_training(learned: Path, capsys: Captured) -> None:
    rows = table(capsys, str(learned), "--show", "best")["measured"]
    names = [(row["task"], row["name"], row["step"]) for row in rows]
    assert names == [
        ("throwing", "Cold-start", "-"),
        ("throwing", "Cold-start + RL", "-"),
        ("movement", "Cold-start", "-"),
        ("throwing", "trainings/no-kl", "3"),
        ("throwing", "trainings/no-kl", "6"),
    ]
    values = rows[3]["values"]
    assert isinstance(values, list)
    scores = [reply.score or 0.0 for reply in (*throws(), throws()[0])]
    for n, value in zip((1, 2, 4), values, strict=True):
        assert value == pytest.approx(fmean(max(some) for some in combinations(scores, n)))


def test_curves_are_the_logged_numbers(learned: Path, capsys: Captured) -> None:
    assert main(["table", str(learned), "--show", "curves", "--format", "csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [(row["run"], row["step"]) for row in rows] == [
        ("trainings/no-kl", str(step)) for step in range(1, 7)
    ]
    assert [float(row["reward_mean"]) for row in rows] == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert float(rows[5]["kl"]) == pytest.approx(0.06)
    assert list(rows[0])[-2:] == ["eval.throwing.valid.share", "eval.throwing.best_at.2"]
    assert [row["eval.throwing.best_at.2"] for row in rows] == [*("", "", "5.0"), *("", "", "6.5")]


def test_training_runs_of_several_folders_are_named_by_path(
    learned: Path, tmp_path: Path, capsys: Captured
) -> None:
    other = write_training(tmp_path / "trainings" / "no-kl", steps=1)
    folders = [str(learned / "trainings"), str(other.parent), "--show", "curves"]
    runs = [row["run"] for row in table(capsys, *folders)["measured"]]
    assert runs == [str(learned / "trainings" / "no-kl")] * 6 + [str(other)]


def test_folders_are_shown_in_the_order_given(learned: Path, capsys: Captured) -> None:
    folders = [str(learned / "evaluations" / name) for name in ("rl", "cold-1")]
    names = [row["name"] for row in table(capsys, *folders)["measured"]]
    assert names == ["Cold-start + RL", "Cold-start"]


def test_missing_replies_and_faults_are_told(tmp_path: Path, capsys: Captured) -> None:
    faulty = throws()[0].model_copy(update={"score": None, "status": "timeout"})
    write_evaluation(tmp_path / "a", "A", [*throws(), faulty], finished=False)
    found = table(capsys, str(tmp_path))
    assert found["measured"][0]["values"][:2] == [3, 4]  # type: ignore[index]
    assert "INCOMPLETE: A lacks 1 of 6 replies." in found["notes"]
    told = "A, throwing: left out 1 of 5 replies, whose simulation crashed or timed out."
    assert told in found["notes"]


def test_what_cannot_be_compared_is_refused(
    learned: Path, tmp_path: Path, capsys: Captured
) -> None:
    def refusal(*arguments: object) -> str:
        assert main(["table", *map(str, arguments)]) == 2
        return capsys.readouterr().err

    assert refusal(tmp_path).startswith(
        f"agentflow: {tmp_path} is not a sweep directory: it has no readable sweep.yaml, and it "
        "holds no evaluations (evaluation.json) and no training runs (training.json)"
    )
    assert "unknown view of evaluations and training runs 'usage'" in refusal(
        learned, "--show", "usage"
    )
    assert "only these views have published rows: published, scores, transfer; not 'best'" in (
        refusal(learned, "--show", "best", "--published")
    )
    assert "there is no evaluation for the view 'published'" in refusal(learned / "trainings")
    assert "there is no training run for the view 'curves'" in refusal(
        learned / "evaluations", "--show", "curves"
    )
    one = write_evaluation(tmp_path / "1", "A", throws())
    two = write_evaluation(tmp_path / "2", "A", throws(), label="another", seed=1)
    assert refusal(one, two) == (
        f"agentflow: {one} and {two} are both named 'A' but have another label, so they cannot be "
        "pooled: evaluate one of them again with another --name\n"
    )
    same = write_evaluation(tmp_path / "3", "A", throws(), model="models/1")
    assert f"{one} and {same} are the same evaluation" in refusal(one, same)
    (one / "samples.jsonl").write_text('{"task": 3}\n')
    assert f"{one / 'samples.jsonl'}, line 1 is damaged: task " in refusal(one)


def test_an_evaluation_without_its_engine_is_damaged(
    learned: Path, tmp_path: Path, capsys: Captured
) -> None:
    folder = shutil.copytree(learned / "evaluations" / "rl", tmp_path / "rl")
    about = json.loads((folder / "evaluation.json").read_text())
    del about["conditions"]["engine"]
    (folder / "evaluation.json").write_text(json.dumps(about))
    assert main(["table", str(folder)]) == 2
    assert "evaluation.json is damaged: conditions: it lacks engine" in capsys.readouterr().err
