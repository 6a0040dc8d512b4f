"""Cheap tests over many values: a loop costs nothing, a parametrised test 5 ms for each value."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any


def for_each(values: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[[], None]]:
    """Make one test of a function that takes a value, or the parts of a tuple; needs no fixture.

    All values are tried. A failure names those that fail, and is that of the first of them.
    """

    values = tuple(values)

    def decorate(test: Callable[..., None]) -> Callable[[], None]:
        @wraps(test)
        def whole() -> None:
            failed: dict[str, AssertionError] = {}
            for value in values:
                try:
                    test(*value if isinstance(value, tuple) else (value,))
                except AssertionError as error:
                    failed[str(value)] = error
            if failed:
                names, first = ", ".join(failed), next(iter(failed.values()))
                raise AssertionError(f"fails for {names}: {first}") from first

        del whole.__wrapped__  # type: ignore[attr-defined]  # its parameters are no fixtures
        return whole

    return decorate
