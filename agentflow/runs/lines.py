"""Owns a file that lines are appended to: a line is in it as a whole, or gone when it is reopened.

What the lines hold is the writer's.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


class LineFile:
    """Appends lines without a buffer, so that what is written survives the death of the process.

    Opening drops a half-written last line.
    """

    def __init__(self, path: Path) -> None:
        """Open or make the file.

        Raises:
            OSError: It cannot be opened for writing.
        """
        self._file = path.open("ab", buffering=0)
        try:
            self._end = _end_of_lines(path)
            os.truncate(path, self._end)
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


def _end_of_lines(path: Path) -> int:
    """Where the last whole line ends, in bytes."""
    with path.open("rb") as lines:
        return sum(len(line) for line in lines if line.endswith(b"\n"))
