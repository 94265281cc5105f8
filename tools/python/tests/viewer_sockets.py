"""A server with a volume that needs no device, and clients at its socket."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from viewer_fakes import PLAIN_WISH, FakeVolume
from websockets.sync.client import ClientConnection, connect

from isowave.viewer.protocol import VERSION
from isowave.viewer.scene import Scene
from isowave.viewer.server import Limits, Server


TIMEOUT = 60  # seconds; for machines that are busy with other things


HELLO = json.dumps({"type": "hello", "version": VERSION})


def wish_text(wish_id: int, isovalue: float = 80) -> str:
    return json.dumps(PLAIN_WISH | {"id": wish_id, "isovalue": isovalue})


@contextmanager
def serving(volume: FakeVolume | None = None, **options: Any) -> Iterator[Server]:
    limits = options.pop("limits", Limits())
    scene = Scene(
        volume or FakeVolume(),
        isovalue=80,
        size=(64, 48),
        **options,
    )
    with Server(scene, limits=limits) as server:
        yield server


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
