"""The server at its socket: who is let in, what closes a connection, what is left afterwards."""

from __future__ import annotations

import gc
import json
import os
import random
import re
import signal
import socket as sockets
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from conftest import TOP
from viewer_fakes import FakeVolume
from viewer_sockets import (
    HELLO,
    TIMEOUT,
    receive,
    receive_until,
    serving,
    talking,
    websocket_url,
    wish_text,
)
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from isowave.viewer import server as server_module
from isowave.viewer.scene import Scene
from isowave.viewer.server import Limits, Server, serve


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving() as shared:
        yield shared


def works(server: Server) -> bool:
    """Whether somebody who comes now sees the lossless picture."""
    with talking(server) as socket:
        socket.send(wish_text(1))
        return receive_until(socket, stage="lossless")["wish"] == 1


def test_the_page_and_its_script(server: Server) -> None:
    page = httpx.get(server.url)
    assert page.status_code == 200 and "text/html" in page.headers["content-type"]
    script = httpx.get(server.url + "view.js")
    assert script.status_code == 200 and "text/javascript" in script.headers["content-type"]
    for answer in (page, script):
        assert "server" not in answer.headers
    policy = page.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self';")
    assert "unsafe" not in policy and "*" not in policy
    # Nothing of anywhere else.
    for text in (page.text, script.text):
        assert "https://" not in text
        assert all(rest.startswith("www.w3.org/2000/svg") for rest in text.split("http://")[1:])


def test_it_listens_at_loopback_with_a_random_token() -> None:
    with serving() as one, serving() as other:
        assert one.host == "127.0.0.1"
        assert one.token != other.token and len(one.token) == 32
        assert one.port != other.port
        assert one._socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    "path", ["", "x/", "x/view.js", "{}x/", "view.js", "?token={}", "{}/x", "%2F{}/"]
)
def test_without_the_token_nothing_is_found(server: Server, path: str) -> None:
    url = f"http://127.0.0.1:{server.port}/" + path.format(server.token)
    answer = httpx.get(url, follow_redirects=False)
    assert answer.status_code == 403
    assert server.token not in answer.text


