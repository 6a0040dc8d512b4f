"""Folders that one process at a time works in: locks, and what may be in them."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from agentflow.errors import RunError
from agentflow.files.atomic import is_full, os_errors

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


_BEYOND = 1 << 30
"""Where Windows locks a byte: past the end of every file that is locked."""


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
    with out_errors(path):
        path.mkdir(parents=True, exist_ok=True)
        folder = open_folder(path)
    try:
        try:
            lock_file(folder)
        except OSError:
            raise RunError(f"{path} is in use by another process; wait for it or stop it") from None
        yield
    finally:
        os.close(folder)


@contextmanager
def hold_new_folder(path: Path) -> Iterator[None]:
    """Lock a new or empty folder for work that is done at once.

    Raises:
        RunError: It is not empty, is in use, or cannot be written.
    """
    with hold_folder(path):
        if visible_names(path):
            raise RunError(f"{path} is not empty; choose another folder with --out")
        yield


def visible_names(folder: Path) -> set[str]:
    """Names of what a folder holds, without hidden files, such as locks and files of desktops."""
    return {item.name for item in folder.iterdir() if not item.name.startswith(".")}


@contextmanager
def out_errors(folder: Path) -> Iterator[None]:
    """Turn errors of the system into RunError about a folder that was named with --out."""
    try:
        yield
    except OSError as error:
        raise RunError(
            f"cannot write to {folder}: {error.strerror}; {'free some space, or ' * is_full(error)}"
            "choose another folder with --out"
        ) from None


def require_plain_files(folder: Path) -> None:
    """Refuse a folder that holds links, pipes or devices, at any depth.

    Reading or writing a received folder then touches nothing outside it, and never waits.

    Raises:
        RunError: It does; or it cannot be read.
    """
    with os_errors(f"cannot read {folder}"), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                require_plain_files(Path(entry.path))
            elif not entry.is_file(follow_symlinks=False):
                kind = "link" if entry.is_symlink() else "pipe or device"
                raise RunError(
                    f"{entry.path} is a {kind}, but runs and sweeps hold only files and "
                    "directories; remove it"
                )
