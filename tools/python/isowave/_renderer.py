"""Renderers."""

from __future__ import annotations

import functools
import math
import queue
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._camera import Camera, turntable_of, view_count
from isowave._checked import Isovalue, flag, refuse, size_of, whole
from isowave._clip import ClipPlane
from isowave._color_map import ColorMap
from isowave._handed_on import takes
from isowave._image import Image
from isowave._levels import Voxels
from isowave._progress import Progress as Told
from isowave._progress import shown
from isowave._request import (
    ALL_OUTPUTS,
    FrameArguments,
    OnPass,
    Progress,
    Request,
    isovalue_or_surfaces,
    normals_of,
    request_of,
)
from isowave._report import Device
from isowave._slice import Slice
from isowave._surface import MAX_SURFACES, Color, Surface

if TYPE_CHECKING:
    from typing_extensions import Unpack


class RendererArguments(TypedDict, total=False):
    """Arguments of Renderer beside the volume."""

    device: str | int | None
    size: tuple[int, int]
    samples: int
    memory_budget: int | None
    cache_blocks: int
    levels: bool
    bounds: bool
    time_budget: bool
    rays: bool
    bounce: bool
    labels: bool
    surfaces: int
    field: Voxels | None
    profiling: bool
    quick: bool


#: Arguments of Renderer that allow more requests, and their defaults.
CAPABILITIES: dict[str, int] = {
    "levels": False,
    "bounds": False,
    "time_budget": False,
    "rays": False,
    "bounce": False,
    "labels": False,
    "surfaces": 0,
}


ON_HOST: dict[str, int] = {
    **dict.fromkeys(CAPABILITIES, True),
    "surfaces": MAX_SURFACES,
}


def renderer_options(
    size: tuple[int, int],
    samples: int,
    memory_budget: int | None,
    cache_blocks: int,
    *,
    surfaces: int = 0,
    **capabilities: bool,
) -> dict[str, Any]:
    """Arguments of Renderer as isowave::RendererOptions, checked."""
    width, height = size_of(size)
    return {
        "width": width,
        "height": height,
        "samples": whole("samples", samples),
        "memory_budget": (
            None if memory_budget is None else whole("memory_budget", memory_budget, 2**64 - 1)
        ),
        "cache_blocks": whole("cache_blocks", cache_blocks),
        **{f"with_{name}": flag(name, value) for name, value in capabilities.items()},
        "with_surfaces": whole("surfaces", surfaces, MAX_SURFACES),
    }


def warn_of_isovalue(core: _core.Volume | _core.Renderer, isovalue: float) -> None:
    """Warns of an isovalue without a surface, at the line that called the package."""
    notice = core.isovalue_notice(isovalue)
    if not notice:
        return
    level, caller = 1, sys._getframe()
    while caller.f_back is not None and str(caller.f_globals["__name__"]).startswith("isowave"):
        level, caller = level + 1, caller.f_back
    warnings.warn(notice, RuntimeWarning, stacklevel=level)


def goes_on(on_pass: OnPass, progress: Progress) -> bool:
    answer = on_pass(progress)
    return answer is None or flag("what on_pass returns", answer)


def draw(
    renderer: _core.Renderer,
    request: Request,
    interrupts: bool = True,
    progress: bool | Told | None = False,
) -> dict[str, Any]:
    """Draws a frame, and returns its arrays. interrupts: looks for Ctrl-C after each pass."""
    on_pass = request.on_pass
    with shown(progress) as told:

        def callback(view: _core.PassView) -> bool:
            assert on_pass is not None
            return goes_on(on_pass, Progress(view))

        is_main = threading.current_thread() is threading.main_thread()
        watched = None if on_pass is None else callback
        done = None if told is None else functools.partial(told, "drawing")
        return renderer.render(request.for_core(), watched, done, interrupts and is_main)


