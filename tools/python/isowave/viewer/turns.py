"""Whose picture is next: clients, the stages of their wishes, and the order of their turns."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from isowave._camera import Camera

from .hits import Hits
from .pictures import Extent
from .protocol import Probe, ProtocolError, Wish
from .steps import Steps

MAX_IN_FLIGHT: Final = 2  # pictures on the way to a client
QUICK_SECONDS: Final = 0.02  # a whole picture that needs no first one
GIVE_WAY_SECONDS: Final = 0.15  # of a picture, before smaller ones come between; then twice as long
TURN_SECONDS: Final = 5.0  # of a picture, at most, before smaller ones come between

Post = Callable[[dict[str, Any], bytes | None], None]
"""Sends a message, and the bytes of a picture with it. Must not block, and may be called from any
thread."""


class Stage(Enum):
    """What is to be done next for a client's wish."""

    FIRST = "first"
    SHARP = "sharp"  # the whole picture with a ray a pixel, before one with more rays
    WHOLE = "whole"
    LOSSLESS = "lossless"
    ENCODING = "encoding"  # the lossless picture, in a thread of its own
    CERTAIN = "certain"
    DONE = "done"


DRAWN: Final = (Stage.FIRST, Stage.SHARP, Stage.WHOLE)  # by the renderer, for a wish's picture


def after_first(wish: Wish) -> Stage:
    """The stage after the first picture. More rays are added to a picture that is sharp."""
    request = wish.request
    is_kept = request.max_image_error is not None or request.time_budget_ms is not None
    return Stage.SHARP if Extent.of(request).is_refined and not is_kept else Stage.WHOLE


@dataclass(eq=False)
class Client:
    """One front end's state. Only the scene changes it, under its lock."""

    post: Post
    wish: Wish | None = None
    stage: Stage = Stage.DONE
    camera: Camera | None = None  # of the wish, once it is known
    gave_way: int = 0  # how often the wish's whole picture was interrupted for another client
    due: float = -math.inf  # when the stage may begin
    ranges: tuple[Any, Any] = (None, None)  # of the wish's colours, once they are known
    to_the_end: bool = False  # the wish's picture within its time was coarse: it is drawn without
    voxel_pixels: float = 0.0  # chosen for the wish's whole picture, to keep the picture's error
    under: NDArray[np.uint8] | None = None  # what the wish shows where a pass has no hits yet
    hits: Hits | None = None  # of the last picture with all pixels
    lossless: tuple[dict[str, Any], NDArray[np.uint8]] | None = None  # what it is made of
    sent: int = 0  # pictures, numbered from 1
    acked: int = 0
    waiting: tuple[dict[str, Any], bytes] | None = None  # the last picture that was held back
    whole_seconds: float = math.inf  # of the last whole picture
    shown: float = -math.inf  # when the last picture was sent
    joined: bool = True
    probe: Probe | None = None  # the last one that waits for an answer
    is_answered: bool = False  # by a thread

    def asks(self, probe: Probe) -> bool:
        """Keeps a probe, in place of one that waits. Returns whether none is being answered."""
        is_first, self.probe, self.is_answered = not self.is_answered, probe, True
        return is_first

    def next_probe(self) -> Probe | None:
        """The one to answer; None: there is none, and the next one needs a thread."""
        probe, self.probe = self.probe, None
        self.is_answered = probe is not None and self.joined
        return probe if self.joined else None

    def take(self, wish: Wish) -> None:
        """The next wish, which ends the one before. Raises ProtocolError."""
        if self.wish is not None and wish.id <= self.wish.id:
            raise ProtocolError("the numbers of wishes must grow")
        skip_first = self.whole_seconds < QUICK_SECONDS or wish.request.time_budget_ms is not None
        self.wish, self.camera = wish, wish.request.camera
        self.stage = after_first(wish) if skip_first else Stage.FIRST
        self.gave_way, self.lossless, self.due = 0, None, -math.inf
        self.under = self.hits = None
        self.ranges, self.voxel_pixels, self.to_the_end = (None, None), 0.0, False

    def leave(self) -> None:
        self.joined = False
        self.wish = self.lossless = self.waiting = self.under = self.hits = None
        self.stage = Stage.DONE

    @property
    def takes_more(self) -> bool:
        """Whether fewer pictures are on the way than may be."""
        return self.sent - self.acked < MAX_IN_FLIGHT

    def acknowledge(self, frame: int, now: float) -> None:
        """A picture has come. Raises ProtocolError."""
        if frame > self.sent:
            raise ProtocolError("a picture was acknowledged that was not sent")
        self.acked = max(self.acked, frame)
        if self.waiting is not None and self.takes_more:
            (head, data), self.waiting = self.waiting, None
            self._send(head, data, now)

    def offer(self, head: dict[str, Any], data: bytes, now: float, *, keep: bool) -> None:
        """Sends a picture. While two are on the way, holds it back, or, not kept, leaves it out."""
        if self.takes_more:
            self.waiting = None
            self._send(head, data, now)
        elif keep:
            self.waiting = head, data

    def _send(self, head: dict[str, Any], data: bytes, now: float) -> None:
        self.sent += 1
        self.shown = now
        self.post({**head, "frame": self.sent}, data)


