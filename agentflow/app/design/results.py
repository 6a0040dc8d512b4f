"""Owns reading back the result of a finished run: every key that is looked at, and of its kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import Any

from agentflow.errors import RunError
from agentflow.runs import read_result

NUMBER = (int, float)
KEYS: Mapping[str, tuple[type, ...]] = MappingProxyType(
    {
        "task": (str,),
        "workflow": (str,),
        "seed": (int,),
        "score": (*NUMBER, NoneType),
        "valid": (bool,),
        "machine": (list, NoneType),
        "stages": (list,),
        "rollouts": (int,),
        "stopped": (str, NoneType),
        "reason": (str,),
        "model": (str,),
        "calls": (int,),
        "simulated_seconds": NUMBER,
        "worker_seconds": NUMBER,
        "run": (str,),
    }
)
"""Keys without which a result is none, and what they may hold."""


def finished(path: Path) -> dict[str, Any]:
    """The result of a finished run.

    Raises:
        RunError: The run is unfinished, or its result is damaged.
    """
    result = read_result(path)
    missing = [key for key in KEYS if key not in result]
    if missing:
        raise _damaged(path, f"it lacks {', '.join(missing)}")
    for key, kinds in KEYS.items():
        if type(result[key]) not in kinds:
            raise _damaged(path, f"its {key} is {str(result[key])[:40]!r}")
    return result


def _damaged(path: Path, why: str) -> RunError:
    return RunError(f"{path / 'result.json'} is damaged: {why}")
