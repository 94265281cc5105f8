"""The renderer of a scene: made for what clients want, and anew when that changes."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

from isowave import _core
from isowave._color_map import color_map_of
from isowave._levels import Voxels
from isowave._renderer import host_renderer
from isowave._request import Request
from isowave._surface import MAX_LABEL, MAX_SURFACES

from .interfaces import RendererLike, VolumeLike
from .pictures import Extent
from .protocol import TokenBucket, Wish, first_line
from .steps import Steps
from .turns import Stage

FIRST_DIVISOR: Final = 4  # of width and height, for the first picture
HOST_SECONDS: Final = 0.5  # for a device to be ready, before the host draws meanwhile
GIVE_BACK_SECONDS: Final = 5.0  # without need of a large renderer, until a smaller one is made
MAX_CAMERA_RAYS: Final = 1 << 24  # of a picture: they take memory, and make passes long
TILE: Final = (256, 256)  # rays of a tile that shows the error of a picture, as the library has it

NO_SURFACES: Final = (
    "the device lacks the memory for these surfaces: draw fewer, or give a larger memory budget"
)
#: Makes the host's renderer for a volume, a field, and a device that is not ready, or None.
MakeHost = Callable[[VolumeLike, "VolumeLike | None", "str | None"], "RendererLike | None"]


@dataclass(frozen=True)
class RendererOptions:
    """What the scene's renderer is made for."""

    largest: Extent  # of a picture
    memory_budget: int | None
    rays_of_hits: int = 0  # Extent.ability of pictures; each more takes memory
    surfaces: int = 0  # most of a picture, unless it has one opaque one; each takes memory
    step: int = 0  # of the series
    labels: bool = False  # a device's draws surfaces of labels alone, or none
    by_label: bool = False  # its field has labels, which colour surfaces

    @property
    def rays(self) -> int:
        return self.largest.rays

    def is_like(self, other: RendererOptions) -> bool:
        """Whether both draw the same step, labels, or not, and colours by them, or not."""
        kinds = [(each.step, each.labels, each.by_label) for each in (self, other)]
        return kinds[0] == kinds[1]


