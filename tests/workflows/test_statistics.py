import statistics

from agentflow.runs.events import FirstAttempt
from agentflow.search.node import Evaluation, SearchCost
from agentflow.workflows.base import Candidate, Stage, count_passes, find_best, stage_row


def scored(trajectory: int, score: float | None, first: FirstAttempt = FirstAttempt()) -> Candidate:  # noqa: B008
    return Candidate(trajectory, evaluation=Evaluation(True, score), first=first)


def test_row() -> None:
    """Scores 4, 1 and -2; one the computer could not score; two invalid."""
    stage = Stage(
        "env_feedback",
        (
            scored(1, 4.0, FirstAttempt(True, True, True)),
            scored(2, 1.0, FirstAttempt(True, True, False)),
            scored(3, None, FirstAttempt(True, False, False)),
            Candidate(4, reason="no machine"),
            Candidate(5, evaluation=Evaluation(False, 0.0)),
            Candidate(6, evaluation=Evaluation(True, -2.0), search_cost=SearchCost(5, 24, 18, 17)),
        ),
        calls=40,
        tokens=4000,
        rollouts=17,
    )
    assert stage_row(stage) == {
        "name": "env_feedback",
        "trajectories": 6,
        "parsed_first": 3,
        "spatial_first": 2,
        "valid_first": 1,
        "valid": 4,
        "mean": 1.0,
        "mean_all": 0.6,
        "max": 4.0,
        "std": statistics.pstdev([4, 1, -2]),
        "calls": 40,
        "tokens": 4000,
        "rollouts": 17,
        "expansions": 5,
        "attempts": 24,
        "children": 18,
    }


def test_passes() -> None:
    """A score of 1 passes, less does not; what the computer could not score is no attempt."""
    stage = Stage(
        "initial",
        (
            scored(1, 1.0, FirstAttempt(True, True, True)),
            scored(2, 0.999, FirstAttempt(True, False, False)),
            scored(3, 1.5, FirstAttempt(True, True, True)),
            scored(4, None, FirstAttempt(True, True, True)),
            Candidate(5, evaluation=Evaluation(False, 1.0)),
        ),
        calls=5,
        tokens=0,
        rollouts=4,
    )
    assert count_passes(stage) == {
        "attempts": 4,
        "parsed": 3,
        "spatial": 2,
        "passes": 2,
        "share": 0.5,
    }
    assert count_passes(Stage("initial", (scored(1, None),), 0, 0, 0))["share"] is None


def test_best_is_the_earliest_among_equals() -> None:
    first = Stage("initial", (scored(1, None), scored(2, 3.0), scored(3, 3.0)), 0, 0, 0)
    later = Stage("blind_refinement", (scored(1, 3.0),), 0, 0, 0)
    assert find_best((first, later)) == (first.candidates[1], first)
    assert find_best((Stage("initial", (scored(1, None), Candidate(2)), 0, 0, 0),)) is None
    assert find_best(()) is None
