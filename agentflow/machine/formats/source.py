"""The text of files and of standard input that are said to hold machines."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import AnyStr, TextIO

from agentflow.errors import UsageError

UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
LARGEST = 64 * 2**20
"""Most bytes of a text (characters for standard input); refuses endless files."""


def read_text(source: str) -> str:
    """The text of a file, or of standard input for `-`; UTF-8, or UTF-16 with a byte order mark."""
    if source == "-":
        return _limit_size(_standard_input().read(LARGEST + 1), "standard input")
    try:
        with Path(source).open("rb") as file:
            data = _limit_size(file.read(LARGEST + 1), source)
        return data.decode("utf-16" if data.startswith(UTF_16_MARKS) else "utf-8-sig")
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{source} is not a text file") from None


def _limit_size(data: AnyStr, source: str) -> AnyStr:
    if len(data) > LARGEST:
        raise UsageError(f"{source} is larger than {LARGEST // 2**20} MB; expected a machine")
    return data


def read_lines(source: str) -> Iterator[str]:
    """The lines of a file, or of standard input for `-`, including blank ones."""
    if source == "-":
        yield from _standard_input()
        return
    try:
        with Path(source).open(encoding="utf-8-sig", errors="replace") as lines:
            yield from lines
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None


def _standard_input() -> TextIO:
    """Standard input as UTF-8; invalid bytes are replaced."""
    if sys.stdin is None:
        raise UsageError("standard input is closed; name a file")
    if isinstance(sys.stdin, io.TextIOWrapper):
        sys.stdin.reconfigure(encoding="utf-8-sig", errors="replace")
    return sys.stdin
