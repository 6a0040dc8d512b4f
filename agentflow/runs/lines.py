"""Owns files of lines of JSON that are appended to: each line is in them as a whole or not at all.

What the lines hold is the writer's.
"""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any


class LineFile:
    """Appends lines without a buffer, so that what is written survives the death of the process.

    Opening drops a half-written last line; one that lacks its line break alone is given it.
    """

    def __init__(self, path: Path) -> None:
        """Open or make the file.

        Raises:
            OSError: It cannot be opened for writing.
        """
        self.path = path
        self._file = path.open("ab", buffering=0)
        self.dropped = 0
        """Bytes of a half-written last line."""
        try:
            self._end = self._end_of_lines(path)
        except BaseException:
            self._file.close()
            raise

    def append(self, line: bytes) -> None:
        """Write one line; `line` has no line break.

        Raises:
            OSError: It could not be written; what was written of it is taken back.
        """
        content = line + b"\n"
        written = 0
        try:
            while written < len(content):
                written += self._file.write(content[written:])
        except OSError:
            with contextlib.suppress(OSError):  # reopening drops what is left of it
                self._file.truncate(self._end)
            raise
        self._end += len(content)

    def close(self) -> None:
        """Close the file; closing twice does no harm."""
        self._file.close()

    def _end_of_lines(self, path: Path) -> int:
        """Where the last whole line ends, in bytes, once every line in the file is whole."""
        end, last = 0, b"\n"
        with path.open("rb") as lines:
            for last in lines:
                end += len(last)
        if not is_whole(last):
            self.dropped = len(last)
            os.truncate(path, end - len(last))
            return end - len(last)
        if not last.endswith(b"\n"):
            end += self._file.write(b"\n")
        return end


def is_whole(line: bytes) -> bool:
    """Whether a line was written to its end, its break perhaps left out: no part is an object."""
    return line.endswith(b"\n") or object_in(line) is not None


def object_in(text: bytes) -> dict[str, Any] | None:
    """The JSON object in a text; None where there is none."""
    try:
        item = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return item if isinstance(item, dict) else None
