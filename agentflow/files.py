"""Files that are never left half-written (atomic replacement, append-only JSON lines); locks."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from agentflow.errors import RunError, UsageError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


_BEYOND = 1 << 30
"""Where Windows locks a byte: past the end of every file that is locked."""


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """A temporary path that replaces `path` on success and is removed on failure.

    Links are followed. Devices and pipes are written to directly.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    final = Path(os.path.realpath(path))
    part = final.with_name(f".{os.getpid()}-{final.name}")
    try:
        yield part
        os.replace(part, final)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def write_output(path: Path, error_type: type[UsageError] = UsageError) -> Iterator[Path]:
    """`write_atomically` for files that users name; failure raises `error_type`."""
    try:
        with write_atomically(path) as part:
            yield part
    except OSError as error:
        raise error_type(f"cannot write {path}: {error.strerror}") from None


def lock_file(descriptor: int, shared: bool = False) -> None:
    """Lock an open file for this process, until it is closed or the process ends.

    Args:
        descriptor: An open file's. On Windows, locks are never shared.
        shared: Other processes may hold shared locks at the same time.

    Raises:
        BlockingIOError: Another process holds a lock.
        OSError: The file system has no locks.
    """
    if sys.platform == "win32":
        os.lseek(descriptor, _BEYOND, os.SEEK_SET)  # locked bytes cannot be read
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError(*error.args) from None
    else:
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)


def open_folder(path: Path) -> int:
    """A descriptor that stands for a folder in `lock_file`.

    Windows opens no folders: there it is that of a hidden file in it.
    """
    if sys.platform == "win32":
        return os.open(path / ".lock", os.O_RDWR | os.O_CREAT)
    return os.open(path, os.O_RDONLY)


@contextmanager
def hold_folder(path: Path) -> Iterator[None]:
    """Create a folder if it is missing, and lock it for this process.

    Raises:
        RunError: Another process holds it, or it cannot be written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        folder = open_folder(path)
    except OSError as error:
        raise cannot_write(path, error) from None
    try:
        try:
            lock_file(folder)
        except OSError:
            raise RunError(f"{path} is in use by another process; wait for it or stop it") from None
        yield
    finally:
        os.close(folder)


def cannot_write(folder: Path, error: OSError) -> RunError:
    """The error of a folder that was named with --out."""
    return RunError(f"cannot write to {folder}: {error.strerror}; choose another folder with --out")


def require_plain_files(folder: Path) -> None:
    """Refuse a folder that holds links, pipes or devices, at any depth.

    Reading or writing a received folder then touches nothing outside it, and never waits.

    Raises:
        RunError: It does; or it cannot be read.
    """
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    require_plain_files(Path(entry.path))
                elif not entry.is_file(follow_symlinks=False):
                    kind = "link" if entry.is_symlink() else "pipe or device"
                    raise RunError(
                        f"{entry.path} is a {kind}, but runs and sweeps hold only files and "
                        "directories; remove it"
                    )
    except OSError as error:
        raise RunError(f"cannot read {folder}: {error.strerror}") from None


def remove_partial_files(folder: Path) -> None:
    """Remove temporary files of `write_atomically` that killed processes left in a folder."""
    for part in folder.glob(".[0-9]*-*"):
        part.unlink()


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

        If that fails, a partial line is removed.
        """
        content = line + b"\n"
        written = 0
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


def whole_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Number (from 1) and content of every complete line."""
    with path.open("rb") as lines:
        for number, line in enumerate(lines, start=1):
            if is_whole(line):
                yield number, line


def is_whole(line: bytes) -> bool:
    """Whether a line is complete, except perhaps for its line break."""
    return line.endswith(b"\n") or parse_object(line) is not None


def parse_object(text: bytes) -> dict[str, Any] | None:
    """The JSON object in a text; None if there is none."""
    try:
        item = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return item if isinstance(item, dict) else None
