"""Files that are never left half-written; errors of the system in the words of users."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from agentflow.errors import RunError, UsageError


def is_full(error: OSError) -> bool:
    """Whether the disk has no space left, or the user may use no more of it."""
    return error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


@contextmanager
def os_errors(what: str, error_type: type[UsageError] = RunError) -> Iterator[None]:
    """Turn errors of the system into `error_type`, with a text such as "cannot read FILE: why"."""
    try:
        yield
    except OSError as error:
        free = "; free some space" * is_full(error)
        raise error_type(f"{what}: {error.strerror}{free}") from None


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


def write_text(path: Path, text: str) -> None:
    """Replace a file by a text, in UTF-8.

    Raises:
        OSError: It cannot be written.
    """
    with write_atomically(path) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def write_output(path: Path, error_type: type[UsageError] = UsageError) -> Iterator[Path]:
    """`write_atomically` for files that users name; failure raises `error_type`."""
    with os_errors(f"cannot write {path}", error_type), write_atomically(path) as part:
        yield part


def write_file(path: Path, content: str | bytes, error_type: type[UsageError] = UsageError) -> None:
    """`write_output` of a text, in UTF-8, or of bytes."""
    with write_output(path, error_type) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def remove_partial_files(folder: Path) -> None:
    """Remove temporary files of `write_atomically` that killed processes left in a folder."""
    for part in folder.glob(".[0-9]*-*"):
        part.unlink()
