"""The viewer in a browser: a page and a websocket, for those who know the token in the URL.

    GET /TOKEN/          the page            GET /TOKEN/view.js   what it runs
        /TOKEN/ws        the websocket: messages as text; of the server also pictures, as bytes:
                         4 bytes length of the head (little endian), the head (JSON), the picture
        /CODE            leads to the page, once: for a browser whose command line others can see

Anything else, a wrong token and a foreign Origin are answered with 403.
"""

from __future__ import annotations

import argparse
import asyncio
import hmac
import json
import os
import re
import secrets
import socket
import struct
import sys
import threading
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from .interfaces import VolumeLike
from .protocol import MAX_MESSAGE_BYTES, ProtocolError, parse
from .scene import Scene, Session, TooManyClients

HEADERS: Final = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
POLICY: Final = (
    "default-src 'none'; script-src 'self'; connect-src 'self' ws://{host} wss://{host}; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# Close codes of RFC 6455 and its registry.
UNSUPPORTED_DATA, POLICY_VIOLATION, TRY_AGAIN_LATER, GOING_AWAY = 1003, 1008, 1013, 1001


@dataclass(frozen=True)
class Limits:
    """What a server takes from its clients.

    message_rate, message_burst  messages of a client: a second, and at once
    queue                        messages that wait to be sent to a client; more: it is gone
    connections                  at the same time, of all kinds
    """

    message_rate: float = 250
    message_burst: float = 500
    queue: int = 64
    connections: int = 64


class Server:
    """Serves a scene from a thread of its own, until close().

    host, port  to listen at; port 0: a free one
    token       who knows it may look; None: a random one of 192 bits
    """

    def __init__(
        self,
        scene: Scene,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        limits: Limits = Limits(),
    ) -> None:
        self.scene = scene
        self._codes: set[str] = set()
        self.token = token or secrets.token_urlsafe(24)
        self._socket = _listen(host, port)
        self.host, self.port = host, int(self._socket.getsockname()[1])
        config = uvicorn.Config(
            _application(scene, self.token, self._codes, limits),
            ws_max_size=MAX_MESSAGE_BYTES,
            ws_per_message_deflate=False,
            limit_concurrency=limits.connections,
            timeout_graceful_shutdown=2,
            lifespan="off",
            log_config=None,
            log_level="critical",
            server_header=False,
        )
        self._uvicorn = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, name="isowave-server", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where the page is. Whoever has it may look at the volume."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/{self.token}/"

    def url_for_once(self) -> str:
        """A URL that leads to the page when it is opened first, and then no more."""
        code = secrets.token_urlsafe(24)
        self._codes.add(code)
        return self.url.removesuffix(f"{self.token}/") + code

    def __repr__(self) -> str:
        return f"isowave viewer at {self.url}"

    def wait(self) -> None:
        """Returns when the server has ended, or no renderer could be made.

        Raises KeyboardInterrupt.
        """
        while self._thread.is_alive() and self.scene.failure is None:
            self._thread.join(0.5)

    def close(self) -> None:
        """Ends server and scene. May be called twice."""
        self._uvicorn.should_exit = True
        self.scene.close()
        self._thread.join()
        self._socket.close()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _run(self) -> None:
        self._uvicorn.run(sockets=[self._socket])


class _Gate:
    """Lets nobody in but those with the token, from a page of ours or from no page."""

    def __init__(self, app: ASGIApp, token: str, codes: set[str]) -> None:
        self._app, self._token, self._codes = app, token.encode(), codes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            return
        if self._may_enter(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "http" and self._takes_code(scope):
            page = {**HEADERS, "Location": f"/{self._token.decode()}/"}
            await Response("", 303, page)(scope, receive, send)
        elif scope["type"] == "http":
            response = Response("isowave: open the whole URL that was printed\n", 403, HEADERS)
            await response(scope, receive, send)
        else:  # before it is accepted, this is answered with 403
            await WebSocket(scope, receive, send).close()

    def _takes_code(self, scope: Scope) -> bool:
        given = str(scope["path"])[1:].encode(errors="replace")
        known = [code for code in self._codes if hmac.compare_digest(code.encode(), given)]
        self._codes.difference_update(known)
        return bool(known)

    def _may_enter(self, scope: Scope) -> bool:
        token = str(scope["path"]).split("/")[1:2] or [""]
        if not hmac.compare_digest(token[0].encode(errors="replace"), self._token):
            return False
        headers = HTTPConnection(scope).headers
        host = headers.get("host", "")
        if not re.fullmatch(r"[A-Za-z0-9._\[\]:-]{1,255}", host):
            return False
        origins = headers.getlist("origin")
        return all(_host_of(origin) == host.lower() for origin in origins)


def _host_of(origin: str) -> str | None:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return None
    return parts.netloc.lower() if parts.scheme in ("http", "https") else None


def _application(scene: Scene, token: str, codes: set[str], limits: Limits) -> ASGIApp:
    def page(request: Request) -> Response:
        policy = POLICY.format(host=request.headers["host"])
        headers = {**HEADERS, "Content-Security-Policy": policy}
        return Response(_read("page.html"), 200, headers, "text/html")

    def script(request: Request) -> Response:
        return Response(_read("view.js"), 200, HEADERS, "text/javascript")

    def nothing(request: Request) -> Response:
        return Response("isowave: there is nothing here\n", 403, HEADERS)

    async def talk(websocket: WebSocket) -> None:
        await _Connection(scene, limits, websocket).run()

    app = Starlette(
        routes=[
            Route("/{token}/", page),
            Route("/{token}/view.js", script),
            WebSocketRoute("/{token}/ws", talk),
            Route("/{rest:path}", nothing),
        ]
    )
    return _Gate(app, token, codes)


class _Connection:
    """A websocket and its session. Ends with whichever of reading and writing ends first."""

    def __init__(self, scene: Scene, limits: Limits, websocket: WebSocket) -> None:
        self._websocket, self._limits = websocket, limits
        self._loop = asyncio.get_running_loop()
        self._queue: asyncio.Queue[tuple[dict[str, Any], bytes | None]] = asyncio.Queue()
        self._full = asyncio.Event()
        self._session = Session(
            scene, self._post, rate=limits.message_rate, burst=limits.message_burst
        )

    async def run(self) -> None:
        await self._websocket.accept()
        tasks = [
            asyncio.create_task(work) for work in (self._read(), self._write(), self._full.wait())
        ]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            code, reason = _close_reason([task.exception() for task in done])
        finally:
            self._session.close()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        if code is not None:
            try:
                await self._websocket.close(code, reason)
            except RuntimeError:  # it is closed already
                pass

    def _post(self, head: dict[str, Any], data: bytes | None) -> None:
        # Raises RuntimeError when the loop has ended; the scene then forgets the client.
        self._loop.call_soon_threadsafe(self._enqueue, head, data)

    def _enqueue(self, head: dict[str, Any], data: bytes | None) -> None:
        if self._queue.qsize() < self._limits.queue:
            self._queue.put_nowait((head, data))
        else:
            self._full.set()

    async def _read(self) -> None:
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(int(message.get("code") or 1005))
            text = message.get("text")
            if text is None:
                raise _BinaryMessage("messages must be text")
            self._session.receive(parse(text))

    async def _write(self) -> None:
        while True:
            head, data = await self._queue.get()
            # Who does not read is noticed by the pings that uvicorn sends.
            text = json.dumps(head, allow_nan=False)
            if data is None:
                await self._websocket.send_text(text)
            else:
                encoded = text.encode()
                size = struct.pack("<I", len(encoded))
                await self._websocket.send_bytes(size + encoded + data)


class _BinaryMessage(ProtocolError):
    pass


def _close_reason(errors: Sequence[BaseException | None]) -> tuple[int | None, str]:
    """What a websocket is closed with; None: it is closed already."""
    for error in errors:
        if isinstance(error, WebSocketDisconnect):
            return None, ""
        if isinstance(error, ProtocolError):
            code = POLICY_VIOLATION
            if isinstance(error, TooManyClients):
                code = TRY_AGAIN_LATER
            elif isinstance(error, _BinaryMessage):
                code = UNSUPPORTED_DATA
            # A reason has at most 123 bytes.
            return code, str(error).encode()[:123].decode(errors="ignore")
    return POLICY_VIOLATION, "the client does not read what it is sent"


def _read(name: str) -> bytes:
    return resources.files(__package__).joinpath(name).read_bytes()


def _listen(host: str, port: int) -> socket.socket:
    """Raises OSError whose text is one line."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise OSError(f"{host}: {error.strerror}") from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise OSError(f"port {port} of {host}: {error.strerror}") from None
    return listener


def serve(
    volume: VolumeLike,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    open_browser: bool = True,
    **options: Any,
) -> Server:
    """Serves a view of a volume and opens it in a browser, where there is a display.

    options  as for Scene: isovalue, title, device, memory_budget, size, samples, max_clients
    """
    server = Server(Scene(volume, **options), host=host, port=port)
    # Without a display, Python would open a browser of the terminal.
    if open_browser and any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")):
        url = server.url_for_once()
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
    return server


def parse_bytes(text: str) -> int:
    """A number of bytes: 1048576, 600MB, 1GiB. Raises ValueError."""
    match = re.fullmatch(r"([0-9]+) *(?:([kmgtpe])(i?))?b?", text.strip().lower())
    if not match:
        raise ValueError(f"'{text}' is no number of bytes, such as 600MB or 1GiB")
    number, prefix, binary = match.groups()
    power = "kmgtpe".index(prefix) + 1 if prefix else 0
    factor: int = (1024 if binary else 1000) ** power
    return int(number) * factor


def parse_size(text: str) -> tuple[int, int]:
    """WxH. Raises ValueError."""
    match = re.fullmatch(r"([1-9][0-9]{0,4})x([1-9][0-9]{0,4})", text)
    if not match:
        raise ValueError(f"'{text}' is no size, such as 1920x1080")
    return int(match[1]), int(match[2])


def make_parser() -> argparse.ArgumentParser:
    """Of the command line of `isowave view`."""
    parser = argparse.ArgumentParser(
        prog="isowave view",
        description="Shows isosurfaces of a volume in a browser, until Ctrl-C ends it.",
    )
    add = parser.add_argument
    add("volume", help="file of any format that isowave reads, or generate:...")
    add("-i", "--isovalue", type=float, help="at first")
    add("--device", help="index, type (gpu, cpu) or a part of the name")
    add("--memory-budget", type=_argument(parse_bytes), help="of device memory: 600MB, 1GiB")
    add("--size", type=_argument(parse_size), default=(1920, 1080), help="of the largest picture")
    add("--rate", type=int, help="bits per voxel of a volume that is compressed")
    add("--tolerance", type=float, help="instead: each voxel is within this of the input's")
    add("--relative-tolerance", type=float, help="the same, as a part of the range of values")
    add("--exact", action="store_true", help="instead: keep the bits of integers")
    add("--levels", type=int, help="levels of detail; 0: all")
    add("--host", default="127.0.0.1", help="to listen at; others than loopback are not encrypted")
    add("--port", type=int, default=0, help="0: a free one")
    add("--max-clients", type=int, default=16, help="that look at the same time")
    add("--no-browser", action="store_true", help="only print the URL")
    return parser


def _argument(parse: Any) -> Any:
    """argparse shows the text of this error alone."""

    def parsed(text: str) -> Any:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parsed


def main(argv: Sequence[str] | None = None) -> int:
    """The command `isowave view`. Returns its exit status."""
    arguments = make_parser().parse_args(argv)
    try:
        import isowave

        ways = ("rate", "tolerance", "relative_tolerance", "levels")
        given = {w: getattr(arguments, w) for w in ways if getattr(arguments, w) is not None}
        if arguments.exact:
            given["exact"] = True
        server = serve(
            isowave.open(arguments.volume, **given),
            title=Path(arguments.volume).name,
            isovalue=arguments.isovalue,
            device=arguments.device,
            memory_budget=arguments.memory_budget,
            size=arguments.size,
            max_clients=arguments.max_clients,
            host=arguments.host,
            port=arguments.port,
            open_browser=not arguments.no_browser,
        )
    except Exception as error:  # of the library, of the socket
        print(f"isowave view: {str(error).splitlines()[0]}", file=sys.stderr)
        return 1
    print(f"{server.url}\nCtrl-C ends it.", flush=True)
    if "SSH_CONNECTION" in os.environ:
        way = f"{server.port}:127.0.0.1:{server.port}"
        print(f"From your machine: ssh -N -L {way} {socket.gethostname()}", flush=True)
    failure = wait_and_close(server)
    if failure is not None:
        print(f"isowave view: {failure}", file=sys.stderr)
    return 0 if failure is None else 1


def wait_and_close(server: Server) -> str | None:
    """Serves until Ctrl-C; returns at once why it cannot, if so."""
    try:
        server.wait()
    except KeyboardInterrupt:
        pass
    failure = server.scene.failure
    server.close()
    return failure
