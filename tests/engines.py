"""Which tests need which physics engine.

Tests in `tests/env/physics/ENGINE` look inside that engine. Elsewhere, a test with the marker of
an engine, such as `@pytest.mark.pybullet`, expects that engine's numbers. Both kinds are left out
where its library is not installed, and the summary says so. All other tests must pass with
whichever engine is the default.
"""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.env.physics.engines import ENGINES, installed_engines


def engine_params() -> list[Any]:
    """Every registered engine's name with its marker, for `parametrize` and `params`."""
    return [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ENGINES]


def missing_engines() -> list[str]:
    """Names of the registered engines whose libraries are not installed."""
    installed = {spec.name for spec in installed_engines()}
    return [name for name in ENGINES if name not in installed]
