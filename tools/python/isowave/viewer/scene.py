"""One renderer, many clients: who is drawn when, what is cancelled, what is sent.

    Session   a front end's connection: checks its messages, limits their rate
    Scene     the renderer, its clients, and the thread in which all is drawn

Of each client the newest wish counts; it cancels the frame of the one before. A wish is drawn in
stages: a first picture of a quarter of the width and height; the whole picture (sent as JPEG after
passes); once the client rests, the lossless picture (PNG), and what is certain of it. Clients take
turns, stage by stage; a long picture gives way to smaller ones between two passes. At most two
pictures are on the way to a client; of those that wait for it only the last is kept, and it is
always sent.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from isowave._camera import Camera

from .host import make_host
from .interfaces import ImageLike, ProgressLike, RendererLike, VolumeLike
from .pictures import Extent, Stopped, dividing_value, encode_jpeg, encode_png, share_within
from .protocol import Ack, Budget, Hello, Message, ProtocolError, TokenBucket, Wish
from .protocol import MAX_FLOAT32, MAX_RAYS, VERSION, check, first_line

MAX_IN_FLIGHT: Final = 2  # pictures on the way to a client
FIRST_DIVISOR: Final = 4  # of width and height, for the first picture
PASS_SECONDS: Final = 0.06  # between pictures of passes
SENDING_SHARE: Final = 4  # passes get so many times the time that their pictures take
SETTLE_SECONDS: Final = 0.1  # after a first picture, for the next wish to come before the whole
REST_SECONDS: Final = 0.12  # without a wish, until the lossless picture
CERTAIN_SECONDS: Final = 0.4  # after the lossless picture, until its bounds are looked for
GIVE_WAY_SECONDS: Final = 0.15  # of a picture, before smaller ones come between; then twice as long
TURN_SECONDS: Final = 5.0  # of a picture, at most, before smaller ones come between
QUICK_SECONDS: Final = 0.02  # a whole picture that needs no first one
SHOW_SECONDS: Final = 0.15  # without a picture, until what a cancelled one has is shown
HOST_SECONDS: Final = 0.5  # for a device to be ready, before the host draws meanwhile
GIVE_BACK_SECONDS: Final = 5.0  # without need of a large renderer, until a smaller one is made
CLOSE_SECONDS: Final = 0.5  # for threads to end; a pass may take longer
MAX_CAMERA_RAYS: Final = 1 << 24  # of them, from the camera: memory, and how long a pass takes
TOO_MANY_BUDGETS: Final = "the memory budget was changed too often: try again in a few seconds"

Post = Callable[[dict[str, Any], bytes | None], None]
"""Sends a message, and the bytes of a picture with it. Must not block, and may be called from any
thread."""


class Stage(Enum):
    """What is to be done next for a client's wish."""

    FIRST = "first"
    WHOLE = "whole"
    LOSSLESS = "lossless"
    ENCODING = "encoding"  # the lossless picture, in a thread of its own
    CERTAIN = "certain"
    DONE = "done"


@dataclass(eq=False)
class Client:
    """One front end's state. Only the scene changes it, under its lock."""

    post: Post
    wish: Wish | None = None
    stage: Stage = Stage.DONE
    camera: Camera | None = None  # of the wish, once it is known
    gave_way: int = 0  # how often the wish's whole picture was interrupted for another client
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

    largest: Extent  # of a picture
    memory_budget: int | None
    ambient: bool = False  # pictures may have ambient rays, which takes memory

    @property
    def rays(self) -> int:
        return self.largest.rays


@dataclass
class _Frame:
    """A frame that is being drawn."""

    client: Client
    wish: Wish
    stage: Stage
    camera: Camera
    began: float
    extent: Extent
    passes: int = 0
    percent: float = 0.0  # of its rays that have ended
    by_host: bool = False
    last_sent: float = -math.inf
    sending_took: float = 0.0  # seconds of the last picture of a pass
    stopped: bool = False


