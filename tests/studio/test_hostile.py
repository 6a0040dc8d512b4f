"""Requests that nobody of good will makes: each is refused, and the studio goes on."""

from __future__ import annotations

import json
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread
from urllib.parse import urlsplit

import httpx
import pytest

from agentflow.studio.app import running
from agentflow.studio.guard import RequestLimits
from tests.studio.serving import Browser, Served, studio

RECORDED = Path(__file__).parent.parent.parent / "runs" / "recorded-throwing"
LIMITS = RequestLimits(upload_s=0.1, streams=2)
SECRET = "nobody may read this"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    above = tmp_path_factory.mktemp("above")
    runs = above / "runs"
    shutil.copytree(RECORDED, runs / "inside")
    shutil.copytree(RECORDED, above / "outside")
    (above / "secret.txt").write_text(SECRET)
    os.symlink(above / "outside", runs / "linked")
    holds_link = shutil.copytree(RECORDED, runs / "holds-link")
    (holds_link / "machines" / f"{0:016x}.json").symlink_to(above / "secret.txt")
    with studio(runs, LIMITS) as found:
        yield found


@pytest.fixture(scope="module")
def browser(served: Served) -> Browser:
    return served.enter()


@pytest.fixture(autouse=True)
def _goes_on(browser: Browser) -> Iterator[None]:
    """After each of them, the studio still answers whom it knows."""
    yield
    assert browser.client.get("/").status_code == 200


def head(served: Served, first: str, *lines: str, host: str = "") -> str:
    return "\n".join([f"{first} HTTP/1.1", f"Host: {host or served.host}", *lines])


def status(answer: bytes) -> int:
    return int(answer.split(b" ", 2)[1])


def bare(url: str) -> httpx.Response:
    """The answer to somebody who has no cookie."""
    return httpx.get(url, trust_env=False)


@pytest.mark.parametrize("path", ["/", "/studio.js", "/api/runs", "/api/follow", "/nowhere"])
def test_nothing_is_told_without_the_cookie(served: Served, path: str) -> None:
    answer = bare(f"{served.base}{path}")
    assert answer.status_code == 403
    assert "token that `agentflow studio` printed" in answer.json()["problem"]


def test_a_visit_without_the_token_is_told_so_on_a_page(served: Served) -> None:
    answer = httpx.get(served.base, trust_env=False, headers={"accept": "text/html"})
    assert (answer.status_code, answer.headers["content-type"]) == (
        *(403, "text/html; charset=utf-8"),
    )
    assert "<p>This address needs the token" in answer.text


def test_the_token_opens_once(served: Served, browser: Browser) -> None:
    assert browser.client.get("/").status_code == 200
    assert bare(served.address).status_code == 403


@pytest.mark.parametrize("query", ["token=", "token=x", "token=%ff", "token=x&token=y", "token"])
def test_other_tokens_open_nothing(served: Served, query: str) -> None:
    assert bare(f"{served.base}/?{query}").status_code == 403


def test_the_cookie_of_another_server_opens_nothing(served: Served, browser: Browser) -> None:
    name = browser.cookie.partition("=")[0]
    for cookie in (f"{name}=", f"{name}=guess", "agentflow-studio-1=x", 'a="', "\xff=1"):
        answer = browser.raw(
            head(served, "GET /api/runs", f"Cookie: {cookie}", "Connection: close"), cookie=False
        )
        assert status(answer) in (400, 403)


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "[::1]:{port}", ""]
)
def test_names_that_rebind_are_refused(served: Served, browser: Browser, host: str) -> None:
    named = host.format(port=served.port) or " "
    assert status(browser.raw(head(served, "GET /api/runs", host=named))) in (400, 421)


def test_two_hosts_are_refused(served: Served, browser: Browser) -> None:
    answer = browser.raw(head(served, "GET /api/runs", "Host: evil.example"))
    assert status(answer) in (400, 421)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1:1"]
)
def test_other_pages_are_refused(served: Served, browser: Browser, origin: str) -> None:
    named = {"origin": origin.format(port=served.port)}
    assert browser.client.get("/api/runs", headers=named).status_code == 403
    assert browser.ask("/api/designs/stop", {"run": "x"}, **named).status_code == 403


