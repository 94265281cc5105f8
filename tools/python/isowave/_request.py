"""Requests of frames: one class, checked in one place, handed over in one place."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._camera import Camera, camera_for_core, vector
from isowave._checked import (
    Isovalue,
    flag,
    function,
    names,
    number,
    numbers,
    refuse,
    size_of,
    whole,
)
from isowave._clip import ClipPlane, clip_of
from isowave._color_map import BY_FIELD, CheckedColorMap, ColorMap, color_map_for_core
from isowave._color_map import color_map_of
from isowave._progress import Progress as Told
from isowave._slice import Slice, slice_map_for_core, slice_map_of, slices_of
from isowave._surface import MAX_SURFACES, Color, Surface, color_of, surface_for_core, surfaces_of

ALL_OUTPUTS = ("rgb", "depth", "normals", "position")
#: Weights of lights: from all around; of a headlight at the eye, and its highlight; from above it.
LIGHTS = ("ambient", "diffuse", "specular", "above")
KNOWN_OUTPUTS = (*ALL_OUTPUTS, "bounds", "surface", "cap", "field")


def rgb_of(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The picture itself. Raises ValueError if it is transparent."""
    if picture.shape[2] == 4:
        raise ValueError("a transparent picture has no rgb: take rgba")
    return picture


class Progress:
    """The picture so far, for on_pass, and only until on_pass returns."""

    def __init__(self, view: _core.PassView) -> None:
        self._view = view
        self._picture: npt.NDArray[np.uint8] | None = None

    def _keep_picture(self) -> None:
        """Draws the picture now. All processes of a BrickRenderer call this."""
        self._picture = self._view.picture()

    def _draw(self) -> npt.NDArray[np.uint8]:
        return self._view.picture() if self._picture is None else self._picture

    @property
    def passes(self) -> int:
        return self._view.passes

    @property
    def completed_percent(self) -> float:
        """Percentage of rays that have ended."""
        return self._view.completed_percent

    @property
    def rgb(self) -> npt.NDArray[np.uint8]:
        """(height, width, 3), drawn when it is asked for; smaller at first with a time budget."""
        return rgb_of(self._draw())

    @property
    def rgba(self) -> npt.NDArray[np.uint8]:
        """(height, width, 4), as rgb, if the picture is transparent."""
        picture = self._draw()
        if picture.shape[2] == 3:
            raise ValueError("the picture has no alpha: render(..., transparent=True)")
        return picture


OnPass = Callable[[Progress], bool | None]


class Look(TypedDict, total=False):
    """Arguments of Renderer.render() that are colours and lights."""

    color_map: ColorMap | str | None
    slice_map: ColorMap | str
    background: Color | None
    background_top: Color | None
    transparent: bool
    lights: Mapping[str, float] | None
    light: Sequence[float] | None
    shadow_rays: int
    light_angle: float
    bounce_rays: int


class FrameArguments(Look, total=False):
    """Arguments of Renderer.render() beside the isovalue."""

    camera: Camera | None
    size: tuple[int, int] | None
    samples: int
    color: Color | None
    normals: str
    clip: Sequence[ClipPlane]
    caps: bool
    surfaces: Sequence[Surface]
    slices: Sequence[Slice]
    outputs: Sequence[str]
    max_surface_error: float | None
    by: str
    max_image_error: float | None
    series: Sequence[Camera]
    voxel_pixels: float
    voxel_error: float
    time_budget_ms: float | None
    ambient_rays: int
    on_pass: OnPass | None
    progress: bool | Told | None


