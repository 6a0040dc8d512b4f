"""Configuration keys and values under their earlier names, which this version still reads."""

import warnings
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

KEYS = {
    "settings.search.waves": "settings.search.request_rounds",
    "settings.rollouts": "settings.max_simulations",
    "settings.looks": "settings.max_pictures",
}
"""Earlier dotted key -> the key now, in the same group."""
VALUES = {("keep_rollouts", "winners"): "best", ("settings.meta_designer", "modules"): "structures"}
"""Dotted key and an earlier value -> the value now."""


class RenamedWarning(FutureWarning):
    """Something was given under its earlier name, which the next version will refuse."""


def rename_note(earlier: str, now: str) -> str:
    """What to write instead."""
    return f"{earlier} is now {now}; the next version will refuse the earlier name"


def update_names(document: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration under today's names; where a key has both names, today's counts."""
    result = deepcopy(dict(document))
    for earlier, now in KEYS.items():
        for group, key in _holder(result, earlier):
            value = group.pop(key)
            group.setdefault(now.rpartition(".")[2], value)
    for (path, earlier), now in VALUES.items():
        for group, key in _holder(result, path):
            if group[key] == earlier:
                group[key] = now
    return result


def warn_of_names(document: Mapping[str, Any]) -> None:
    """Warn of each earlier name in a configuration that a person wrote."""
    for earlier, now in KEYS.items():
        for _ in _holder(document, earlier):
            _warn(earlier, now)
    for (path, earlier), now in VALUES.items():
        for group, key in _holder(document, path):
            if group[key] == earlier:
                _warn(f"{path}: {earlier}", f"{path}: {now}")


def _warn(earlier: str, now: str) -> None:
    warnings.warn(rename_note(earlier, now), RenamedWarning, stacklevel=3)


def _holder(document: object, path: str) -> Iterator[tuple[Any, str]]:
    """The group that holds a dotted key, and the key in it; nothing if it is not there."""
    *groups, last = path.split(".")
    for name in groups:
        document = document.get(name) if isinstance(document, Mapping) else None
    if isinstance(document, Mapping) and last in document:
        yield document, last
