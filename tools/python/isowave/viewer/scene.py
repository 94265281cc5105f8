"""One renderer, many clients: draws their wishes, stage by stage, in turns.

    Turns (turns.py)          clients, and whose picture is next
    Renderers (renderers.py)  the renderer, made for what clients want
    Steps (steps.py)          volumes of a series
    Scene                     the thread in which all is drawn
    Session (session.py)      a front end's connection

The newest wish of a client counts; it cancels the frame before. A wish is drawn in stages: a first
picture, a quarter as wide and high; if it asks for more than a ray a pixel, a sharp picture of
one; the whole picture (JPEG, after passes over the first); once the client rests, the lossless
picture (PNG), and what is certain of it. A picture that a time has left coarse is drawn to its end
before. Clients take turns; a long picture gives way to smaller ones between passes. At most two
pictures are on the way to a client; the last of those that wait is kept, and always sent.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from isowave._annotate import Annotations
from isowave._camera import Camera
from isowave._checked import Isovalue
from isowave._color_map import ColorMap

from . import messages
from .interfaces import ImageLike, ProgressLike, RendererLike, SeriesLike, VolumeLike
from .hits import Hits, seen
from .jpeg import encode_jpeg
from .page_files import page_maker
from .pictures import Extent, Stopped, annotate, chosen_voxel_pixels, encode_png, laid_over
from .pictures import opaque, picture_of, share_within
from .protocol import MAX_FLOAT32, MAX_RAYS, Ack, Budget, Message, PageFile, Probe, SceneFile, Wish
from .renderers import MakeHost, RendererOptions, Renderers, make_host
from .steps import Steps
from .turns import Client, Frame, Post, Stage, Turns, after_first

PASS_SECONDS: Final = 0.06  # between pictures of passes
TELL_SECONDS: Final = 0.25  # between messages that say how far a picture is
SENDING_SHARE: Final = 4  # passes get so many times the time that their pictures take
PAUSE_SECONDS: Final = 0.03  # from a first picture to the whole one: a drag's next wish comes first
SETTLE_SECONDS: Final = 0.1  # the same if the whole picture takes longer than that
REST_SECONDS: Final = 0.12  # without a wish, until the lossless picture
CERTAIN_SECONDS: Final = 0.4  # after the lossless picture, until its bounds are looked for
SHOW_SECONDS: Final = 0.15  # without a picture, until what a cancelled one has is shown
CLOSE_SECONDS: Final = 0.5  # for threads to end; a pass may take longer
TOO_MANY_BUDGETS: Final = "the memory budget was changed too often: try again in a few seconds"


class Scene:
    """A volume's renderer and those who look at it.

    volume         a volume, or a series: each client looks at a step of its own. At most two steps
                   are in memory. Range, histogram and suggested isovalues are those of the first.
    isovalue       at first; None, "auto": the first of Volume.suggested_isovalues()
    scene          what pages show at first: JSON of scene_fields(); "": the surface of `isovalue`
    annotations    what pages draw over pictures at first; None: those of `scene`
    color_map      what colours surfaces at first; None: that of `scene`
    field          a second volume, for colours by its values or labels; it may be the volume
                   itself, or the series itself, and else comes with no series
    field_name     of the field's file, for scenes that pages save if the field has no source
    device         as in isowave.Renderer
    memory_budget  as in isowave.Renderer
    size, samples  the largest picture that the renderer is made for at first; it is made anew when
                   a client wants more
    max_clients    further ones are refused
    max_rays       of a client's picture: pixels x samples^2 x (1 + Extent.rays_of_hits). A larger
                   one is drawn with fewer pixels, then fewer of these rays, and says so. At most
                   MAX_CAMERA_RAYS come from the camera, or as many as `size` and `samples` have.
    make_host      makes a renderer that draws while the device's is prepared, or None
    clock          seconds; tests replace it
    start          False: no thread; call step() instead, as tests do

    Raises ValueError, whose text is one line.
    """

    def __init__(
        self,
        volume: VolumeLike | SeriesLike,
        *,
        isovalue: Isovalue | None = None,
        title: str = "",
        scene: str = "",
        annotations: Annotations | None = None,
        color_map: ColorMap | None = None,
        field: VolumeLike | SeriesLike | None = None,
        field_name: str = "",
        device: str | None = None,
        memory_budget: int | None = None,
        size: tuple[int, int] = (1920, 1080),
        samples: int = 1,
        max_clients: int = 16,
        max_rays: int = MAX_RAYS,
        make_host: MakeHost = make_host,
        clock: Callable[[], float] = time.monotonic,
        start: bool = True,
    ) -> None:
        if isovalue == "auto":
            isovalue = None
        if isovalue is not None and not abs(isovalue) <= MAX_FLOAT32:
            raise ValueError(f"isovalue {isovalue}: give a number that is finite in float32")
        for name, limit in (("max_clients", max_clients), ("max_rays", max_rays)):
            if limit < 1:
                raise ValueError(f"{name} {limit}: give 1 or more")
        shows_volume = field is volume
        if isinstance(volume, SeriesLike) and not (field is None or shows_volume):
            raise ValueError("a series has no second volume: leave out field")
        if isinstance(field, SeriesLike) and not shows_volume:
            raise ValueError("the field is a series: give one of its volumes")
        self._isovalue, self._title = isovalue, title
        self._first_shown = messages.first_shown(scene, annotations, color_map)
        self._max_clients, self._clock = max_clients, clock
        self._changed = threading.Condition()
        self._has_threads, self._threads = start, list[threading.Thread]()
        self._steps = Steps(volume, self._changed, self._do)
        self._first = self._steps.volume  # of a series: until its facts are known
        self._facts: dict[str, Any] = {}
        self._field = None if shows_volume or isinstance(field, SeriesLike) else field
        self._shows_volume = shows_volume
        self._field_name = "volume" if shows_volume else field_name
        self._closing = self._prepared = False
        self._histogram: dict[str, Any] | None = None
        self._histogram_due = True
        self._range = (0.0, 1.0)
        self._renderers = Renderers(
            self._steps,
            field=self._field,
            shows_volume=shows_volume,
            device=device,
            first=RendererOptions(Extent(size, samples), memory_budget),
            max_rays=max_rays,
            make_host=make_host if start else None,
            changed=self._changed,
            wishes=lambda: self._turns.wishes(),
            tell=self._tell_of_renderers,
            do=self._do,
            clock=clock,
        )
        self._turns = Turns(self._renderers.can_draw, self._renderers.suits, self._steps, clock)
        if start:
            self._do(self._work)

    # Called by transports, from any thread. None of these waits for a frame, except close().

    def join(self, post: Post) -> Client | None:
        """A new client, which gets messages by `post` from now on. None: there are too many."""

        def deliver(head: dict[str, Any], data: bytes | None = None) -> None:
            try:
                post(head, data)
            except Exception:  # of the transport: this client is gone
                self.leave(client)

        with self._changed:
            if self._closing or len(self._turns.clients) >= self._max_clients:
                return None
            client = Client(deliver)
            self._turns.clients.append(client)
            client.post(messages.status(self._steps.volume, self._renderers), None)
            if self._prepared:
                self._welcome(client)
            return client

    def leave(self, client: Client) -> None:
        """Forgets a client; its frame ends after the pass at hand."""
        with self._changed:
            client.leave()
            if client in self._turns.clients:
                self._turns.clients.remove(client)
            self._renderers.note_needs()
            self._changed.notify_all()

    def receive(self, client: Client, message: Message) -> None:
        """Takes a client's message. Raises ProtocolError."""
        with self._changed:
            if not client.joined:
                return
            if isinstance(message, Ack):
                client.acknowledge(message.frame, self._clock())
            elif isinstance(message, Wish):
                self._steps.check(message.step)
                client.take(message)
                self._renderers.note_needs()
            elif isinstance(message, Budget) and not self._renderers.set_budget(message.bytes):
                client.post(messages.error(RuntimeError(TOO_MANY_BUDGETS), None), None)
            elif isinstance(message, SceneFile):
                client.post(messages.scene(message.text), None)
            elif isinstance(message, PageFile):
                make = page_maker(self._steps, self._title, message.text, self._field)
                self._do(lambda: client.post(*make()))
            elif isinstance(message, Probe) and client.asks(message):
                self._do(lambda: self._answer(client))
            self._changed.notify_all()

    @property
    def num_clients(self) -> int:
        with self._changed:
            return len(self._turns.clients)

    @property
    def failure(self) -> str | None:
        """Why no renderer could be made at all, in one line; None: one was, or will be."""
        with self._changed:
            return self._renderers.failure if self._renderers.never_worked else None

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
            for client in self._turns.clients:
                client.joined = False
            self._turns.clients.clear()
            self._renderers.close()
            self._changed.notify_all()
            threads = [t for t in self._threads if t is not threading.current_thread()]
        end = time.monotonic() + CLOSE_SECONDS
        while (
            any(t.is_alive() for t in threads)
            and not self._renderers.is_making
            and time.monotonic() < end
        ):
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

    def _tell_of_renderers(self, error: Exception | None) -> None:
        """The renderer is another one, or is being made, or could not be. The lock is held."""
        if error is not None:
            self._broadcast(messages.error(error, None))
        self._broadcast(messages.status(self._steps.volume, self._renderers))

    def _broadcast(self, head: dict[str, Any]) -> None:
        for client in list(self._turns.clients):
            client.post(head, None)

    # What follows runs in the scene's thread.

    def step(self) -> bool:
        """Does the next thing that is due, if any, and says whether there was one."""
        if not self._prepared:
            self._prepare()
            return True
        self._renderers.give_back()
        if self._renderers.must_make:
            self._renderers.make()
            return True
        with self._changed:
            self._read_steps()
            turn = self._turns.next()
        if turn is not None:
            self._serve(*turn)
            return True
        if self._histogram_due:
            self._make_histogram()
            self._forget_first()
            return True
        return False

    def _read_steps(self) -> None:
        """Has the step read that a client waits for; else the next one, if all look at one."""
        step = self._turns.step_to_read()
        if step is not None:
            self._steps.read(step)
        elif len({wish.step for wish in self._turns.wishes()}) == 1:
            self._steps.read_ahead()

    def _work(self) -> None:
        self._renderers.make()  # meanwhile, the volume is looked at
        while not self._closing:
            if self.step():
                continue
            with self._changed:
                self._read_steps()  # a wish may have come since
                seconds = self._seconds_to_rest()
                if not self._closing and seconds != 0:
                    self._changed.wait(seconds)

    def _seconds_to_rest(self) -> float | None:
        """Until something is due; None: nothing is before a client or a renderer comes."""
        if self._renderers.must_make:
            return 0.0
        due = self._turns.due()
        if self._renderers.give_back_due is not None:
            due.append(self._renderers.give_back_due)
        return max(0.0, min(due) - self._clock()) if due else None

    def _serve(self, client: Client, wish: Wish, stage: Stage) -> None:
        """One stage of a wish. Errors concern this client alone."""
        with self._changed:
            renderer = self._renderers.renderer or self._renderers.host
            extent = self._renderers.fitted(wish, stage)
        try:
            if stage is Stage.LOSSLESS:
                self._encode_lossless(client, wish)
            elif not self._renderers.suits(wish):
                self._move(wish)
            elif renderer is None:
                raise RuntimeError(self._renderers.failure)
            elif stage is Stage.CERTAIN:
                self._send_bounds(renderer, client, wish, extent)
            elif renderer is self._renderers.host or not self._renderers.grow(wish, stage):
                self._draw(renderer, client, wish, stage, extent)
        except Exception as error:  # of the library, or of its drivers
            self._wish_failed(client, wish, error)

    def _move(self, wish: Wish) -> None:
        """Wants another renderer, which is made next. Raises what reading the step raised."""
        if wish.step != self._steps.drawn and self._histogram_due:
            self._make_histogram()
            self._forget_first()
        self._renderers.move(wish)

    def _wish_failed(self, client: Client, wish: Wish, error: Exception) -> None:
        with self._changed:
            if client.joined and client.wish is wish:
                client.stage = Stage.DONE
                client.post(messages.error(error, wish.id), None)

    def _draw(
        self, renderer: RendererLike, client: Client, wish: Wish, stage: Stage, extent: Extent
    ) -> None:
        began = self._clock()
        camera = client.camera or renderer.camera(size=wish.size)
        with self._changed:
            if client.wish is not wish:
                return
            client.camera = camera
        frame = Frame(client, wish, stage, camera, began, extent, client.ranges)
        frame.by_host = renderer is self._renderers.host
        request = replace(
            extent.request(wish.request, camera),
            outputs=("rgb",) if stage is Stage.FIRST else ("rgb", "depth"),
            time_budget_ms=None if client.to_the_end else wish.request.time_budget_ms,
            on_pass=lambda so_far: self._on_pass(frame, so_far),
        )
        if frame.by_host:  # full detail until the device draws, not interrupted by a time
            request = replace(request, max_surface_error=None, by="proof", time_budget_ms=None)
        if frame.by_host or self._steps.volume.num_levels == 1:
            request = replace(request, voxel_pixels=0.0)
        image = renderer.draw(request)
        if frame.stopped:
            self._show_what_there_is(frame, image)
            return
        of = image.statistics
        frame.ranges = of.get("color_range"), of.get("slice_range")
        drawn = picture_of(image, request)
        rgb = self._annotated(frame, drawn)
        data = encode_jpeg(opaque(rgb))
        seconds, volume = self._clock() - frame.began, self._steps.volume
        head = messages.finished_picture(frame, seconds, image, volume, self._renderers)
        with self._changed:
            if self._is_stale(frame):
                return
            now, client.ranges = self._clock(), frame.ranges
            client.offer(head, data, now, keep=True)
            if stage is not Stage.FIRST and image.depth is not None:
                client.hits = Hits(image.depth, camera, wish.step)
            if stage is Stage.FIRST:
                # Not while the next wish is on its way: it would wait for a pass to end.
                is_long = client.whole_seconds > SETTLE_SECONDS
                wait = SETTLE_SECONDS if is_long else PAUSE_SECONDS
                client.stage, client.due, client.under = after_first(wish), now + wait, drawn
            elif stage is Stage.SHARP:
                client.stage, client.due = Stage.WHOLE, now + REST_SECONDS
                client.under, client.whole_seconds = None, now - frame.began
            elif request.time_budget_ms is not None and not image.complete:
                client.stage, client.due = Stage.WHOLE, now + REST_SECONDS
                client.under, client.to_the_end = drawn, True
            else:
                client.stage, client.due = Stage.LOSSLESS, now + REST_SECONDS
                client.under, client.lossless = None, (head, rgb)
                if after_first(wish) is Stage.WHOLE:
                    client.whole_seconds = now - frame.began
                client.voxel_pixels = chosen_voxel_pixels(image, wish.size, extent)

    def _annotated(self, frame: Frame, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture with its wish's annotations."""
        wish, names = frame.wish, self._steps.names
        if wish.annotations is None:
            return picture
        extent = frame.extent
        if frame.stage is Stage.FIRST:
            with self._changed:
                extent = self._renderers.fitted(wish, Stage.WHOLE)
        whole = replace(wish.request, camera=frame.camera, size=extent.size)
        title = self._title if names is None else names[wish.step]
        return annotate(picture, whole, wish.annotations, title, frame.ranges)

    def _answer(self, client: Client) -> None:
        """Says what is seen at places of the client's last picture."""
        while True:
            with self._changed:
                probe, hits, volume = client.next_probe(), client.hits, self._steps.volume
                if probe is None:
                    return
                is_there = hits is not None and hits.step == self._steps.drawn
            place = seen(hits, probe.at, volume, self._field) if hits and is_there else {}
            client.post({"type": "probe", "id": probe.id, **messages.NOTHING, **place}, None)

    def _on_pass(self, frame: Frame, so_far: ProgressLike) -> bool:
        """Sends the picture so far if it is worth it. False: the frame is to stop."""
        frame.passes, frame.percent = so_far.passes, so_far.completed_percent
        now = self._clock()
        with self._changed:
            is_overtaken = frame.by_host and self._renderers.renderer is not None  # by the device
            if (
                self._is_stale(frame)
                or is_overtaken
                or self._turns.give_way(frame, now, self._renderers.fitted)
            ):
                frame.stopped = True
                return False
            for other in self._turns.clients:
                if other.stage is Stage.LOSSLESS and other.wish is not None and now >= other.due:
                    self._encode_lossless(other, other.wish)
            # A large picture takes long to send: then passes get most of the time nevertheless.
            wait = max(PASS_SECONDS, SENDING_SHARE * frame.sending_took)
            under = frame.client.under
            worth_it = frame.is_better_than_before and (
                now - max(frame.began, frame.last_sent) >= wait and frame.client.takes_more
            )
            if frame.stage is not Stage.FIRST and now - frame.last_told >= TELL_SECONDS:
                frame.last_told = now
                frame.client.post(messages.progress(frame), None)
        if worth_it:
            rgb = so_far.rgb
            drawn = rgb if under is None else laid_over(under, rgb, frame.wish.request)
            data = encode_jpeg(self._annotated(frame, drawn))
            frame.last_sent = self._clock()
            frame.sending_took = frame.last_sent - now
            with self._changed:
                if not self._is_stale(frame):
                    if under is not None:
                        frame.client.under = drawn
                    self._offer_pass(frame, data)
        return True

    def _is_stale(self, frame: Frame) -> bool:
        return frame.client.wish is not frame.wish or self._closing

    def _offer_pass(self, frame: Frame, data: bytes) -> None:
        now = self._clock()
        head = messages.picture(frame, "pass", now - frame.began)
        frame.client.offer(head, data, now, keep=False)

    def _show_what_there_is(self, frame: Frame, image: ImageLike) -> None:
        """While wishes come faster than first pictures are made, parts of those are shown."""
        client = frame.client
        if frame.stage is not Stage.FIRST or self._clock() - client.shown < SHOW_SECONDS:
            return
        picture = self._annotated(frame, opaque(picture_of(image, frame.wish.request)))
        data = encode_jpeg(picture)
        with self._changed:
            if client.joined:
                self._offer_pass(frame, data)

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
                now = self._clock()
                # Errors are bounded only of whole surfaces; labels have none.
                is_bounded = not (wish.request.clip or wish.request.has_labels)
                client.stage = Stage.CERTAIN if is_bounded else Stage.DONE
                client.due = now + CERTAIN_SECONDS
                head = {**head, "stage": "lossless", "format": "png"}
                client.offer(head, data, now, keep=True)
                self._changed.notify_all()

    def _send_bounds(
        self, renderer: RendererLike, client: Client, wish: Wish, extent: Extent
    ) -> None:
        """How far the surface may be off, by the rays of a first picture: bounds take time."""
        if client.camera is None:
            return
        pixels = extent.size[1] / wish.size[1]  # of the first picture, to one of the whole picture
        error = wish.request.max_surface_error
        voxel_pixels = client.voxel_pixels or wish.request.voxel_pixels
        request = replace(
            extent.request(wish.request, client.camera),
            outputs=("depth", "bounds"),
            max_surface_error=None if error is None else error * pixels,
            voxel_pixels=voxel_pixels * pixels if self._steps.volume.num_levels > 1 else 0.0,
            time_budget_ms=None,
            color_map=None,
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
                    client.post({"type": "bounds", **bounds}, None)

    # What is known of the volume before the first picture.

    def _prepare(self) -> None:
        low, high = (float(v) for v in self._first.value_range)
        if math.isfinite(low) and math.isfinite(high):
            self._range = low, high
        else:
            self._make_histogram()
        if self._isovalue is None:
            self._isovalue = self._first_isovalue()
        shown = self._first if self._shows_volume else self._field
        field = None if shown is None else messages.field(shown, self._field_name)
        facts = messages.welcome(self._first, self._title, self._range, field, self._steps)
        self._facts = {**facts, "isovalue": self._isovalue, **self._first_shown}
        with self._changed:
            self._prepared = True
            for client in list(self._turns.clients):
                self._welcome(client)
        self._forget_first()

    def _forget_first(self) -> None:
        """Once its facts are known, the first step of a series may go from memory."""
        if self._steps.names is not None and not self._histogram_due:
            del self._first

    def _first_isovalue(self) -> float:
        """Any value of the range draws something for a person to start from."""
        try:
            suggested = self._first.suggested_isovalues()
        except Exception as error:
            with self._changed:
                self._broadcast(messages.error(error, None))
            suggested = []
        return suggested[0] if suggested else (self._range[0] + self._range[1]) / 2

    def _welcome(self, client: Client) -> None:
        client.post(self._facts, None)
        if self._histogram is not None:
            client.post(self._histogram, None)

    def _make_histogram(self) -> None:
        """Without one the viewer works, too: the slider then has no bars."""
        self._histogram_due = False
        try:
            bins = messages.bins_of(self._first.source_dtype, self._range)
            counts, edges = self._first.histogram(bins=bins)
        except Exception as error:
            with self._changed:
                self._broadcast(messages.error(error, None))
            return
        suggested = []
        with contextlib.suppress(Exception):  # _first_isovalue() told of it, or needs none
            suggested = self._first.suggested_isovalues()
        message = messages.histogram(counts, edges, suggested)
        with self._changed:
            self._histogram = message
            if self._prepared:
                self._broadcast(message)
            else:
                self._range = float(edges[0]), float(edges[-1])
