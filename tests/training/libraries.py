"""Whether the libraries of the extra `train`, such as PyTorch and TRL, are there.

`.venv` does not hold them. `scripts/servers training` makes `.venv-training`, which does, and
`scripts/test --all` then runs the tests marked `training` there. Such a test imports what it needs
inside itself.
"""

from __future__ import annotations

import pytest

from tests.installed import missing

INSTALLED = "training" not in missing()


def require_training() -> pytest.MarkDecorator:
    """The marker of all tests of a module that imports PyTorch or TRL; skips it without these.

    Called before the module imports them.
    """
    if not INSTALLED:
        pytest.skip("TRL is missing", allow_module_level=True)
    return pytest.mark.training