@pytest.mark.parametrize("wrong", ["", "wrong", "{}x", "x{}", "é", "%00"])
def test_a_websocket_needs_the_token(server: Server, wrong: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{server.port}/{wrong.format(server.token)}/ws")
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "http://[", "file://", ""]
)
def test_foreign_origins_are_refused(server: Server, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(websocket_url(server), additional_headers={"Origin": origin})
    assert refused.value.response.status_code == 403
    assert httpx.get(server.url, headers={"Origin": origin}).status_code == 403


def test_the_pages_own_origin_is_let_in(server: Server) -> None:
    origin = f"http://127.0.0.1:{server.port}"
    with connect(websocket_url(server), additional_headers={"Origin": origin}) as socket:
        socket.send(HELLO)
        assert receive(socket)[0]["type"] == "status"


def test_a_page_of_a_name_that_leads_here_lacks_the_token(server: Server) -> None:
    host = f"evil.example:{server.port}"
    headers = {"Host": host, "Origin": f"http://{host}"}
    for path in ("", "view.js", "ws"):
        answer = httpx.get(f"http://127.0.0.1:{server.port}/{path}", headers=headers)
        assert answer.status_code == 403 and server.token not in answer.text


def test_odd_hosts_are_refused(server: Server) -> None:
    answer = httpx.get(server.url, headers={"Host": "a; script-src *"})
    assert answer.status_code in (400, 403)


def test_other_methods_do_nothing(server: Server) -> None:
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"):
        answer = httpx.request(method, server.url)
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")
    whole, head = httpx.get(server.url), httpx.head(server.url)
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["content-length"] == str(len(whole.content))
    assert works(server)


# What is sent and the answer's status. {t}: the token; {h}: the host.
ANSWERS = {
    "page": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\n\r\n", 200),
    "with a query": ("GET /{t}/?x HTTP/1.0\r\nHost: {h}\r\n\r\n", 200),
    "code": ("GET /{c} HTTP/1.1\r\nHost: {h}\r\n\r\n", 303),
    "rubbish": ("rubbish\r\n\r\n", 400),
    "encrypted": ("\x16\x03\x01\x02\x00", 400),
    "version": ("GET /{t}/ HTTP/2\r\nHost: {h}\r\n\r\n", 400),
    "another address": ("GET http://{h}/{t}/ HTTP/1.1\r\nHost: {h}\r\n\r\n", 400),
    "bad field": ("GET /{t}/ HTTP/1.1\r\nHost : {h}\r\n\r\n", 400),
    "folded field": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nX: a\r\n b\r\n\r\n", 400),
    "control character": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nX: \x00\r\n\r\n", 400),
    "no token": ("GET / HTTP/1.1\r\nHost: {h}\r\n\r\n", 403),
    "nothing there": ("GET /{t}/x HTTP/1.1\r\nHost: {h}\r\n\r\n", 403),
    "no host": ("GET /{t}/ HTTP/1.1\r\n\r\n", 403),
    "two hosts": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nHost: {h}\r\n\r\n", 403),
    "origin": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nOrigin: http://x\r\n\r\n", 403),
    "body of a stranger": ("POST / HTTP/1.1\r\nHost: {h}\r\nContent-Length: 9999\r\n\r\n", 403),
    "method": ("POST /{t}/ HTTP/1.1\r\nHost: {h}\r\nContent-Length: 9999\r\n\r\n", 405),
    "half": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nX-", 408),
    "body": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nContent-Length: 9999\r\n\r\n", 413),
    "chunks": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nTransfer-Encoding: chunked\r\n\r\n", 413),
    "no upgrade": ("GET /{t}/ws HTTP/1.1\r\nHost: {h}\r\n\r\n", 426),
    "no key": (
        "GET /{t}/ws HTTP/1.1\r\nHost: {h}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n",
        400,
    ),
    "many fields": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\n" + "X: y\r\n" * 200 + "\r\n", 431),
    "long field": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nX: " + "y" * 20000 + "\r\n\r\n", 431),
    "long path": ("GET /" + "y" * 20000, 431),
    "no place": ("GET /{t}/ HTTP/1.1\r\nHost: {h}\r\n\r\n", 503),
}


@pytest.mark.parametrize("case", ANSWERS)
def test_all_answers_have_the_same_headers_and_close_the_connection(case: str) -> None:
    text, status = ANSWERS[case]
    limits = Limits(head_seconds=0.2 if status == 408 else 60, connections=1 - (status == 503))
    with serving(limits=limits) as server:
        code = server.url_for_once().rpartition("/")[2]
        sent = text.format(t=server.token, c=code, h=f"127.0.0.1:{server.port}")
        with dialling(server) as raw:
            raw.sendall(sent.encode("latin-1"))
            answer = read_all(raw).decode()
    head, _, body = answer.partition("\r\n\r\n")
    first, *lines = head.split("\r\n")
    fields = dict(line.lower().split(": ", 1) for line in lines)
    assert first.startswith(f"HTTP/1.1 {status} ")
    assert fields["x-content-type-options"] == "nosniff"
    assert fields["referrer-policy"] == "no-referrer"
    assert fields["x-frame-options"] == "deny"
    assert fields["cross-origin-opener-policy"] == "same-origin"
    assert fields["cross-origin-resource-policy"] == "same-origin"
    assert fields["cache-control"] == "no-store"
    assert fields["content-security-policy"].startswith("default-src 'none';")
    assert "close" in fields["connection"]
    assert fields["content-length"] == str(len(body.encode()))
    assert status in (200, 303) or body.startswith("isowave: ") and body.count("\n") == 1


def test_a_websocket_is_opened_with_the_same_headers(server: Server) -> None:
    with talking(server) as socket:
        assert socket.response is not None
        assert socket.response.headers["x-content-type-options"] == "nosniff"
        assert socket.response.headers["cache-control"] == "no-store"


@contextmanager
def dialling(server: Server) -> Iterator[sockets.socket]:
    with sockets.create_connection(("127.0.0.1", server.port), timeout=TIMEOUT) as raw:
        yield raw


def read_all(raw: sockets.socket) -> bytes:
    """Until the server has closed the connection; b"" also when it was reset."""
    data = b""
    try:
        while part := raw.recv(65536):
            data += part
    except ConnectionResetError:
        pass
    return data


QUICK = Limits(head_seconds=0.3, answer_seconds=0.3, hello_seconds=0.3, idle_seconds=0.3)


HANDSHAKE = (
    "GET /{t}/ws HTTP/1.1\r\nHost: {h}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)


SLOW = {
    "sends nothing": "",
    "half a request line": "GET /",
    "half a head": "GET /nope/ HTTP/1.1\r\nHost: x\r\nX-",
    "half a head with the token": "GET /{t}/ HTTP/1.1\r\nHost: {h}\r\nX-",
    "half a handshake": HANDSHAKE[:-2],
    "keeps an answered connection": "GET / HTTP/1.1\r\nHost: x\r\n\r\n",
    "keeps the page's connection": "GET /{t}/ HTTP/1.1\r\nHost: {h}\r\n\r\n",
    "half a body": "POST /{t}/ HTTP/1.1\r\nHost: {h}\r\nContent-Length: 9999\r\n\r\nabc",
    "no hello": HANDSHAKE,
    "half a frame": HANDSHAKE + "\x81",
}


@pytest.mark.parametrize("case", SLOW)
def test_slow_connections_end(case: str) -> None:
    with serving(limits=QUICK) as server, dialling(server) as raw:
        sent = SLOW[case].format(t=server.token, h=f"127.0.0.1:{server.port}")
        raw.sendall(sent.encode("latin-1"))
        read_all(raw)
        assert eventually(lambda: not server._tasks and not server._known)
        assert not server._strangers


def test_a_head_that_comes_byte_by_byte_has_one_time_limit() -> None:
    with serving(limits=QUICK) as server, dialling(server) as raw:
        sent = 0
        with pytest.raises(OSError):
            for _ in range(10 * TIMEOUT):
                raw.sendall(b"G")
                sent += 1
                threading.Event().wait(0.1)
        assert sent < 10 * TIMEOUT


@pytest.mark.parametrize("sent", [b"", b"GET /nope/ HTTP/1.1\r\nHost: x\r\nX-"])
def test_connections_without_the_token_never_keep_out_those_with_it(sent: bytes) -> None:
    """However many there are, and even if none of them ends by itself."""
    with serving(limits=Limits(strangers=8, connections=8, head_seconds=TIMEOUT)) as server:
        held = [sockets.create_connection(("127.0.0.1", server.port)) for _ in range(100)]
        for raw in held:
            try:
                raw.sendall(sent)
            except OSError:  # it had to make room
                pass
        assert httpx.get(server.url).status_code == 200
        assert works(server)
        assert len(server._strangers) <= 8
        for raw in held:
            raw.close()


def test_thousands_of_connections_in_turn_leave_nothing(server: Server) -> None:
    files = len(os.listdir("/proc/self/fd"))
    for i in range(1100):  # more than a process may have open
        with dialling(server) as raw:
            raw.sendall(b"GET / HT"[: i % 9])
    assert works(server)
    assert eventually(lambda: len(os.listdir("/proc/self/fd")) <= files)


def test_too_many_connections_with_the_token_are_refused_and_places_come_back() -> None:
    with serving(limits=Limits(connections=3)) as server:
        with talking(server), talking(server), talking(server):
            refused = httpx.get(server.url)
            assert (refused.status_code, refused.headers["retry-after"]) == (503, "1")
            assert refused.text == (
                "isowave: too many connections are open: close one, then try again\n"
            )
            with pytest.raises(InvalidStatus) as late:
                connect(websocket_url(server))
            assert late.value.response.status_code == 503
        assert eventually(lambda: not server._known)
        assert works(server)


def test_a_client_that_reads_nothing_at_all_is_gone_in_the_end() -> None:
    """What it is sent is more than sockets hold, but less than the queue does."""
    with serving(limits=QUICK) as server, dialling(server) as raw:
        sent = HANDSHAKE.format(t=server.token, h=f"127.0.0.1:{server.port}")
        raw.sendall(sent.encode() + masked(HELLO))
        assert eventually(lambda: server.scene.num_clients == 1)
        for _ in range(30):
            server.scene._turns.clients[0].post({"type": "picture"}, bytes(1 << 20))
        assert eventually(lambda: server.scene.num_clients == 0 and not server._tasks)
        assert works(server)


def masked(text: str) -> bytes:
    """A frame of a client: text, with a mask of zeros."""
    data = text.encode()
    size = struct.pack("!B", 0x80 | len(data)) if len(data) < 126 else b"\xfe"
    long = struct.pack("!H", len(data)) if len(data) >= 126 else b""
    return b"\x81" + size + long + bytes(4) + data


def test_a_client_that_answers_no_pings_is_gone() -> None:
    with serving(limits=QUICK) as server, dialling(server) as raw:
        sent = HANDSHAKE.format(t=server.token, h=f"127.0.0.1:{server.port}")
        raw.sendall(sent.encode() + masked(HELLO))
        data = read_all(raw)
        assert b"the client does not answer" in data
        assert server.scene.num_clients == 0


def test_a_client_that_answers_pings_stays() -> None:
    with serving(limits=Limits(idle_seconds=0.1)) as server, talking(server) as socket:
        receive_until(socket, state="ready")
        with pytest.raises(TimeoutError):
            while True:
                socket.recv(timeout=1)
        socket.send(wish_text(1))
        assert receive_until(socket, stage="whole")["wish"] == 1


def test_a_message_may_come_in_fragments(server: Server) -> None:
    with talking(server) as socket:
        socket.send([wish_text(1)[:40], wish_text(1)[40:]])
        assert receive_until(socket, stage="whole")["wish"] == 1
        with pytest.raises(ConnectionClosed) as closed:
            socket.send(["x" * 5000, "x" * 5000])
            while True:
                socket.recv(timeout=TIMEOUT)
    assert closed.value.rcvd is not None and closed.value.rcvd.code == 1009


BAD = [
    ("{", 1008, "not JSON"),
    ("[]", 1008, "not a JSON object"),
    ('{"type": "dance"}', 1008, "no known type"),
    ('{"type": "ack", "frame": 99}', 1008, "not sent"),
    ('{"type": "ack", "frame": -1}', 1008, "frame"),
    ("[" * 4000, 1008, "not JSON"),
    (HELLO, 1008, "second hello"),
    (wish_text(1).replace("80", "NaN"), 1008, "NaN"),
    ('"' + "x" * 10000 + '"', 1009, ""),
    ("x" * 5_000_000, None, ""),  # it may be cut before the close code is read
    (b"\x00\x01", 1003, "must be text"),
]


@pytest.mark.parametrize("message, code, reason", BAD, ids=range(len(BAD)))
def test_bad_messages_close_one_connection(
    server: Server, message: str | bytes, code: int | None, reason: str
) -> None:
    with talking(server) as other:
        with talking(server) as socket, pytest.raises(ConnectionClosed) as closed:
            socket.send(message)
            while True:
                socket.recv(timeout=TIMEOUT)
        got = closed.value.rcvd
        assert code is None or (got is not None and got.code == code and reason in got.reason)
        other.send(wish_text(1))
        assert receive_until(other, stage="whole")["wish"] == 1


def test_the_first_message_is_hello(server: Server) -> None:
    with talking(server, hello=False) as socket, pytest.raises(ConnectionClosed) as closed:
        socket.send(wish_text(1))
        socket.recv(timeout=TIMEOUT)
    assert closed.value.rcvd is not None and "hello" in closed.value.rcvd.reason


def test_too_many_messages_close_the_connection() -> None:
    with serving(limits=Limits(message_rate=1e-3, message_burst=20)) as server:
        with talking(server) as socket, pytest.raises(ConnectionClosed) as closed:
            for i in range(30):
                socket.send(wish_text(i))
            while True:
                socket.recv(timeout=TIMEOUT)
        assert closed.value.rcvd is not None and "too many messages" in closed.value.rcvd.reason
        assert works(server)


def test_too_many_clients_are_asked_to_come_again() -> None:
    with serving(max_clients=2) as server:
        with talking(server) as one, talking(server) as two:
            receive(one), receive(two)
            with talking(server) as three, pytest.raises(ConnectionClosed) as closed:
                three.recv(timeout=TIMEOUT)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1013 and "too many" in closed.value.rcvd.reason


def test_a_client_that_reads_nothing_gets_no_more_than_two_pictures(server: Server) -> None:
    with talking(server) as socket:
        for i in range(1, 30):
            socket.send(wish_text(i, 80 + i))
        assert works(server) and works(server)
        # Messages come in order: what is acknowledged now was on the way before.
        frames = []
        while len(frames) < 2:
            head, _ = receive(socket)
            frames += [head["frame"]] if head["type"] == "picture" else []
        with pytest.raises(TimeoutError):
            while receive_now(socket)["type"] != "picture":
                pass
        socket.send('{"type": "ack", "frame": 2}')
        assert receive_until(socket, stage="lossless")["wish"] == 29


def receive_now(socket: ClientConnection) -> dict[str, Any]:
    message = socket.recv(timeout=0.2)
    return json.loads(message) if isinstance(message, str) else {"type": "picture"}


def test_reconnects_leave_nothing() -> None:
    volume = FakeVolume()
    with serving(volume) as server:
        assert works(server)
        gc.collect()
        threads, files = threading.active_count(), len(os.listdir("/proc/self/fd"))
        for i in range(30):
            with talking(server) as socket:
                socket.send(wish_text(1, i))
                if i % 3 == 0:
                    receive_until(socket, type="picture")
                if i % 2:  # as a machine that goes to sleep
                    socket.socket.shutdown(sockets.SHUT_RDWR)
        assert works(server)
        assert eventually(lambda: server.scene.num_clients == 0)
        assert eventually(lambda: threading.active_count() <= threads)
        gc.collect()
        assert eventually(lambda: len(os.listdir("/proc/self/fd")) <= files + 1)
        assert len(volume.renderers) == 1
    assert server.url  # closed twice does no harm
    server.close()


def eventually(condition: Any) -> bool:
    """Waits for a condition, as long as a busy machine may need."""
    waiting = threading.Event()
    return any(condition() or waiting.wait(0.1) for _ in range(10 * TIMEOUT))


def test_nothing_is_left_when_a_server_ends() -> None:
    threads = {t.ident for t in threading.enumerate()}
    with serving() as server:
        assert works(server)
    assert eventually(lambda: {t.ident for t in threading.enumerate()} <= threads)
    with pytest.raises(httpx.ConnectError):
        httpx.get(server.url)


def test_fuzz_at_the_socket(server: Server) -> None:
    chance = random.Random(7)
    valid = [
        HELLO,
        wish_text(1),
        '{"type": "ack", "frame": 0}',
        '{"type": "budget", "bytes": null}',
    ]
    for _ in range(60):
        text = chance.choice(valid)
        cut = chance.randrange(len(text))
        noise = bytes(chance.randrange(256) for _ in range(chance.randrange(40)))
        with talking(server, hello=chance.random() < 0.8) as socket:
            try:
                if chance.random() < 0.3:
                    socket.send(noise)
                socket.send(
                    (text[:cut] + noise.decode("latin-1") + text[cut:])[: chance.randrange(9000)]
                )
                socket.send(chance.choice(valid))
                socket.recv(timeout=TIMEOUT)
            except ConnectionClosed:
                pass
    assert works(server)


def test_raw_rubbish_at_the_socket_is_survived(server: Server) -> None:
    chance = random.Random(8)
    start = f"GET /{server.token}/ws HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n".encode()
    upgrade = b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    key = b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    for i in range(40):
        noise = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 400)))
        with sockets.create_connection(("127.0.0.1", server.port), timeout=TIMEOUT) as raw:
            raw.sendall((start + upgrade + key if i % 2 else b"") + noise)
            raw.shutdown(sockets.SHUT_WR)
    assert works(server)


