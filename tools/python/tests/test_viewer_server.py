"""The server at its socket: who is let in, what closes a connection, what is left afterwards."""

from __future__ import annotations

import gc
import json
import os
import random
import signal
import socket as sockets
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from viewer_fakes import FakeCamera, FakeVolume
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

import isowave
from isowave.viewer import server as server_module
from isowave.viewer import view
from isowave.viewer.scene import Scene
from isowave.viewer.server import Limits, Server, main, make_parser, parse_bytes, parse_size, serve

TIMEOUT = 60  # seconds; for machines that are busy with other things
HELLO = '{"type": "hello", "version": 2}'


def wish_text(wish_id: int, isovalue: float = 80) -> str:
    wish = {"type": "wish", "id": wish_id, "isovalue": isovalue, "size": [32, 24]}
    wish |= {"camera": None, "color": [1, 1, 1], "background": [0, 0, 0], "samples": 1}
    return json.dumps(wish | {"max_error": None, "time_budget": None, "ambient": 0})


@contextmanager
def serving(volume: FakeVolume | None = None, **options: Any) -> Iterator[Server]:
    limits = options.pop("limits", Limits())
    scene = Scene(
        volume or FakeVolume(),
        isovalue=80,
        size=(64, 48),
        make_camera=lambda v: FakeCamera(v.eye, v.at, v.up, v.fovy),
        **options,
    )
    with Server(scene, limits=limits) as server:
        yield server


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving() as shared:
        yield shared


def websocket_url(server: Server) -> str:
    return server.url.replace("http", "ws", 1) + "ws"


@contextmanager
def talking(server: Server, hello: bool = True) -> Iterator[ClientConnection]:
    url = websocket_url(server)
    with connect(url, max_size=None, compression=None, ping_interval=None) as socket:
        if hello:
            socket.send(HELLO)
        yield socket


def receive(socket: ClientConnection) -> tuple[dict[str, Any], bytes]:
    message = socket.recv(timeout=TIMEOUT)
    if isinstance(message, str):
        return json.loads(message), b""
    (size,) = struct.unpack_from("<I", message)
    return json.loads(message[4 : 4 + size]), message[4 + size :]


def receive_until(socket: ClientConnection, **wanted: Any) -> dict[str, Any]:
    """Acknowledges pictures until a message with these entries comes."""
    while True:
        head, _ = receive(socket)
        if head["type"] == "picture":
            socket.send(json.dumps({"type": "ack", "frame": head["frame"]}))
        if all(head.get(k) == v for k, v in wanted.items()):
            return head


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
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["cache-control"] == "no-store"
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
    assert answer.headers["x-content-type-options"] == "nosniff"
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


def test_odd_hosts_are_refused(server: Server) -> None:
    answer = httpx.get(server.url, headers={"Host": "a; script-src *"})
    assert answer.status_code in (400, 403)


def test_other_methods_do_nothing(server: Server) -> None:
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert httpx.request(method, server.url).status_code in (403, 405)
    assert works(server)


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


def test_100_reconnects_leave_nothing() -> None:
    volume = FakeVolume()
    with serving(volume) as server:
        assert works(server)
        gc.collect()
        threads, files = threading.active_count(), len(os.listdir("/proc/self/fd"))
        for i in range(100):
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


@pytest.mark.parametrize(
    "text, expected",
    [("5", 5), ("600MB", 600_000_000), ("1GiB", 1 << 30), ("2 k", 2000), ("3b", 3), ("1Ki", 1024)],
)
def test_numbers_of_bytes(text: str, expected: int) -> None:
    assert parse_bytes(text) == expected


@pytest.mark.parametrize("text", ["", "MB", "-1", "1.5GB", "1ZB", "1 000", "0x10", "1GiBB"])
def test_no_numbers_of_bytes(text: str) -> None:
    with pytest.raises(ValueError, match="600MB"):
        parse_bytes(text)


def test_sizes() -> None:
    assert parse_size("1920x1080") == (1920, 1080)
    for text in ("", "x", "0x5", "5x", "5X5", "100000x1"):
        with pytest.raises(ValueError, match="1920x1080"):
            parse_size(text)


def test_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    parsed = make_parser().parse_args(
        ["a.nrrd", "-i", "5", "--memory-budget", "1GiB", "--size", "8x9"]
    )
    assert (parsed.isovalue, parsed.memory_budget, parsed.size) == (5.0, 1 << 30, (8, 9))
    with pytest.raises(SystemExit):
        make_parser().parse_args(["a.nrrd", "--memory-budget", "much"])
    assert "such as 600MB" in capsys.readouterr().err


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


def failing(options: dict[str, Any]) -> Exception:
    return RuntimeError("no such device: nonsense")


def test_a_view_that_cannot_draw_ends_with_the_reason(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RuntimeError, match="no such device: nonsense"):
        view(FakeVolume(refuse=failing), block=True, notebook=False, open_browser=False)
    monkeypatch.setattr(isowave, "open", lambda path: FakeVolume(refuse=failing))
    assert main(["ball.nrrd", "--no-browser", "--device", "nonsense"]) == 1
    output = capsys.readouterr()
    assert output.out.count("http://127.0.0.1:") == 2
    assert output.err == "isowave view: no such device: nonsense\n"


def test_a_view_that_does_not_block_is_a_server() -> None:
    server = view(FakeVolume(), isovalue=80, block=False, notebook=False, open_browser=False)
    assert isinstance(server, Server)
    assert httpx.get(server.url).status_code == 200
    server.close()


def test_the_command_ends_with_ctrl_c(tmp_path: Path) -> None:
    script = tmp_path / "run.py"
    script.write_text(
        "import isowave, sys, signal\n"
        "from viewer_fakes import FakeVolume\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "isowave.open = lambda path: FakeVolume()\n"
        "from isowave.viewer import main\n"
        "sys.exit(main(['ball.nrrd', '--no-browser']))\n"
    )
    here = str(Path(__file__).parent)
    path = os.pathsep.join([here, *sys.path])
    with subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        assert httpx.get(url).status_code == 200
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, error) == (0, "")


def test_the_command_says_in_one_line_what_is_wrong(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*arguments: Any, **options: Any) -> None:
        raise OSError("port 80 of 127.0.0.1: Permission denied")

    monkeypatch.setattr(server_module, "serve", fails)
    assert main(["no_such_file.nrrd", "--no-browser"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("isowave view: ") and error.count("\n") == 1
