"""How far long work is: reported by the code that does it, drawn by whoever asked for it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Protocol


class Progress(Protocol):
    """Receives how far long work is."""

    def __call__(self, done: int, of: int, /) -> None:
        """So many of all parts are done, such as simulations or questions; called after each."""


def silent(_done: int, _of: int, /) -> None:
    """Progress that nobody watches."""


def counter(say: Progress, of: int) -> Callable[[], None]:
    """Says with each call that one more part is done: parts may end in any order."""
    done = count(1)
    return lambda: say(next(done), of)
