"""The viewer as a Jupyter widget: the same front end, through the kernel's channel. No ports.

A widget may be displayed several times, in several windows: each view has its own state.
"""

from __future__ import annotations

import asyncio
import base64
import queue
import threading
import time
from collections import OrderedDict
from dataclasses import replace
from typing import Any, Final

import anywidget
import traitlets

from isowave._image import WHITE
from isowave._request import Request, optional_color
from isowave._scene import Scene as VolumeScene

from .front_end import script
from .interfaces import SeriesLike, VolumeLike
from .protocol import Ack, ProtocolError, Wish
from .scene import Scene
from .session import Session, TooManyClients

STILL_SIZE: Final = (960, 540)  # of the first picture
STILL_SECONDS: Final = 3.0  # to draw it, before the widget is displayed
MAX_VIEWS: Final = 8  # of a widget; the one that was silent for longest makes room


class Widget(anywidget.AnyWidget):
    """A view of a scene.

    height  height of the widget [CSS pixels]
    still   the first picture, for pages without a kernel; empty until the widget is displayed
    """

    _esm = script()
    height = traitlets.Int(540, min=200, max=4000).tag(sync=True)
    still = traitlets.Bytes().tag(sync=True)

    def __init__(self, scene: Scene, first: Wish, **traits: Any) -> None:
        """first: what still shows; its isovalue is that of the scene."""
        super().__init__(**traits)
        self._scene, self._first, self._open = scene, first, True
        self._format = ""  # of still
        self._sessions: OrderedDict[str, Session] = OrderedDict()
        try:
            self._loop: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
        except RuntimeError:
            self._loop = None
        self.on_msg(self._receive)

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """With the first picture, which exported notebooks show."""
        bundle: Any = super()._repr_mimebundle_(**options)
        if not self.still and self._open:
            self._format, self.still = first_picture(self._scene, self._first)
        if self.still:
            data = bundle[0] if isinstance(bundle, tuple) else bundle
            data[f"image/{self._format}"] = base64.b64encode(self.still).decode()
        return bundle

    def _receive(self, widget: object, content: object, buffers: object) -> None:
        """Takes a message of a view: {"view": its name, "message": as in protocol.py}.

        Or "alive", which is answered at once; or None: the view is gone.
        """
        if not isinstance(content, dict) or content.keys() != {"view", "message"}:
            return
        view, message = content["view"], content["message"]
        if not isinstance(view, str) or not 1 <= len(view) <= 64:
            return
        if message == "alive":
            self._post(view, {"type": "alive"}, None)
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


def first_picture(scene: Scene, first: Wish) -> tuple[str, bytes]:
    """The wish's picture, and before it its format; after STILL_SECONDS the best so far, if any."""
    heard: queue.Queue[tuple[dict[str, Any], bytes | None]] = queue.Queue()
    client = scene.join(lambda head, data: heard.put((head, data)))
    best, end = ("", b""), time.monotonic() + STILL_SECONDS
    try:
        while client is not None:
            head, data = heard.get(timeout=max(0, end - time.monotonic()))
            if head["type"] == "welcome":
                request = replace(first.request, isovalue=head["isovalue"])
                scene.receive(client, replace(first, request=request))
            elif head["type"] == "picture" and data is not None:
                best = head["format"], data
                scene.receive(client, Ack(head["frame"]))
            if head.get("stage") == "lossless" or head["type"] == "error":
                break
    except queue.Empty:
        pass
    finally:
        if client is not None:
            scene.leave(client)
    return best


_lock = threading.Lock()
_scenes: dict[tuple[Any, ...], tuple[Scene, int]] = {}  # in use, and by how many widgets


def show(
    volume: VolumeLike | SeriesLike,
    *,
    height: int = 540,
    first: VolumeScene | None = None,
    **options: Any,
) -> Widget:
    """Shows a volume, or a series, in a widget.

    Widgets of one volume and the same options share a renderer.

    first    the scene of options["scene"]
    options  as for Scene
    """
    annotations = options.get("annotations")
    arguments: dict[str, Any] = {}
    if first is not None:
        annotations = annotations or first.annotations
        of_volume = {"field", "isovalue"}
        arguments = {n: each for n, each in first._arguments().items() if n not in of_volume}
    background = optional_color(arguments.get("background")) or WHITE
    arguments |= {
        "background": background,
        "size": STILL_SIZE,
        "transparent": False,
        "outputs": ("rgb",),
        "progress": False,
    }
    wish = Wish(1, Request(0.0, **arguments), annotations=annotations)
    same = {**options, "field": id(options.get("field"))}
    key = (id(volume), *sorted(same.items()))
    with _lock:
        scene, users = _scenes.get(key) or (Scene(volume, **options), 0)
        _scenes[key] = scene, users + 1
    return Widget(scene, wish, height=height)


def _release(scene: Scene) -> None:
    with _lock:
        for key, (other, users) in list(_scenes.items()):
            if other is scene:
                if users > 1:
                    _scenes[key] = scene, users - 1
                    return
                del _scenes[key]
    scene.close()