@dataclass(frozen=True)
class Request:
    """A request of a frame: the arguments of Renderer.render(), which describes them.

    With surfaces, the isovalue becomes that of the first one.

    Raises
    ------
    TypeError, ValueError
        An argument of another kind, in one line that names it. The compiled part judges whether
        values make sense, and whether the renderer can draw them.
    """

    isovalue: float
    camera: Camera | None = None
    size: tuple[int, int] | None = None
    samples: int = 1
    color: Color | None = None
    color_map: ColorMap | CheckedColorMap | str | None = None
    background: Color | None = None
    background_top: Color | None = None
    lights: Mapping[str, float] | None = None
    light: Sequence[float] | None = None
    shadow_rays: int = 0
    light_angle: float = 3.0
    bounce_rays: int = 0
    transparent: bool = False
    normals: str = "smooth"
    clip: Sequence[ClipPlane] = ()
    caps: bool = True
    surfaces: Sequence[Surface] = ()
    slices: Sequence[Slice] = ()
    slice_map: ColorMap | CheckedColorMap | str = "gray"
    outputs: Sequence[str] = ALL_OUTPUTS
    max_surface_error: float | None = None
    by: str = "proof"
    max_image_error: float | None = None
    series: Sequence[Camera] = ()
    voxel_pixels: float = 0.0
    voxel_error: float = 0.0
    time_budget_ms: float | None = None
    ambient_rays: int = 0
    on_pass: OnPass | None = None
    progress: bool | Told | None = None

    def __post_init__(self) -> None:
        outputs = names("outputs", self.outputs)
        unknown = {*outputs} - {*KNOWN_OUTPUTS}
        if unknown:
            listed = ", ".join(sorted(unknown))
            raise ValueError(f"outputs {listed}: there are {', '.join(KNOWN_OUTPUTS)}")
        checked = {
            "camera": None if self.camera is None else camera_of(self.camera),
            "size": None if self.size is None else size_of(self.size),
            "samples": whole("samples", self.samples),
            "color": optional_color(self.color),
            "color_map": color_map_of(self.color_map),
            "background": optional_color(self.background),
            "background_top": optional_color(self.background_top),
            "lights": lights_of(self.lights),
            "light": None if self.light is None else vector(numbers("light", self.light, 3)),
            "shadow_rays": whole("shadow_rays", self.shadow_rays),
            "light_angle": number("light_angle", self.light_angle),
            "bounce_rays": whole("bounce_rays", self.bounce_rays),
            "transparent": flag("transparent", self.transparent),
            "normals": normals_of(self.normals),
            "clip": clip_of(self.clip),
            "caps": flag("caps", self.caps),
            "surfaces": surfaces_of(self.surfaces),
            "slices": slices_of(self.slices),
            "slice_map": slice_map_of(self.slice_map),
            "outputs": outputs,
            "max_surface_error": optional("max_surface_error", self.max_surface_error),
            "by": evidence_of(self.by),
            "max_image_error": optional("max_image_error", self.max_image_error),
            "series": series_of(self.series),
            "voxel_pixels": number("voxel_pixels", self.voxel_pixels),
            "voxel_error": number("voxel_error", self.voxel_error),
            "time_budget_ms": optional("time_budget_ms", self.time_budget_ms),
            "ambient_rays": whole("ambient_rays", self.ambient_rays),
            "on_pass": function("on_pass", self.on_pass),
            "progress": progress_of(self.progress),
        }
        surfaces = checked["surfaces"]
        if surfaces and self.color is not None:
            raise ValueError("color: surfaces have colours of their own")
        by_field = checked["color_map"] is not None and checked["color_map"].by in BY_FIELD
        if self.color_map is not None and self.color is not None and not by_field:
            raise ValueError("color: the colour map colours surfaces")
        if len({bool(surface.labels) for surface in surfaces}) == 2:
            raise ValueError("surfaces of labels are drawn without isosurfaces: give all labels")
        has_own = surfaces and not surfaces[0].labels
        value = number("isovalue", surfaces[0].isovalue if has_own else self.isovalue)
        object.__setattr__(self, "isovalue", value)
        for name in ("background", "background_top"):
            if self.transparent and checked[name] is not None:
                raise ValueError(f"{name}: a transparent picture has none")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def isovalues(self) -> list[float]:
        """Those of all surfaces; none of surfaces of labels."""
        return [] if self.has_labels else self.values

    @property
    def values(self) -> list[float]:
        """Isovalues of all surfaces, or their labels."""
        return [value for each in self.surfaces for value in each.values] or [self.isovalue]

    @property
    def has_labels(self) -> bool:
        return any(surface.labels for surface in self.surfaces)

    @property
    def num_surfaces(self) -> int:
        """Surfaces that a renderer must be made for; slices need those for one."""
        return min(max(len(self.surfaces), 1 if self.slices else 0), MAX_SURFACES)

    @property
    def needs_field(self) -> bool:
        """Whether a renderer needs a field to draw this."""
        color_map = color_map_of(self.color_map)
        return "field" in self.outputs or (color_map is not None and color_map.by in BY_FIELD)

    @property
    def shows_volume(self) -> bool:
        """Whether the field is the volume itself, unless there is another."""
        color_map = color_map_of(self.color_map)
        return color_map is not None and color_map.by in ("caps", "labels")

    @property
    def needs(self) -> dict[str, str]:
        """Options that a renderer needs to draw this, and the argument that needs each option."""
        by_proof = self.max_surface_error is not None and self.by == "proof"
        by_sample = self.max_surface_error is not None and self.by == "sample"
        of_levels = by_sample and not self.num_surfaces  # several surfaces have the finest alone
        asked = {
            "bounds": ("max_surface_error", by_proof or "bounds" in self.outputs),
            "levels": (
                "max_surface_error" if by_sample else "voxel_pixels",
                of_levels or self.voxel_pixels > 0,
            ),
            "time_budget": ("time_budget_ms", self.time_budget_ms is not None),
            "labels": ("labels", self.has_labels),
            "rays": (
                "ambient_rays" if self.ambient_rays else "shadow_rays",
                self.ambient_rays != 0 or self.shadow_rays != 0,
            ),
            "bounce": ("bounce_rays", self.bounce_rays != 0),
        }
        return {option: argument for option, (argument, is_asked) in asked.items() if is_asked}

    def for_core(self) -> dict[str, Any]:
        """The request as fields of isowave::FrameRequest. Needs a camera and a size."""
        assert self.camera is not None and self.size is not None
        return {
            **camera_for_core(self.camera),
            "isovalue": self.isovalue,
            "width": self.size[0],
            "height": self.size[1],
            "samples": self.samples,
            "surface": self.color,
            **color_map_for_core(color_map_of(self.color_map)),
            "background": self.background,
            "background_top": self.background_top,
            **lights_of(self.lights),
            "light_direction": self.light,
            "shadow_rays": self.shadow_rays,
            "light_angle": self.light_angle,
            "bounce_rays": self.bounce_rays,
            "transparent": self.transparent,
            "normals": self.normals,
            "clip": [{"normal": plane.normal, "offset": plane.offset} for plane in self.clip],
            "caps": self.caps,
            "surfaces": [surface_for_core(each) for each in self.surfaces],
            "slices": [vars(each) for each in self.slices],
            **slice_map_for_core(slice_map_of(self.slice_map)),
            "voxel_pixels": self.voxel_pixels,
            "voxel_error": self.voxel_error,
            "max_surface_error": self.max_surface_error,
            "by": self.by,
            "max_image_error": self.max_image_error,
            "series": [camera_for_core(camera) for camera in self.series],
            "time_budget_ms": self.time_budget_ms,
            "ambient_rays": self.ambient_rays,
            "want_picture": "rgb" in self.outputs,
            "want_depth": "depth" in self.outputs,
            "want_normals": "normals" in self.outputs,
            "want_positions": "position" in self.outputs,
            "want_field": "field" in self.outputs,
            "want_hits": not {"surface", "cap"}.isdisjoint(self.outputs),
            "want_bounds": "bounds" in self.outputs,
        }


