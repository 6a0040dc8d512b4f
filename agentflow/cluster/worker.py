"""What runs in a process of the cluster: an actor that runs batches of rollouts."""

from __future__ import annotations

import pickle
import time
from collections.abc import Sequence

from ray.util import get_node_ip_address

from agentflow.env.constants import constants
from agentflow.env.physics.engines import installed_engines
from agentflow.env.pool.worker import Reply, run_job
from agentflow.machine.blocks.library import library
from agentflow.version import __version__

Batch = Sequence[bytes]
"""Pickled arguments of `simulate`. Ray carries bytes only: arrays would stay in its object store,
read-only, for as long as anybody holds their rollout."""


class Worker:
    """Plays rollouts one after another; Ray makes an actor of it, and its engine stays loaded."""

    def conditions(self) -> tuple[dict[str, str], str]:
        """What this process would simulate with, and the address of its node."""
        return conditions(), get_node_ip_address()

    def run_batch(self, batch: Batch) -> tuple[bytes, float]:
        """The pickled replies to a batch, in its order, and the seconds that the work took."""
        begin = time.perf_counter()
        replies = [_run_job(job) for job in batch]
        work = time.perf_counter() - begin
        return pickle.dumps(replies, pickle.HIGHEST_PROTOCOL), work


def conditions() -> dict[str, str]:
    """What decides the results of rollouts here: name -> version or digest."""
    engines = {spec.name: spec.identity.version for spec in installed_engines()}
    return {
        "agentflow": __version__,
        "constants": constants().digest,
        "blocks": library().digest,
        **engines,
    }


def _run_job(job: bytes) -> Reply:
    try:
        arguments = pickle.loads(job)
    except Exception as error:  # noqa: BLE001 - such as a plugin that is not installed here
        return f"{type(error).__name__}: {error}"
    return run_job(arguments)
