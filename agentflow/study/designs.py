"""Types of designs, by the words that people and models use for them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

import yaml


def design_type(text: str) -> str | None:
    """The type whose words are used most often; of several, the one that is named first.

    None if no word of any type is used.
    """
    used: dict[str, int] = {}
    for word in re.findall(r"[a-z]+", text.lower()):
        if kind := _types().get(word):
            used[kind] = used.get(kind, 0) + 1
    return max(used, key=lambda kind: used[kind], default=None)


@cache
def _types() -> Mapping[str, str]:
    """Word -> type, with the forms of each word."""
    listed = yaml.safe_load((files("agentflow.study") / "designs.yaml").read_text("utf-8"))
    return {
        word + ending: kind
        for kind, words in listed.items()
        for word in words
        for ending in ("", "s", "es", "ed", "er", "ers", "ing")
    }
