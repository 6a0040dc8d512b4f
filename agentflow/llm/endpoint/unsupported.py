"""Learn from an endpoint's error messages which parameters it does not support.

Wordings differ between vendors; the patterns here come from public bug reports.
"""

import re
from collections.abc import Callable, Mapping

from agentflow.llm.endpoint.faults import ErrorResponse

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
    "tool_choice",
)
"""Parameters that can be omitted, more specific names first."""
_UNSUPPORTED = re.compile(
    r"(?i)unsupported|not\s+support|n't\s+support|not\s+(?:been\s+)?(?:permitted|allowed|"
    r"implemented|available|accepted|compatible)|extra[_ ](?:inputs|fields|forbidden)|"
    r"unrecogni[sz]ed|unknown|unexpected|deprecated|only the default|only \S+ is (?:supported|"
    r"allowed)|cannot both be|no longer|must be verified to|does not (?:accept|allow|permit|take)"
)
_EITHER_OR = re.compile(r"(?i)cannot both be|only one of|use only one|not both")
_STATUSES = (400, 415, 422, 501)
_TOOLS = re.compile(r"(?i)\btools\b(?![\[.])|\btool (?:use|choice|call)|\bfunction call")
"""Words for tools, but not for one of the request's tools, as in tools[0].function.name."""
_NO_TOOLS = re.compile(r"(?i)not enabled|no endpoints found that support|requires --")
"""How servers say that tools are unavailable, besides `_UNSUPPORTED`."""
_IMAGES = re.compile(r"(?i)\bimages?\b|\bvision\b|multi-?modal|content must be a string")
_NO_IMAGES = re.compile(
    r"(?i)not enabled|no endpoints found that support|only supported|not a multi|at most 0|"
    r"missing data|must be a string"
)
"""How servers say that they take no pictures, besides `_UNSUPPORTED`."""
_TOOLS_STATUSES = (*_STATUSES, 404, 500)
_SUBSTITUTES = {"max_tokens": "max_completion_tokens", "json_schema": "json_object"}
"""What to send instead of an unsupported parameter or response format."""


class UnsupportedParameters:
    """Parameters that one endpoint does not support; one object per endpoint and run.

    Args:
        warn: Called with one line of text, once per unsupported parameter.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self.actions: dict[str, str] = {}
        """Unsupported parameter -> what is done instead."""

    def adapt(self, body: Mapping[str, object]) -> dict[str, object]:
        """Copy a request body without the parameters known to be unsupported."""
        adapted = dict(body)
        if "max_tokens" in self.actions and "max_tokens" in adapted:
            adapted["max_completion_tokens"] = adapted["max_tokens"]
        for name in self.actions:
            adapted.pop(name, None)
        if "response_format" in adapted:
            form = self._supported_format(adapted.pop("response_format"))
            adapted |= {"response_format": form} if form else {}
        if "stream" not in adapted:
            adapted.pop("stream_options", None)
        return adapted

    def learn(self, response: ErrorResponse, sent: Mapping[str, object], message: str) -> bool:
        """Learn from an error response; whether to retry with the adapted body.

        Args:
            response: The error response.
            sent: The rejected body.
            message: The server's message without secrets, for the warning.
        """
        name = _unsupported_parameter(response, sent)
        if name is None:
            return False
        substitute = _SUBSTITUTES.get(name)
        if name == "response_format":
            kind = _format_type(sent[name])
            name, substitute = f"{name} {kind}", _SUBSTITUTES.get(kind)
        if name not in self.actions:
            action = f"replaced by {substitute}" if substitute else "omitted"
            self.actions[name] = action
            self._warn(f"the endpoint does not support {name}: {action} from now on ({message})")
        return True

    def _supported_format(self, wanted: object) -> object:
        """The wanted response format or its next supported substitute; None without any."""
        kind: str | None = _format_type(wanted)
        while kind and f"response_format {kind}" in self.actions:
            kind = _SUBSTITUTES.get(kind)
            wanted = {"type": kind} if kind else None
        return wanted


def refuses_tools(response: ErrorResponse) -> bool:
    """Whether an error response says that model or server do not support tools."""
    return _refuses(response, _TOOLS, _NO_TOOLS)


def refuses_images(response: ErrorResponse) -> bool:
    """Whether an error response says that model or server take no pictures."""
    return _refuses(response, _IMAGES, _NO_IMAGES)


def _refuses(response: ErrorResponse, what: re.Pattern[str], how: re.Pattern[str]) -> bool:
    words = f"{response.message} {response.param} {response.code}".replace("_", " ")
    unsupported = _UNSUPPORTED.search(words) or how.search(words)
    return bool(response.status in _TOOLS_STATUSES and unsupported and what.search(words))


def _format_type(form: object) -> str:
    return str(form["type"]) if isinstance(form, Mapping) else ""


def _unsupported_parameter(response: ErrorResponse, sent: Mapping[str, object]) -> str | None:
    if response.status not in _STATUSES:
        return None
    field = response.param.split(".")[0]
    optional = [name for name in _OPTIONAL if name in sent]
    named = [name for name in optional if name == field or _position(name, response.message) >= 0]
    if "response_format" in named:
        return "response_format"  # for any message: the request also works without it
    words = f"{response.message} {response.code}".replace("_", " ")
    if not named or not _UNSUPPORTED.search(words):
        return None
    if "top_p" in named and "temperature" in named and _EITHER_OR.search(response.message):
        return "top_p"
    if field in named:
        return field
    return min(named, key=lambda name: _position(name, response.message))


def _position(name: str, message: str) -> int:
    """Index of a parameter's name as a whole word in a message; -1 if absent."""
    word = "stream(?:ing)?" if name == "stream" else name
    found = re.search(rf"(?<![\w-]){word}(?![\w-])", message)
    return found.start() if found else -1
