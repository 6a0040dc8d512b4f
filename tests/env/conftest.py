"""Every registered engine, for the tests of what all engines have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Engine, EngineSpec
from agentflow.env.physics.registry import ENGINES
from tests.env.physics.rig import weightless
from tests.installed import engine_params

MakeEngine = Callable[[Constants | None], Engine]


@pytest.fixture(scope="module", params=engine_params())
def engine_spec(request: pytest.FixtureRequest) -> EngineSpec:
    return ENGINES[request.param]


@pytest.fixture(scope="module")
def engine(engine_spec: EngineSpec) -> Iterator[Engine]:
    started = engine_spec.start()
    yield started
    started.close()


@pytest.fixture(scope="module")
def calm(engine_spec: EngineSpec) -> Iterator[Engine]:
    """An engine without gravity."""
    started = engine_spec.start(weightless())
    yield started
    started.close()


@pytest.fixture
def make_engine(engine_spec: EngineSpec) -> Iterator[MakeEngine]:
    """Starts engines with other constants; they are closed after the test."""
    started: list[Engine] = []

    def make(physics: Constants | None = None) -> Engine:
        started.append(engine_spec.start(physics))
        return started[-1]

    yield make
    for each in started:
        each.close()
