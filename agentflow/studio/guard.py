"""Checks every request before anything else sees it: who asks, from where, how much, how long.

A token opens the studio once; the browser that brought it has a cookie from then on.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

import anyio
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from agentflow.listening import is_secret, make_token

STYLE = (
    ":root{color-scheme:light dark;--paper:#fcfbf8;--ink:#1c2226;--wash:#f3f1ea}"
    "@media(prefers-color-scheme:dark){:root{--paper:#14181a;--ink:#e6e8e6;--wash:#1d2225}}"
    "body{max-width:40rem;margin:4rem auto;padding:0 1.2rem;background:var(--paper);"
    "color:var(--ink);font:16px/1.55 Inter,system-ui,sans-serif}"
    "code{background:var(--wash);border-radius:4px;padding:.1rem .3rem}"
)
"""Of refusals that a person sees; no style sheet is served to them."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'sha256-{}'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
    "trusted-types 'none'; require-trusted-types-for 'script'"
)
HEADERS = {
    "content-security-policy": POLICY.format(b64encode(sha256(STYLE.encode()).digest()).decode()),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
LAST = {"connection": "close"}
"""Of answers to a request whose body nobody reads any more."""
FOLLOW = "/api/follow"
"""The path of event streams, which stay open."""
Headers = Iterable[tuple[bytes, bytes]]
"""Names, in lower case, and values, as ASGI has them."""
CLOSED = (
    "this address needs the token that `agentflow studio` printed, and the token opens one "
    "browser only: go on there, or start the studio again to use another one; runs are kept, and "
    "designs that were stopped can be resumed"
)

PAGE = (
    '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
    '<meta name="viewport" content="width=device-width"><meta name="color-scheme" '
    'content="light dark"><title>agentflow studio</title><style>' + STYLE + "</style></head>"
    "<body><h1>agentflow studio</h1><p>{}.</p></body></html>"
)
"""A refusal as a page."""


@dataclass(frozen=True)
class RequestLimits:
    """What one request may take."""

    body: int = 4 * 2**20
    """Bytes; a machine of 800 blocks has 50,000."""
    upload_s: float = 10.0
    """Seconds until its body must be there."""
    answer_s: float = 180.0
    """Seconds until it must be answered; a simulation takes at most 90."""
    streams: int = 24
    """Event streams at a time; a browser opens 6 to one host."""


class Refusal(Exception):
    """A request that is not carried out: an HTTP status, and what to change."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


class Access:
    """The secrets of one server on a port of 127.0.0.1."""

    def __init__(self, port: int) -> None:
        """Make new secrets."""
        self.port = port
        self._token = make_token()
        self._session = make_token()

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
        if not self._token or not is_secret(token, self._token):
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
                if self._name in jar and is_secret(jar[self._name].value, self._session):
                    return True
        return False

    @property
    def _name(self) -> str:
        """Ports share cookies, so the name distinguishes studios."""
        return f"agentflow-studio-{self.port}"


class Guard:
    """Passes on the requests of the one browser that has brought the token."""

    def __init__(self, app: ASGIApp, access: Access, limits: RequestLimits) -> None:
        """Stand before an application."""
        self._app, self._access, self._limits = app, access, limits
        self._streams = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or refuse it."""
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return
        send = _with_headers(send)
        try:
            if self._redeems(scope):
                home = {"location": "/", "set-cookie": self._access.cookie}
                await Response(status_code=303, headers=home)(scope, receive, send)
                return
            self._require_trusted(scope)
            if scope["path"] == FOLLOW:
                await self._stream(scope, receive, send)
                return
            body = await self._body(scope, receive)
            with anyio.fail_after(self._limits.answer_s):
                await self._app(scope, _replay(body, receive), send)
        except Refusal as refusal:
            answer = _page_told(refusal) if reads_pages(scope) else told(refusal, LAST)
            await answer(scope, receive, send)
        except TimeoutError:
            late = Refusal(504, "this took too long; try it again, or with less")
            await told(late, LAST)(scope, receive, send)

    def _redeems(self, scope: Scope) -> bool:
        """Whether the request opens the studio with the token."""
        self._require_place(scope)
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])
        opens = scope["method"] == "GET" and scope["path"] == "/"
        return opens and self._access.redeem(given[0])

    def _require_trusted(self, scope: Scope) -> None:
        headers = scope["headers"]
        if not self._access.knows(headers):
            raise Refusal(403, CLOSED)
        if scope["method"] not in ("GET", "HEAD", "POST"):
            raise Refusal(405, f"the studio knows GET and POST, not {scope['method'][:20]}")
        if any(name == b"upgrade" for name, _ in headers):
            raise Refusal(400, "the studio has no websockets")

    def _require_place(self, scope: Scope) -> None:
        """Refuse other names of this machine, and requests that other pages make."""
        headers = scope["headers"]
        hosts = [value.decode("latin-1") for name, value in headers if name == b"host"]
        if len(hosts) != 1 or hosts[0].lower() not in self._access.hosts:
            known = " or ".join(self._access.hosts)
            raise Refusal(421, f"the request is for another host; ask {known}")
        origins = {value.decode("latin-1").lower() for name, value in headers if name == b"origin"}
        if origins - {f"http://{hosts[0].lower()}"} or (scope["method"] == "POST" and not origins):
            raise Refusal(403, "the request comes from another page; use the studio's own")
        sites = {value for name, value in headers if name == b"sec-fetch-site"}
        if sites - {b"same-origin", b"none"}:
            raise Refusal(403, "the request comes from another site; use the studio's own page")
        path = scope["path"]
        if "\\" in path or "\0" in path or not {"..", "."}.isdisjoint(path.split("/")):
            raise Refusal(400, "the path leads elsewhere; paths here have no .. and no backslash")

    async def _body(self, scope: Scope, receive: Receive) -> bytes:
        """The whole body of a request, if it is small and comes in time."""
        sizes = [value for name, value in scope["headers"] if name == b"content-length"]
        too_large = Refusal(413, f"a request has at most {self._limits.body} bytes; send less")
        if any(not size.isdigit() or int(size) > self._limits.body for size in sizes):
            raise too_large
        body = bytearray()
        try:
            with anyio.fail_after(self._limits.upload_s):
                while True:
                    message = await receive()
                    body += message.get("body", b"")
                    if len(body) > self._limits.body:
                        raise too_large
                    if not message.get("more_body", False):
                        break
        except TimeoutError:
            raise Refusal(408, "the body of the request did not come in time") from None
        if body and scope["method"] != "POST":
            raise Refusal(400, f"a {scope['method']} request has no body here; use POST")
        return bytes(body)

    async def _stream(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] != "GET":
            raise Refusal(405, "an event stream is read with GET")
        if self._streams >= self._limits.streams:
            raise Refusal(429, "too many event streams are open; close other tabs of the studio")
        self._streams += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._streams -= 1


def told(refusal: Refusal, headers: Mapping[str, str] | None = None) -> Response:
    """A refusal as an answer."""
    content = json.dumps({"problem": refusal.text})
    return Response(content, refusal.status, headers, media_type="application/json")


def reads_pages(scope: Scope) -> bool:
    """Whether a person has opened the address, not a script."""
    return any(name == b"accept" and b"text/html" in value for name, value in scope["headers"])


def _page_told(refusal: Refusal) -> Response:
    words = escape(refusal.text[:1].upper() + refusal.text[1:])
    content = PAGE.replace("{}", re.sub("`(.*?)`", r"<code>\1</code>", words))
    return Response(content, refusal.status, LAST, media_type="text/html")


def _replay(body: bytes, receive: Receive) -> Receive:
    """Gives the application a body that has been read, then what comes next: its end."""
    left: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> Message:
        return left.pop() if left else await receive()

    return again


def _with_headers(send: Send) -> Callable[[Message], Any]:
    """Adds the headers of every answer."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            added = [(key.encode(), value.encode()) for key, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", ()), *added]}
        await send(message)

    return sent
