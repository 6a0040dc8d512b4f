"""Which engines there are, and how each is identified."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import pytest

from agentflow.env.physics.engines import ENGINES, EngineSpec, default_engine
from agentflow.errors import ConfigError


def test_an_engine_is_identified_without_loading_its_library() -> None:
    code = (
        "import sys\n"
        "from agentflow.env.physics.engines import default_engine\n"
        "print(default_engine().identity, 'pybullet' in sys.modules, 'numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"pybullet {version('pybullet')} False False\n"


@pytest.mark.parametrize("name", ENGINES)
def test_engines_are_registered_by_their_name(name: str) -> None:
    assert ENGINES[name].name == name


def test_the_preferred_engine_is_the_default() -> None:
    assert default_engine() is ENGINES["pybullet"]


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
