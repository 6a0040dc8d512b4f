import math
from random import Random

import pytest
from pydantic import ValidationError

from agentflow.errors import ConfigError, UnknownNameError
from agentflow.search.mcts import mcts
from agentflow.search.registry import STRATEGIES
from agentflow.search.settings import SearchSettings, UcbSettings
from agentflow.search.strategies import extras
from docs.make.configuration import meanings


def test_by_name() -> None:
    assert STRATEGIES["mcts"] is mcts
    with pytest.raises(UnknownNameError) as caught:
        STRATEGIES["mtcs"]
    assert str(caught.value) == (
        "unknown search strategy 'mtcs'; known: mcts, ab-mcts, halving, "
        "best_of_n, random, half-and-half, independent, map-elites"
    )


def test_settings_list_the_same_names() -> None:
    told = meanings(SearchSettings)["strategy"]
    assert told.endswith(": " + ", ".join(STRATEGIES.ours) + ".")


def test_defaults() -> None:
    numbers = SearchSettings()
    assert (numbers.strategy, numbers.rounds, numbers.width, numbers.request_rounds) == (
        "halving",
        5,
        4,
        5,
    )
    assert (numbers.ucb.c, numbers.ucb.scale) == (math.sqrt(2), "minmax")


@pytest.mark.parametrize("settings", [SearchSettings, UcbSettings])
def test_every_setting_has_help(settings: type[SearchSettings] | type[UcbSettings]) -> None:
    assert set(meanings(settings)) == set(settings.model_fields)


@pytest.mark.parametrize(
    "wrong", [{"rounds": -1}, {"width": 0}, {"request_rounds": 0}, {"depth": 3}, {"ucb": {"c": -1}}]
)
def test_invalid_settings_are_rejected(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        SearchSettings.model_validate(wrong)


def test_options_are_refused_by_a_strategy_that_takes_none() -> None:
    assert extras(SearchSettings(), Random(0)) == {}
    with pytest.raises(ConfigError, match=r"halving takes no options: remove settings\.search\.o"):
        extras(SearchSettings(options={"depth": 1}))
