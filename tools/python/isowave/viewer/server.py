"""The viewer in a browser: a page and a websocket, for those who know the token in the URL.

    GET /TOKEN/          the page            GET /TOKEN/view.js   what it runs
        /TOKEN/ws        the websocket: messages as text; of the server also pictures, as bytes:
                         4 bytes length of the head (little endian), the head (JSON), the picture
        /CODE            leads to the page, once: for a browser whose command line others can see

Anything else, a wrong token and a foreign Origin are answered with 403.

Connections without the token have places of their own. If these are full, the oldest such
connection ends. So connections without the token never keep out those with it.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import secrets
import struct
import threading
import webbrowser
from collections.abc import Coroutine
from dataclasses import dataclass
from importlib import resources
from typing import Any, Final

from websockets.frames import Frame, Opcode
from websockets.http11 import Request as Handshake
from websockets.protocol import State
from websockets.server import ServerProtocol

from .door import HEADERS, Door, Refused, Request, answer, hand_over, parse_head, read_head
from .front_end import script
from .interfaces import SeriesLike, VolumeLike
from .protocol import MAX_MESSAGE_BYTES, ProtocolError, parse
from .scene import Scene
from .session import Session, TooManyClients

POLICY: Final = (
    "default-src 'none'; script-src 'self'; connect-src 'self' ws://{host} wss://{host}; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
CLOSE_SECONDS: Final = 0.3  # for clients to hear that the server ends
# Close codes of RFC 6455 and its registry.
GOING_AWAY, UNSUPPORTED_DATA, INVALID_DATA = 1001, 1003, 1007
POLICY_VIOLATION, TRY_AGAIN_LATER = 1008, 1013
NOT_READ: Final = "the client does not read what it is sent"


@dataclass(frozen=True)
class Limits:
    """Limits that a server sets to its clients.

    message_rate, message_burst  most messages of a client a second, and at once
    queue           most messages that wait to be sent to a client; a client with more is gone
    connections     most connections with the token at the same time
    strangers       most connections without the token; if one more comes, the oldest ends
    head_seconds    time for the whole head of a request
    answer_seconds  time in which a client takes an answer, or closes a websocket that ends
    hello_seconds   time from the websocket's beginning to the client's hello
    idle_seconds    time in which a client reads something that it is sent, or answers a ping; also
                    the time between pings
    """

    message_rate: float = 250
    message_burst: float = 500
    queue: int = 64
    connections: int = 64
    strangers: int = 256
    head_seconds: float = 5
    answer_seconds: float = 2
    hello_seconds: float = 5
    idle_seconds: float = 20


class Server:
    """Serves a scene from a thread of its own, until close().

    host, port  address to listen at; port 0: a free one
    listener    a socket that listens there already, or None
    token       lets its holders look; None: a random one of 192 bits

    Raises OSError or ValueError, whose text is one line, if it cannot listen there.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        listener: socket.socket | None = None,
        token: str | None = None,
        limits: Limits = Limits(),
    ) -> None:
        self.scene, self._limits = scene, limits
        self.token = token or secrets.token_urlsafe(24)
        self._door = Door(self.token)
        self._socket = listener or _listen(host, port)
        self.host, self.port = host, int(self._socket.getsockname()[1])
        self._strangers: dict[asyncio.StreamWriter, None] = {}  # the oldest is in front
        self._known = set[asyncio.StreamWriter]()
        self._talks = set[_Connection]()
        self._tasks = set[asyncio.Task[None]]()
        self._loop, self._stop = asyncio.new_event_loop(), asyncio.Event()
        self._loop.set_exception_handler(_report)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="isowave-server", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page. Everyone with this address may look at the volume."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/{self.token}/"

    def url_for_once(self) -> str:
        """A URL that leads to the page the first time that it is opened."""
        return self.url.removesuffix(f"{self.token}/") + self._door.make_code()

    def __repr__(self) -> str:
        return f"isowave viewer at {self.url}"

    def wait(self) -> None:
        """Returns when the server has ended, or no renderer could be made.

        Raises KeyboardInterrupt.
        """
        # Ctrl-C in Thread.join() lets Python 3.11 take a thread that runs for one that has ended.
        while not self._ended.wait(0.5) and self.scene.failure is None:
            pass

    def close(self) -> None:
        """Ends server and scene. May be called twice."""
        try:
            self._loop.call_soon_threadsafe(self._stop.set)
        except RuntimeError:  # it has ended
            pass
        self.scene.close()
        self._ended.wait()
        self._thread.join()
        self._socket.close()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    # What follows runs in the server's thread.

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()
            self._ended.set()

    async def _serve(self) -> None:
        listener = await asyncio.start_server(self._take, sock=self._socket, backlog=128)
        await self._stop.wait()
        listener.close()
        for talk in self._talks:
            talk.end(GOING_AWAY, "the server ends")
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=CLOSE_SECONDS)
        for task in self._tasks:
            task.cancel()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=CLOSE_SECONDS)

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serves one connection, from its beginning to its end."""
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        self._strangers[writer] = None
        if len(self._strangers) > self._limits.strangers:
            oldest = next(iter(self._strangers))
            del self._strangers[oldest]
            oldest.transport.abort()
        try:
            await self._answer(reader, writer)
        except (asyncio.TimeoutError, EOFError, OSError):  # the client is gone, or too slow
            pass
        finally:
            self._strangers.pop(writer, None)
            self._known.discard(writer)
            self._tasks.discard(task)
            writer.transport.abort()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with_body = True
        try:
            head, rest = await self._read_head(reader)
            request = parse_head(head)
            with_body = request.method != "HEAD"
            self._admit(request, writer)
            if request.path == f"/{self.token}/ws":
                protocol = _shake_hands(head)
                talk = _Connection(self.scene, self._limits, protocol, reader, writer)
                self._talks.add(talk)
                try:
                    await talk.run(rest)
                finally:
                    self._talks.discard(talk)
                return
            data = self._file(request, with_body)
        except Refused as refused:
            text = f"isowave: {refused}\n".encode()
            data = answer(refused.status, text, with_body=with_body, **refused.headers)
        await hand_over(reader, writer, data, self._limits.answer_seconds)

    async def _read_head(self, reader: asyncio.StreamReader) -> tuple[bytes, bytes]:
        try:
            return await asyncio.wait_for(read_head(reader), self._limits.head_seconds)
        except asyncio.TimeoutError:
            raise Refused(408) from None

    def _admit(self, request: Request, writer: asyncio.StreamWriter) -> None:
        """Gives a connection with the token a place. Raises Refused."""
        if self._door.takes_code(request):
            raise Refused(303, Location=f"/{self.token}/")
        if not self._door.may_enter(request):
            raise Refused(403)
        if len(self._known) >= self._limits.connections:
            raise Refused(503, Retry_After="1")
        self._strangers.pop(writer, None)
        self._known.add(writer)
        if request.method not in ("GET", "HEAD"):
            raise Refused(405, Allow="GET, HEAD")
        if request.has_body:
            raise Refused(413)

    def _file(self, request: Request, with_body: bool) -> bytes:
        name = request.path.removeprefix(f"/{self.token}/")
        if name == "":
            policy = POLICY.format(host=request.only("host"))
            page, kind = _read_page(), "text/html; charset=utf-8"
            return answer(200, page, kind, with_body=with_body, Content_Security_Policy=policy)
        if name == "view.js":
            kind = "text/javascript; charset=utf-8"
            return answer(200, script().encode(), kind, with_body=with_body)
        raise Refused(403)


def _report(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Ignores failures of sockets: a connection that cannot be accepted waits."""
    if not isinstance(context.get("exception"), OSError):
        loop.default_exception_handler(context)


