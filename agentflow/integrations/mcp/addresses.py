"""Where a server listens over HTTP, and the token that clients must send."""

from __future__ import annotations

import os
import re
import socket
import stat
from dataclasses import dataclass
from pathlib import Path

from agentflow.errors import UsageError
from agentflow.files.lines import open_regular
from agentflow.listening import make_token

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
SHORTEST_TOKEN = 16
"""Characters; a made token has 43."""


@dataclass(frozen=True)
class HttpAddress:
    """A host and a port to listen on; port 0 is any free one."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> HttpAddress:
        """Read `127.0.0.1:8000` or `[::1]:8000`, in lower case, as clients send it.

        Raises:
            UsageError: It is not a host and a port.
        """
        found = re.fullmatch(
            r"([\w.-]+|\[[\da-f:.]*:[\da-f:.]*\]):(\d{1,5})", text.lower(), re.ASCII
        )
        if not found or int(found[2]) > 65535:
            raise UsageError(f"--http takes HOST:PORT, as in 127.0.0.1:8000, not {text[:80]!r}")
        return cls(found[1], int(found[2]))

    @property
    def names(self) -> list[str]:
        """Names that requests may call this machine by, in their Host header."""
        if self.host in LOOPBACK:
            return [*LOOPBACK]
        own = {socket.gethostname(), socket.getfqdn(), *_own_addresses()}
        return [*LOOPBACK, *sorted(own - {*LOOPBACK})] if self.anywhere else [self.host]

    @property
    def name(self) -> str:
        """The name to call this machine by."""
        return socket.gethostname() if self.anywhere else self.host

    @property
    def anywhere(self) -> bool:
        """Whether it stands for every network interface."""
        return self.host in ("0.0.0.0", "[::]")


def _own_addresses() -> list[str]:
    try:
        found = socket.getaddrinfo(socket.gethostname(), None)
    except OSError:
        return []
    addresses = {str(item[4][0]) for item in found}
    return [f"[{address}]" if ":" in address else address for address in addresses]


def read_token(path: Path) -> str:
    """The token in a file, which is created with a new token if it does not exist.

    Raises:
        UsageError: Others can read the file, or it holds no usable token.
    """
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(f"{make_token()}\n")
    except FileExistsError:
        pass
    except OSError as error:
        raise UsageError(f"cannot create the token file {path}: {error.strerror}") from None
    try:
        with open_regular(path) as file:
            mode = os.fstat(file.fileno()).st_mode
            text = file.read(4096)
    except FileNotFoundError:  # of what the name leads to: creating it failed, as it exists
        raise UsageError(
            f"the token file {path} is a link to a file that does not exist; remove it, and a "
            "token will be made"
        ) from None
    except OSError as error:
        raise UsageError(f"cannot read the token file {path}: {error.strerror}") from None
    if os.name == "posix" and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise UsageError(f"other users can access the token file {path}: run chmod 600 {path}")
    token = text.strip()
    if not token:
        raise UsageError(f"the token file {path} is empty; remove it, and a token will be made")
    if not (token.isascii() and token.decode("ascii").isprintable()) or b" " in token:
        raise UsageError(f"the token file {path} must hold one word of ASCII characters")
    if len(token) < SHORTEST_TOKEN:
        raise UsageError(
            f"the token in {path} has {len(token)} characters; it needs at least {SHORTEST_TOKEN}"
        )
    return token.decode("ascii")
