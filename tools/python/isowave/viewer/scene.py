"""One renderer, many clients: who is drawn when, what is cancelled, what is sent.

    Session   a front end's connection: checks its messages, limits their rate
    Scene     the renderer, its clients, and the thread in which all is drawn

Of each client the newest wish counts; it cancels the frame of the one before. A wish is drawn in
stages: a first picture of a quarter of the width and height; the whole picture (sent as JPEG after
passes); once the client rests, the lossless picture (PNG), and what is certain of it. Clients take
turns, stage by stage. At most two pictures are on the way to a client; of those that wait for it
only the last is kept, and it is always sent.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .host import make_host
from .interfaces import ImageLike, ProgressLike, RendererLike, VolumeLike
from .pictures import count_rays, dividing_value, encode_jpeg, encode_png, fit_size, share_within
from .protocol import Ack, Budget, Hello, Message, ProtocolError, TokenBucket, View, Wish
from .protocol import VERSION, check

MAX_IN_FLIGHT: Final = 2  # pictures on the way to a client
FIRST_DIVISOR: Final = 4  # of width and height, for the first picture
PASS_SECONDS: Final = 0.06  # between pictures of passes
SETTLE_SECONDS: Final = 0.1  # after a first picture, for the next wish to come before the whole
REST_SECONDS: Final = 0.12  # without a wish, until the lossless picture
CERTAIN_SECONDS: Final = 0.4  # after the lossless picture, until its bounds are looked for
GIVE_WAY_SECONDS: Final = 0.15  # of a whole picture, before others' first pictures come between
QUICK_SECONDS: Final = 0.02  # a whole picture that needs no first one
SHOW_SECONDS: Final = 0.15  # without a picture, until what a cancelled one has is shown
HOST_SECONDS: Final = 0.5  # for a device to be ready, before the host draws meanwhile
CLOSE_SECONDS: Final = 10.0  # for a pass, or a renderer that is being made, to end
MAX_RAYS: Final = 1 << 26  # of a picture

Post = Callable[[dict[str, Any], bytes | None], None]
"""Sends a message, and the bytes of a picture with it. Must not block, and may be called from any
thread."""


class Stage(Enum):
    """What is to be done next for a client's wish."""

    FIRST = "first"
    WHOLE = "whole"
    LOSSLESS = "lossless"
    CERTAIN = "certain"
    DONE = "done"


@dataclass(eq=False)
class Client:
    """One front end's state. Only the scene changes it, under its lock."""

    post: Post
    wish: Wish | None = None
    stage: Stage = Stage.DONE
    view: View | None = None  # of the wish, once it is known
    gave_way: bool = False  # the wish's whole picture was interrupted for another client
    due: float = -math.inf  # when the stage may begin
    lossless: tuple[dict[str, Any], NDArray[np.uint8]] | None = None  # what it is made of
    sent: int = 0  # pictures, numbered from 1
    acked: int = 0
    waiting: tuple[dict[str, Any], bytes] | None = None  # the last picture that was held back
    whole_seconds: float = math.inf  # of the last whole picture
    shown: float = -math.inf  # when the last picture was sent
    joined: bool = True


@dataclass(frozen=True)
class RendererOptions:
    """What the scene's renderer is made for."""

    size: tuple[int, int]
    samples: int
    memory_budget: int | None
    ambient: bool = False  # pictures may have ambient rays, which takes memory

    @property
    def rays(self) -> int:
        return count_rays(self.size, self.samples)


@dataclass
class _Frame:
    """A frame that is being drawn."""

    client: Client
    wish: Wish
    stage: Stage
    view: View
    began: float
    size: tuple[int, int]
    samples: int
    passes: int = 0
    percent: float = 0.0  # of its rays that have ended
    last_sent: float = field(default=-math.inf)
    stopped: bool = False


