"""Which tests need a library that is not everywhere: an engine, PyTorch with TRL, Ray, or CAD.

Tests in `tests/env/physics/ENGINE` look inside that engine. Elsewhere, a test with the marker of
an engine, such as `@pytest.mark.pybullet`, expects that engine's numbers. Tests with the marker
`training`, `cluster` or `cad` need libraries that `.venv` does not hold: `scripts/test --all` runs
these tests, and no others, in the environments of these names. Where a library is not installed,
its tests are left out, and the summary says so. All other tests must pass with whichever engine is
the default.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import pytest

from agentflow.env.physics.engines import installed_engines
from agentflow.env.physics.registry import ENGINES

ENVIRONMENTS = {"training": "trl", "cluster": "ray", "cad": "OCP"}
"""Marker -> library that its tests need; `scripts/servers MARKER` makes an environment with it."""


def engine_params() -> list[Any]:
    """Every registered engine's name with its marker, for `parametrize` and `params`."""
    return [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ENGINES]


def missing_engines() -> list[str]:
    """Names of the registered engines whose libraries are not installed."""
    installed = {spec.name for spec in installed_engines()}
    return [name for name in ENGINES if name not in installed]


def missing() -> dict[str, str]:
    """Marker -> why its tests are left out here."""
    engines = {
        name: f"{name} is not installed, and all in tests/env/physics/{name}"
        for name in missing_engines()
    }
    return engines | {
        marker: f"{library} is not installed; after `scripts/servers {marker}`, scripts/test --all "
        f"runs them in .venv-{marker}"
        for marker, library in ENVIRONMENTS.items()
        if find_spec(library) is None
    }
