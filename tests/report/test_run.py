"""What the page of a run says."""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import pytest

from agentflow.errors import RunError
from agentflow.holding import with_holding
from agentflow.metrics.usage import no_price
from agentflow.report.run import RunStory, rejection_reasons, score_curve, validity
from agentflow.runs import read_result
from agentflow.runs.events import AttemptEvent, VariedScore, VerificationEvent
from agentflow.runs.locations import Location
from agentflow.runs.result import FinalistResult
from tests.metrics.events import attempt as answered
from tests.metrics.events import edit, evaluation, expansion
from tests.report.hostile import NASTY, hostile_run
from tests.runs.results import a_result

RECORDED = Path(__file__).parent.parent.parent / "runs" / "recorded-throwing"


def attempt(code: str, problem: str = "", **data: object) -> AttemptEvent:
    known = {"role": "designer", "valid": not code, "code": code, "problem": problem}
    return answered(problem, **{**known, **data})


def test_a_finished_run() -> None:
    result = read_result(RECORDED)
    calls = result.calls
    story = RunStory.read(RECORDED, result, None)
    data = story.to_json(no_price, priced=False)
    assert data["run"] == {
        "task": "throwing",
        "workflow": "hierarchical",
        "author": "procedural (no language model)",
        "seed": 0,
        "trajectories": 2,
        "begun": 2,
        "score": result.score,
        "verified": with_holding(result.to_json()["verified"]),
        "passed": None,
        "sentence": "by the best machine, found in refinement with feedback",
        "about": f"procedural (no language model): {calls} calls, 8 machines simulated",
        "prices": False,
    }
    first = next(iter(story.machines.values()))
    assert (first.score, first.best) == (result.score, True)
    assert len(story.machines) == 8
    assert len(data["progress"]) == 8
    assert max(point["score"] for point in data["progress"]) == result.score
    last = data["progress"][-1]
    assert (last["expansions"], last["calls"], last["tokens"]) == (2, calls, 0)
    assert [row["name"] for row in data["stages"]] == [
        "initial",
        "blind_refinement",
        "env_feedback",
    ]
    assert data["usage"][-1]["calls"] == calls
    assert data["usage"][0] == {
        "role": "meta_designer",
        "calls": 1,
        "prompt": 0,
        "completion": 0,
        "reasoning": 0,
        "cached": 0,
        "seconds": 0.0,
        "cost": None,
    }
    assert data["talk"][0] == {"role": "meta_designer", "labels": ["meta_designer/attempt-1"]}
    json.dumps(data, allow_nan=False)


def test_a_higher_score_than_that_of_the_chosen_machine_is_explained() -> None:
    story = RunStory.read(RECORDED, read_result(RECORDED), None)
    high, own = list(story.machines.values())[:2]
    assert high.machine
    assert own.machine
    assert high.score
    assert own.score
    assert high.score > own.score
    known = {"verified": 3.0, "simulations": 8}
    finalists = [
        FinalistResult(machine=high.machine, score=high.score, mean=2.0, **known),
        FinalistResult(machine=own.machine, score=own.score, mean=2.5, **known),
    ]
    assert story.result
    result = story.result.model_copy(update={"finalists": finalists})
    scores = tuple(VariedScore(str(n), "ok", s) for n, s in enumerate((9.0, 3.0, 1.0)))
    tested = VerificationEvent(Location("finalist"), high.machine, 3.0, 1.0, 9.0, scores)
    nodes = tuple(replace(node, best=node == own) for node in story.nodes)
    chosen = replace(story, result=result, events=(tested, *story.events), nodes=nodes)
    assert chosen.to_json(no_price, priced=False)["run"]["passed"] == {
        **finalists[0].model_dump(),
        "title": high.title,
        "chosen": 2.5,
        "holds": 2,
        "of": 3,
    }
    same = replace(chosen, nodes=story.nodes)  # the one with the highest score was chosen
    assert same.to_json(no_price, priced=False)["run"]["passed"] is None


def test_calls_are_kept_whole_and_what_comes_again_once() -> None:
    story = RunStory.read(RECORDED, None, None)
    packed = story.to_json(no_price, priced=False)["calls"]
    said = json.loads(zlib.decompress(base64.b64decode(packed)))
    assert len(said["calls"]) == read_result(RECORDED).calls
    designers = [call for call in said["calls"] if call["label"].startswith("designer")]
    systems = {tuple(call["messages"][0]) for call in designers}
    assert len(systems) == 1
    role, number = systems.pop()
    assert role == "system"
    assert said["texts"][number].startswith("You ")
    assert "<Modification Steps>" in said["calls"][-1]["reply"]
    assert said["calls"][-1]["valid"] is True


