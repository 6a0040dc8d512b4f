"""A search over the whole run chooses the machine that scores most on average when verified."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import agentflow
from agentflow.app.design.replay import replay
from agentflow.cli.display.show_runs import show_objectives
from agentflow.runs import read_document, read_events, read_result
from agentflow.runs.reading import document_text

MACHINES = Path(__file__).parents[2] / "machines" / "common"
FRAGILE = (MACHINES / "fragile_throw.json").read_text()
"""A model designed it; half of its verifying simulations score 0."""
STURDIER = (MACHINES / "sturdier_throw.json").read_text()
"""It was found in the same run and scores 4 % less."""
SETTINGS = {"trajectories": 2, "max_simulations": 2, "search.strategy": "independent"}

pytestmark = [pytest.mark.slow, pytest.mark.pybullet]


def design(out: Path, **settings: object) -> agentflow.Design:
    replies = iter((FRAGILE, STURDIER))
    return agentflow.design(
        "throwing",
        workflow="iterative",
        engine="pybullet",
        answer=lambda _: f"```json\n{next(replies)}\n```",
        settings={**SETTINGS, **settings},
        out=out,
    )


def ignore(_line: str) -> None:
    """Ignores remarks."""


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return design(tmp_path_factory.mktemp("chosen")).run


@pytest.fixture(scope="module")
def highest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return design(tmp_path_factory.mktemp("highest"), finalists=1).run


def test_a_machine_that_holds_is_chosen(
    chosen: Path, highest: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    best, plain = read_result(chosen), read_result(highest)
    assert (best.score or 0) < (plain.score or 0)
    assert (best.verified_score or 0) > 1.5 * (plain.verified_score or 0)
    assert best.finalists is not None
    assert [item.score for item in best.finalists] == [plain.score, best.score]
    assert [item.verified for item in best.finalists] == [plain.verified_score, best.verified_score]
    means = [item.mean or 0 for item in best.finalists]
    assert best.verified is not None
    scores = [item.score or 0 for item in best.verified.scores]
    assert means[0] < means[1] == pytest.approx(sum(scores) / len(scores))
    assert plain.finalists is None
    assert best.rollouts == plain.rollouts == 2
    digest = best.finalists[1].machine
    assert (chosen / "rollouts" / f"{digest}.npz").exists()
    kinds = [(event.label, event.data["machine"]) for event in read_events(chosen)
             if event.kind == "verification"]  # fmt: skip
    assert kinds == [("finalist/candidate-1", best.finalists[0].machine), ("best", digest)]
    show_objectives(best.to_json())
    assert (
        "chosen by the mean score of 2 machines in 18 verifying simulations; the machine"
        in capsys.readouterr().out
    )


def test_runs_replay_and_resume_as_they_were_made(
    chosen: Path, highest: Path, tmp_path: Path
) -> None:
    """Also those of versions that knew no finalists."""
    cut = shutil.copytree(chosen, tmp_path / "cut")
    (cut / "result.json").unlink()
    lines = (cut / "events.jsonl").read_text().splitlines(keepends=True)
    (cut / "events.jsonl").write_text("".join(lines[:-1]))  # before the last verification is told
    agentflow.resume(cut, answer=lambda _: "all replies are recorded")
    assert read_result(cut).finalists == read_result(chosen).finalists
    older = shutil.copytree(highest, tmp_path / "older")
    document = read_document(older)
    del document["config"]["settings"]["finalists"]
    (older / "run.yaml").write_text(document_text(document))
    assert [replay(run, ignore) for run in (chosen, cut, older)] == [None] * 3
