import pytest
import yaml
from pydantic import ValidationError

from agentflow.machine.tree import ROOT, Machine
from agentflow.workflows.settings import WorkflowSettings
from docs.make.configuration import meanings


def test_defaults_are_the_published_numbers() -> None:
    settings = WorkflowSettings()
    assert (settings.trajectories, settings.candidates, settings.search.rounds) == (8, 1, 5)
    assert settings.asks_querier


def test_every_switch_has_help() -> None:
    assert set(meanings(WorkflowSettings)) == set(WorkflowSettings.model_fields)


def test_a_bare_off_of_yaml_is_off() -> None:
    read = yaml.safe_load("{meta_designer: off, inspector: off}")
    settings = WorkflowSettings.model_validate(read)
    assert (settings.meta_designer, settings.inspector) == ("off", False)
    with pytest.raises(ValidationError, match="meta_designer"):
        WorkflowSettings.model_validate({"meta_designer": True})


def test_rationales_go_round() -> None:
    settings = WorkflowSettings(rationales=("a", "b"))
    assert [settings.rationale(number) for number in (1, 2, 3)] == ["a", "b", "a"]
    assert WorkflowSettings().rationale(1) == ""


def test_rationales_and_a_start_machine_exclude_each_other() -> None:
    start = ({"type": 0, "id": 0, "parent": -1, "face_id": -1},)
    assert str(WorkflowSettings(start=start).start_machine) == str(Machine((ROOT,)))
    assert WorkflowSettings().start_machine is None
    with pytest.raises(ValidationError, match="rationales guide first designs; a run with a start"):
        WorkflowSettings(start=start, rationales=("a",))


@pytest.mark.parametrize(
    ("querier", "feedback", "asks"),
    [(True, "active", True), (False, "active", False), (True, "basic", False)],
)
def test_the_querier_is_asked_when_its_answers_are_told(
    querier: bool, feedback: str, asks: bool
) -> None:
    settings = WorkflowSettings.model_validate({"querier": querier, "feedback": feedback})
    assert settings.asks_querier is asks
