"""How far long work is: reported by the code that does it, drawn by whoever asked for it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
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


@dataclass
class Tally:
    """How many simulations, or trials of them, are done of those started since none ran."""

    done: int = 0
    of: int = 0
    _noun: str = ""
    _running: int = 0

    @contextmanager
    def count(self, parts: int) -> Iterator[Callable[[], None]]:
        """While a simulation runs, which has so many trials; gives what to call after each."""
        if not self._running:
            self.done = self.of = 0
        self._noun = "trials" if parts > 1 else "simulations"
        self._running += 1
        self.of += parts

        def end_one() -> None:
            self.done += 1

        try:
            yield end_one
        finally:
            self._running -= 1

    def __str__(self) -> str:
        """Such as "3 of 8 simulations done"; "" while none runs."""
        return f"{self.done} of {self.of} {self._noun} done" if self._running else ""


TALLY: ContextVar[Tally] = ContextVar("tally", default=Tally())  # noqa: B039 - nobody reads this one
"""Where pools count what the current call has them simulate."""
