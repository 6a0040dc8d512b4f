"""Where rollouts run: in worker processes on this machine, or on a Ray cluster."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Literal

from agentflow.env.pool.base import OpenPool
from agentflow.env.pool.pool import RolloutPool
from agentflow.errors import ConfigError

Where = Literal["local", "ray"]


def pools_on(where: Where) -> OpenPool:
    """Opens pools there.

    Raises:
        ConfigError: Ray is not installed.
    """
    if where == "local":
        return RolloutPool
    _require_ray()
    from agentflow.cluster.pool import RayPool

    return RayPool


def connect(workers: int) -> None:
    """Connect to a Ray cluster, or start one for so many workers.

    Raises:
        ConfigError: Ray is not installed, or the cluster cannot be used.
    """
    _require_ray()
    from agentflow.cluster.connection import connect

    connect(workers)


def _require_ray() -> None:
    if find_spec("ray") is None:
        raise ConfigError(
            "--on ray needs Ray; install it on every node with: pip install 'agentflow[cluster]'"
        )
