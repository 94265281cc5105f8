"""The viewer as a Jupyter widget: the same front end, through the kernel's channel. No ports.

A widget may be displayed several times, in several windows: each view has its own state.
"""

from __future__ import annotations

import asyncio
import threading
from collections import OrderedDict
from typing import Any, Final

import anywidget
import traitlets

from .front_end import script
from .interfaces import SeriesLike, VolumeLike
from .protocol import ProtocolError
from .scene import Scene
from .session import Session, TooManyClients

MAX_VIEWS: Final = 8  # of a widget; the one that was silent for longest makes room


class Widget(anywidget.AnyWidget):
    """A view of a scene.

    height  height of the widget [CSS pixels]
    """

    _esm = script()
    height = traitlets.Int(540, min=200, max=4000).tag(sync=True)

    def __init__(self, scene: Scene, **traits: Any) -> None:
        super().__init__(**traits)
        self._scene, self._open = scene, True
        self._sessions: OrderedDict[str, Session] = OrderedDict()
        try:
            self._loop: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
        except RuntimeError:
            self._loop = None
        self.on_msg(self._receive)

    def _receive(self, widget: object, content: object, buffers: object) -> None:
        """Takes a message of a view: {"view": its name, "message": as in protocol.py}."""
        if not isinstance(content, dict) or content.keys() != {"view", "message"}:
            return
        view, message = content["view"], content["message"]
        if not isinstance(view, str) or not 1 <= len(view) <= 64:
            return
        hello = isinstance(message, dict) and message.get("type") == "hello"
        if message is None or hello:
            self._forget(view)
        if message is None:  # the view is gone
            return
        session = self._sessions.get(view) or (self._new_session(view) if hello else None)
        if session is None:
            return
        self._sessions.move_to_end(view)
        try:
            session.receive(message)
        except ProtocolError as error:
            self._forget(view)
            retry = isinstance(error, TooManyClients)
            self._post(view, {"type": "closed", "retry": retry, "message": str(error)}, None)

    def _new_session(self, view: str) -> Session:
        while len(self._sessions) >= MAX_VIEWS:
            self._forget(next(iter(self._sessions)))
        session = Session(self._scene, lambda head, data: self._post(view, head, data))
        self._sessions[view] = session
        return session

    def _forget(self, view: str) -> None:
        session = self._sessions.pop(view, None)
        if session is not None:
            session.close()

    def _post(self, view: str, head: dict[str, Any], data: bytes | None) -> None:
        """Sends from the kernel's own thread, to which its sockets belong, and in order."""
        arguments = {"view": view, "message": head}, [data] if data is not None else []
        if self._loop is None:
            self.send(*arguments)
        else:
            self._loop.call_soon_threadsafe(self.send, *arguments)

    def close(self) -> None:
        """Removes the widget from all pages and releases its scene."""
        for view in list(self._sessions):
            self._forget(view)
        super().close()
        if self._open:
            self._open = False
            _release(self._scene)


_lock = threading.Lock()
_scenes: dict[tuple[Any, ...], tuple[Scene, int]] = {}  # in use, and by how many widgets


def show(volume: VolumeLike | SeriesLike, *, height: int = 540, **options: Any) -> Widget:
    """Shows a volume, or a series, in a widget.

    Widgets of one volume and the same options share a renderer.

    options  as for Scene
    """
    same = {**options, "field": id(options.get("field"))}
    key = (id(volume), *sorted(same.items()))
    with _lock:
        scene, users = _scenes.get(key) or (Scene(volume, **options), 0)
        _scenes[key] = scene, users + 1
    return Widget(scene, height=height)


def _release(scene: Scene) -> None:
    with _lock:
        for key, (other, users) in list(_scenes.items()):
            if other is scene:
                if users > 1:
                    _scenes[key] = scene, users - 1
                    return
                del _scenes[key]
    scene.close()
