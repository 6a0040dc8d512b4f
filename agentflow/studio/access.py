"""Who may use the studio: a token that opens it once, and the cookie of the browser that did."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie

Headers = Iterable[tuple[bytes, bytes]]
"""Names, in lower case, and values, as ASGI has them."""


class Access:
    """The secrets of one server on a port of 127.0.0.1."""

    def __init__(self, port: int) -> None:
        """Make new secrets."""
        self.port = port
        self._token = secrets.token_urlsafe(32)
        self._session = secrets.token_urlsafe(32)

    @property
    def address(self) -> str:
        """What opens the studio, once."""
        return f"http://127.0.0.1:{self.port}/?token={self._token}"

    @property
    def hosts(self) -> tuple[str, ...]:
        """Names of this server in Host headers; any other may be a page that rebinds its name."""
        return (f"127.0.0.1:{self.port}", f"localhost:{self.port}")

    def redeem(self, token: str) -> bool:
        """Whether this is the token; it is used up if so."""
        if not self._token or not _equal(token, self._token):
            return False
        self._token = ""
        return True

    @property
    def cookie(self) -> str:
        """The Set-Cookie header of the browser that brought the token."""
        return f"{self._name}={self._session}; Path=/; HttpOnly; SameSite=Strict"

    def knows(self, headers: Headers) -> bool:
        """Whether a request has the cookie."""
        for name, value in headers:
            if name == b"cookie":
                jar = SimpleCookie()
                try:
                    jar.load(value.decode("latin-1"))
                except CookieError:
                    continue
                if self._name in jar and _equal(jar[self._name].value, self._session):
                    return True
        return False

    @property
    def _name(self) -> str:
        """Ports share cookies, so the name tells studios apart."""
        return f"agentflow-studio-{self.port}"


def _equal(given: str, secret: str) -> bool:
    """Compare in constant time."""
    return secrets.compare_digest(given.encode("utf-8", "surrogatepass"), secret.encode())
