"""Requests of frames: one class, checked in one place, handed over in one place."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._camera import Camera, vector
from isowave._checked import flag, function, names, number, numbers, refuse, size_of, whole
from isowave._clip import ClipPlane, clip_of

Color = str | Sequence[float]  # "#rrggbb", or red, green, blue from 0 to 1
ALL_OUTPUTS = ("rgb", "depth", "normals", "position")
KNOWN_OUTPUTS = (*ALL_OUTPUTS, "bounds")


def rgb_of(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The picture itself. Raises ValueError if it is transparent."""
    if picture.shape[2] == 4:
        raise ValueError("a transparent picture has no rgb: take rgba")
    return picture


class Progress:
    """The picture so far, for on_pass, and only until on_pass returns."""

    def __init__(self, view: _core.PassView) -> None:
        self._view = view

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
        return rgb_of(self._view.picture())

    @property
    def rgba(self) -> npt.NDArray[np.uint8]:
        """(height, width, 4), as rgb, if the picture is transparent."""
        picture = self._view.picture()
        if picture.shape[2] == 3:
            raise ValueError("the picture has no alpha: render(..., transparent=True)")
        return picture


@dataclass(frozen=True)
class Request:
    """A request of a frame: the arguments of Renderer.render(), which describes them.

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
    background: Color | None = None
    transparent: bool = False
    normals: str = "smooth"
    clip: Sequence[ClipPlane] = ()
    caps: bool = True
    outputs: Sequence[str] = ALL_OUTPUTS
    max_error: float | None = None
    by: str = "proof"
    series: Sequence[Camera] = ()
    voxel_pixels: float = 0.0
    voxel_error: float = 0.0
    time_budget: float | None = None
    ambient: int = 0
    on_pass: Callable[[Progress], bool | None] | None = None

    def __post_init__(self) -> None:
        outputs = names("outputs", self.outputs)
        unknown = {*outputs} - {*KNOWN_OUTPUTS}
        if unknown:
            listed = ", ".join(sorted(unknown))
            raise ValueError(f"outputs {listed}: there are {', '.join(KNOWN_OUTPUTS)}")
        checked = {
            "isovalue": number("isovalue", self.isovalue),
            "camera": None if self.camera is None else camera_of(self.camera),
            "size": None if self.size is None else size_of(self.size),
            "samples": whole("samples", self.samples),
            "color": None if self.color is None else color_of(self.color),
            "background": None if self.background is None else color_of(self.background),
            "transparent": flag("transparent", self.transparent),
            "normals": normals_of(self.normals),
            "clip": clip_of(self.clip),
            "caps": flag("caps", self.caps),
            "outputs": outputs,
            "max_error": optional("max_error", self.max_error),
            "by": evidence_of(self.by),
            "series": series_of(self.series),
            "voxel_pixels": number("voxel_pixels", self.voxel_pixels),
            "voxel_error": number("voxel_error", self.voxel_error),
            "time_budget": optional("time_budget", self.time_budget),
            "ambient": whole("ambient", self.ambient),
            "on_pass": function("on_pass", self.on_pass),
        }
        if self.transparent and self.background is not None:
            raise ValueError("background: a transparent picture has none")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def needs(self) -> dict[str, str]:
        """Options that a renderer needs to draw this, and the argument that needs each option."""
        by_proof = self.max_error is not None and self.by == "proof"
        by_sample = self.max_error is not None and self.by == "sample"
        asked = {
            "bounds": ("max_error", by_proof or "bounds" in self.outputs),
            "levels": (
                "max_error" if by_sample else "voxel_pixels",
                by_sample or self.voxel_pixels > 0,
            ),
            "time_budget": ("time_budget", self.time_budget is not None),
            "rays": ("ambient", self.ambient != 0),
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
            "background": self.background,
            "transparent": self.transparent,
            "normals": self.normals,
            "clip": [{"normal": plane.normal, "offset": plane.offset} for plane in self.clip],
            "caps": self.caps,
            "voxel_pixels": self.voxel_pixels,
            "voxel_error": self.voxel_error,
            "max_surface_error": self.max_error,
            "by": self.by,
            "series": [camera_for_core(camera) for camera in self.series],
            "time_budget_ms": None if self.time_budget is None else 1000 * self.time_budget,
            "ambient_rays": self.ambient,
            "want_picture": "rgb" in self.outputs,
            "want_depth": "depth" in self.outputs,
            "want_normals": "normals" in self.outputs,
            "want_positions": "position" in self.outputs,
            "want_bounds": "bounds" in self.outputs,
        }


def color_of(color: Color) -> tuple[float, float, float]:
    if isinstance(color, str):
        digits = re.fullmatch("#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})", color)
        if not digits:
            raise ValueError(f"color {color!r}: give '#rrggbb', or red, green, blue from 0 to 1")
        return vector(int(part, 16) / 255 for part in digits.groups())
    color = numbers("color", color, 3)
    if not all(0 <= part <= 1 for part in color):
        raise ValueError(f"color {tuple(color)}: give red, green and blue, from 0 to 1")
    return vector(color)


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


def camera_for_core(camera: Camera) -> dict[str, Any]:
    """The camera as fields of isowave::Camera."""
    return {
        "eye": camera.eye,
        "at": camera.at,
        "up": camera.up,
        "fovy_degrees": camera.fovy,
        "parallel_height": camera.parallel_height,
    }


def normals_of(normals: str) -> str:
    if normals not in ("smooth", "cell"):
        raise ValueError(f"normals {normals!r}: give 'smooth' or 'cell'")
    return normals


def evidence_of(by: str) -> str:
    if by not in ("proof", "sample"):
        raise ValueError(f"by {by!r}: give 'proof' or 'sample'")
    return by


def optional(name: str, value: Any) -> float | None:
    return None if value is None else number(name, value)