def positions_of(volume: Voxels, positions: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    """World positions, as float32 if that holds them."""
    return positions.astype(np.float32) if volume._core.float32_positions else positions


class Renderer:
    """Draws frames of one volume on a device or on the host, with the same bits.

    Threads may share a renderer: its frames take turns.

    Parameters
    ----------
    volume
        The volume to draw.
    device
        "host": this process draws, without OpenCL. "gpu", "cpu", an index, or a part of a name: an
        OpenCL device draws. None: $ISOWAVE_DEVICE, else the first GPU, else the host; an OpenCL
        device for the CPU if cache_blocks or profiling are given, or the host's memory is not
        enough.
    size, samples
        Largest picture (width, height), and rays per pixel along each axis: frames may have as many
        rays, in any shape. Frames of the host may have more.
    memory_budget
        Most device memory to take [bytes]; None: three quarters of it. With a budget, the renderer
        takes all of it at once. Without, the cache begins small, and grows between frames. On the
        host, most memory for value ranges and decoded blocks; None: a quarter of it.
    cache_blocks
        Number of decoded blocks of 4^3 voxels that a device keeps, 8 and more. 0: as many as the
        budget allows, or without a budget as many as frames need.
    levels, bounds, time_budget, rays
        Whether frames may use levels of detail; ask for `max_surface_error` and bounds; have a
        `time_budget_ms`; have `ambient_rays`, and cast_rays() may be called. On the host they may.
    bounce
        The same as rays, and frames may have `bounce_rays`. On the host they may.
    surfaces
        How many `surfaces` frames may have, up to 8. Frames of the host may have 8.
    labels
        A device's frames have surfaces of labels alone, Surface(labels=...). Needs surfaces=; not
        with levels, bounds and time_budget. Other labels than those of the frame
        before decode all blocks once. Frames of the host may have either.
    field
        A second volume, of any grid, that ColorMap(by="field") colours surfaces by. It is read at
        its finest level, and takes up to half the memory. The volume itself takes none, except with
        labels.
    profiling
        Measures a device's stages, for statistics["stage_ms"]. The host then waits for each pass.
    quick
        Returns at once: a thread makes the device's renderer, which may take half a minute if a
        driver compiles kernels. Until the renderer is ready, the host draws the same bits. Volumes
        that are too large for the host wait for the device. No effect if the host draws.
    """

    max_rays: float  # of a frame

    def __init__(
        self,
        volume: Voxels,
        *,
        device: str | int | None = None,
        size: tuple[int, int] = (1280, 720),
        samples: int = 1,
        memory_budget: int | None = None,
        cache_blocks: int = 0,
        levels: bool = False,
        bounds: bool = False,
        time_budget: bool = False,
        rays: bool = False,
        bounce: bool = False,
        labels: bool = False,
        surfaces: int = 0,
        field: Voxels | None = None,
        profiling: bool = False,
        quick: bool = False,
    ) -> None:
        can = {"levels": levels, "bounds": bounds, "time_budget": time_budget, "labels": labels}
        can |= {"rays": rays or bounce, "bounce": bounce}
        options = renderer_options(
            size, samples, memory_budget, cache_blocks, surfaces=surfaces, **can
        )
        options |= {"profiling": flag("profiling", profiling), "quick": flag("quick", quick)}
        if field is not None and not isinstance(getattr(field, "_core", None), _core.Volume):
            raise refuse("field", field, "an isowave.Volume")
        options["field"] = None if field is None else field._core
        name = "" if device is None else str(device)
        core = _core.make_renderer(name, volume._core, options)
        self._hold(volume, core, size_of(size), {**can, "surfaces": surfaces})
        self._has_field = field is not None
        if not self._on_host:
            self.max_rays = self.size[0] * self.size[1] * options["samples"] ** 2
        if notice := self._core.device["notice"]:
            warnings.warn(notice, RuntimeWarning, stacklevel=2)

    def _hold(
        self, volume: Voxels, core: _core.Renderer, size: tuple[int, int], can: dict[str, int]
    ) -> None:
        """can: what a device's frames may ask for, by the arguments of the constructor."""
        self.volume, self.size = volume, size
        self._has_field = False
        self._core, self._on_host = core, not core.device["name"]
        self._can: dict[str, int] = ON_HOST if self._on_host else can
        self.max_rays = math.inf
        self._iterating: int | None = None  # the thread that looks at a picture of passes()

    @property
    def device(self) -> Device:
        """As an entry of isowave.devices(), and notice: a line that names operations whose results
        differ from the host's, or "". Pictures of such a device may differ in last bits. All texts
        are "" if the host draws."""
        return Device(self._core.device)

    @property
    def memory_bytes(self) -> int:
        """Memory of the device or the host that the renderer holds; 0 before it is ready."""
        return self._core.memory_bytes

    @property
    def ready(self) -> bool:
        """Whether the device draws; False while the host draws (quick)."""
        return self._core.ready

    def wait(self) -> None:
        """Waits until the device draws. Raises Error if its renderer cannot be made."""
        self._core.wait()

    def camera(
        self,
        isovalue: Isovalue | None = None,
        size: tuple[int, int] | None = None,
        *,
        surfaces: Sequence[Surface] = (),
    ) -> Camera:
        """A view from the front right and above; the surfaces, or without any the volume's box,
        fill the picture."""
        return self.turntable(1, isovalue, size, surfaces=surfaces)[0]

    def turntable(
        self,
        num_views: int,
        isovalue: Isovalue | None = None,
        size: tuple[int, int] | None = None,
        *,
        surfaces: Sequence[Surface] = (),
    ) -> list[Camera]:
        """Views once around the surfaces, or the volume's box, as Volume.turntable()."""
        width, height = self.size if size is None else size_of(size)
        if isovalue is None and not surfaces:
            return turntable_of(self.volume, num_views, "corner", (width, height), None, 1.0)
        value = self.volume._isovalue(isovalue_or_surfaces(isovalue, surfaces))
        request = Request(value, surfaces=surfaces)
        if request.has_labels and not self._can["labels"]:
            raise _core.Error("labels needs a renderer that was made with labels=True")
        self._check_turn()
        cameras = self._core.turntable(
            request.values, view_count(num_views), width, height, request.has_labels
        )
        return [Camera(*camera) for camera in cameras]

    def _check_turn(self) -> None:
        """Raises Error in the loop over passes(), whose frame keeps the renderer until it ends."""
        if self._iterating == threading.get_ident():
            raise _core.Error("the renderer is at work for passes(): end that, or make another one")

    def render(
        self,
        isovalue: Isovalue | None = None,
        *,
        camera: Camera | None = None,
        size: tuple[int, int] | None = None,
        samples: int = 1,
        color: Color | None = None,
        color_map: ColorMap | str | None = None,
        background: Color | None = None,
        background_top: Color | None = None,
        lights: Mapping[str, float] | None = None,
        light: Sequence[float] | None = None,
        shadow_rays: int = 0,
        light_angle: float = 3.0,
        bounce_rays: int = 0,
        transparent: bool = False,
        normals: str = "smooth",
        clip: Sequence[ClipPlane] = (),
        caps: bool = True,
        surfaces: Sequence[Surface] = (),
        slices: Sequence[Slice] = (),
        slice_map: ColorMap | str = "gray",
        outputs: Sequence[str] = ALL_OUTPUTS,
        max_surface_error: float | None = None,
        by: str = "proof",
        max_image_error: float | None = None,
        series: Sequence[Camera] = (),
        voxel_pixels: float = 0.0,
        voxel_error: float = 0.0,
        time_budget_ms: float | None = None,
        ambient_rays: int = 0,
        on_pass: Callable[[Progress], bool | None] | None = None,
        progress: bool | Told | None = None,
    ) -> Image:
        """Draws a frame. Decoded blocks are kept for the next frame.

        Parameters
        ----------
        isovalue
            Value of the field on the surface. "auto": the first of Volume.suggested_isovalues().
        camera
            None: that of camera() without a surface, Camera.of(volume).
        size
            Width and height [pixels]; None: the renderer's largest.
        samples
            Rays per pixel along each axis, 1 to 8; colours are their mean. With max_image_error the
            most that may be chosen: 4 often suffice.
        color, background, color_map
            Colours of surface and background: "#rrggbb", a name as "bone", or three numbers 0 to 1.
            A ColorMap colours surfaces by the distance along an axis, or by the renderer's field.
        background_top
            The background goes linearly from `background` at the lower edge to this colour at the
            upper; None: it is uniform.
        lights
            Other weights than {"ambient": 0.15, "diffuse": 0.5, "specular": 0.2, "above": 0.45}.
        light
            Direction (x, y, z) towards a light of the scene, in world space. It comes instead of
            the light "above", which turns with the camera, with its weight.
        shadow_rays, light_angle
            Rays from each hit towards that light, up to 255: 1 gives hard shadows, 16 and more soft
            ones, of a light with half that angle [degrees, up to 45]. Each takes about as long as a
            frame without any. Needs rays=True.
        bounce_rays
            Least number of ambient rays, up to 255, if that light bounces: each hit then gets light
            of it by way of one other place of a surface of opacity 1. 16 and more give smooth
            pictures. Each takes up to twice the time of an ambient ray. Needs bounce=True.
        transparent
            Draws `rgba` instead of `rgb`, without a background: see Image.rgba.
        normals
            "smooth": central differences; "cell": gradients of cells, which jump between them.
        clip, caps
            Up to 14 clipping planes, see ClipPlane and clip_box(): what is in all of their half
            spaces is drawn. Flat caps close cuts through what is inside the surface, or cuts are
            open. A `max_surface_error` by proof and the output "bounds" need whole surfaces.
        surfaces
            Up to 8 surfaces in one picture, instead of `isovalue` and `color`: see Surface. Needs
            surfaces= of the constructor; not with max_image_error, time_budget_ms; labels not with
            voxel_pixels, max_surface_error. Errors are those of each ray's first hit. Rays of
            `ambient_rays` and shadows end at those of opacity 1.
        slices, slice_map
            Planes that show the voxels beside the surfaces, see Slice: up to 8 with them, with
            their conditions. A ColorMap gives colours and range [the volume's]; the rest of it is
            not used.
        outputs
            Arrays of Image: "rgb", "depth", "normals", "position", "bounds", "surface", "cap",
            "field".
        max_surface_error
            Largest distance between drawn and true surface [pixels], that the detail must keep: see
            statistics["detail"].
        by
            "proof" of max_surface_error, against the volume before compression, which needs
            bounds=True; or "sample": 99 % of the hits keep it, against full detail. Needs
            levels=True.
        max_image_error
            Largest error of the picture, above 0 and up to 1: the mean of FLIP's over all pixels,
            against 64 rays a pixel at full detail. The cheapest rays and voxel_pixels are chosen
            that keep it with 95 % confidence, by tiles of the picture without ambient, shadow and
            bounce rays. Arrays then have statistics["detail"]["samples"] as many rows and columns.
            Levels of detail need levels=True. Not with max_surface_error.
        series
            Views, as of a movie, that share max_surface_error or max_image_error: most hits of all
            of them together, or the mean of their pictures, keep it.
        voxel_pixels, voxel_error
            Largest distance between voxels of coarser levels [pixels], which needs levels=True, and
            largest difference of decoded voxels from the compressed ones [voxel values]; 0: none.
        time_budget_ms
            Time within which the best possible picture is drawn [ms]. Needs time_budget=True.
        ambient_rays
            Rays from each hit, up to 255, that find out how much of the sky it sees. 16 and more
            look smooth. Each takes about as long as a frame without any. Needs rays=True.
        on_pass
            Called after each pass with the picture so far. If it returns False, the frame stops.
        progress
            As compress() has it, for frames of more than two seconds without time_budget_ms.

        Raises
        ------
        Error
            A request that the renderer was not made for, in one line. Later frames can be drawn.
        """
        arguments = {name: value for name, value in locals().items() if name != "self"}
        arguments["isovalue"] = self.volume._isovalue(isovalue_or_surfaces(isovalue, surfaces))
        return self.draw(Request(**arguments))

    def draw(self, request: Request) -> Image:
        """Draws a frame, as render()."""
        self._check_turn()
        for option, argument in request.needs.items():
            if not self._can[option]:
                raise _core.Error(f"{argument} needs a renderer that was made with {option}=True")
        if request.needs_field and not self._has_field:
            raise _core.Error("values of a field need a renderer that was made with field=VOLUME")
        needed = request.num_surfaces
        if needed > self._can["surfaces"]:
            asked = "surfaces" if request.surfaces else "slices"
            raise _core.Error(f"{asked} needs a renderer that was made with surfaces={needed}")
        request = self._completed(request)
        # On a GPU, frames end before a person can press Ctrl-C, and looking for Ctrl-C after each
        # pass would cost time.
        interrupts = self.device["type"] != "gpu"
        for isovalue in request.isovalues:
            warn_of_isovalue(self._core, isovalue)
        frame = draw(self._core, request, interrupts, request.progress)
        if "positions" in frame:
            frame["positions"] = positions_of(self.volume, frame["positions"])
        return Image(frame, request)

    def _completed(self, request: Request) -> Request:
        size = request.size or self.size
        camera = request.camera or Camera.of(self.volume, size=size)
        return replace(request, size=size, camera=camera)

    def cast_rays(
        self, rays: npt.ArrayLike, isovalue: Isovalue, *, normals: str = "smooth"
    ) -> dict[str, npt.NDArray[Any]]:
        """As Volume.cast_rays(), by this renderer. Needs rays=True."""
        self._check_turn()
        if not self._can["rays"]:
            raise _core.Error("cast_rays needs a renderer that was made with rays=True")
        value = self.volume._isovalue(isovalue)
        warn_of_isovalue(self._core, value)
        try:
            array = np.ascontiguousarray(rays, np.float64)
        except (TypeError, ValueError):
            raise refuse("rays", rays, "numbers, (..., 6): origin, direction") from None
        if array.ndim == 0 or array.shape[-1] != 6:
            raise ValueError(f"rays of shape {array.shape}: the last axis has 6: origin, direction")
        found = self._core.cast_rays(array.reshape(-1, 6), value, normals_of(normals))
        lead = array.shape[:-1]
        return {
            "t_hit": found["depth"].reshape(lead),
            "normals": found["normals"].reshape(*lead, 3),
            "position": positions_of(self.volume, found["positions"]).reshape(*lead, 3),
            "cell": found["cells"][..., ::-1].reshape(*lead, 3),
        }

    def __reduce__(self) -> Any:
        raise TypeError(
            "renderers cannot be pickled: pickle the volume, and call volume.renderer()"
        )

    def __repr__(self) -> str:
        width, height = self.size
        state = "" if self.ready else ", not ready"
        return f"<isowave.Renderer {width} x {height}, {self.device['name'] or 'host'}{state}>"

    @takes(render, without=("on_pass", "progress"))
    def passes(
        self, isovalue: Isovalue | None = None, **frame: Unpack[FrameArguments]
    ) -> Iterator[Image]:
        """Yields the picture after each pass, and the finished one last; arguments as render().

        Pictures before the last have only rgb, or rgba. The frame waits until the next picture is
        asked for, and ends when the iterator is closed.
        """
        pictures: queue.Queue[Image | BaseException | None] = queue.Queue(maxsize=1)
        closed = threading.Event()

        def put(item: Image | BaseException | None) -> None:
            while not closed.is_set() and not _core.is_ending():
                try:
                    pictures.put(item, timeout=0.05)
                except queue.Full:
                    continue
                return

        def on_pass(progress: Progress) -> bool:
            if progress.completed_percent == 100 and not request.ambient_rays:
                return True  # the finished picture follows
            statistics: dict[str, Any] = {"passes": progress.passes, "complete": False}
            statistics["completed_percent"] = progress.completed_percent
            picture = progress.rgba if request.transparent else progress.rgb
            put(Image({"picture": picture, "statistics": statistics}, request))
            return not closed.is_set() and not _core.is_ending()

        def draw() -> None:
            try:
                put(self.draw(request))
            except BaseException as error:  # noqa: BLE001: the loop over the passes raises it
                put(error)
            put(None)

        self._check_turn()
        value = self.volume._isovalue(isovalue_or_surfaces(isovalue, frame.get("surfaces", ())))
        asked = request_of(value, frame)
        if asked.on_pass is not None or asked.progress:
            raise TypeError("passes() takes neither on_pass nor progress: it yields the passes")
        request = self._completed(replace(asked, on_pass=on_pass, progress=False))
        thread = threading.Thread(target=draw, name="isowave passes", daemon=True)
        thread.start()
        try:
            while True:
                item = pictures.get()
                if item is None:
                    return
                if isinstance(item, BaseException):
                    raise item
                self._iterating = threading.get_ident()
                yield item
                self._iterating = None
        finally:
            self._iterating = None
            closed.set()
            # Any thread may have dropped the iterator, and when Python ends the frame is over.
            if thread is not threading.current_thread() and not _core.is_ending():
                thread.join()


def host_renderer(volume: Voxels) -> Renderer:
    """Makes a Renderer that draws on the host, in a quarter of its memory at most.

    Raises
    ------
    Error
        The memory is not enough.
    """
    renderer = Renderer.__new__(Renderer)
    renderer._hold(volume, _core.host_renderer(volume._core, 0), (1280, 720), ON_HOST)
    return renderer
