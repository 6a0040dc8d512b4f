"""What keeps a cluster from being used is one sentence."""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from agentflow.app.pools import pools_on
from agentflow.cli import main
from agentflow.env.pool.pool import RolloutPool
from agentflow.errors import ConfigError, RunError
from agentflow.extras import install


def test_local_is_the_pool_of_this_machine() -> None:
    assert pools_on("local") is RolloutPool


@pytest.mark.skipif(find_spec("ray") is not None, reason="Ray is installed")
def test_without_ray_the_extra_is_named() -> None:
    with pytest.raises(ConfigError) as error:
        pools_on("ray")
    assert str(error.value) == (
        f"--backend ray needs Ray; install it on every node with: {install('cluster')}"
    )


@pytest.fixture
def connect() -> Callable[[int], None]:
    """Connects, as a process does that is not connected yet."""
    import ray

    from agentflow.cluster.connection import connect

    ray.shutdown()
    return connect


def free_port() -> int:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        return int(closed.getsockname()[1])


@pytest.mark.cluster
def test_an_address_where_nothing_answers(
    connect: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    address = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("RAY_ADDRESS", address)
    with pytest.raises(ConfigError) as error:
        connect(2)
    assert str(error.value) == (
        f"no Ray cluster answers at RAY_ADDRESS={address} (Connection refused): check the address, "
        "or unset RAY_ADDRESS to use this computer alone"
    )


@pytest.mark.cluster
@pytest.mark.parametrize("address", ["head", "ray://head:10001", "head:port"])
def test_what_is_no_address(
    address: str, connect: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", address)
    with pytest.raises(ConfigError) as error:
        connect(2)
    assert str(error.value) == (
        f"RAY_ADDRESS takes the address of a cluster's head, such as 10.0.0.1:6379, not {address!r}"
    )


@pytest.mark.cluster
def test_a_node_with_other_versions() -> None:
    from agentflow.cluster.connection import require_same_versions

    ours = {"agentflow": "0.2", "constants": "a", "mujoco": "4.0.1"}
    require_same_versions(ours, dict(ours), "10.0.0.2")
    with pytest.raises(ConfigError) as error:
        require_same_versions(ours, {"agentflow": "0.1", "constants": "a"}, "10.0.0.2")
    assert str(error.value) == (
        "the node 10.0.0.2 differs from this process: agentflow 0.1 instead of 0.2, mujoco missing "
        "instead of 4.0.1; install the same versions on all nodes, since results would differ"
    )


@pytest.mark.cluster
def test_a_cluster_with_another_ray() -> None:
    import ray
    from ray._private.utils import check_version_info

    from agentflow.cluster.connection import refusal

    ours = ".".join(map(str, sys.version_info[:3]))
    with pytest.raises(RuntimeError) as error:
        check_version_info({"ray_version": "2.9.0", "python_version": "3.9.1"}, "a process")
    assert str(refusal("10.0.0.1:6379", error.value)) == (
        "the Ray cluster at RAY_ADDRESS=10.0.0.1:6379 has Ray 2.9.0, Python 3.9.1, this process "
        f"Ray {ray.__version__}, Python {ours}: install the same versions on all nodes"
    )


@pytest.mark.cluster
async def test_an_address_that_no_longer_answers_is_named() -> None:
    from agentflow.cluster.connection import watch

    servers = [await asyncio.start_server(hang_up, "127.0.0.1", 0) for _ in range(2)]
    head, here = (f"127.0.0.1:{server.sockets[0].getsockname()[1]}" for server in servers)
    watching = asyncio.create_task(watch({head: "no head", here: "not here: run"}, 0.01, 0.2))
    await asyncio.sleep(0.5)
    assert not watching.done()
    servers[1].close()
    with pytest.raises(RunError) as error:
        await watching
    servers[0].close()
    assert str(error.value) == "not here: run this command again (design and sweep with --resume)"


async def hang_up(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    writer.close()


@pytest.mark.cluster
def test_what_ray_cannot_end_holds_nobody_up() -> None:
    from agentflow.cluster.connection import let_go

    begun, may_end = threading.Event(), threading.Event()

    def end_nothing(name: str) -> None:
        begun.set()
        may_end.wait(60)
        raise RuntimeError(name)

    let_go(end_nothing, "worker")
    assert begun.wait(60)
    may_end.set()


@pytest.mark.cluster
@pytest.mark.slow
@pytest.mark.parametrize(("mode", "sent"), [(None, "token"), ("disabled", "disabled")])
def test_the_token_that_ray_start_asks_for_is_sent(
    mode: str | None, sent: str, tmp_path: Path
) -> None:
    (tmp_path / ".ray").mkdir()
    (tmp_path / ".ray" / "auth_token").write_text("0123456789abcdef" * 3)
    code = (
        "import os; from agentflow.cluster.connection import _send_token; _send_token(); "
        "print(os.environ['RAY_AUTH_MODE'])"
    )
    variables = {"HOME": str(tmp_path), "PATH": os.environ["PATH"], "PYTHONPATH": os.getcwd()}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=variables | ({"RAY_AUTH_MODE": mode} if mode else {}),
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == (f"{sent}\n", "")


def test_one_machine_needs_no_cluster(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "examples/car.json", "--task", "movement", "--backend", "ray"]) == 2
    assert capsys.readouterr().err == (
        "agentflow: --backend ray is for many machines: add --jsonl, or remove --backend\n"
    )
