"""A Ray cluster of two nodes on this machine, for the tests of this folder; none is left behind."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest

NODE = {"num_cpus": 1, "include_dashboard": False, "include_log_monitor": False, "no_monitor": True}
"""One processor for each node, and only those processes of Ray that a test needs."""

ON_CLUSTER = [
    pytest.mark.cluster,
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.usefixtures("cluster"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # Ray leaves processes to its reaper
]


@pytest.fixture(scope="session")
def cluster() -> Iterator[Any]:
    """Two nodes with one processor each; RAY_ADDRESS names them. Tests put back what they remove.

    Starting it takes far longer than a test, so all tests share it.
    """
    import ray
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("RAY_USAGE_STATS_ENABLED", "0")
        environment.setenv("RAY_AUTH_MODE", "disabled")  # whatever token the user has
        environment.setenv("RAY_worker_niceness", "0")  # by default 15: they come last
        environment.setenv("PYTHONPATH", os.getcwd())
        started = Cluster()
        try:
            for _ in range(2):
                started.add_node(**NODE)
            environment.setenv("RAY_ADDRESS", started.address)
            yield started
        finally:
            ray.shutdown()
            started.shutdown()