def test_posts_without_an_origin_are_refused(browser: Browser) -> None:
    assert browser.client.post("/api/designs/stop", json={"run": "x"}).status_code == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_requests_of_other_sites_are_refused(browser: Browser, site: str) -> None:
    answer = browser.client.get("/api/runs", headers={"sec-fetch-site": site})
    assert answer.status_code == 403


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt",
        "/api/../../secret.txt",
        "/%2e%2e/secret.txt",
        "/api/%2e%2e%2fsecret.txt",
        "/..%5csecret.txt",
        "/%252e%252e/secret.txt",
        "//secret.txt",
        "/secret.txt%00.js",
        "http://evil.example/secret.txt",
    ],
)
def test_paths_lead_nowhere_else(served: Served, browser: Browser, path: str) -> None:
    answer = browser.raw(head(served, f"GET {path}"))
    assert status(answer) in (400, 404)
    assert SECRET.encode() not in answer


@pytest.mark.parametrize(
    "run",
    [
        "..",
        "../outside",
        "inside/../../outside",
        "./inside",
        "inside/",
        "/etc",
        "linked",
        "holds-link",
        "%2e%2e/outside",
        "..\\outside",
        "C:outside",
        "~",
        "inside\x00",
        "",
        "x" * 5000,
    ],
)
def test_names_of_runs_lead_nowhere_else(browser: Browser, run: str) -> None:
    for path in ("/api/run", "/api/follow"):
        answer = browser.client.get(path, params={"run": run})
        assert answer.status_code == 400, path
    machine = browser.client.get("/api/machine", params={"run": run, "machine": "0" * 16})
    assert machine.status_code == 400
    assert SECRET not in machine.text


@pytest.mark.parametrize("machine", ["../../secret", "0" * 15, "G" * 16, "0" * 16 + "\n"])
def test_names_of_machines_are_hashes(browser: Browser, machine: str) -> None:
    given = {"run": "inside", "machine": machine}
    assert browser.client.get("/api/machine", params=given).status_code == 400


def test_a_body_of_100_mb_is_refused_before_it_is_read(served: Served, browser: Browser) -> None:
    lines = (f"Origin: {served.base}", "Content-Type: application/json")
    large = head(served, "POST /api/designs", *lines, f"Content-Length: {100 * 2**20}")
    assert status(browser.raw(large)) == 413


def test_a_body_without_a_length_is_cut_off(browser: Browser) -> None:
    def endless() -> Iterator[bytes]:
        for _ in range(100):
            yield b"x" * 2**20

    headers = {"origin": browser.served.base, "content-type": "application/json"}
    try:
        answer = browser.client.post("/api/designs", content=endless(), headers=headers)
    except httpx.TransportError:  # closed while it was still being sent
        return
    assert answer.status_code == 413


@pytest.mark.parametrize("length", ["-1", "1e3", "0x10", "5, 5000000000"])
def test_lengths_that_are_no_numbers_are_refused(
    served: Served, browser: Browser, length: str
) -> None:
    lines = (f"Origin: {served.base}", f"Content-Length: {length}")
    assert status(browser.raw(head(served, "POST /api/designs", *lines))) in (400, 413)


def test_a_slow_body_is_not_waited_for(served: Served, browser: Browser) -> None:
    lines = (f"Origin: {served.base}", "Content-Type: application/json", "Content-Length: 50")
    assert status(browser.raw(head(served, "POST /api/designs", *lines), b'{"task"')) == 408


DEEP = json.loads('{"task": "throwing", "machine": ' + "[" * 50 + "]" * 50 + "}")
WRONG: dict[str, Callable[[], object]] = {
    "a list": list,
    "a number": lambda: 7,
    "no task": dict,
    "a task that is a number": lambda: {"task": 1},
    "a seed that is a text": lambda: {"task": "throwing", "seed": "0"},
    "a field that is unknown": lambda: {"task": "throwing", "command": "rm"},
    "a task that is a file": lambda: {"task": "/etc/passwd.yaml"},
    "a workflow that runs programs": lambda: {"task": "throwing", "workflow": "external"},
    "a model that is a folder": lambda: {"task": "throwing", "model": "../outside"},
    "options": lambda: {"task": "throwing", "model": "--trust", "base_url": "--out=/tmp"},
    "a URL with a password": lambda: {
        "task": "throwing",
        "model": "m",
        "base_url": "http://me:secret@127.0.0.1:9/v1",
    },
    "a deep machine": lambda: DEEP,
    "a machine of texts": lambda: {"task": "throwing", "machine": [{"type": "<script>"}]},
}


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_types_are_refused(browser: Browser, wrong: str) -> None:
    answer = browser.ask("/api/designs", WRONG[wrong]())
    assert answer.status_code == 400
    assert "secret" not in answer.text
    assert browser.get("/api/designs") == []