class Scene:
    """A volume's renderer and those who look at it.

    isovalue       at first; None: the one that divides the histogram best
    device         as in isowave.Renderer
    memory_budget  of device memory [bytes]; None: the library's default
    size, samples  the largest picture that the renderer is made for at first; it is made anew when
                   a client wants more
    max_clients    further ones are refused
    make_host      a renderer that draws while the first one of the device is prepared, or None
    clock          seconds; tests replace it
    start          False: no thread; call step() instead, as tests do
    """

    def __init__(
        self,
        volume: VolumeLike,
        *,
        isovalue: float | None = None,
        title: str = "",
        device: str | None = None,
        memory_budget: int | None = None,
        size: tuple[int, int] = (1920, 1080),
        samples: int = 1,
        max_clients: int = 16,
        make_camera: Callable[[View], Any] | None = None,
        make_host: Callable[[VolumeLike], RendererLike | None] = make_host,
        clock: Callable[[], float] = time.monotonic,
        start: bool = True,
    ) -> None:
        self._volume, self._isovalue, self._title = volume, isovalue, title
        self._device, self._max_clients = device, max_clients
        self._make_camera = make_camera or _isowave_camera
        self._make_host, self._clock = make_host, clock
        self._changed = threading.Condition()
        self._clients: list[Client] = []  # who comes next is in front
        self._closing = self._prepared = self._failed = False
        self._failure = ""  # why there is no renderer
        self._histogram: dict[str, Any] | None = None
        self._histogram_due = True
        self._range = (0.0, 1.0)
        self._renderer: RendererLike | None = None
        self._made: RendererOptions | None = None  # what the renderer was made for
        self._wanted = RendererOptions(size, samples, memory_budget)
        self._fallback: RendererOptions | None = None  # worked before
        self._host: RendererLike | None = None  # draws until there is a renderer
        self._making: threading.Thread | None = None  # the first renderer
        self._ray_limit, self._may_have_ambient = MAX_RAYS, True
        self._thread: threading.Thread | None = None
        if start:
            self._thread = threading.Thread(target=self._work, name="isowave-viewer", daemon=True)
            self._thread.start()

    # Called by transports, from any thread. None of these waits for a frame, except close().

    def join(self, post: Post) -> Client | None:
        """A new client, which gets messages by `post` from now on. None: there are too many."""
        with self._changed:
            if self._closing or len(self._clients) >= self._max_clients:
                return None
            client = Client(post)
            self._clients.append(client)
            self._post(client, self._status())
            if self._prepared:
                self._welcome(client)
            return client

    def leave(self, client: Client) -> None:
        """Forgets a client; its frame ends after the pass at hand."""
        with self._changed:
            client.joined = False
            client.wish = client.lossless = client.waiting = None
            client.stage = Stage.DONE
            if client in self._clients:
                self._clients.remove(client)
            self._changed.notify_all()

    def receive(self, client: Client, message: Message) -> None:
        """Takes a client's message. Raises ProtocolError."""
        with self._changed:
            if not client.joined:
                return
            if isinstance(message, Ack):
                self._acknowledge(client, message.frame)
            elif isinstance(message, Wish):
                self._take_wish(client, message)
            elif isinstance(message, Budget):
                self._want(replace(self._wanted, memory_budget=message.bytes))
            self._changed.notify_all()

    @property
    def num_clients(self) -> int:
        with self._changed:
            return len(self._clients)

    @property
    def failure(self) -> str | None:
        """Why no renderer could be made at all, in one line; None: one was, or will be."""
        with self._changed:
            return self._failure if self._failed and self._fallback is None else None

    def close(self) -> None:
        """Ends the frame at hand, the thread and the renderer."""
        with self._changed:
            self._closing = True
            for client in list(self._clients):
                client.joined = False
            self._clients.clear()
            self._changed.notify_all()
        if self._thread and self._thread is not threading.current_thread():
            self._thread.join(CLOSE_SECONDS)
        if self._making:
            self._making.join(CLOSE_SECONDS)
        self._renderer = self._host = None  # the thread's last frame may still hold it

    # What follows runs in the scene's thread.

    def step(self) -> bool:
        """Does the next thing that is due, if any, and says whether there was one."""
        if not self._prepared:
            self._prepare()
            return True
        if self._must_make():
            self._make_renderer()
            return True
        turn = self._next_turn()
        if turn is not None:
            self._serve(*turn)
            return True
        if self._histogram_due:
            self._make_histogram()
            return True
        return False

    def _work(self) -> None:
        self._begin()
        while True:
            with self._changed:
                if self._closing:
                    return
            if not self.step():
                with self._changed:
                    if not self._closing and not self._is_due():
                        self._changed.wait(self._seconds_to_rest())

    def _is_due(self) -> bool:
        return any(self._has_turn(client) for client in self._clients) or self._must_make()

    def _must_make(self) -> bool:
        """Whether the renderer is another one than is wanted, and nobody is at it."""
        is_made = self._made == self._wanted or self._failed
        return not is_made and (self._making is None or not self._making.is_alive())

    def _begin(self) -> None:
        """Kernels may take long to compile: in another thread, and the host draws meanwhile."""
        self._making = threading.Thread(target=self._make_renderer, daemon=True)
        self._making.start()
        self._prepare()
        self._making.join(HOST_SECONDS)
        if self._making.is_alive():
            try:
                host = self._make_host(self._volume)
            except Exception:  # there is not enough memory: then nothing is drawn meanwhile
                return
            with self._changed:
                if self._renderer is None and not self._failed:
                    self._host = host

    def _seconds_to_rest(self) -> float | None:
        due = [c.due for c in self._clients if self._may_begin(c)]
        return max(0.0, min(due) - self._clock()) if due else None

    def _has_turn(self, client: Client) -> bool:
        return self._may_begin(client) and self._clock() >= client.due

    def _may_begin(self, client: Client) -> bool:
        """Whether there is what the client's stage needs, but for time."""
        if client.stage in (Stage.DONE, Stage.LOSSLESS):
            return client.stage is Stage.LOSSLESS
        if self._renderer is not None or self._failed:
            return True
        return self._host is not None and client.stage is not Stage.CERTAIN

    def _next_turn(self) -> tuple[Client, Wish, Stage] | None:
        """The first client in the row that something is to be done for; it goes to the end."""
        with self._changed:
            for client in list(self._clients):
                if self._has_turn(client) and client.wish is not None:
                    self._clients.remove(client)
                    self._clients.append(client)
                    return client, client.wish, client.stage
        return None

    def _serve(self, client: Client, wish: Wish, stage: Stage) -> None:
        """One stage of a wish. Whatever goes wrong concerns this client alone."""
        renderer = self._renderer or self._host
        try:
            if stage is Stage.LOSSLESS:
                self._send_lossless(client, wish)
            elif renderer is None:
                raise RuntimeError(self._failure)
            elif stage is Stage.CERTAIN:
                self._send_bounds(renderer, client, wish)
            elif renderer is self._host or not self._grow(wish, stage):
                self._draw(renderer, client, wish, stage)
        except Exception as error:  # of the library, or of its drivers
            with self._changed:
                if client.joined and client.wish is wish:
                    client.stage = Stage.DONE
                    self._post_error(client, error, wish.id)

    def _draw(self, renderer: RendererLike, client: Client, wish: Wish, stage: Stage) -> None:
        began = self._clock()
        view = client.view or wish.view or home_view(renderer, wish)
        with self._changed:
            if client.wish is not wish:
                return
            client.view = view
        size, samples = self._fitted(wish, stage)
        frame = _Frame(client, wish, stage, view, began, size, samples)
        image = renderer.render(
            wish.isovalue,
            camera=self._make_camera(view),
            size=size,
            samples=samples,
            color=wish.color,
            background=wish.background,
            max_error=wish.max_error,
            outputs=("rgb",),
            time_budget=None if wish.time_budget is None else wish.time_budget / 1000,
            ambient=0 if stage is Stage.FIRST or not self._has_ambient() else wish.ambient,
            on_pass=lambda so_far: self._on_pass(frame, so_far),
        )
        if frame.stopped:
            self._show_what_there_is(frame, image)
            return
        rgb = picture_of(image)
        data = encode_jpeg(rgb)
        head = self._finished_head(frame, image)
        with self._changed:
            if self._is_stale(frame):
                return
            self._offer(client, head, data, keep=True)
            now = self._clock()
            if stage is Stage.FIRST:
                # A pass of a whole picture may be long: not while the next wish is on its way.
                settles = client.whole_seconds > SETTLE_SECONDS
                client.stage, client.due = Stage.WHOLE, now + (SETTLE_SECONDS if settles else 0)
            else:
                client.stage, client.due = Stage.LOSSLESS, now + REST_SECONDS
                client.lossless, client.whole_seconds = (head, rgb), now - frame.began

    def _on_pass(self, frame: _Frame, so_far: ProgressLike) -> bool:
        """Sends the picture so far where it is worth it. False: the frame is to stop."""
        frame.passes, frame.percent = so_far.passes, so_far.completed_percent
        now = self._clock()
        with self._changed:
            if self._is_stale(frame) or self._gives_way(frame, now):
                frame.stopped = True
                return False
            worth_it = (
                frame.stage is Stage.WHOLE
                and now - max(frame.began, frame.last_sent) >= PASS_SECONDS
                and self._in_flight(frame.client) < MAX_IN_FLIGHT
            )
        if worth_it:
            frame.last_sent = now
            data = encode_jpeg(so_far.rgb)
            with self._changed:
                if not self._is_stale(frame):
                    self._offer(frame.client, self._head(frame, "pass"), data, keep=False)
        return True

    def _is_stale(self, frame: _Frame) -> bool:
        return frame.client.wish is not frame.wish or self._closing

    def _gives_way(self, frame: _Frame, now: float) -> bool:
        """A whole picture lets others' first pictures come between, once."""
        client = frame.client
        if frame.stage is not Stage.WHOLE or client.gave_way:
            return False
        client.gave_way = now - frame.began >= GIVE_WAY_SECONDS and any(
            other.stage is Stage.FIRST for other in self._clients if other is not client
        )
        return client.gave_way

    def _show_what_there_is(self, frame: _Frame, image: ImageLike) -> None:
        """While wishes come faster than first pictures are made, parts of those are shown."""
        client = frame.client
        if frame.stage is not Stage.FIRST or self._clock() - client.shown < SHOW_SECONDS:
            return
        data = encode_jpeg(picture_of(image))
        with self._changed:
            if client.joined:
                self._offer(client, self._head(frame, "pass"), data, keep=False)

    def _send_lossless(self, client: Client, wish: Wish) -> None:
        with self._changed:
            made_of = client.lossless
        if made_of is None:
            return
        head, rgb = made_of
        data = encode_png(rgb)
        with self._changed:
            if client.wish is wish:
                client.stage, client.lossless = Stage.CERTAIN, None
                client.due = self._clock() + CERTAIN_SECONDS
                self._offer(client, {**head, "stage": "lossless", "format": "png"}, data, keep=True)

    def _send_bounds(self, renderer: RendererLike, client: Client, wish: Wish) -> None:
        """How far the surface may be off, by the rays of a first picture: bounds take time."""
        if client.view is None:
            return
        size, samples = self._fitted(wish, Stage.FIRST)
        pixels = size[1] / wish.size[1]  # of the first picture, to one of the whole picture
        image = renderer.render(
            wish.isovalue,
            camera=self._make_camera(client.view),
            size=size,
            samples=samples,
            color=wish.color,
            background=wish.background,
            outputs=("depth", "bounds"),
            max_error=None if wish.max_error is None else wish.max_error * pixels,
            time_budget=None,
            ambient=0,
            on_pass=lambda so_far: client.wish is wish and not self._closing,
        )
        with self._changed:
            if client.wish is wish:
                client.stage = Stage.DONE
                if image.depth is not None and image.bounds is not None and image.complete:
                    within = share_within(image.depth, image.bounds, pixels)
                    stated = bool(image.statistics["errors_are_stated"])
                    bounds = {"wish": wish.id, "within_pixel": within, "errors_are_stated": stated}
                    self._post(client, {"type": "bounds", **bounds})

    # Renderers.

    def _grow(self, wish: Wish, stage: Stage) -> bool:
        """Wants a renderer for more rays, or ambient ones, if the wish has such and may."""
        wanted = self._wanted
        more = wanted.rays < count_rays(wish.size, wish.samples) <= self._ray_limit
        ambient = wanted.ambient or (wish.ambient > 0 and self._may_have_ambient)
        if stage is Stage.FIRST or (not more and ambient == wanted.ambient):
            return False
        size, samples = (wish.size, wish.samples) if more else (wanted.size, wanted.samples)
        self._want(RendererOptions(size, samples, wanted.memory_budget, ambient))
        return True

    def _has_ambient(self) -> bool:
        """The host, which draws before there is a renderer of the device, always has."""
        return self._made is None or self._made.ambient

    def _want(self, options: RendererOptions) -> None:
        with self._changed:
            if options.memory_budget != self._wanted.memory_budget:
                self._ray_limit, self._may_have_ambient = MAX_RAYS, True
            self._wanted, self._failed = options, False

    def _make_renderer(self) -> None:
        """Replaces the renderer. Memory for two is rarely there: the old one goes first."""
        with self._changed:
            wanted = self._wanted
            self._renderer, self._made = None, None
            self._broadcast(self._status())
        try:
            renderer = self._volume.renderer(
                device=self._device,
                size=wanted.size,
                samples=wanted.samples,
                memory_budget=wanted.memory_budget,
                levels=self._volume.num_levels > 1,
                bounds=True,
                time_budget=True,
                rays=wanted.ambient,
            )
        except Exception as error:
            self._renderer_failed(wanted, error)
            return
        with self._changed:
            self._renderer, self._made, self._fallback = renderer, wanted, wanted
            self._host = None
            self._broadcast(self._status())
            self._changed.notify_all()

    def _renderer_failed(self, wanted: RendererOptions, error: Exception) -> None:
        """Goes back to what worked. Nothing did: waits for another budget."""
        with self._changed:
            fallback = self._fallback if self._fallback != wanted else None
            if self._wanted == wanted:
                self._failed, self._failure = fallback is None, first_line(error)
                self._host = None
                if fallback is not None:
                    self._wanted = fallback
                    if wanted.rays > fallback.rays:
                        self._ray_limit = fallback.rays
                    if wanted.ambient and not fallback.ambient:
                        self._may_have_ambient = False
            for client in list(self._clients):
                self._post_error(client, error, None)
            self._broadcast(self._status())
            self._changed.notify_all()

    def _fitted(self, wish: Wish, stage: Stage) -> tuple[tuple[int, int], int]:
        """Size and samples of a stage's picture, within what the renderer was made for."""
        if stage is Stage.FIRST:
            width, height = (max(1, side // FIRST_DIVISOR) for side in wish.size)
            return fit_size((width, height), 1, self._limit()), 1
        return fit_size(wish.size, wish.samples, self._limit()), wish.samples

    def _limit(self) -> int:
        return self._made.rays if self._made else MAX_RAYS

    # What is sent. The lock is held.

    def _take_wish(self, client: Client, wish: Wish) -> None:
        if client.wish is not None and wish.id <= client.wish.id:
            raise ProtocolError("the numbers of wishes must grow")
        skip_first = client.whole_seconds < QUICK_SECONDS or wish.time_budget is not None
        client.wish, client.view = wish, wish.view
        client.stage = Stage.WHOLE if skip_first else Stage.FIRST
        client.gave_way, client.lossless, client.due = False, None, -math.inf

    def _acknowledge(self, client: Client, frame: int) -> None:
        if frame > client.sent:
            raise ProtocolError("a picture was acknowledged that was not sent")
        client.acked = max(client.acked, frame)
        if client.waiting is not None and self._in_flight(client) < MAX_IN_FLIGHT:
            (head, data), client.waiting = client.waiting, None
            self._send(client, head, data)

    @staticmethod
    def _in_flight(client: Client) -> int:
        return client.sent - client.acked

    def _offer(self, client: Client, head: dict[str, Any], data: bytes, *, keep: bool) -> None:
        """Sends a picture, or holds it back while two are on the way. Not kept: leaves it out."""
        if self._in_flight(client) < MAX_IN_FLIGHT:
            client.waiting = None
            self._send(client, head, data)
        elif keep:
            client.waiting = head, data

    def _send(self, client: Client, head: dict[str, Any], data: bytes) -> None:
        client.sent += 1
        client.shown = self._clock()
        self._post(client, {**head, "frame": client.sent}, data)

    def _finished_head(self, frame: _Frame, image: ImageLike) -> dict[str, Any]:
        statistics = image.statistics
        return {
            **self._head(frame, frame.stage.value),
            "complete": bool(image.complete),
            "passes": int(statistics["passes"]),
            "percent": 100.0,
            "decoded_blocks": int(statistics["decoded_blocks"]),
            "detail": _plain(statistics.get("detail")),
        }

    def _head(self, frame: _Frame, stage: str) -> dict[str, Any]:
        view = frame.view
        return {
            "type": "picture",
            "wish": frame.wish.id,
            "stage": stage,
            "format": "jpeg",
            "size": list(frame.size),
            "samples": frame.samples,
            "isovalue": frame.wish.isovalue,
            "camera": {
                "eye": list(view.eye),
                "at": list(view.at),
                "up": list(view.up),
                "fovy_deg": view.fovy,
            },
            "complete": False,
            "ms": round((self._clock() - frame.began) * 1e3, 2),
            "passes": frame.passes,
            "percent": frame.percent,
            "decoded_blocks": None,
            "detail": None,
        }

    def _post_error(self, client: Client, error: Exception, wish: int | None) -> None:
        self._post(client, {"type": "error", "wish": wish, "message": first_line(error)})

    def _broadcast(self, head: dict[str, Any]) -> None:
        for client in list(self._clients):
            self._post(client, head)

    def _post(self, client: Client, head: dict[str, Any], data: bytes | None = None) -> None:
        """Sends. A client whose transport fails is gone."""
        try:
            client.post(head, data)
        except Exception:  # whatever transports raise
            self.leave(client)

    def _status(self) -> dict[str, Any]:
        renderer = self._renderer
        state = "ready" if renderer else "failed" if self._failed else "starting"
        return {
            "type": "status",
            "state": state,
            "device": str(renderer.device["name"]) if renderer else None,
            "memory_bytes": int(renderer.memory_bytes) if renderer else None,
            "device_memory": int(renderer.device["memory_bytes"]) if renderer else None,
            "memory_budget": self._wanted.memory_budget,
            "nbytes": int(self._volume.nbytes),
        }

    def _welcome(self, client: Client) -> None:
        volume = self._volume
        self._post(
            client,
            {
                "type": "welcome",
                "version": VERSION,
                "title": self._title,
                "shape": [int(n) for n in volume.shape],
                "spacing": [float(s) for s in volume.spacing],
                "dtype": str(volume.source_dtype),
                "range": list(self._range),
                "bits_per_voxel": float(volume.bits_per_voxel),
                "max_error": _finite(volume.max_error),
                "isovalue": self._isovalue,
            },
        )
        if self._histogram is not None:
            self._post(client, self._histogram)

    # What is known of the volume before the first picture.

    def _prepare(self) -> None:
        low, high = (float(v) for v in self._volume.value_range)
        known = math.isfinite(low) and math.isfinite(high)
        if self._isovalue is None or not known:
            self._make_histogram()
        if known:
            self._range = low, high
        if self._isovalue is None:
            self._isovalue = (self._range[0] + self._range[1]) / 2
            if self._histogram is not None:
                self._isovalue = dividing_value(self._histogram["counts"], *self._range)
        with self._changed:
            self._prepared = True
            for client in list(self._clients):
                self._welcome(client)

    def _make_histogram(self) -> None:
        """Without one the viewer works, too: the slider then has no bars."""
        self._histogram_due = False
        try:
            counts, edges = self._volume.histogram(bins=256)
        except Exception as error:
            with self._changed:
                for client in list(self._clients):
                    self._post_error(client, error, None)
            return
        message = {
            "type": "histogram",
            "counts": [int(n) for n in counts],
            "range": [float(edges[0]), float(edges[-1])],
        }
        with self._changed:
            self._histogram = message
            if self._prepared:
                self._broadcast(message)
            else:
                self._range = float(edges[0]), float(edges[-1])


class Session:
    """A front end's connection, whatever carries it.

    post    as Client's
    rate    messages a second; burst: at once
    """

    def __init__(
        self,
        scene: Scene,
        post: Post,
        *,
        rate: float = 250,
        burst: float = 500,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._scene, self._post = scene, post
        self._bucket = TokenBucket(rate, burst, clock)
        self._client: Client | None = None
        self._closed = False

    def receive(self, content: object) -> None:
        """Takes a message's JSON object. Raises ProtocolError: close the connection then."""
        if self._closed:
            return
        if not self._bucket.take():
            raise ProtocolError("too many messages")
        message = check(content)
        if isinstance(message, Hello):
            if self._client is not None:
                raise ProtocolError("a second hello")
            self._client = self._scene.join(self._post)
            if self._client is None:
                raise TooManyClients("too many clients are connected; close another one first")
        elif self._client is None:
            raise ProtocolError("the first message must be hello")
        else:
            self._scene.receive(self._client, message)

    def close(self) -> None:
        """Ends it. May be called twice."""
        self._closed = True
        if self._client is not None:
            self._scene.leave(self._client)
            self._client = None


class TooManyClients(ProtocolError):
    """The scene has as many clients as it may have."""


def home_view(renderer: RendererLike, wish: Wish) -> View:
    """The view in which the surface fills the picture."""
    camera = renderer.camera(wish.isovalue, wish.size)
    return View(camera.eye, camera.at, camera.up, camera.fovy)


def picture_of(image: ImageLike) -> NDArray[np.uint8]:
    rgb = image.rgb
    assert rgb is not None  # it was asked for
    return rgb


def first_line(error: Exception) -> str:
    """What an error says, in one line of bounded length."""
    lines = str(error).strip().splitlines()
    return (lines[0] if lines else type(error).__name__)[:500]


def _isowave_camera(view: View) -> Any:
    import isowave

    return isowave.Camera(view.eye, view.at, view.up, view.fovy)


def _finite(value: object) -> float | None:
    if isinstance(value, (int, float, np.number)) and math.isfinite(float(value)):
        return float(value)
    return None


def _plain(value: object) -> dict[str, Any] | None:
    """A dict of numbers and texts, without what JSON does not have."""
    if not isinstance(value, Mapping):
        return None
    return {str(key): v if isinstance(v, (bool, str)) else _finite(v) for key, v in value.items()}
