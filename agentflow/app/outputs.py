"""Owns files that users ask for: there as a whole, or as they were before. What they hold is
others'."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def written(out: Path) -> Iterator[Path]:
    """A path to write to; it takes the place of `out` in the end, and goes when writing fails.

    Devices and pipes have nothing to lose, so they are written to as they are.

    Raises:
        OSError: As it came; `out` is as before.
    """
    if out.exists() and not out.is_file():
        yield out
        return
    final = Path(os.path.realpath(out))
    part = final.with_name(f".{os.getpid()}-{final.name}")
    try:
        yield part
        os.replace(part, final)
    finally:
        part.unlink(missing_ok=True)