@dataclass
class Frame:
    """A frame that is being drawn."""

    client: Client
    wish: Wish
    stage: Stage
    camera: Camera
    began: float
    extent: Extent
    ranges: tuple[Any, Any]  # of its colours and its slices' colours, for annotations
    passes: int = 0
    percent: float = 0.0  # of its rays that have ended
    by_host: bool = False
    last_sent: float = -math.inf
    last_told: float = -math.inf  # of its percent
    sending_took: float = 0.0  # seconds of the last picture of a pass
    stopped: bool = False

    @property
    def is_better_than_before(self) -> bool:
        """Whether a pass shows more than the page does; pictures within a time do by themselves."""
        request = self.wish.request
        is_shown = self.client.under is not None or request.time_budget_ms is not None
        return self.stage is not Stage.FIRST and is_shown and not request.transparent


class Turns:
    """The clients, in the order of their turns. All calls need the scene's lock.

    can_draw  whether there is a renderer for a stage
    suits     whether the renderer is of a wish's step, and draws labels if it has some: such
              wishes come first
    steps     of the series
    """

    def __init__(
        self,
        can_draw: Callable[[Stage], bool],
        suits: Callable[[Wish], bool],
        steps: Steps,
        clock: Callable[[], float],
    ) -> None:
        self._can_draw, self._suits, self._steps, self._clock = can_draw, suits, steps, clock
        self.clients: list[Client] = []

    def wishes(self) -> list[Wish]:
        return [client.wish for client in self.clients if client.wish is not None]

    def next(self) -> tuple[Client, Wish, Stage] | None:
        """The first client in the row that something is to be done for; it goes to the end."""
        for client in self.clients:
            if self.has_turn(client) and client.wish is not None:
                self.clients.remove(client)
                self.clients.append(client)
                return client, client.wish, client.stage
        return None

    def due(self) -> list[float]:
        """When clients' stages may begin that only wait for their time; -inf: at once."""
        due = (self._due(client) for client in self.clients if self._may_begin(client))
        return [when for when in due if when < math.inf]

    def has_turn(self, client: Client) -> bool:
        return self._may_begin(client) and self._clock() >= self._due(client)

    def step_to_read(self) -> int | None:
        """The step of the first client in the row that waits for another renderer."""
        for client in self.clients:
            if self._needs_other_renderer(client) and client.stage is not Stage.CERTAIN:
                assert client.wish is not None
                return client.wish.step
        return None

    def _due(self, client: Client) -> float:
        """When the client's stage may begin.

        A client who needs another renderer waits while this one is being made, and then for
        clients whom this one suits, until this one has had its time.
        """
        if not self._needs_other_renderer(client):
            return client.due
        leave_at = self._steps.leave_at
        stays = any(
            other.stage in DRAWN and not self._needs_other_renderer(other) for other in self.clients
        )
        return max(client.due, leave_at) if stays or math.isinf(leave_at) else client.due

    def _needs_other_renderer(self, client: Client) -> bool:
        """Whether the client's stage needs a renderer of another step, or of labels."""
        needs_renderer = client.stage in (*DRAWN, Stage.CERTAIN)
        return needs_renderer and client.wish is not None and not self._suits(client.wish)

    def _may_begin(self, client: Client) -> bool:
        """Whether there is all that the client's stage needs, but for time."""
        if client.stage in (Stage.DONE, Stage.ENCODING, Stage.LOSSLESS):
            return client.stage is Stage.LOSSLESS
        if self._needs_other_renderer(client):
            assert client.wish is not None
            # Bounds are not worth another renderer.
            if client.stage is Stage.CERTAIN or not self._steps.may_draw(client.wish.step):
                return False
        return self._can_draw(client.stage)

    def give_way(self, frame: Frame, now: float, fitted: Callable[[Wish, Stage], Extent]) -> bool:
        """A picture that takes long lets smaller ones of others come between, and is drawn anew.

        It is drawn twice as long each time before it gives way, up to TURN_SECONDS.
        """
        client = frame.client
        turn = min(GIVE_WAY_SECONDS * 2.0**client.gave_way, TURN_SECONDS)
        if frame.stage is Stage.FIRST or now - frame.began < turn:
            return False
        gives_way = any(
            other.wish is not None
            and other.stage in DRAWN
            and self.has_turn(other)
            and fitted(other.wish, other.stage).all_rays < frame.extent.all_rays
            for other in self.clients
            if other is not client
        )
        client.gave_way += gives_way
        return gives_way
