"""Designs by edits, with real physics."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from agentflow.errors import ConfigError, UsageError
from agentflow.integrations.episode import DesignEpisode
from agentflow.rewards import Sample, Scorer, reward
from tests.integrations.foreign import CAR

SHORT = {"window": 1}


@pytest.fixture(scope="module")
def scorer() -> Iterator[Scorer]:
    scorer = Scorer(workers=1)
    yield scorer
    scorer.close()


@pytest.fixture
def episode(scorer: Scorer) -> DesignEpisode:
    return DesignEpisode(scorer, Sample("movement", CAR, knobs=SHORT))


@pytest.mark.slow
def test_gains_add_up_to_the_score_of_the_last_machine(scorer: Scorer) -> None:
    episode = DesignEpisode(scorer, Sample("movement", "", knobs=SHORT))
    assert len(episode.machine) == 1
    first = episode.score
    outcomes = [episode.act(action) for action in (CAR, "Remove 6", "Add 2 to 2 in 3 as wheel")]
    assert [outcome.status for outcome in outcomes] == ["ok"] * 3
    assert outcomes[0].gain > 1 > outcomes[1].gain
    assert sum(outcome.gain for outcome in outcomes) == pytest.approx(episode.score - first)
    assert episode.machine.to_json() == json.loads(CAR)
    assert episode.score == reward("movement", CAR, knobs=SHORT).value
    assert outcomes[-1].text == episode.state
    assert "## Current machine\n[\n" in episode.state
    assert f"Score: {episode.score:.2f} m" in episode.state


@pytest.mark.parametrize(
    ("action", "problem"),
    [
        (
            "Remove 3\nRemove 99",
            "Remove 3: Success\nRemove 99: Error (block_not_found: ",
        ),
        ("Remove the wheel", "Remove the wheel: Error (bad_format: "),
        ("[{}]", "block 0 has no 'type'"),
        (
            CAR.replace('"face_id": 3', '"face_id": 2'),
            "block 4 (Powered Wheel) and block 3 (Powered Wheel) overlap by",
        ),
        (CAR.replace('"type": 2', '"type": 36', 1), "type 36 (Boulder)"),
    ],
)
def test_an_action_that_cannot_be_carried_out_changes_nothing(
    action: str, problem: str, episode: DesignEpisode
) -> None:
    before = episode.machine, episode.score, episode.state
    outcome = episode.act(action)
    assert (outcome.gain, outcome.status, outcome.fault) == (0.0, "refused", False)
    assert outcome.text.startswith("The machine is unchanged.\n")
    assert problem in outcome.text
    assert outcome.text.endswith(episode.state)
    assert (episode.machine, episode.score, episode.state) == before


def test_an_incomplete_machine_is_kept_and_scores_nothing(scorer: Scorer) -> None:
    episode = DesignEpisode(scorer, Sample("throwing", ""))
    assert (episode.score, episode.status) == (0.0, "invalid")
    outcome = episode.act("Add 15 to 0 in 4")
    assert (outcome.gain, outcome.status) == (0.0, "invalid")
    assert "requires exactly 1 block of type 36 (Boulder); there are 0" in outcome.text
    assert len(episode.machine) == 2


def test_the_rules_are_those_of_the_prompts(episode: DesignEpisode) -> None:
    for heading in ("# Machine format", "# Edit commands", "## Task", "## Blocks", "## Physics"):
        assert f"\n{heading}\n" in episode.rules
    assert "Task: movement\n" in episode.rules


def test_a_start_that_cannot_be_read_is_an_error(scorer: Scorer) -> None:
    with pytest.raises(UsageError, match=r"^the start machine is not valid: Removal 3: Error "):
        DesignEpisode(scorer, Sample("movement", "Removal 3"))
    with pytest.raises(ConfigError, match="unknown knob 'wet' of movement"):
        DesignEpisode(scorer, Sample("movement", CAR, knobs={"wet": 1}))