def test_an_unfinished_run_shows_its_best_so_far(tmp_path: Path) -> None:
    story = RunStory.read(hostile_run(tmp_path), None, None)
    data = story.to_json(lambda _model, _usage: 0.5, priced=True)
    assert (data["run"]["score"], data["run"]["sentence"]) == (
        12.5,
        "is the best so far: the run is unfinished, so it is not verified",
    )
    place = f"{tmp_path.name}/hostile"
    assert data["facts"][:2] == [
        ("Run", "hostile"),
        ("Resume", f"agentflow design --resume {place}"),
    ]
    assert data["usage"][-1]["cost"] == 1.5
    said = json.loads(zlib.decompress(base64.b64decode(data["calls"])))
    assert said["calls"][0]["reply"] == NASTY


def test_an_unfinished_run_names_its_model_as_a_finished_one(tmp_path: Path) -> None:
    """Who answers stands in the record from the start, rules and chance as no language model."""
    run = tmp_path / "my runs" / "one"
    copytree(RECORDED, run)
    (run / "result.json").unlink()
    data = RunStory.read(run, None, None).to_json(lambda _model, _usage: 0.0, priced=True)
    assert data["run"]["about"].startswith("procedural (no language model): ")
    assert data["facts"][1] == ("Resume", "agentflow design --resume 'my runs/one'")
    named = dict(data["facts"])  # as in the form that starts a run
    assert (named["Trajectories"], named["Search rounds"]) == ("2", "1")


def test_a_run_without_a_machine_says_why(tmp_path: Path) -> None:
    reason = "no valid machine: overlap"
    run = hostile_run(tmp_path)
    for stopped, end in ((None, ""), ("budget", "; its budget was used up")):
        story = RunStory.read(run, a_result(reason=reason, stopped=stopped), None)
        head = story.to_json(no_price, priced=False)["run"]
        assert (head["score"], head["sentence"]) == (None, f"{reason}{end}")


def test_a_run_in_which_nothing_scored_praises_no_machine(tmp_path: Path) -> None:
    stages = read_result(RECORDED).to_json()["stages"]
    result = a_result(valid=True, machine=[{}], score=0.0, stages=stages, best_stage="env_feedback")
    story = RunStory.read(hostile_run(tmp_path), result, None)
    assert story.to_json(no_price, priced=False)["run"]["sentence"] == "is the highest score"


def test_one_point_per_scored_evaluation() -> None:
    events = [
        answered("designer/traj-1/attempt-1", tokens=10),
        evaluation("initial/traj-1", None, at=1.0),
        evaluation("initial/traj-2", 3.0, at=2.0),
        answered("refiner/blind/traj-1/attempt-1", tokens=5),
        expansion(1, 1, "v"),
        evaluation("initial/traj-3", 2.0, at=3.0),
        evaluation("initial/traj-4", 9.0, valid=False, at=4.0),
        edit(1, 2),
        evaluation("initial/traj-5", 1.0, at=5.0),
    ]
    points = [tuple(point.values())[:-1] for point in score_curve(events)]
    assert points == [
        (0, 1, 10, 2.0, 3.0),
        (1, 2, 15, 3.0, 2.0),
        (1, 2, 15, 4.0, 9.0),
        (2, 2, 15, 5.0, 1.0),
    ]
    assert all(point["machine"] for point in score_curve(events))


def test_reasons_are_counted_with_an_example() -> None:
    attempts = [attempt("overlap", "1 in 2"), attempt(""), attempt("overlap", "3"), attempt("type")]
    assert rejection_reasons(attempts) == [
        {"code": "overlap", "count": 2, "example": "1 in 2"},
        {"code": "type", "count": 1, "example": ""},
    ]


def test_validity_by_role() -> None:
    attempts = [attempt("x", parsed=False), attempt("", repaired=True), attempt("", role="refiner")]
    assert validity(attempts) == [
        {"role": "designer", "attempts": 2, "parsed": 1, "valid": 1, "repaired": 1},
        {"role": "refiner", "attempts": 1, "parsed": 1, "valid": 1, "repaired": 0},
    ]


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a run directory: it has no readable run\.yaml"):
        RunStory.read(tmp_path, None, None)
