"""Owns the rollouts of one run while it lasts: in memory as long as they are few, else in a file.

Which of them outlive the run, and how files that are kept look, is others' to say.
"""

from __future__ import annotations

import pickle
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import suppress

from agentflow.env.rollout import Rollout
from agentflow.errors import RunError

IN_MEMORY = 32 * 2**20
"""Bytes of rollouts that stay in memory; chosen: some 400 of machines of 20 blocks."""


class Rollouts(Mapping[str, Rollout]):
    """Rollouts by key, in the order in which they came.

    The file is a temporary one without a name: it is gone with this process, however that ends.
    """

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        """At most `in_memory` bytes, not 0, stay in memory; of more than that, none do."""
        self._file = tempfile.SpooledTemporaryFile(in_memory)  # noqa: SIM115 - closed below
        weakref.finalize(self, self._file.close)
        self._places: dict[str, int] = {}
        self._lost: RunError | None = None
        """Why nothing can be put in or taken out any more."""

    def put(self, key: str, rollout: Rollout) -> None:
        """Remember a rollout.

        Raises:
            RunError: There is no room for temporary files, or was none before.
        """
        self._demand_file()
        try:
            place = self._file.seek(0, 2)
            pickle.dump(rollout, self._file)
            self._file.flush()
        except OSError as error:
            with suppress(OSError):  # what could not be written cannot be now either
                self._file.close()
            self._lost = RunError(
                f"cannot write a temporary file: {error.strerror or error}; "
                "let TMPDIR name a folder with room"
            )
            raise self._lost from None
        self._places[key] = place

    def _demand_file(self) -> None:
        if self._lost is not None:
            raise self._lost

    def __getitem__(self, key: str) -> Rollout:
        self._demand_file()
        self._file.seek(self._places[key])
        rollout: Rollout = pickle.load(self._file)
        return rollout

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)
