"""Rows as data frames, where pandas is installed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from agentflow.extras import needs_extra

if TYPE_CHECKING:
    import pandas

Row = Mapping[str, Any]
"""Name of a column -> value."""


def frame(rows: Iterable[Row], columns: Iterable[str] = ()) -> pandas.DataFrame:
    """A data frame of rows; without any, it has these columns.

    Raises:
        ConfigError: pandas is not installed.
    """
    with needs_extra("notebook"):
        import pandas
    items = list(rows)
    names = dict.fromkeys([*columns, *(name for row in items for name in row)])
    found = pandas.DataFrame(items, columns=list(names))
    unknown = found.columns[found.isna().all()]
    return found.astype(dict.fromkeys(unknown, "float64"))  # not a number, rather than None
