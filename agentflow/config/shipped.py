"""The configurations that ship with the package, which every folder can name."""

import os
from pathlib import Path

FOLDER = "configs"
_PACKAGE = Path(__file__).parents[1]
_PLACES = (_PACKAGE / FOLDER, _PACKAGE.parent / FOLDER)
"""Where they are in an installed package, and in a checkout."""


def find_config(path: Path) -> Path:
    """The file that a path names: itself if it exists, else the configuration that ships.

    Those are named as in a checkout, `configs/inspector.yaml`, or briefly: `inspector`.
    """
    if os.path.exists(path):  # unlike the methods of Path, it takes names of any length
        return path
    name = str(path).removeprefix(f"{FOLDER}{os.sep}")
    places = (place / f"{name}{suffix}" for place in _PLACES for suffix in ("", ".yaml"))
    found = () if path.is_absolute() else filter(os.path.isfile, places)
    return next(iter(found), path)
