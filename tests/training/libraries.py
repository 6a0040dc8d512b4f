"""Which tests need the libraries of `agentflow[train]`, such as PyTorch and TRL.

`.venv` does not hold them. `scripts/servers training` makes `.venv-training`, which does, and
`scripts/test` then runs the tests in this folder there as well.
"""

from __future__ import annotations

from importlib.util import find_spec

import pytest

INSTALLED = find_spec("trl") is not None
REASON = "TRL is missing: run scripts/servers training; then scripts/test runs these tests as well"

needs_training = pytest.mark.skipif(not INSTALLED, reason=REASON)
"""For single tests; what they need is then imported inside them."""


def require_training() -> None:
    """Skip a test module that imports PyTorch or TRL. Called before it imports them."""
    if not INSTALLED:
        pytest.skip(REASON, allow_module_level=True)