def test_a_port_that_is_taken_is_one_line(server: Server) -> None:
    scene = Scene(FakeVolume(), start=False)
    with pytest.raises(OSError, match=f"port {server.port} of 127.0.0.1: Address already in use"):
        Server(scene, port=server.port)


def test_the_browser_gets_a_url_that_works_once(monkeypatch: pytest.MonkeyPatch) -> None:
    opened, was_opened = list[str](), threading.Event()

    def open_browser(url: str) -> None:
        opened.append(url)
        was_opened.set()

    monkeypatch.setattr(server_module.webbrowser, "open", open_browser)
    monkeypatch.setenv("DISPLAY", ":0")
    with serve(FakeVolume(), isovalue=80) as server:
        assert was_opened.wait(TIMEOUT)
        assert server.token not in opened[0]
        assert httpx.get(opened[0] + "x").status_code == 403
        first = httpx.get(opened[0])
        assert (first.status_code, first.headers["location"]) == (303, f"/{server.token}/")
        assert httpx.get(opened[0]).status_code == 403
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    with serve(FakeVolume(), isovalue=80):
        pass
    assert len(opened) == 1  # without a display, no browser of the terminal


def test_a_port_that_is_none_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    volume = FakeVolume()
    for port in (80000, 65536, -1):
        with pytest.raises(ValueError, match=f"port {port}: give one from 1 to 65535"):
            serve(volume, port=port, open_browser=False)
    assert not volume.renderers, "none is begun"


def test_ctrl_c_leaves_the_server_to_close(server: Server) -> None:
    """Python 3.11's Thread.join() forgets a running thread when a signal interrupts it."""
    threading.Timer(0.1, signal.raise_signal, [signal.SIGINT]).start()
    with pytest.raises(KeyboardInterrupt):
        server.wait()
    assert server._thread.is_alive()
    server.close()
    assert not server._thread.is_alive()


def test_the_threat_model_names_tests_that_exist() -> None:
    readme = (TOP / "tools/python/isowave/viewer/README.md").read_text()
    named = set(re.findall(r"`(test_[a-z0-9_]+)`", readme))
    here = Path(__file__).parent
    texts = [path.read_text() for path in here.glob("test_viewer_*.py")]
    existing = {name for text in texts for name in re.findall(r"^def (test_\w+)", text, re.M)}
    assert len(named) > 20 and not named - existing
