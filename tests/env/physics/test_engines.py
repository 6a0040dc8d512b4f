"""Which engines there are, and how each is identified."""

from __future__ import annotations

from importlib.metadata import version

import pytest

from agentflow.env.physics.engine import EngineSpec
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.registry import ENGINES
from agentflow.errors import ConfigError
from tests.installed import missing_engines
from tests.processes import run_python


def test_an_engine_is_identified_without_loading_its_library() -> None:
    code = (
        "import sys\n"
        "from agentflow.env.physics.engines import default_engine\n"
        "print(default_engine().name, {'pybullet', 'mujoco', 'numpy'} & {*sys.modules})"
    )
    assert run_python("-c", code).stdout == f"{default_engine().name} set()\n"


@pytest.mark.parametrize("name", ENGINES)
def test_engines_are_registered_by_their_name(name: str) -> None:
    assert ENGINES[name].name == name


@pytest.mark.pybullet
def test_pybullet_is_the_default_where_it_is_installed() -> None:
    assert default_engine() is ENGINES["pybullet"]


def test_the_first_engine_that_is_installed_is_the_default() -> None:
    missing = missing_engines()
    assert default_engine().name == next(name for name in ENGINES if name not in missing)


def test_an_engine_whose_library_is_missing_says_what_to_install() -> None:
    spec = EngineSpec("fast", ("no-such-library", "nor-this-one"), "nowhere:Engine")
    with pytest.raises(ConfigError) as caught:
        _ = spec.identity
    assert str(caught.value) == (
        "the physics engine 'fast' needs no-such-library or nor-this-one; install it"
    )


def test_the_first_library_that_is_installed_counts() -> None:
    spec = EngineSpec("fast", ("no-such-library", "numpy"), "nowhere:Engine")
    assert str(spec.identity) == f"fast {version('numpy')}"
