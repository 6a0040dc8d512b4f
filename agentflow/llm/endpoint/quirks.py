"""Owns which parameters an endpoint refuses: learned from its refusals, remembered for the run.

Wordings differ between vendors; the patterns here were gathered from public bug reports.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from agentflow.llm.endpoint.faults import Refusal

_OPTIONAL = (
    "max_completion_tokens",
    "max_tokens",
    "temperature",
    "top_p",
    "seed",
    "stop",
    "response_format",
    "stream_options",
    "stream",
)
"""Parameters that a request can do without, the more specific names first."""
_UNSUPPORTED = re.compile(
    r"(?i)unsupported|not\s+support|n't\s+support|not\s+(?:been\s+)?(?:permitted|allowed|"
    r"implemented|available|accepted|compatible)|extra[_ ](?:inputs|fields|forbidden)|"
    r"unrecogni[sz]ed|unknown|unexpected|deprecated|only the default|only \S+ is (?:supported|"
    r"allowed)|cannot both be|no longer|must be verified to|does not (?:accept|allow|permit|take)"
)
_EITHER_OR = re.compile(r"(?i)cannot both be|only one of|use only one|not both")
_STATUSES = (400, 415, 422, 501)
_INSTEAD = {"max_tokens": "max_completion_tokens", "json_schema": "json_object"}
"""What is sent in place of a refused parameter or response format."""


class Quirks:
    """What one endpoint refuses. One object per endpoint and run; safe in one event loop.

    Args:
        warn: Called once for each refused parameter with one line of text.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self.refused: dict[str, str] = {}
        """Parameter -> what was done about it."""

    def adapt(self, body: Mapping[str, object]) -> dict[str, object]:
        """The body without what is known to be refused."""
        adapted = dict(body)
        if "max_tokens" in self.refused and "max_tokens" in adapted:
            adapted["max_completion_tokens"] = adapted["max_tokens"]
        for name in self.refused:
            adapted.pop(name, None)
        if "response_format" in adapted:
            form = self._form(adapted.pop("response_format"))
            adapted |= {"response_format": form} if form else {}
        if "stream" not in adapted:
            adapted.pop("stream_options", None)
        return adapted

    def learn(self, refusal: Refusal, sent: Mapping[str, object], said: str) -> bool:
        """Whether a refusal names a parameter that can be left out of the next attempt.

        Args:
            refusal: What the server answered.
            sent: The body that it refused.
            said: The server's words as they may be shown.
        """
        name = _refused_parameter(refusal, sent)
        if name is None:
            return False
        instead = _INSTEAD.get(name)
        if name == "response_format":
            kind = _kind(sent[name])
            name, instead = f"{name} {kind}", _INSTEAD.get(kind)
        if name not in self.refused:
            action = f"{instead} is sent instead" if instead else "left out"
            self.refused[name] = action
            self._warn(f"the endpoint refuses {name}: {action} from now on ({said})")
        return True

    def _form(self, wanted: object) -> object:
        """The response format wanted or the next one that is not refused; None without any."""
        kind: str | None = _kind(wanted)
        while kind and f"response_format {kind}" in self.refused:
            kind = _INSTEAD.get(kind)
            wanted = {"type": kind} if kind else None
        return wanted


def _kind(form: object) -> str:
    return str(form["type"]) if isinstance(form, Mapping) else ""


def _refused_parameter(refusal: Refusal, sent: Mapping[str, object]) -> str | None:
    if refusal.status not in _STATUSES:
        return None
    named = [name for name in _OPTIONAL if name in sent and _names(name, refusal)]
    if "response_format" in named:
        return "response_format"  # whatever the words: without it the request is a plain one
    words = f"{refusal.message} {refusal.code}".replace("_", " ")
    if not named or not _UNSUPPORTED.search(words):
        return None
    if "top_p" in named and "temperature" in named and _EITHER_OR.search(refusal.message):
        return "top_p"
    field = refusal.param.split(".")[0]
    if field in named:
        return field
    return min(named, key=lambda name: _position(name, refusal.message))


def _names(name: str, refusal: Refusal) -> bool:
    return refusal.param.split(".")[0] == name or _position(name, refusal.message) >= 0


def _position(name: str, message: str) -> int:
    """Where a message names a parameter as a word of its own; -1 where it does not."""
    found = re.search(rf"(?<![\w-]){name}(?![\w-])", message)
    return found.start() if found else -1
