"""The connection of this process to a Ray cluster, which it starts here if there is none."""

import asyncio
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from typing import Any, NoReturn

import ray

from agentflow.errors import ConfigError, RunError

ADDRESS = "RAY_ADDRESS"
"""Environment variable with the address of a cluster, such as 10.0.0.1:6379."""
QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",  # reports to nobody that it runs
    "RAY_IGNORE_UNHANDLED_ERRORS": "1",  # those of calls that are given up
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # the behaviour of later versions; else it warns
}
"""How Ray should behave, unless the user has said otherwise."""
OBJECTS = 128 * 2**20
"""Bytes of the object store on this machine: only batches and their results pass through it."""
ANSWER_LIMIT = 10.0
"""Seconds that a cluster has to answer."""
PLACE_LIMIT = 600.0
"""Seconds that a cluster has to offer processors for the first worker: new nodes take minutes."""
BEAT, SILENCE = 3.0, 30.0
"""Seconds between two looks at Ray's processes, and how long one may stay silent before it
counts as gone. A minute after the head was lost, Ray ends this process."""


def connect(workers: int) -> None:
    """Connect to the cluster at RAY_ADDRESS; without it, start one for so many workers here.

    The connection stays until this process ends, which also ends a cluster that it started.

    Raises:
        ConfigError: There is no such cluster, or it has another version of Python or Ray.
    """
    if ray.is_initialized():
        return
    for name, value in QUIET.items():
        os.environ.setdefault(name, value)
    address = os.environ.get(ADDRESS) or None
    if address is not None:
        _require_answer(address)
        _send_token()
        # Ray tries 20 times, a minute each, where something else answers; it has no public setting.
        ray._private.ray_constants.NUM_REDIS_GET_RETRIES = 1
    here = {"num_cpus": workers, "object_store_memory": OBJECTS, "include_dashboard": False}
    try:
        ray.init(
            address or "local",
            log_to_driver=False,
            logging_level=logging.ERROR,
            **({} if address else here),
        )
    except Exception as error:  # Ray raises errors of any type
        raise refusal(address, error) from error
    # Without a public switch, Ray prints on standard output which of its processes have died.
    ray._private.worker._worker_logs_enabled = False


def _send_token() -> None:
    """Send the token of this user, if there is one and RAY_AUTH_MODE says nothing else.

    `ray start` asks for it then, without further notice, and Ray writes one whenever it starts a
    cluster for one process alone. Ray has no public function for this.
    """
    with suppress(ImportError):  # earlier versions
        from ray._private.authentication import authentication_token_setup as tokens

        tokens.logger.setLevel(logging.ERROR)
        tokens.maybe_enable_token_auth_if_token_available(warn_if_disabled=False)


def _require_answer(address: str) -> None:
    """Look whether anything answers there: Ray itself would look for minutes."""
    host, _, port = address.rpartition(":")
    if not (host and port.isdigit() and "/" not in host):
        raise ConfigError(
            f"{ADDRESS} takes the address of a cluster's head, such as 10.0.0.1:6379, "
            f"not {address!r}"
        )
    try:
        socket.create_connection((host, int(port)), ANSWER_LIMIT).close()
    except OSError as error:
        raise ConfigError(
            f"no Ray cluster answers at {ADDRESS}={address} ({error.strerror or error}): check the "
            f"address, or unset {ADDRESS} to use this computer alone"
        ) from None


def refusal(address: str | None, error: Exception) -> ConfigError:
    """What to tell the user when Ray refuses with this error."""
    if address is None:
        return ConfigError(f"cannot start Ray on this computer: {_first_line(error)}")
    cluster = f"the Ray cluster at {ADDRESS}={address}"
    lines = [line.strip() for line in str(error).splitlines()]
    found = [line for line in lines if line.startswith(("Ray: ", "Python: "))]
    if len(found) == 4:
        theirs, ours = (", ".join(pair).replace(":", "") for pair in (found[:2], found[2:]))
        return ConfigError(
            f"{cluster} has {theirs}, this process {ours}: install the same versions on all nodes"
        )
    if isinstance(error, ray.exceptions.AuthenticationError):
        return ConfigError(
            f"{cluster} asks for a token: set RAY_AUTH_TOKEN to the one that "
            "`ray get-auth-token` prints on its head"
        )
    return ConfigError(
        f"{cluster} cannot be used from here: run agentflow on one of its nodes; `ray start` "
        f"makes a computer a node ({_first_line(error)})"
    )


def require_same_versions(ours: Mapping[str, str], theirs: Mapping[str, str], node: str) -> None:
    """Refuse a node whose results would not be ours.

    Raises:
        ConfigError: It has other versions.
    """
    differ = [name for name in sorted({*ours, *theirs}) if ours.get(name) != theirs.get(name)]
    if differ:
        found = ", ".join(
            f"{name} {theirs.get(name, 'missing')} instead of {ours.get(name, 'none')}"
            for name in differ
        )
        raise ConfigError(
            f"the node {node} differs from this process: {found}; install the same versions on "
            "all nodes, since results would differ"
        )


def no_place() -> ConfigError:
    """What to tell the user when nothing can start."""
    return ConfigError(
        f"the Ray cluster had no free processor within {PLACE_LIMIT:g} s: wait until others have "
        "finished, or add nodes"
    )


async def watch_cluster() -> NoReturn:
    """Wait until the head of the cluster, or Ray on this computer, has not answered for some time.

    Without its process on this computer, Ray starts nothing and says nothing.

    Raises:
        RunError: It is gone.
    """
    context = ray.get_runtime_context()
    head, own = context.gcs_address, context.get_node_id()
    lost = "no longer answers"
    (node,) = (each for each in ray.nodes() if each["NodeID"] == own)
    here = f"{node['NodeManagerAddress']}:{node['NodeManagerPort']}"
    again = "start it here, then" if os.environ.get(ADDRESS) else "run"
    await watch(
        {
            head: f"the head of the Ray cluster, {head}, {lost}: start the cluster, then",
            here: f"Ray {lost} on this computer ({here}): {again}",
        }
    )


async def watch(
    watched: Mapping[str, str], beat: float = BEAT, silence: float = SILENCE
) -> NoReturn:
    """Wait until an address has not answered for some seconds; raise its problem as RunError."""
    heard = dict.fromkeys(watched, time.monotonic())
    while True:
        await asyncio.sleep(beat)
        answers = await asyncio.gather(*map(_answers, watched))
        for (address, problem), answered in zip(watched.items(), answers, strict=True):
            if answered:
                heard[address] = time.monotonic()
            elif time.monotonic() - heard[address] > silence:
                raise RunError(f"{problem} this command again (design and sweep with --resume)")


async def _answers(address: str) -> bool:
    host, _, port = address.rpartition(":")
    try:
        _, writer = await asyncio.wait_for(asyncio.open_connection(host, int(port)), BEAT)
    except (OSError, asyncio.TimeoutError):
        return False
    with closing(writer):
        return True


async def result_of(sent: Any) -> Any:
    """The result of a call of an actor, or of a task."""
    return await asyncio.wrap_future(sent.future())


def let_go(act: Callable[..., object], *given: Any, **options: Any) -> None:
    """Have Ray end something, in another thread: without its head it waits for a minute, in which
    nobody would notice that the head is gone."""

    def attempt() -> None:
        with suppress(Exception):  # what cannot be reached has ended
            act(*given, **options)

    threading.Thread(target=attempt, daemon=True).start()


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
