"""Single values as text. Imports almost nothing, so every command can afford it."""

import errno
import sys
from contextlib import suppress

from agentflow.progress import Progress

WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EBADF)
"""Write errors. One without a file name is about stdout, as all other writes name their file."""


def escape_controls(text: str, kept: str = "") -> str:
    """Text with non-printable characters escaped, except those in `kept`."""
    return "".join(c if c.isprintable() or c in kept else repr(c)[1:-1] for c in text)


def show_count(noun: str) -> Progress:
    """Shows progress on stderr: one line that changes on a terminal, else every tenth as a line."""

    def show(done: int, of: int) -> None:
        tenth = of >= 10 and done * 10 // of != (done - 1) * 10 // of
        with suppress(OSError, ValueError, AttributeError):  # stderr is closed
            if sys.stderr.isatty():
                end = "\n" if done == of else "\r"
                print(f"agentflow: {noun} {done} of {of}", end=end, file=sys.stderr, flush=True)
            elif tenth:
                print(f"agentflow: {noun} {done} of {of}", file=sys.stderr, flush=True)

    return show


def describe_os_error(error: OSError) -> str:
    """An OSError as one line, with the file name if it has one."""
    path = error.filename2 or error.filename
    why = error.strerror or str(error)
    if error.errno in WRITING:
        return f"cannot write {path or 'the output'}: {why}"
    return f"cannot use {path}: {why}" if path else f"system error: {why}"
