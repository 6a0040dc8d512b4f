"""What tools return, and how transports describe a tool to clients."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ToolSpec:
    """A tool as clients see it."""

    name: str
    description: str
    parameters: Mapping[str, Any]
    """JSON schema of its arguments, which are an object."""


@dataclass(frozen=True)
class ToolResult:
    """The answer to one call."""

    text: str
    """What the agent reads."""
    data: Mapping[str, Any]
    image: bytes | None = None
    """A PNG picture, only of `look`."""
    refused: bool = False
    """Whether the call was refused; the text says what to change."""


class RefusedCall(Exception):
    """A call that cannot be carried out: words that say what to change, and data."""

    def __init__(self, text: str, code: str = "", **data: Any) -> None:
        """`code` is the kind of the first problem of a machine or an edit, for counting."""
        super().__init__(text)
        self.code, self.data = code, data

    @property
    def result(self) -> ToolResult:
        """The answer to such a call."""
        return ToolResult(str(self), {"refused": str(self), **self.data}, refused=True)


class StageEnded(RefusedCall):
    """A call that came, or was still in progress, when its stage had ended."""

    def __init__(self) -> None:
        """The same words for every tool."""
        super().__init__("this stage has ended; nothing more can be done in it", "stage_ended")


def brief_numbers(value: Any) -> Any:
    """JSON data with numbers of at most five significant digits and six decimals: models pay for
    each digit."""
    if isinstance(value, float):
        return float(f"{round(value, 6):.5g}")
    if isinstance(value, Mapping):
        return {key: brief_numbers(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [brief_numbers(item) for item in value]
    return value