class Scene:
    """A volume's renderer and those who look at it.

    isovalue       at first; None: the one that divides the histogram best
    device         as in isowave.Renderer
    memory_budget  of device memory [bytes]; None: the library's default
    size, samples  the largest picture that the renderer is made for at first; it is made anew when
                   a client wants more
    max_clients    further ones are refused
    max_rays       of a client's picture: pixels x samples^2 x (1 + ambient). A larger one is drawn
                   with fewer pixels, then fewer ambient rays, and says so. Of the camera's rays
                   there are MAX_CAMERA_RAYS at most, or as many as `size` and `samples` have.
    make_host      a renderer that draws while the first one of the device is prepared, or None
    clock          seconds; tests replace it
    start          False: no thread; call step() instead, as tests do

    Raises ValueError, whose text is one line.
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
        max_rays: int = MAX_RAYS,
        make_host: Callable[[VolumeLike], RendererLike | None] = make_host,
        clock: Callable[[], float] = time.monotonic,
        start: bool = True,
    ) -> None:
        if isovalue is not None and not abs(isovalue) <= MAX_FLOAT32:
            raise ValueError(f"isovalue {isovalue}: give a number that is finite in float32")
        for name, limit in (("max_clients", max_clients), ("max_rays", max_rays)):
            if limit < 1:
                raise ValueError(f"{name} {limit}: give 1 or more")
        self._volume, self._isovalue, self._title = volume, isovalue, title
        self._device, self._max_clients = device, max_clients
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
        self._base = Extent(size, samples)  # of the first renderer
        self._wanted = RendererOptions(self._base, memory_budget)
        self._too_large_since: float | None = None  # the renderer, for what clients want
        self._max_rays = max_rays
        self._budgets = TokenBucket(1 / GIVE_BACK_SECONDS, 5, clock)  # each makes a renderer
        self._fallback: RendererOptions | None = None  # worked before
        self._host: RendererLike | None = None  # draws until there is a renderer
        self._ray_limit = self._first_ray_limit = max(MAX_CAMERA_RAYS, self._base.rays)
        self._may_have_ambient = True
        self._makes = False  # a renderer is being made
        self._threads: list[threading.Thread] = []
        self._has_threads = start
        if start:
            self._do(self._work)

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
            self._note_needs()
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
                if self._budgets.take():
                    self._want(replace(self._wanted, memory_budget=message.bytes))
                else:
                    self._post_error(client, RuntimeError(TOO_MANY_BUDGETS), None)
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

    @property
    def is_busy(self) -> bool:
        """After close(): whether a pass is being drawn, or a renderer made, to its end."""
        return any(thread.is_alive() for thread in self._threads)

    def close(self) -> None:
        """Ends the frame at hand, the threads and the renderer.

        A long pass ends later; so does a renderer that is being made, which is not waited for.
        """
        with self._changed:
            self._closing = True
            for client in list(self._clients):
                client.joined = False
            self._clients.clear()
            self._renderer = self._host = None  # a frame that is being drawn still holds it
            self._changed.notify_all()
            threads = [t for t in self._threads if t is not threading.current_thread()]
        end = time.monotonic() + CLOSE_SECONDS
        while any(t.is_alive() for t in threads) and not self._makes and time.monotonic() < end:
            time.sleep(0.005)

    def _do(self, work: Callable[[], None]) -> None:
        """Works in another thread, if the scene has threads."""
        if not self._has_threads:
            work()
            return
        thread = threading.Thread(target=work, name="isowave-viewer", daemon=True)
        with self._changed:
            self._threads = [t for t in self._threads if t.is_alive()]
            self._threads.append(thread)
            thread.start()

    # What follows runs in the scene's thread.

    def step(self) -> bool:
        """Does the next thing that is due, if any, and says whether there was one."""
        if not self._prepared:
            self._prepare()
            return True
        self._give_back()
        if self._must_make():
            self._make()
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
        self._make()  # meanwhile, the volume is looked at
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
        """Whether the renderer is another one than is wanted, and none is being made."""
        return not (self._made == self._wanted or self._failed or self._makes)

    def _make(self) -> None:
        """Replaces the renderer. Memory for two is rarely there: the old one goes first.

        Kernels may take long to compile: in another thread, and the host draws meanwhile.
        """
        with self._changed:
            self._makes, wanted = True, self._wanted
            self._renderer, self._made = None, None
            self._broadcast(self._status())
        self._do(lambda: self._make_renderer(wanted))
        if self._has_threads:
            self._do(self._make_host_renderer)

    def _make_host_renderer(self) -> None:
        def is_over() -> bool:
            return self._closing or not self._makes

        with self._changed:
            if self._host is not None or self._changed.wait_for(is_over, HOST_SECONDS):
                return
        try:
            host = self._make_host(self._volume)
        except Exception:  # there is not enough memory: then nothing is drawn meanwhile
            return
        with self._changed:
            if not is_over():
                self._host = host
                self._changed.notify_all()

    def _seconds_to_rest(self) -> float | None:
        due = [c.due for c in self._clients if self._may_begin(c)]
        if self._too_large_since is not None:
            due.append(self._too_large_since + GIVE_BACK_SECONDS)
        return max(0.0, min(due) - self._clock()) if due else None

    def _has_turn(self, client: Client) -> bool:
        return self._may_begin(client) and self._clock() >= client.due

    def _may_begin(self, client: Client) -> bool:
        """Whether there is what the client's stage needs, but for time."""
        if client.stage in (Stage.DONE, Stage.ENCODING, Stage.LOSSLESS):
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
        with self._changed:
            renderer = self._renderer or self._host
            extent = self._fitted(wish, stage)
        try:
            if stage is Stage.LOSSLESS:
                self._encode_lossless(client, wish)
            elif renderer is None:
                raise RuntimeError(self._failure)
            elif stage is Stage.CERTAIN:
                self._send_bounds(renderer, client, wish, extent)
            elif renderer is self._host or not self._grow(wish, stage):
                self._draw(renderer, client, wish, stage, extent)
        except Exception as error:  # of the library, or of its drivers
            self._wish_failed(client, wish, error)

    def _wish_failed(self, client: Client, wish: Wish, error: Exception) -> None:
        with self._changed:
            if client.joined and client.wish is wish:
                client.stage = Stage.DONE
                self._post_error(client, error, wish.id)

    def _draw(
        self, renderer: RendererLike, client: Client, wish: Wish, stage: Stage, extent: Extent
    ) -> None:
        began = self._clock()
        camera = client.camera or renderer.camera(wish.request.isovalue, wish.size)
        with self._changed:
            if client.wish is not wish:
                return
            client.camera = camera
        frame = _Frame(client, wish, stage, camera, began, extent, by_host=renderer is self._host)
        request = replace(
            wish.request,
            camera=camera,
            size=extent.size,
            samples=extent.samples,
            ambient=extent.ambient,
            on_pass=lambda so_far: self._on_pass(frame, so_far),
        )
        image = renderer.draw(request)
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
            is_overtaken = frame.by_host and self._renderer is not None  # by the device
            if self._is_stale(frame) or is_overtaken or self._gives_way(frame, now):
                frame.stopped = True
                return False
            for other in self._clients:
                if other.stage is Stage.LOSSLESS and other.wish is not None and now >= other.due:
                    self._encode_lossless(other, other.wish)
            # A large picture takes long to send: then passes get most of the time nevertheless.
            wait = max(PASS_SECONDS, SENDING_SHARE * frame.sending_took)
            worth_it = (
                frame.stage is Stage.WHOLE
                and now - max(frame.began, frame.last_sent) >= wait
                and self._in_flight(frame.client) < MAX_IN_FLIGHT
            )
        if worth_it:
            data = encode_jpeg(so_far.rgb)
            frame.last_sent = self._clock()
            frame.sending_took = frame.last_sent - now
            with self._changed:
                if not self._is_stale(frame):
                    self._offer(frame.client, self._head(frame, "pass"), data, keep=False)
        return True

    def _is_stale(self, frame: _Frame) -> bool:
        return frame.client.wish is not frame.wish or self._closing

    def _gives_way(self, frame: _Frame, now: float) -> bool:
        """A picture that takes long lets smaller ones of others come between, and is drawn anew.

        It is drawn twice as long each time before it gives way, up to TURN_SECONDS.
        """
        client = frame.client
        turn = min(GIVE_WAY_SECONDS * 2.0**client.gave_way, TURN_SECONDS)
        if frame.stage is not Stage.WHOLE or now - frame.began < turn:
            return False
        gives_way = any(
            other.wish is not None
            and other.stage in (Stage.FIRST, Stage.WHOLE)
            and self._has_turn(other)
            and self._fitted(other.wish, other.stage).all_rays < frame.extent.all_rays
            for other in self._clients
            if other is not client
        )
        client.gave_way += gives_way
        return gives_way

    def _show_what_there_is(self, frame: _Frame, image: ImageLike) -> None:
        """While wishes come faster than first pictures are made, parts of those are shown."""
        client = frame.client
        if frame.stage is not Stage.FIRST or self._clock() - client.shown < SHOW_SECONDS:
            return
        data = encode_jpeg(picture_of(image))
        with self._changed:
            if client.joined:
                self._offer(client, self._head(frame, "pass"), data, keep=False)

    def _encode_lossless(self, client: Client, wish: Wish) -> None:
        """In a thread of its own: large pictures take seconds."""
        with self._changed:
            made_of = client.lossless
            if client.wish is not wish or made_of is None:
                return
            client.stage, client.lossless = Stage.ENCODING, None
        self._do(lambda: self._send_lossless(client, wish, *made_of))

    def _send_lossless(
        self, client: Client, wish: Wish, head: dict[str, Any], rgb: NDArray[np.uint8]
    ) -> None:
        try:
            data = encode_png(rgb, lambda: client.wish is wish and not self._closing)
        except Stopped:
            return
        except Exception as error:
            self._wish_failed(client, wish, error)
            return
        with self._changed:
            if client.wish is wish:
                client.stage, client.due = Stage.CERTAIN, self._clock() + CERTAIN_SECONDS
                self._offer(client, {**head, "stage": "lossless", "format": "png"}, data, keep=True)
                self._changed.notify_all()

    def _send_bounds(
        self, renderer: RendererLike, client: Client, wish: Wish, extent: Extent
    ) -> None:
        """How far the surface may be off, by the rays of a first picture: bounds take time."""
        if client.camera is None:
            return
        pixels = extent.size[1] / wish.size[1]  # of the first picture, to one of the whole picture
        max_error = wish.request.max_error
        request = replace(
            wish.request,
            camera=client.camera,
            size=extent.size,
            samples=extent.samples,
            outputs=("depth", "bounds"),
            max_error=None if max_error is None else max_error * pixels,
            time_budget=None,
            ambient=0,
            on_pass=lambda so_far: client.wish is wish and not self._closing,
        )
        image = renderer.draw(request)
        with self._changed:
            if client.wish is wish:
                client.stage = Stage.DONE
                if image.depth is not None and image.bounds is not None and image.complete:
                    within = share_within(image.depth, image.bounds, pixels)
                    stated = bool(image.statistics["errors_are_stated"])
                    bounds = {"wish": wish.id, "within_pixel": within, "errors_are_stated": stated}
                    self._post(client, {"type": "bounds", **bounds})

    # Renderers.

    def _plan(self, wish: Wish) -> Extent:
        """The whole picture of a wish, as far as the server's limits and the memory allow it."""
        ambient = wish.request.ambient if self._may_have_ambient else 0
        return Extent(wish.size, wish.request.samples, ambient).within(
            self._ray_limit, self._max_rays
        )

    def _grow(self, wish: Wish, stage: Stage) -> bool:
        """Wants a renderer for more rays, or ambient ones, if the wish's picture has such."""
        wanted, plan = self._wanted, self._plan(wish)
        ambient = wanted.ambient or plan.ambient > 0
        if stage is Stage.FIRST or (plan.rays <= wanted.rays and ambient == wanted.ambient):
            return False
        largest = replace(plan, ambient=0) if plan.rays > wanted.rays else wanted.largest
        self._want(RendererOptions(largest, wanted.memory_budget, ambient))
        return True

    def _needed(self) -> RendererOptions:
        """The smallest renderer for what clients want now. The lock is held."""
        plans = [self._plan(client.wish) for client in self._clients if client.wish is not None]
        largest = max((self._base, *plans), key=lambda plan: plan.rays)
        ambient = any(plan.ambient > 0 for plan in plans)
        return RendererOptions(replace(largest, ambient=0), self._wanted.memory_budget, ambient)

    def _note_needs(self) -> None:
        """Notes since when the renderer is much larger than clients need. The lock is held."""
        needed, wanted = self._needed(), self._wanted
        fits = needed.rays > wanted.rays / 2 and needed.ambient >= wanted.ambient
        if fits:
            self._too_large_since = None
        elif self._too_large_since is None:
            self._too_large_since = self._clock()

    def _give_back(self) -> None:
        """Wants a smaller renderer if none of the clients has needed a large one for long."""
        with self._changed:
            since = self._too_large_since
            if since is not None and self._clock() >= since + GIVE_BACK_SECONDS:
                self._too_large_since = None
                self._want(self._needed())

    def _want(self, options: RendererOptions) -> None:
        with self._changed:
            if options.memory_budget != self._wanted.memory_budget:
                self._ray_limit, self._may_have_ambient = self._first_ray_limit, True
            self._wanted, self._failed = options, False
            self._note_needs()

    def _make_renderer(self, wanted: RendererOptions) -> None:
        try:
            renderer = self._volume.renderer(
                device=self._device,
                size=wanted.largest.size,
                samples=wanted.largest.samples,
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
            self._makes, self._host = False, None
            if self._closing:
                return
            self._renderer, self._made, self._fallback = renderer, wanted, wanted
            self._broadcast(self._status())
            self._changed.notify_all()

    def _renderer_failed(self, wanted: RendererOptions, error: Exception) -> None:
        """Goes back to what worked. Nothing did: waits for another budget."""
        with self._changed:
            self._makes = False
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

    def _fitted(self, wish: Wish, stage: Stage) -> Extent:
        """A stage's picture, within what the renderer was made for.

        The host, which draws before there is a renderer of the device, has no limits of its own.
        """
        made, plan = self._made, self._plan(wish)
        if stage is not Stage.WHOLE:
            width, height = (max(1, side // FIRST_DIVISOR) for side in wish.size)
            plan = Extent((width, height), 1)
        if made is None:
            return plan.within(self._ray_limit, self._max_rays)
        fitted = plan.within(made.rays, self._max_rays)
        return fitted if made.ambient else replace(fitted, ambient=0)

    # What is sent. The lock is held.

    def _take_wish(self, client: Client, wish: Wish) -> None:
        if client.wish is not None and wish.id <= client.wish.id:
            raise ProtocolError("the numbers of wishes must grow")
        skip_first = client.whole_seconds < QUICK_SECONDS or wish.request.time_budget is not None
        client.wish, client.camera = wish, wish.request.camera
        client.stage = Stage.WHOLE if skip_first else Stage.FIRST
        client.gave_way, client.lossless, client.due = 0, None, -math.inf
        self._note_needs()

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
            "reduced": self._reduced(frame),
            "notice": self._volume.isovalue_notice(frame.wish.request.isovalue),
            "complete": bool(image.complete),
            "passes": int(statistics["passes"]),
            "percent": 100.0,
            "decoded_blocks": int(statistics["decoded_blocks"]),
            "detail": _plain(statistics.get("detail")),
        }

    def _head(self, frame: _Frame, stage: str) -> dict[str, Any]:
        camera = frame.camera
        return {
            "type": "picture",
            "wish": frame.wish.id,
            "stage": stage,
            "format": "jpeg",
            "size": list(frame.extent.size),
            "samples": frame.extent.samples,
            "ambient": frame.extent.ambient,
            "reduced": None,
            "notice": "",
            "isovalue": frame.wish.request.isovalue,
            "camera": {
                "eye": list(camera.eye),
                "at": list(camera.at),
                "up": list(camera.up),
                "fovy_deg": camera.fovy,
            },
            "complete": False,
            "ms": round((self._clock() - frame.began) * 1e3, 2),
            "passes": frame.passes,
            "percent": frame.percent,
            "decoded_blocks": None,
            "detail": None,
        }

    def _reduced(self, frame: _Frame) -> str | None:
        """Why a whole picture has fewer rays than its wish, in one line; None: it has all."""
        wish, extent = frame.wish, frame.extent
        asked = Extent(wish.size, wish.request.samples, wish.request.ambient)
        if frame.stage is not Stage.WHOLE or extent == asked:
            return None
        why = "The device has no memory for more"
        if asked != asked.within(self._first_ray_limit, self._max_rays):
            of_camera = min(self._first_ray_limit, self._max_rays)
            why = f"The server draws at most {self._max_rays:,} rays, {of_camera:,} from the camera"
        width, height = extent.size
        rays, ambient = _count(extent.samples**2, "ray"), _count(extent.ambient, "ambient ray")
        return f"{why}: this picture has {width} x {height} pixels, {rays} a pixel, {ambient}."

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
            "notice": str(renderer.device["notice"]) if renderer else None,
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

    @property
    def has_joined(self) -> bool:
        """Whether the front end has said hello."""
        return self._client is not None

    def close(self) -> None:
        """Ends it. May be called twice."""
        self._closed = True
        if self._client is not None:
            self._scene.leave(self._client)
            self._client = None


class TooManyClients(ProtocolError):
    """The scene has as many clients as it may have."""


def picture_of(image: ImageLike) -> NDArray[np.uint8]:
    rgb = image.rgb
    assert rgb is not None  # it was asked for
    return rgb


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'s' * (number != 1)}"


def _finite(value: object) -> float | None:
    if isinstance(value, (int, float, np.number)) and math.isfinite(float(value)):
        return float(value)
    return None


def _plain(value: object) -> dict[str, Any] | None:
    """A dict of numbers and texts, without what JSON does not have."""
    if not isinstance(value, Mapping):
        return None
    return {str(key): v if isinstance(v, (bool, str)) else _finite(v) for key, v in value.items()}
