"""A store of rollouts on any file system that fsspec opens, such as an object store."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO
from typing import Any, TypeVar
from uuid import uuid4

from agentflow.env.archive import UNREADABLE, read_npz, write_npz
from agentflow.env.pool.pool import Simulator
from agentflow.env.pool.store import rollout_key
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task
from agentflow.errors import ConfigError, RunError
from agentflow.extras import install
from agentflow.machine import Machine

_T = TypeVar("_T")


class RemoteStore:
    """A simulator in front of another that stores each rollout once, behind a URL.

    Files appear whole, under the hash of what determines their rollout. So any number of processes
    on any number of machines can share the store without locks.
    """

    def __init__(self, url: str, pool: Simulator) -> None:
        """Choose the file system; nothing is read yet.

        Raises:
            ConfigError: fsspec, or its part for this kind of URL, is not installed, or this is not
                the URL of a file system.
        """
        try:
            from fsspec.core import url_to_fs

            self._files, self._root = url_to_fs(url)
        except ImportError as error:
            raise ConfigError(
                f"the store {url} needs a library that is not installed: "
                f"{install('cluster')}, and what its kind of URL asks for ({error})"
            ) from None
        except ValueError as error:
            raise ConfigError(f"the store {url} is not the URL of a file system: {error}") from None
        self._url, self._pool = url, pool

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

        Rollouts without a score, which failed because of the computer, are not stored, nor are
        those with another interval between samples.

        Raises:
            RunError: The file system cannot be used.
        """
        if interval is not None:
            return await self._pool.run(
                machine, task, seed=seed, variation=variation, interval=interval
            )
        path = f"{self._root}/rollouts/{rollout_key(machine, task, seed, variation)}.npz"
        with suppress(FileNotFoundError, *UNREADABLE):
            return read_npz(BytesIO(await self._call(self._files.cat_file, path)))
        rollout = await self._pool.run(machine, task, seed=seed, variation=variation)
        if rollout.score is not None:
            data = BytesIO()
            write_npz(rollout, data)
            await self._call(self._write, path, data.getvalue())
        return rollout

    def _write(self, path: str, data: bytes) -> None:
        """Write a file that appears whole: not every file system writes so itself."""
        part = f"{path}.{uuid4().hex}.part"
        self._files.makedirs(path.rpartition("/")[0], exist_ok=True)
        self._files.pipe_file(part, data)
        self._files.mv(part, path)

    async def _call(self, function: Callable[..., _T], *arguments: Any) -> _T:
        """Call a function that reads or writes there, in a thread."""
        try:
            return await asyncio.to_thread(function, *arguments)
        except FileNotFoundError:
            raise
        except Exception as error:  # file systems raise errors of any type
            raise RunError(f"cannot use the store {self._url}: {error}") from error
