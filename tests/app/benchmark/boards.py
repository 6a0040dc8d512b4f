"""A small benchmark with the fastest items, and its folder after a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

SMALL: dict[str, Any] = {
    "title": "Small",
    "benchmark": {
        "version": 2,
        "pars": {"gearing-1": {"floor": 0.0, "par": 1.0}, "gearing-2": {"floor": 0.0, "par": 1.0}},
    },
    "base": {},
    "axes": {
        "part": {
            "first": {
                "workflow": "single",
                "trajectories": 2,
                "placements": 2,
                "max_simulations": 2,
                "search.rounds": 0,
                "max_retry": 1,
                "verify": False,
            },
            "refined": {
                "workflow": "iterative",
                "trajectories": 1,
                "placements": 3,
                "max_simulations": 3,
                "search.rounds": 1,
                "search.width": 1,
            },
        },
        "task": {
            "gearing-1": {"task": "gearing", "workflow": "placement"},
            "gearing-2": {"task": "gearing/2", "workflow": "placement"},
        },
    },
    "table": {"metrics": ["share"]},
}
"""Two items of one family."""


PARS = SMALL["benchmark"]["pars"]


def write(folder: Path, **changes: Any) -> Path:
    """The file of the small benchmark, with changed keys."""
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump({**SMALL, **changes}, sort_keys=False))
    return file
