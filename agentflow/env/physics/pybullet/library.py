"""The PyBullet library, imported without the build time that it prints to standard error."""

import os
import sys
from types import ModuleType


def _load() -> ModuleType:
    """Import PyBullet while file descriptor 2 is redirected to the null device."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        import pybullet as loaded
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
    module: ModuleType = loaded
    return module


pybullet = _load()
