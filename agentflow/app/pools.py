"""Where rollouts run: in worker processes on this machine, or on a Ray cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from agentflow.errors import ConfigError
from agentflow.extras import install, is_installed

if TYPE_CHECKING:
    from agentflow.env.pool.pool import OpenPool

Where = Literal["local", "ray"]


def pools_on(where: Where) -> OpenPool:
    """Opens pools there.

    Raises:
        ConfigError: Ray is not installed.
    """
    if where == "local":
        from agentflow.env.pool.pool import RolloutPool  # slow to load, and only needed here

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
    if not is_installed("ray"):
        raise ConfigError(
            f"--backend ray needs Ray; install it on every node with: {install('cluster')}"
        )