def request_of(isovalue: float, arguments: FrameArguments) -> Request:
    """The request of these arguments. Raises TypeError: one that there is not."""
    names = [*FrameArguments.__annotations__]
    for name in arguments:
        if name not in names:
            near = "".join(
                f": do you mean {each}?" for each in difflib.get_close_matches(name, names, 1)
            )
            raise TypeError(f"there is no argument {name}{near}")
    return Request(isovalue, **arguments)


def isovalue_or_surfaces(isovalue: Isovalue | None, surfaces: Sequence[Surface]) -> Isovalue:
    """The isovalue; 0 with surfaces, whose first one has it. Raises TypeError: both, or none."""
    if isovalue is not None and surfaces:
        raise TypeError("isovalue and surfaces: give one of both")
    if isovalue is None and not surfaces:
        raise TypeError("give an isovalue, or surfaces")
    return 0.0 if isovalue is None else isovalue


def camera_of(camera: Any) -> Camera:
    if not isinstance(camera, Camera):
        raise refuse("camera", camera, "an isowave.Camera")
    return Camera(
        vector(numbers("Camera.eye", camera.eye, 3)),
        vector(numbers("Camera.at", camera.at, 3)),
        vector(numbers("Camera.up", camera.up, 3)),
        number("Camera.fovy", camera.fovy),
        optional("Camera.parallel_height", camera.parallel_height),
    )


def series_of(series: Any) -> tuple[Camera, ...]:
    if not isinstance(series, Sequence):
        raise refuse("series", series, "a list of cameras")
    return tuple(camera_of(camera) for camera in series)


def lights_of(lights: Any) -> dict[str, float]:
    if lights is None:
        return {}
    if not isinstance(lights, Mapping):
        raise refuse("lights", lights, "a dict")
    unknown = {*lights} - {*LIGHTS}
    if unknown:
        listed = ", ".join(sorted(map(str, unknown)))
        raise ValueError(f"lights {listed}: there are {', '.join(LIGHTS)}")
    return {name: number(f"lights[{name!r}]", value) for name, value in lights.items()}


def normals_of(normals: str) -> str:
    if normals not in ("smooth", "cell"):
        raise ValueError(f"normals {normals!r}: give 'smooth' or 'cell'")
    return normals


def evidence_of(by: str) -> str:
    if by not in ("proof", "sample"):
        raise ValueError(f"by {by!r}: give 'proof' or 'sample'")
    return by


def progress_of(progress: Any) -> Any:
    return progress if progress is None or callable(progress) else flag("progress", progress)


def optional_color(color: Color | None) -> Any:
    return None if color is None else color_of(color)


def optional(name: str, value: Any) -> float | None:
    return None if value is None else number(name, value)
