"""The kinds of failures, each with the rule for counting it. Imports almost nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

STILL = 0.1
"""A machine counts as motionless if no block moves farther than this, m."""


@dataclass(frozen=True)
class FailureKind:
    """One kind of failure. A refused reply has one kind, a machine may have several.

    An accepted reply can only be of kind `RATIONALE`.
    """

    name: str
    level: Literal["format", "planning", "construction"]
    """planning: the wrong machine was planned; construction: it was built wrongly."""
    rule: str
    codes: frozenset[str] = frozenset()
    """Codes of the refused replies of this kind."""
    unit: Literal["reply", "machine"] = "reply"
    """What is counted: replies, or simulated machines (each once)."""


EMPTY = FailureKind(
    "empty reply",
    "format",
    "the reply has no text, or only tool calls",
    frozenset({"empty_reply", "tool_calls"}),
)
CUT_OFF = FailureKind(
    "cut-off reply", "format", "the reply reached the length limit", frozenset({"truncated"})
)
FILTERED = FailureKind(
    "filtered reply",
    "format",
    "the endpoint's content filter stopped the reply",
    frozenset({"content_filter"}),
)
UNPARSABLE = FailureKind("unparsable", "format", "the reply is not in the required format")
MISSING = FailureKind(
    "missing component",
    "planning",
    "a machine or blueprint has too few or too many of a required block",
    frozenset({"required_count", "required_missing"}),
)
PLAN = FailureKind(
    "plan not followed",
    "planning",
    "a design changes or drops the blocks it was given, adds no new ones, or uses a type that the "
    "blueprint does not list for the structure; or a blueprint contradicts itself",
    frozenset(
        {
            "given_altered",
            "nothing_added",
            "type_outside_structure",
            "undefined_structure",
            "not_in_build_order",
            "repeated_structure",
            "no_structure",
            "bad_structure",
            "bad_types",
            "too_many_types",
            "missing_key",
        }
    ),
)
RATIONALE = FailureKind(
    "rationale not followed",
    "planning",
    "an accepted machine has fewer blocks of a type than its rationale states "
    '("four Small Wheels"); nothing else in the rationale is checked',
)
FORBIDDEN = FailureKind(
    "block not allowed",
    "planning",
    "a block type is unknown or not allowed in the task",
    frozenset({"type_not_allowed", "unknown_type", "two_ended_type"}),
)
MOTIONLESS = FailureKind(
    "no motion",
    "planning",
    f"no block moves more than {STILL} m after power comes on; not counted for "
    "gearing, where cogs turn in place",
    unit="machine",
)
FACING = FailureKind(
    "wrong facing",
    "construction",
    "the axle of a powered wheel is not along x in a driving task, or a loaded "
    "container does not open upwards",
    unit="machine",
)
ATTACHMENT = FailureKind(
    "wrong attachment",
    "construction",
    "a block is attached to a parent or face that does not exist, is occupied or "
    "comes later; a block has an impossible rotation; or a two-ended block has only one parent, or "
    "joins the same two faces as another of its type",
    frozenset(
        {
            "face_not_found",
            "face_occupied",
            "parent_not_found",
            "parent_not_earlier",
            "no_parent",
            "rotation",
            "two_ended",
            "duplicate_connection",
        }
    ),
)
OVERLAP = FailureKind("overlap", "construction", "two blocks overlap", frozenset({"overlap"}))
EDIT = FailureKind(
    "refused edit",
    "construction",
    "an edit cannot be parsed or applied, such as one that uses an unknown name, for a reason not "
    "listed above",
)
BREAKAGE = FailureKind(
    "breakage", "construction", "a connection broke in the simulation", unit="machine"
)
OTHER = FailureKind(
    "other",
    "construction",
    "anything else, such as the machine's size, its number of blocks, the order of its ids or what "
    "its control program names",
    frozenset(
        {
            "size_limit",
            "id_sequence",
            "root",
            "starting_block",
            "too_many_blocks",
            "too_many_parts",
            "too_many_controls",
            "controls_not_allowed",
            "control_block",
            "control_group",
            "control_level",
            "control_time",
            "blocks_altered",
        }
    ),
)
KINDS = (
    EMPTY,
    CUT_OFF,
    FILTERED,
    UNPARSABLE,
    MISSING,
    PLAN,
    RATIONALE,
    FORBIDDEN,
    MOTIONLESS,
    FACING,
    ATTACHMENT,
    OVERLAP,
    EDIT,
    BREAKAGE,
    OTHER,
)
