"""The rollouts of a run in progress: in memory while few, otherwise in a temporary file."""

from __future__ import annotations

import pickle
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import suppress

from agentflow.env.rollout import Rollout
from agentflow.errors import RunError

IN_MEMORY = 32 * 2**20
"""Bytes of rollouts kept in memory: about 400 rollouts of 20-block machines."""


class Rollouts(Mapping[str, Rollout]):
    """Rollouts by key, in order of arrival.

    The temporary file has no name, so it disappears with this process however that ends.
    """

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        """Keep rollouts in memory up to `in_memory` bytes in all (not 0), then all in a file."""
        self._file = tempfile.SpooledTemporaryFile(in_memory)  # noqa: SIM115 - closed below
        weakref.finalize(self, self._file.close)
        self._places: dict[str, int] = {}
        self._lost: RunError | None = None
        """Why rollouts can no longer be stored or read."""

    def put(self, key: str, rollout: Rollout) -> None:
        """Store a rollout.

        Raises:
            RunError: There is no space for temporary files, now or earlier.
        """
        self._raise_if_lost()
        try:
            place = self._file.seek(0, 2)
            pickle.dump(rollout, self._file)
            self._file.flush()
        except OSError as error:
            with suppress(OSError):  # closing tries to write again
                self._file.close()
            self._lost = RunError(
                f"cannot write a temporary file: {error.strerror or error}; "
                "set TMPDIR to a directory with free space"
            )
            raise self._lost from None
        self._places[key] = place

    def _raise_if_lost(self) -> None:
        if self._lost is not None:
            raise self._lost

    def __getitem__(self, key: str) -> Rollout:
        self._raise_if_lost()
        self._file.seek(self._places[key])
        rollout: Rollout = pickle.load(self._file)
        return rollout

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)