class Renderers:
    """The renderer, and while a device's is being made, the host's.

    The renderer is the host's if isowave.Renderer chooses that, as on a machine without a GPU.

    steps     the volumes
    field     as in isowave.Renderer; None with shows_volume: the volume that is drawn
    device    as in isowave.Renderer
    first     what the first renderer is made for; none is made for less
    max_rays  of a client's picture, with those of its hits
    make_host draws until the device's renderer is made
    changed   the scene's lock; notified when a renderer is there, or cannot be made
    wishes    those of the clients now
    tell      hears of a change: an error, or None. The lock is held
    do        works in another thread
    clock     seconds
    """

    def __init__(
        self,
        steps: Steps,
        *,
        field: VolumeLike | None,
        shows_volume: bool,
        device: str | None,
        first: RendererOptions,
        max_rays: int,
        make_host: MakeHost | None,
        changed: threading.Condition,
        wishes: Callable[[], list[Wish]],
        tell: Callable[[Exception | None], None],
        do: Callable[[Callable[[], None]], None],
        clock: Callable[[], float],
    ) -> None:
        self._steps, self._field, self._shows_volume = steps, field, shows_volume
        self._device, self._make_host = device, make_host
        self._changed, self._wishes, self._tell = changed, wishes, tell
        self._do, self._clock = do, clock
        self.renderer: RendererLike | None = None
        self.host: RendererLike | None = None  # draws until there is a device's renderer
        self.failed = False
        self.failure = ""  # why there is no renderer
        self.is_making = False
        self._closing = False
        self._base, self.wanted = first.largest, first
        self._made: RendererOptions | None = None  # what the renderer was made for
        self._fallback: RendererOptions | None = None  # worked before
        self._too_large_since: float | None = None  # the renderer, for what clients want
        self._budgets = TokenBucket(1 / GIVE_BACK_SECONDS, 5, clock)  # each makes a renderer
        self.max_rays = max_rays
        self._ray_limit = self.first_ray_limit = max(MAX_CAMERA_RAYS, first.rays)
        self._may_have_rays = True  # of hits
        self._most_surfaces = MAX_SURFACES

    @property
    def never_worked(self) -> bool:
        return self.failed and self._fallback is None

    @property
    def must_make(self) -> bool:
        """Whether the renderer is another one than is wanted, and none is being made."""
        return not (self._made == self.wanted or self.failed or self.is_making)

    @property
    def on_host(self) -> bool:
        """Whether the renderer is the host's, which draws pictures of any size."""
        return self.renderer is not None and not self.renderer.device["name"]

    def can_draw(self, stage: Stage) -> bool:
        """Whether a stage may begin. If no renderer could be made, it ends with that error."""
        if self.renderer is not None or self.failed:
            return True
        return self.host is not None and stage is not Stage.CERTAIN

    def close(self) -> None:
        """Lets the renderers go; a frame that is being drawn still holds one."""
        self._closing = True
        self.renderer = self.host = None

    # How large pictures are.

    def plan(self, wish: Wish, stage: Stage = Stage.WHOLE) -> Extent:
        """The whole picture of a wish, as far as the server's limits and the memory allow it."""
        extent = Extent.of(wish.request)
        if stage is Stage.SHARP:
            extent = Extent(extent.size, 1)
        plan = extent if self._may_have_rays else extent.of_camera
        return plan.within(self._ray_limit, self.max_rays)

    def _of_camera(self, plan: Extent) -> Extent:
        """The camera's rays that a renderer is made for: those of a tile, if they are more."""
        tile = Extent(TILE, 1).within(self._ray_limit, MAX_CAMERA_RAYS)
        is_small = plan.chooses and plan.rays < tile.rays
        return tile if is_small else Extent(plan.size, plan.samples)

    def fitted(self, wish: Wish, stage: Stage) -> Extent:
        """A stage's picture, within what the device's renderer was made for.

        The host has no limits of its own.
        """
        made, plan = self._made, self.plan(wish, stage)
        if stage not in (Stage.SHARP, Stage.WHOLE):
            width, height = (max(1, side // FIRST_DIVISOR) for side in wish.size)
            plan = Extent((width, height), 1)
        if made is None and plan.chooses:  # full detail until the device draws
            plan = replace(plan, samples=1, chooses=False)
        if made is None or self.on_host:
            return plan.within(self._ray_limit, self.max_rays)
        fitted = plan.within(made.rays, self.max_rays)
        if made.rays_of_hits < 2:
            fitted = replace(fitted, bounce=0)
        return fitted if made.rays_of_hits else fitted.of_camera

    # What renderer is wanted.

    def suits(self, wish: Wish) -> bool:
        """Whether the wish is of the renderer's kind. The host's renderer draws labels, too."""
        draws_alike = self.on_host or self.wanted.labels == wish.request.has_labels
        return draws_alike and wish.step == self._steps.drawn and self._has_field(wish.request)

    def _has_field(self, request: Request) -> bool:
        """Whether the renderer has the field that a request needs.

        If no renderer could be made with a field of labels, requests without colours need another.
        """
        wanted, volume = self.wanted, self._steps.volume
        if not request.needs_field:
            return not (self.failed and wanted.by_label)
        needed = self._field_of(volume, request.has_labels, is_by_label(request))
        return needed is self._field_of(volume, wanted.labels, wanted.by_label)

    def move(self, wish: Wish) -> None:
        """Wants a renderer of the wish's step, which was read, and of its kind.

        Raises what reading the step raised.
        """
        with self._changed:
            if wish.step != self._steps.drawn:
                self._steps.draw(wish.step)
                self.host = None  # it draws another step
            labels, surfaces = wish.request.has_labels, self.wanted.surfaces
            if self.on_host:  # it draws both
                labels = self.wanted.labels
            self.renderer = None
            if labels != self.wanted.labels:
                surfaces = room_for(wish)
            kind: dict[str, Any] = {"labels": labels, "by_label": is_by_label(wish.request)}
            self._want(replace(self.wanted, step=wish.step, surfaces=surfaces, **kind))

    def grow(self, wish: Wish, stage: Stage) -> bool:
        """Wants a renderer for what the wish's picture has: more rays, those of hits, surfaces.

        Raises RuntimeError, one line, if the device has no memory for the surfaces.
        """
        if self.on_host:
            return False
        wanted, plan = self.wanted, self.plan(wish, stage)
        surfaces = max(wanted.surfaces, room_for(wish))
        if surfaces > self._most_surfaces:
            raise RuntimeError(NO_SURFACES)
        if surfaces == wanted.surfaces and stage is Stage.FIRST:
            return False
        of_hits = max(wanted.rays_of_hits, plan.ability)
        camera = self._of_camera(plan)
        largest = camera if camera.rays > wanted.rays else wanted.largest
        more = replace(wanted, largest=largest, rays_of_hits=of_hits, surfaces=surfaces)
        if more == wanted:
            return False
        self._want(more)
        return True

    def set_budget(self, memory_budget: int | None) -> bool:
        """Wants a renderer with another memory budget. False: the budget changes too often."""
        if not self._budgets.take():
            return False
        self._want(replace(self.wanted, memory_budget=memory_budget))
        return True

    def _needed(self) -> RendererOptions:
        """The smallest renderer for what clients want now. The lock is held."""
        plans = [self.plan(wish) for wish in self._wishes()]
        largest = max((self._base, *map(self._of_camera, plans)), key=lambda plan: plan.rays)
        of_hits = max((plan.ability for plan in plans), default=0)
        alike = [w for w in self._wishes() if w.request.has_labels == self.wanted.labels]
        surfaces = max(map(room_for, alike), default=1 if self.wanted.labels else 0)
        by_label = self.wanted.by_label and any(is_by_label(w.request) for w in self._wishes())
        more: dict[str, Any] = {"rays_of_hits": of_hits, "surfaces": surfaces, "by_label": by_label}
        return replace(self.wanted, largest=largest, **more)

    def note_needs(self) -> None:
        """Notes since when the renderer is much larger than clients need. The lock is held."""
        needed, wanted = self._needed(), self.wanted
        has_more = (
            wanted.rays_of_hits > needed.rays_of_hits
            or wanted.surfaces > needed.surfaces
            or wanted.by_label > needed.by_label
        )
        fits = needed.rays > wanted.rays / 2 and not has_more
        if fits or self.on_host:
            self._too_large_since = None
        elif self._too_large_since is None:
            self._too_large_since = self._clock()

    @property
    def give_back_due(self) -> float | None:
        """When a smaller renderer is made, unless clients come to need the larger one."""
        return None if self._too_large_since is None else self._too_large_since + GIVE_BACK_SECONDS

    def give_back(self) -> None:
        """Wants a smaller renderer if clients have not needed a large one for long."""
        with self._changed:
            if self.give_back_due is not None and self._clock() >= self.give_back_due:
                self._too_large_since = None
                self._want(self._needed())

    def _want(self, options: RendererOptions) -> None:
        with self._changed:
            if options.memory_budget != self.wanted.memory_budget:
                self._ray_limit, self._may_have_rays = self.first_ray_limit, True
                self._most_surfaces = MAX_SURFACES
            self.wanted, self.failed = options, False
            self.note_needs()

    # How it is made.

    def make(self) -> None:
        """Replaces the renderer. Memory for two is rarely there: the old one goes first.

        Kernels may take long to compile: in another thread, and the host draws meanwhile.
        """
        with self._changed:
            self.is_making, wanted, made = True, self.wanted, self._made
            self._steps.leave_at = math.inf
            volume = self._steps.volume
            self.renderer, self._made = None, None
            if made is None or replace(made, step=wanted.step) != wanted:
                self._tell(None)  # of another step, pictures tell
        self._do(lambda: self._make_renderer(volume, wanted))
        # Not by a renderer with quick=True: a wish with max_error or time_budget would wait for the
        # device. The host leaves both out, and the device then draws the wish with them. The host's
        # renderer is made in a thread of its own, and only if the device takes long.
        if self._make_host is not None:
            self._do(lambda: self._make_for_host(volume))

    def _field_of(self, volume: VolumeLike, labels: bool, by_label: bool) -> VolumeLike | None:
        """The field of a renderer of these options.

        Labels that colour surfaces are those of the second volume if it may have some, else of the
        volume itself.
        """
        second = volume if self._shows_volume else self._field
        if by_label:
            return second if second is not None and may_have_labels(second) else volume
        return None if labels else second

    def _make_renderer(self, volume: VolumeLike, wanted: RendererOptions) -> None:
        options: dict[str, Any] = {
            "device": self._device,
            "size": wanted.largest.size,
            "samples": wanted.largest.samples,
            "memory_budget": wanted.memory_budget,
            "levels": volume.num_levels > 1 and not wanted.labels,
            "bounds": not wanted.labels,
            "time_budget": not wanted.labels,
            "labels": wanted.labels,
            "rays": wanted.rays_of_hits > 0,
            "bounce": wanted.rays_of_hits > 1,
            "surfaces": wanted.surfaces,
            "field": self._field_of(volume, wanted.labels, wanted.by_label),
        }
        try:
            renderer = volume.renderer(**options)
        except Exception as error:
            self._renderer_failed(wanted, error)
            return
        with self._changed:
            self.is_making, self.host = False, None
            if self._closing:
                return
            self.renderer, self._made, self._fallback = renderer, wanted, wanted
            self._steps.has_renderer(self._clock())
            self._tell(None)
            self._changed.notify_all()

    def _renderer_failed(self, wanted: RendererOptions, error: Exception) -> None:
        """Goes back to what worked. If nothing did, waits for another budget."""
        with self._changed:
            self.is_making = False
            self._steps.has_renderer(self._clock())
            fallback = self._fallback if self._fallback != wanted else None
            if fallback is not None and not fallback.is_like(wanted):
                fallback = None  # the step's volume may be gone, and labels are no surfaces
            if self.wanted == wanted:
                self.failed, self.failure = fallback is None, first_line(error)
                self.host = None
                if fallback is not None:
                    self.wanted = fallback
                    if wanted.rays > fallback.rays:
                        self._ray_limit = fallback.rays
                    if wanted.rays_of_hits and not fallback.rays_of_hits:
                        self._may_have_rays = False
                    if wanted.surfaces > fallback.surfaces:
                        self._most_surfaces = fallback.surfaces
            self._tell(error)
            self._changed.notify_all()

    def _make_for_host(self, volume: VolumeLike) -> None:
        def is_over() -> bool:
            is_other = self._steps.volume is not volume
            return self._closing or not self.is_making or is_other

        with self._changed:
            if self.host is not None or self._changed.wait_for(is_over, HOST_SECONDS):
                return
        field = self._field_of(volume, False, self.wanted.by_label)
        try:
            assert self._make_host is not None
            host = self._make_host(volume, field, self._device)
        except Exception:  # there is not enough memory: then nothing is drawn meanwhile
            return
        with self._changed:
            if not is_over():
                self.host = host
                self._changed.notify_all()


def room_for(wish: Wish) -> int:
    """How many surfaces a renderer is made for: as one adds surfaces, it is made anew thrice."""
    count = wish.request.num_surfaces  # 1, if there are slices alone
    return 1 << (count - 1).bit_length() if count else 0


def is_by_label(request: Request) -> bool:
    """Whether labels colour the surfaces."""
    color_map = color_map_of(request.color_map)
    return color_map is not None and color_map.by == "labels"


def may_have_labels(volume: VolumeLike) -> bool:
    """Whether all voxels may be labels, as the library takes them."""
    low, high = volume.value_range
    return volume.source_dtype.kind in "iu" and low >= 0 and high <= MAX_LABEL


def make_host(
    volume: VolumeLike, field: VolumeLike | None, device: str | None
) -> RendererLike | None:
    """A renderer of the host for a volume of isowave's, unless the host draws anyway."""
    if not isinstance(volume, Voxels) or _core.draws_on_host(device or ""):
        return None
    if field is None:
        return host_renderer(volume)
    of_field: Any = field
    return volume.renderer(device="host", field=of_field)
