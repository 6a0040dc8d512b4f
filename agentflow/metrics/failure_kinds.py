"""The kinds of failures, each with the rule for counting it. Imports almost nothing."""

import json
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Literal

STILL = 0.1
"""A machine counts as motionless if no block moves farther than this, m."""


@dataclass(frozen=True)
class FailureKind:
    """One kind of failure. A refused reply has one kind, a machine may have several.

    An accepted reply can only be of kind `RATIONALE`.

    At the level `planning`, the wrong machine was planned, at `construction`, it was built wrongly.
    `codes` are those of the refused replies of this kind. `unit` is what is counted: replies, or
    simulated machines, each once.
    """

    name: str
    level: Literal["format", "planning", "construction"]
    rule: str
    codes: frozenset[str] = frozenset()
    unit: Literal["reply", "machine"] = "reply"


def _read(item: dict[str, Any]) -> FailureKind:
    codes = frozenset(item.pop("codes", ()))
    return FailureKind(**item | {"rule": item["rule"].format(still=STILL)}, codes=codes)


KINDS = tuple(
    map(_read, json.loads((files(__package__) / "failure_kinds.json").read_text("utf-8")))
)
"""In the order in which they are listed."""
_NAMED = {kind.name: kind for kind in KINDS}
EMPTY, CUT_OFF, FILTERED = (_NAMED[f"{what} reply"] for what in ("empty", "cut-off", "filtered"))
UNPARSABLE, RATIONALE = _NAMED["unparsable"], _NAMED["rationale not followed"]
MOTIONLESS, BREAKAGE, FACING = _NAMED["no motion"], _NAMED["breakage"], _NAMED["wrong facing"]
EDIT, OTHER = _NAMED["refused edit"], _NAMED["other"]
