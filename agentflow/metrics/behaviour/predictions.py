"""What a refiner predicts of an edit: success or not, and a score, by fixed rules on its words."""

from __future__ import annotations

import re

SUCCESS = (
    *("achieve", "clear", "complete", "farther", "higher", "hold", "improve", "increase"),
    *("pass", "solve", "stable", "succeed", "success", "successful"),
)
"""Words of success; ours, as no list is published. Forms in -s, -es, -d, -ed and -ing count."""
DENIALS = r"(?:not|never|no|nothing|without|fails? to|unlikely|cannot|hardly)"
"""Words that deny a word of success within the three words after them."""

_SUCCESS = re.compile(rf"\b(?:{'|'.join(SUCCESS)})(?:e?[sd]|ing)?\b", re.IGNORECASE)
_DENIED = re.compile(rf"\b{DENIALS}(?:\s+[\w-]+){{0,2}}\s+$", re.IGNORECASE)

_NUMBER = r"-?\d+(?:\.\d+)?"
_RANGE = rf"({_NUMBER})(?:\s*(?:-|to|or)\s*({_NUMBER}))?(?![\d.]*\d|\s*(?:%|per\s?cent))"
_WORDS = "at|about|around|roughly|nearly|some|of|is|be|to|least|than|more|again"
_FILLER = rf"(?:\s*(?:[=:]|(?:{_WORDS})\b))*"
_POINTS = (
    re.compile(rf"\bscore[sd]?{_FILLER}\s*{_RANGE}", re.IGNORECASE),
    re.compile(rf"{_RANGE}\s+points?\b", re.IGNORECASE),
)
_METRES = (
    re.compile(
        rf"\b(?:distance|throw|lands?){_FILLER}\s*{_RANGE}\s*m\b(?!\s+behind)", re.IGNORECASE
    ),
    re.compile(rf"{_RANGE}\s*m(?:etres)?\s+(?:away|in\s+{_NUMBER}\s*s)\b", re.IGNORECASE),
)


def predicts_success(prediction: str) -> bool:
    """Whether a prediction has a word of success that is not denied just before it."""
    return any(
        not _DENIED.search(prediction[: found.start()]) for found in _SUCCESS.finditer(prediction)
    )


def predicted_score(prediction: str, *, metres: bool) -> float | None:
    """The score that a prediction names, the middle of a range; None if it names none.

    It is the number after "score", or before "points". Where the score is a distance, it is also
    the number of metres after "distance", "throw" or "lands" (not "lands 7 m behind it"), or before
    "away" or "in 20 s". The first that is found counts, in this order.

    Args:
        prediction: The refiner's words.
        metres: Whether the score of the task is a distance.
    """
    for pattern in (*_POINTS, *(_METRES if metres else ())):
        if found := pattern.search(prediction):
            ends = [float(end) for end in found.groups() if end]
            return sum(ends) / len(ends)
    return None
