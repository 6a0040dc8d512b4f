"""Reading files without ever waiting: pipes, devices and folders are refused before a byte is read.

A received folder may hold anything under any name. The refusal is an OSError, so that whoever
reports that a file cannot be read reports this as well.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


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


def read_regular(path: Path, most: int = -1, *, links: bool = True) -> bytes:
    """The content of a regular file, or its first `most` bytes; errors are `open_regular`'s."""
    with open_regular(path, links=links) as file:
        return file.read(most)