@pytest.mark.parametrize(
    ("kind", "body", "code"),
    [
        ("text/plain", b'{"run": "x"}', 415),
        ("application/x-www-form-urlencoded", b"run=x", 415),
        ("application/json", b"\xff\xfe", 400),
        ("application/json", b'{"run": NaN}', 400),
        ("application/json", b"[" * 100_000, 400),
    ],
    ids=["text", "form", "bytes", "NaN", "brackets"],
)
def test_bodies_that_are_not_json_are_refused(
    browser: Browser, kind: str, body: bytes, code: int
) -> None:
    headers = {"origin": browser.served.base, "content-type": kind}
    answer = browser.client.post("/api/designs/stop", content=body, headers=headers)
    assert answer.status_code == code


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_other_methods_are_refused(browser: Browser, method: str) -> None:
    headers = {"origin": browser.served.base}
    assert browser.client.request(method, "/api/runs", headers=headers).status_code == 405


def test_a_get_with_a_body_is_refused(served: Served, browser: Browser) -> None:
    assert status(browser.raw(head(served, "GET /api/runs", "Content-Length: 2"), b"{}")) == 400


def test_websockets_are_refused(served: Served, browser: Browser) -> None:
    lines = (
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    )
    assert status(browser.raw(head(served, "GET /api/follow", *lines))) == 400


def test_only_so_many_streams_are_open(browser: Browser) -> None:
    held = [browser.client.stream("GET", "/api/follow") for _ in range(LIMITS.streams)]
    lines = [stream.__enter__().iter_lines() for stream in held]
    assert all(next(line).startswith("data: ") for line in lines)
    assert browser.client.get("/api/follow").status_code == 429
    for stream in held:
        stream.__exit__(None, None, None)
    for _ in range(100):
        with browser.client.stream("GET", "/api/follow") as again:
            if again.status_code == 200:
                return
        time.sleep(0.05)
    raise AssertionError("closed streams still count")


def test_heads_that_are_too_long_or_garbage_are_refused(served: Served, browser: Browser) -> None:
    assert status(browser.raw(head(served, "GET /", "X: " + "x" * 200_000))) == 400
    with socket.create_connection(("127.0.0.1", served.port)) as wire:
        wire.sendall(b"\x16\x03\x01 hello\r\n\r\n")
        assert wire.recv(1000).startswith(b"HTTP/1.1 400")


def test_two_tabs_that_stop_the_same_run_are_both_told(browser: Browser) -> None:
    answers: list[int] = []

    def stop() -> None:
        answers.append(browser.ask("/api/designs/stop", {"run": "inside"}).status_code)

    tabs = [Thread(target=stop) for _ in range(2)]
    for tab in tabs:
        tab.start()
    for tab in tabs:
        tab.join()
    assert answers == [400, 400]  # this studio has not started it


def test_every_answer_forbids_what_a_page_does_not_need(browser: Browser) -> None:
    for path in ("/", "/studio.js", "/api/runs", "/nowhere"):
        headers = browser.client.get(path).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"
        assert "access-control-allow-origin" not in headers


def test_the_cookie_is_for_this_site_and_no_script(tmp_path: Path) -> None:
    with studio(tmp_path) as other:
        answer = bare(other.address)
        assert answer.headers["set-cookie"].endswith("; Path=/; HttpOnly; SameSite=Strict")


async def test_a_folder_has_the_same_port_each_time_or_any_other_while_it_is_taken(
    tmp_path: Path,
) -> None:
    async with running(tmp_path, None) as first, running(tmp_path, None) as other:
        assert urlsplit(first).port != urlsplit(other).port
    async with running(tmp_path, None) as again:
        assert urlsplit(again).port == urlsplit(first).port
