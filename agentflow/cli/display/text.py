"""Owns how single values are written for a person. Imports hardly anything, so it costs nothing."""

from __future__ import annotations

import errno

WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EBADF)
"""Errors of which those that name no file are standard output's: whoever writes a file names it."""


def number(value: float | None) -> str:
    """A score with two decimals; a dash where there is none."""
    return "-" if value is None else f"{value:.2f}"


def harmless(text: str, kept: str = "") -> str:
    """Text by others, without what a terminal would obey, but for the characters `kept`."""
    return "".join(c if c.isprintable() or c in kept else repr(c)[1:-1] for c in text)


def refusal(error: OSError) -> str:
    """What the operating system would not do, with the file where it names one."""
    path = error.filename2 or error.filename
    why = error.strerror or str(error)
    if error.errno in WRITING:
        return f"cannot write {path or 'the output'}: {why}"
    return f"cannot use {path}: {why}" if path else f"the system refuses: {why}"
