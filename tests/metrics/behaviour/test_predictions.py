"""What a prediction says, by the rules on its words."""

from __future__ import annotations

import pytest

from agentflow.agents.replies import expectations
from agentflow.metrics.behaviour import predicted_score, predicts_success


@pytest.mark.parametrize(
    ("words", "success"),
    [
        ("A higher score than before.", True),
        ("All ten trials succeed; score 10.", True),
        ("Hoop 1 is passed; the arm holds.", True),
        ("A success is unlikely.", True),  # the denial comes after the word
        ("It does not pass the ring.", False),
        ("That will hardly clear the wall.", False),
        ("It may never be stable again.", False),
        ("Nothing improves. The arm holds.", True),  # a denial reaches two words, not a sentence
        ("The boulder leaves at 0.3 s.", False),
        ("", False),
    ],
)
def test_words_of_success_count_unless_denied(words: str, success: bool) -> None:
    assert predicts_success(words) is success


@pytest.mark.parametrize(
    ("words", "metres", "score"),
    [
        ("Score about 23-25.", False, 24.0),
        ("Score at least 22 m", False, 22.0),
        ("score: 10", False, 10.0),
        ("both rings, 20 points or more", False, 20.0),
        ("11 to 15 points, the starting point", False, 13.0),
        ("Distance about 80-90 m.", True, 85.0),
        ("it lands about 75 to 85 m away", True, 80.0),
        ("about 166 m in 20 s", True, 166.0),
        ("Distance about 80-90 m.", False, None),
        ("lands about 7 m behind it", True, None),
        ("lands at about z = 4 to 6", True, None),
        ("Expected throw about 20 to 30 percent farther", True, None),
        ("throw 30 % farther", True, None),
        ("with 40 m/s after 2 s", True, None),
        ("", True, None),
    ],
)
def test_a_score_is_named_as_points_or_as_metres(
    words: str, metres: bool, score: float | None
) -> None:
    assert predicted_score(words, metres=metres) == score


def test_only_sentences_about_the_future_are_predictions_of_agents() -> None:
    text = (
        "It scored 22.5 m. The longer arm should reach a score of 30. Let me see.\nI'll simulate."
    )
    assert expectations(text) == "The longer arm should reach a score of 30. I'll simulate."
    assert predicted_score(expectations(text), metres=True) == 30.0
    assert expectations("Score 22, as before.") == ""
