"""Where the server listens, and the files that hold its token."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from agentflow.errors import UsageError
from agentflow.integrations.mcp.addresses import LOOPBACK, HttpAddress, read_token

TOKEN = "k3n-0f-a-t0ken-of-24-chs"


def write(path: Path, content: bytes, mode: int = 0o600) -> Path:
    path.write_bytes(content)
    path.chmod(mode)
    return path


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [("127.0.0.1:8000", "127.0.0.1", 8000), ("[::1]:0", "[::1]", 0), ("Box.lan:1", "box.lan", 1)],
)
def test_reads_a_host_and_a_port(text: str, host: str, port: int) -> None:
    assert HttpAddress.parse(text) == HttpAddress(host, port)


@pytest.mark.parametrize(
    "text",
    [
        *("", "8000", ":8000", "127.0.0.1:", "host:65536", "host:-1", "a:b", "host:" + "9" * 5000),
        *("::1:8000", "[127.0.0.1]:8000", "[box]:8000", "http://host:8000", "a b:8000"),
    ],
)
def test_refuses_what_is_no_address(text: str) -> None:
    with pytest.raises(UsageError) as error:
        HttpAddress.parse(text)
    assert str(error.value) == f"--http takes HOST:PORT, as in 127.0.0.1:8000, not {text[:80]!r}"


def test_loopback_answers_only_to_loopback_names() -> None:
    assert HttpAddress("127.0.0.1", 0).names == [*LOOPBACK]
    assert HttpAddress("box.lan", 80).names == ["box.lan"]
    assert {*LOOPBACK, socket.gethostname()} <= {*HttpAddress("0.0.0.0", 0).names}


def test_makes_a_token_that_only_the_owner_can_read(tmp_path: Path) -> None:
    token = read_token(tmp_path / "token")
    assert len(token) == 43
    assert (tmp_path / "token").stat().st_mode & 0o777 == 0o600
    assert read_token(tmp_path / "token") == token


def test_ignores_whitespace_around_a_token(tmp_path: Path) -> None:
    assert read_token(write(tmp_path / "token", f"\n {TOKEN}\r\n".encode())) == TOKEN


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "the token file {} is empty; remove it, and a token will be made"),
        (b" \n", "the token file {} is empty; remove it, and a token will be made"),
        (b"two words of a token", "the token file {} must hold one word of ASCII characters"),
        (
            "schlüssel-schlüss".encode(),
            "the token file {} must hold one word of ASCII characters",
        ),
        (b"a\0bcdefghijklmnopq", "the token file {} must hold one word of ASCII characters"),
        (b"short", "the token in {} has 5 characters; it needs at least 16"),
    ],
)
def test_refuses_a_file_without_a_usable_token(
    tmp_path: Path, content: bytes, problem: str
) -> None:
    path = write(tmp_path / "token", content)
    with pytest.raises(UsageError) as error:
        read_token(path)
    assert str(error.value) == problem.format(path)


def test_refuses_a_token_that_others_can_read(tmp_path: Path) -> None:
    path = write(tmp_path / "token", TOKEN.encode(), 0o640)
    with pytest.raises(UsageError) as error:
        read_token(path)
    assert str(error.value) == f"other users can access the token file {path}: run chmod 600 {path}"


def test_refuses_a_folder_and_a_path_that_cannot_be_written(tmp_path: Path) -> None:
    for path, problem in {
        tmp_path: f"cannot read the token file {tmp_path}: Is a directory",
        tmp_path / "no" / "token": f"cannot create the token file {tmp_path / 'no' / 'token'}: "
        f"{os.strerror(2)}",
    }.items():
        with pytest.raises(UsageError) as error:
            read_token(path)
        assert str(error.value) == problem
