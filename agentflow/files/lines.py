"""Growing files of JSON lines, and reading files without ever waiting. A kill leaves at most half
a last line, which does not count.

A received folder may hold anything under any name. The refusal is an OSError, so that whoever
reports that a file cannot be read reports this as well.
"""

import errno
import json
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from agentflow.errors import AgentflowError, DamagedError, RunError
from agentflow.files.atomic import os_errors
from agentflow.files.faults import tell_fault


def open_regular(path: Path, *, links: bool = True) -> BinaryIO:
    """Open a regular file for reading bytes.

    Args:
        path: The file.
        links: Whether a link to a file will do.

    Raises:
        OSError: It is missing, cannot be read, or is no regular file.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    if not links:
        flags |= getattr(os, "O_NOFOLLOW", 0)
        if path.is_symlink():
            raise OSError(errno.ELOOP, "it is a link", str(path))
    descriptor = os.open(path, flags)
    try:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "it is a pipe or device, not a file", str(path))
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_regular(path: Path, most: int = -1) -> bytes:
    """The content of a regular file, or its first `most` bytes; errors are `open_regular`'s."""
    with open_regular(path) as file:
        return file.read(most)


_T = TypeVar("_T")


class LineFile:
    """Appends lines without a buffer: a line is in the file, complete, once `append` returns.

    Opening drops a half-written last line. A last line that only lacks its line break is kept.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("ab", buffering=0)
        self.dropped = 0
        """Bytes of a half-written last line."""
        try:
            self._end = self._end_of_lines()
        except BaseException:
            self._file.close()
            raise

    def append(self, line: bytes) -> int:
        """Write a line, given without its line break, and return its byte offset.

        Raises:
            RunError: It could not be written; a partial line is removed.
        """
        content = line + b"\n"
        written = 0
        with os_errors(f"cannot write {self.path}"):
            try:
                while written < len(content):
                    written += self._file.write(content[written:])
            except OSError:
                self._remove_partial_line()
                raise
        begin, self._end = self._end, self._end + len(content)
        return begin

    def close(self) -> None:
        """Close the file; closing twice is harmless."""
        self._file.close()

    def _remove_partial_line(self) -> None:
        try:
            self._file.truncate(self._end)
        except OSError:
            self._file.close()  # nothing may follow half a line; reopening drops it

    def _end_of_lines(self) -> int:
        """The size of the file in bytes, after completing or dropping its last line."""
        end, last = 0, b"\n"
        with self.path.open("rb") as lines:
            for last in lines:
                end += len(last)
        if not is_whole(last):
            self.dropped = len(last)
            os.truncate(self.path, end - len(last))
            return end - len(last)
        if not last.endswith(b"\n"):
            end += self._file.write(b"\n")
        return end


def damaged_line(file: Path, number: int, why: ValueError) -> DamagedError:
    """The error of a line that cannot be read; it says why if that is known in words."""
    told = tell_fault(why, "the line")
    return DamagedError(f"{file} is damaged in line {number}{': ' * bool(told)}{told}")


def read_lines(
    file: Path,
    parse: Callable[[bytes], _T],
    refuse: Callable[[Path, int, ValueError], AgentflowError] = damaged_line,
) -> Iterator[_T]:
    """Read the complete lines of a growing file, one at a time; none if there is no file.

    Args:
        file: The file.
        parse: Reads a line. ValueError says that it is damaged, and why; pydantic's is put in
            plain words.
        refuse: Makes the error of a damaged line from the file, the line's number and the reason.

    Raises:
        RunError: The file cannot be read.
        AgentflowError: A line is damaged; the message names it.
    """
    with os_errors(f"cannot read {file}"):
        if file.exists() and not file.is_file():
            raise RunError(f"{file} is damaged: expected a file")
        for number, line in whole_lines(file) if file.exists() else ():
            try:
                item = parse(line)
            except ValueError as error:
                raise refuse(file, number, error) from None
            yield item


def read_new_lines(file: Path, parse: Callable[[bytes], _T], offset: int) -> tuple[list[_T], int]:
    """The lines that are complete beyond a byte offset, and the offset behind them.

    Raises:
        RunError: The file cannot be read, or a line is damaged.
    """
    with os_errors(f"cannot read {file}"):
        try:
            with open_regular(file, links=False) as lines:
                lines.seek(offset)
                content = lines.read()
        except FileNotFoundError:
            return [], offset
    end = content.rfind(b"\n") + 1
    try:
        return [parse(line) for line in content[:end].splitlines()], offset + end
    except ValueError:
        return list(read_lines(file, parse)), offset  # raises, as this names the damaged line


@contextmanager
def open_lines(
    file: Path,
    parse: Callable[[bytes], _T],
    refuse: Callable[[Path, int, ValueError], AgentflowError] = damaged_line,
) -> Iterator[tuple[LineFile, list[_T]]]:
    """A growing file, open for further lines, and its complete lines; a half one is removed.

    Arguments and errors are those of `read_lines`.
    """
    lines = LineFile(file)
    try:
        yield lines, list(read_lines(file, parse, refuse))
    finally:
        lines.close()


def require_planned(file: Path, found: Iterable[object], planned: Iterable[object]) -> None:
    """Refuse a growing file whose lines are not the first ones of the plan.

    Raises:
        RunError: They are not; the message names the first such line.
    """
    wanted = iter(planned)
    for number, item in enumerate(found, start=1):
        if item != next(wanted, None):
            raise RunError(f"{file} is damaged in line {number}: the plan has another one there")


def whole_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Number (from 1) and content of every complete line."""
    with open_regular(path) as lines:
        for number, line in enumerate(lines, start=1):
            if is_whole(line):
                yield number, line


def is_whole(line: bytes) -> bool:
    """Whether a line is complete, except perhaps for its line break."""
    return line.endswith(b"\n") or parse_object(line) is not None


def parse_object(text: bytes) -> dict[str, Any] | None:
    """The JSON object in a text; None if there is none.

    Numbers that are not finite, or have hundreds of digits, are not JSON that agentflow writes.
    """
    try:
        item = _DECODER.decode(text.decode(json.detect_encoding(text), "surrogatepass"))
    except (ValueError, RecursionError):
        return None
    return item if isinstance(item, dict) else None


_MOST_DIGITS = 300
"""Longest whole number; longer ones are beyond the range of floating-point numbers."""


def _finite(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise ValueError(text)
    return value


def _whole(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(text)
    return int(text)


_DECODER = json.JSONDecoder(parse_float=_finite, parse_int=_whole, parse_constant=_finite)