def _shake_hands(head: bytes) -> ServerProtocol:
    """Returns a websocket whose answer is still to be sent. Raises Refused."""
    protocol = ServerProtocol(max_size=MAX_MESSAGE_BYTES)
    protocol.receive_data(head)
    events = protocol.events_received()
    if len(events) != 1 or not isinstance(events[0], Handshake):
        raise Refused(400)
    response = protocol.accept(events[0])
    if response.status_code == 426:
        raise Refused(426, Upgrade="websocket", Connection="Upgrade, close")
    if response.status_code != 101:
        raise Refused(400)
    for name, value in HEADERS.items():
        response.headers[name] = value
    protocol.send_response(response)
    return protocol


class _Ended(Exception):
    """A websocket that is to be closed; code None: it is closed, or cannot be any more."""

    def __init__(self, code: int | None = None, reason: str = "") -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


class _Connection:
    """A websocket and its session. Ends with whichever of its tasks ends first."""

    def __init__(
        self,
        scene: Scene,
        limits: Limits,
        protocol: ServerProtocol,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        self._limits, self._protocol = limits, protocol
        self._reader, self._writer = reader, writer
        self._loop = asyncio.get_running_loop()
        self._queue: asyncio.Queue[tuple[dict[str, Any], bytes | None]] = asyncio.Queue()
        self._end: asyncio.Future[_Ended] = self._loop.create_future()
        self._message = bytearray()  # fragments so far
        self._heard = True  # something came since the last ping
        self._drains = asyncio.Lock()  # Python 3.10 lets only one task wait for a writer
        self._session = Session(
            scene, self._post, rate=limits.message_rate, burst=limits.message_burst
        )

    def end(self, code: int | None = None, reason: str = "") -> None:
        """Lets run() close the websocket, with the first code that is given."""
        if not self._end.done():
            self._end.set_result(_Ended(code, reason))

    async def run(self, begun: bytes) -> None:
        """Runs the connection. begun: bytes that came behind the handshake's head."""
        works = (self._read(begun), self._write(), self._ping())
        tasks = [asyncio.create_task(self._until_end(work)) for work in works]
        timer = self._loop.call_later(self._limits.hello_seconds, self._expect_hello)
        try:
            ended = await self._end
        finally:
            timer.cancel()
            self._session.close()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        if self._protocol.state is State.OPEN and ended.code is not None:
            self._protocol.send_close(ended.code, ended.reason)
        data = b"".join(self._protocol.data_to_send())
        await hand_over(self._reader, self._writer, data, self._limits.answer_seconds)

    async def _until_end(self, work: Coroutine[Any, Any, None]) -> None:
        # Before Python 3.12, wait_for() may lose a cancellation: the works look at _end, too.
        try:
            await work
        except _Ended as ended:
            self.end(ended.code, ended.reason)
        except ProtocolError as error:
            code = TRY_AGAIN_LATER if isinstance(error, TooManyClients) else POLICY_VIOLATION
            # A reason has at most 123 bytes.
            self.end(code, str(error).encode()[:123].decode(errors="ignore"))
        except OSError:
            pass
        finally:
            self.end()

    def _expect_hello(self) -> None:
        if not self._session.has_joined:
            self.end(POLICY_VIOLATION, "no hello came in time")

    def _post(self, head: dict[str, Any], data: bytes | None) -> None:
        # Raises RuntimeError when the loop has ended; the scene then forgets the client.
        self._loop.call_soon_threadsafe(self._enqueue, head, data)

    def _enqueue(self, head: dict[str, Any], data: bytes | None) -> None:
        if self._queue.qsize() < self._limits.queue:
            self._queue.put_nowait((head, data))
        else:
            self.end(POLICY_VIOLATION, NOT_READ)

    async def _read(self, data: bytes) -> None:
        while not self._end.done():
            self._heard = True
            self._protocol.receive_data(data)
            for event in self._protocol.events_received():
                assert isinstance(event, Frame)
                self._take(event)
            await self._flush()  # answers to pings and to a close
            if self._protocol.state is not State.OPEN:
                raise _Ended
            data = await self._reader.read(65536)
            if not data:
                raise _Ended

    def _take(self, frame: Frame) -> None:
        if frame.opcode is Opcode.BINARY:
            raise _Ended(UNSUPPORTED_DATA, "messages must be text")
        if frame.opcode not in (Opcode.TEXT, Opcode.CONT):
            return
        self._message += frame.data  # the protocol limits the sum
        if frame.fin:
            try:
                text = self._message.decode()
            except UnicodeDecodeError:
                raise _Ended(INVALID_DATA, "messages must be UTF-8") from None
            self._message.clear()
            self._session.receive(parse(text))

    async def _write(self) -> None:
        while not self._end.done():
            head, data = await self._queue.get()
            encoded = json.dumps(head, allow_nan=False).encode()
            if data is None:
                self._protocol.send_text(encoded)
            else:
                size = struct.pack("<I", len(encoded))
                self._protocol.send_binary(size + encoded + data)
            await self._flush()

    async def _ping(self) -> None:
        while not self._end.done():
            await asyncio.sleep(self._limits.idle_seconds)
            if not self._heard and self._writer.transport.get_write_buffer_size() == 0:
                raise _Ended(POLICY_VIOLATION, "the client does not answer")
            self._heard = False
            self._protocol.send_ping(b"")
            await self._flush()

    async def _flush(self) -> None:
        """Sends what the protocol has, and waits while the client reads it, however slowly."""
        self._writer.write(b"".join(self._protocol.data_to_send()))
        async with self._drains:
            while True:
                left = self._writer.transport.get_write_buffer_size()
                try:
                    await asyncio.wait_for(self._writer.drain(), self._limits.idle_seconds)
                    return
                except asyncio.TimeoutError:
                    if self._writer.transport.get_write_buffer_size() >= left:
                        raise _Ended(POLICY_VIOLATION, NOT_READ) from None


def _read_page() -> bytes:
    return resources.files(__package__).joinpath("page.html").read_bytes()


def _listen(host: str, port: int) -> socket.socket:
    """Raises OSError or ValueError, whose text is one line."""
    if not 0 <= port <= 65535:
        raise ValueError(f"port {port}: give one from 1 to 65535, or 0 for a free one")
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
    volume: VolumeLike | SeriesLike,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    open_browser: bool = True,
    **options: Any,
) -> Server:
    """Serves a view of a volume, or of a series, and opens it in a browser, if there is a display.

    options  as for Scene: isovalue, title, device, memory_budget, size, samples, max_clients,
             max_rays
    """
    listener = _listen(host, port)  # before a renderer is made, which takes long
    try:
        scene = Scene(volume, **options)
    except Exception:
        listener.close()
        raise
    server = Server(scene, host=host, port=port, listener=listener)
    # Without a display, Python would open a browser of the terminal.
    if open_browser and has_display():
        url = server.url_for_once()
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
    return server


def has_display() -> bool:
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))


def wait_and_close(server: Server) -> str | None:
    """Serves until Ctrl-C. If it cannot serve, returns the reason at once."""
    try:
        server.wait()
    except KeyboardInterrupt:
        pass
    failure = server.scene.failure
    try:
        server.close()
    except KeyboardInterrupt:  # once more
        pass
    return failure
