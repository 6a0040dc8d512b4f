"""Single values as text. Imports almost nothing, so every command can afford it."""

from __future__ import annotations

import errno

WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EBADF)
"""Write errors. One without a file name is about stdout, as all other writes name their file."""


def number(value: float | None) -> str:
    """A score with two decimals; "-" for None."""
    return "-" if value is None else f"{value:.2f}"


def block_count(count: int, most: int | None) -> str:
    """The blocks of a machine, and the most that its task allows: "23 of 40 blocks"."""
    return f"{count} blocks" if most is None else f"{count} of {most} blocks"


def escape_controls(text: str, kept: str = "") -> str:
    """Text with non-printable characters escaped, except those in `kept`."""
    return "".join(c if c.isprintable() or c in kept else repr(c)[1:-1] for c in text)


def describe_os_error(error: OSError) -> str:
    """An OSError as one line, with the file name if it has one."""
    path = error.filename2 or error.filename
    why = error.strerror or str(error)
    if error.errno in WRITING:
        return f"cannot write {path or 'the output'}: {why}"
    return f"cannot use {path}: {why}" if path else f"system error: {why}"
