"""Stores of rollouts: those of a run in progress, and a content-addressed folder shared by the
runs of a sweep."""

import asyncio
import os
import pickle
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from agentflow.env.archive import load_npz, save_npz
from agentflow.env.physics.engines import physics_conditions
from agentflow.env.pool.pool import Simulator
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.family import CommonKnobs
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import RunError, UsageError
from agentflow.files.atomic import os_errors, write_atomically, write_output
from agentflow.files.documents import digest_of
from agentflow.machine.tree import Machine
from agentflow.version import __version__

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


def rollout_key(machine: Machine, task: Task, seed: int, variation: Variation = DEFAULT) -> str:
    """Hash of everything that determines a rollout: equal keys mean equal bits."""
    return f"{machine.digest}-{_setting_key(task, seed, variation)}"


def _setting_key(task: Task, seed: int, variation: Variation = DEFAULT) -> str:
    setting = {
        "agentflow": __version__,
        **physics_conditions(task.engine),
        "family": f"{task.family} {FAMILIES.identity(task.family)}".strip(),
        "parameters": _knobs(task),
        "window": task.window,
        "schedule": asdict(task.schedule),
        "seed": seed,
        "variation": variation.key,
    }
    return digest_of(setting)


def _knobs(task: Task) -> dict[str, Any]:
    """The knobs of a task; those that tasks did not have from the start, unless as by default."""
    knobs: dict[str, Any] = task.parameters.model_dump(mode="json")
    usual = CommonKnobs().model_dump(mode="json")
    later = ("controls", "sensing", "requirements")
    return {name: v for name, v in knobs.items() if name not in later or v != usual[name]}


class Store:
    """A simulator that stores each machine and rollout once, in one folder.

    Files appear whole, under the hash of what determines them, so processes can share the folder.
    """

    def __init__(self, path: Path, pool: Simulator) -> None:
        """Open or create the folder; missing rollouts are simulated in the pool.

        Raises:
            RunError: The folder cannot be created.
        """
        self._machines, self._rollouts = path / "machines", path / "rollouts"
        self._pool = pool
        self._busy: dict[str, asyncio.Lock] = {}
        with os_errors(f"cannot write to {path}"):
            for folder in (self._machines, self._rollouts):
                folder.mkdir(parents=True, exist_ok=True)

    async def run(
        self,
        machine: Machine,
        task: Task,
        *,
        seed: int = 0,
        variation: Variation = DEFAULT,
        interval: float | None = None,
    ) -> Rollout:
        """Load the rollout, or simulate and store it.

        Concurrent calls for one rollout simulate it once. Rollouts without a score, which failed
        because of the computer, are not stored.

        Raises:
            UsageError: The rollout cannot be written.
        """
        key = rollout_key(machine, task, seed, variation)
        key += "" if interval is None else f"-every-{interval}"
        async with self._busy.setdefault(key, asyncio.Lock()):
            path = self._rollouts / f"{key}.npz"
            if path.exists():
                # Not in a thread: that costs more than reading these files, and NumPy parses their
                # headers with `ast`, which in CPython 3.11 is not thread-safe
                # (https://github.com/python/cpython/issues/106905).
                with suppress(UsageError):
                    return load_npz(path)
            rollout = await self._pool.run(
                machine, task, seed=seed, variation=variation, interval=interval
            )
            if rollout.score is not None:
                with write_output(path) as part:
                    save_npz(rollout, part)
            return rollout

    def share(self, run: Path, task: Task, seed: int) -> None:
        """Hard-link the machines and rollouts of a finished run to those stored here.

        Rollouts that are not stored here, which failed because of the computer, are skipped.
        """
        for file in (run / "machines").glob("[!.]*.json"):
            _hard_link(file, self._machines / file.name)
        for file in (run / "rollouts").glob("[!.]*.npz"):
            kept = self._rollouts / f"{file.stem}-{_setting_key(task, seed)}.npz"
            if kept.exists():
                _hard_link(file, kept)


def _hard_link(file: Path, kept: Path) -> None:
    """Link two paths to one file, the kept one; do nothing where links are unsupported."""
    with suppress(OSError):
        try:
            os.link(file, kept)
        except FileExistsError:
            if not file.samefile(kept):
                with write_atomically(file) as part:
                    os.link(kept, part)
