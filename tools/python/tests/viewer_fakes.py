"""A volume and its renderer without a device: a ball whose radius the isovalue gives.

It has the interface of isowave.Volume and isowave.Renderer as far as the viewer uses it, ends its
passes when a test lets it, and counts what exists.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isowave._camera import Camera
from isowave._placed import Vector
from isowave._request import Request
from isowave._source_file import SourceFile

SIDE = 64  # voxels along each axis, spacing 1
VALUES = 255.0  # at the centre; 0 at the middle of a face
TILE_RAYS = 256 * 256  # of a tile of the picture, which shows its error
FLIP_OF_ONE = 0.016  # of one ray a pixel

#: A wish that asks for nothing special; tests change what they are about.
PLAIN_WISH: dict[str, Any] = {
    "type": "wish",
    "id": 1,
    "isovalue": 80,
    "size": [32, 24],
    "camera": None,
    "color": [1, 1, 1],
    "background": [0, 0, 0],
    "background_top": None,
    "samples": 1,
    "max_error": None,
    "by": "proof",
    "time_budget": None,
    "voxel_pixels": 0,
    "ambient": 0,
    "clip": [],
    "caps": True,
    "surfaces": [],
    "color_map": None,
    "slices": [],
    "slice_map": {"colors": "gray", "range": None},
    "step": 0,
    "annotations": None,
    "lights": None,
    "light": None,
    "shadow": None,
    "bounce": 0,
    "transparent": False,
}


@dataclass
class FakeProgress:
    rgb: NDArray[np.uint8]
    passes: int
    completed_percent: float


@dataclass
class FakeImage:
    rgb: NDArray[np.uint8]
    statistics: Mapping[str, Any]
    complete: bool
    rgba: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((1, 1, 4), np.uint8))
    depth: NDArray[np.float32] | None = None
    bounds: NDArray[np.float32] | None = None


@dataclass
class Drawn:
    """One call of FakeRenderer.draw."""

    request: Request
    passes: int = 0
    stopped: bool = False

    @property
    def size(self) -> tuple[int, int]:
        assert self.request.size is not None
        return self.request.size


@dataclass
class FakeVolume:
    """before_pass  called before each pass of each frame, in the thread that draws
    refuse       an error for a renderer with these options, or None
    on_host      the renderers are the host's, which have no limits
    suggested    what suggested_isovalues() returns, unless it is to fail
    is_coarse    pictures within a time end before they are complete
    source       the file that it came from
    """

    passes: int = 3
    before_pass: Callable[[Drawn], None] = lambda drawn: None
    refuse: Callable[[dict[str, Any]], Exception | None] = lambda options: None
    frames: list[Drawn] = field(default_factory=list)
    renderers: list[dict[str, Any]] = field(default_factory=list)
    shape: tuple[int, int, int] = (SIDE, SIDE, SIDE)
    spacing: tuple[float, float, float] = (1.0, 1.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    anatomical: bool = False
    box: tuple[Vector, Vector] = ((0.0, 0.0, 0.0), (SIDE - 1.0, SIDE - 1.0, SIDE - 1.0))
    source_dtype: np.dtype[Any] = field(default_factory=lambda: np.dtype(np.uint8))
    value_range: tuple[float, float] = (0.0, VALUES)
    nbytes: int = 65536
    bits_per_voxel: float = 2.0
    max_error: float | None = 0.5
    num_levels: int = 1
    on_host: bool = False
    suggested: tuple[float, ...] = (90.5, 180.5)
    fail_suggesting: bool = False
    refuse_voxels: bool = False
    is_coarse: bool = False
    source: SourceFile | None = None

    def __getitem__(self, key: Any) -> NDArray[np.float32]:
        """Voxels: VALUES at the centre, less outwards."""
        if self.refuse_voxels:
            raise RuntimeError("the file is gone")
        z, y, x = (np.arange(SIDE)[part] - (SIDE - 1) / 2 for part in key)
        away = np.sqrt(z[:, None, None] ** 2 + y[:, None] ** 2 + x**2)
        return (VALUES * (1 - away / (SIDE / 2))).astype(np.float32)

    def isovalue_notice(self, isovalue: float) -> str:
        least, largest = self.value_range
        return "" if least < isovalue <= largest else f"isovalue {isovalue:g} is outside."

    def save_page(self, fields: dict[str, Any], path: Any, title: str, field: Any) -> None:
        isovalues = [surface["isovalue"] for surface in fields["surfaces"]]
        Path(path).write_text(f"<!doctype html><title>{title}</title>{isovalues}")

    def suggested_isovalues(self) -> list[float]:
        if self.fail_suggesting:
            raise RuntimeError("the file is shorter than it was")
        return list(self.suggested)

    def histogram(self, bins: int = 256) -> tuple[NDArray[Any], NDArray[Any]]:
        """The share of space between two radii, as a ball has it."""
        edges = np.linspace(0, VALUES, bins + 1)
        radius = SIDE / 2 * (1 - edges / VALUES)
        return np.round(-np.diff(4 / 3 * math.pi * radius**3)).astype(np.int64), edges

    def renderer(self, **options: Any) -> FakeRenderer:
        self.renderers.append(options)
        error = self.refuse(options)
        if error:
            raise error
        return FakeRenderer(self, options)


class FakeRenderer:
    def __init__(self, volume: FakeVolume, options: dict[str, Any]) -> None:
        self._volume, self._options = volume, options
        self._cache: set[float] = set()
        self.device: Mapping[str, Any] = {
            "name": "" if volume.on_host else options["device"] or "fake device",
            "memory_bytes": 0 if volume.on_host else 1 << 30,
            "notice": "",
        }
        width, height = options["size"]
        self.memory_bytes = 48 * width * height * options["samples"] ** 2

    def camera(self, *, size: tuple[int, int]) -> Camera:
        centre = (SIDE - 1) / 2
        away = 2.2 * max(2.0, self._radius(VALUES / 3)) * max(1.0, size[1] / size[0])
        return Camera((centre, centre, centre + away), (centre, centre, centre))

    def draw(self, request: Request) -> FakeImage:
        drawn = Drawn(request)
        width, height = self._options["size"]
        columns, rows = drawn.size
        if not self._volume.on_host:
            if (
                columns * rows * request.samples**2
                > width * height * self._options["samples"] ** 2
            ):
                raise RuntimeError("the renderer was not made for so many rays")
            if (request.ambient_rays or request.shadow_rays) and not self._options["rays"]:
                raise RuntimeError("the renderer was not made for rays of hits")
            if request.bounce_rays and not self._options["bounce"]:
                raise RuntimeError("the renderer was not made for light that bounces")
            if request.num_surfaces > self._options.get("surfaces", 0):
                raise RuntimeError("the renderer was made for fewer surfaces, or without slices")
            if request.has_labels != self._options.get("labels", False):
                raise RuntimeError("a renderer of labels draws labels alone, and others draw none")
        if request.has_labels and request.slices:
            raise RuntimeError("labels are drawn without slices")
        if len(set(request.isovalues)) < len(request.isovalues):
            raise RuntimeError(f"two surfaces have the isovalue {request.isovalue:g}")
        if request.needs_field and self._options.get("field") is None:
            raise RuntimeError("the renderer was made without a field")
        if "bounds" in request.outputs and request.has_labels:
            raise RuntimeError("labels are drawn without an error")
        image_error = request.max_image_error
        if request.num_surfaces and (image_error or request.time_budget_ms):
            raise RuntimeError("surfaces are drawn without max_image_error and time_budget_ms")
        if request.has_labels and request.max_surface_error:
            raise RuntimeError("labels are drawn without max_surface_error")
        if image_error and (
            request.max_surface_error or request.time_budget_ms or request.voxel_pixels
        ):
            raise RuntimeError("max_image_error chooses the detail, and is kept alone")
        if request.voxel_pixels and not self._options["levels"]:
            raise RuntimeError("the renderer was not made for levels of detail")
        if image_error and not self._volume.on_host:
            if width * height * self._options["samples"] ** 2 < TILE_RAYS:
                raise RuntimeError("the renderer was made for fewer rays than a tile has")
        if math.isnan(request.isovalue):
            raise RuntimeError("the isovalue is not a number")
        self._volume.frames.append(drawn)
        picture = self._layers(request)
        cached, image = request.isovalue in self._cache, picture
        for i in range(self._volume.passes):
            self._volume.before_pass(drawn)
            drawn.passes += 1
            image = picture.copy()
            image[rows * (i + 1) // self._volume.passes :] = _bytes(request.background or (1, 1, 1))
            statistics = {
                "passes": i + 1,
                "decoded_blocks": 0 if cached else 100 * (i + 1),
                "errors_are_stated": False,
                "field_range": (3.0, 250.5) if request.needs_field else None,
                "detail": self._chosen(request),
            }
            percent = 100.0 * (i + 1) / self._volume.passes
            if request.on_pass and not request.on_pass(FakeProgress(image, i + 1, percent)):
                drawn.stopped = True
                return FakeImage(image, statistics, False)
        self._cache.add(request.isovalue)
        # Three quarters of the rays meet a surface; of these, two thirds are off by 0.2 pixels.
        part = np.arange(columns * rows, dtype=np.float32).reshape(rows, columns) % 4
        depth = np.where(part == 0, np.inf, 5).astype(np.float32)
        bounds = np.choose(part.astype(int), [0, 0.2, 0.2, np.inf]).astype(np.float32)
        alpha = np.full((rows, columns, 1), 255, np.uint8)
        if "rgb" in request.outputs:
            depth = self._rays(request)[2]
            alpha = np.where(np.isfinite(depth), 255, 0).astype(np.uint8)[:, :, None]
            if "depth" not in request.outputs:
                return FakeImage(image, statistics, True, np.dstack((image, alpha)))
        is_whole = not (self._volume.is_coarse and request.time_budget_ms)
        return FakeImage(image, statistics, is_whole, np.dstack((image, alpha)), depth, bounds)

    def _chosen(self, request: Request) -> dict[str, Any] | None:
        """Rays and levels for an error of the picture: FLIP is FLIP_OF_ONE by n x n rays, by n."""
        error = request.max_image_error
        if error is None:
            return None
        choices = [n for n in (1, 2, 4, 8) if n < request.samples] + [request.samples]
        reached = [n for n in choices if 1.25 * FLIP_OF_ONE / n <= error]
        samples = reached[0] if reached else choices[-1]
        return {
            "voxel_pixels": 0.5 if reached and self._options["levels"] else 0.0,
            "voxel_error": 0.0,
            "reachable": bool(reached),
            "advice": "" if reached else "allow more rays",
            "samples": samples,
            "tiles": 48,
            "flip": FLIP_OF_ONE / samples,
            "highest_flip": 1.25 * FLIP_OF_ONE / samples,
        }

    def _layers(self, request: Request) -> NDArray[np.uint8]:
        """The picture of one ball, or of balls one in another."""
        if not request.surfaces:
            return self._picture(request)
        seen: NDArray[Any] = np.array(_bytes(request.background or (1, 1, 1)))
        for each in sorted(request.surfaces, key=lambda s: -s.values[0]):
            look: dict[str, Any] = {"color": each.color, "color_map": None}
            ball = replace(request, surfaces=(), isovalue=each.values[0], **look)
            seen = each.opacity * self._picture(ball) + (1 - each.opacity) * seen
        return np.round(seen).astype(np.uint8)

    @staticmethod
    def _radius(isovalue: float) -> float:
        return SIDE / 2 * min(1.0, max(0.0, 1 - isovalue / VALUES))

    def _picture(self, request: Request) -> NDArray[np.uint8]:
        """A lit ball with a chequered surface, so that turning it shows.

        Each ray has four pixels: numpy would take most of a page's time.
        """
        rays, normal, depth = self._rays(request)
        light = 0.2 + 0.8 * np.clip(-np.sum(normal * rays, axis=2), 0, 1)
        cells = np.floor(normal * 4).astype(int).sum(axis=2) % 2
        shade = (light * (1 - 0.25 * cells))[:, :, None] * np.array(
            request.color or (0.5, 0.5, 0.5)
        )
        hit, background = np.isfinite(depth)[:, :, None], np.array(request.background or (1, 1, 1))
        rgb = np.where(hit, _full(shade, request), background)
        picture: NDArray[np.uint8] = np.round(255 * rgb).astype(np.uint8)
        return picture

    def _rays(self, request: Request) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float32]]:
        """Directions and normals of rays, each of four pixels; depth of all pixels."""
        camera, isovalue = request.camera, request.isovalue
        assert camera is not None and request.size is not None
        columns, rows = request.size
        width, height = (columns + 1) // 2, (rows + 1) // 2
        eye = np.array(camera.eye)
        forward = _unit(np.array(camera.at) - eye)
        right = _unit(np.cross(forward, camera.up))
        up = np.cross(right, forward)
        a = math.tan(math.radians(camera.fovy) / 2)
        u = (2 * (np.arange(width) + 0.5) / width - 1) * a * width / height
        v = (1 - 2 * (np.arange(height) + 0.5) / height) * a
        rays = forward + u[None, :, None] * right + v[:, None, None] * up
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        to = np.full(3, (SIDE - 1) / 2) - eye
        along = rays @ to
        inside = along**2 - to @ to + self._radius(isovalue) ** 2
        hit = (inside >= 0) & (along > 0)
        t = along - np.sqrt(np.maximum(inside, 0))
        normal = (rays * t[:, :, None] - to) / max(self._radius(isovalue), 1e-9)
        depth = np.where(hit, t, np.inf).astype(np.float32)
        return rays, normal, _full(depth, request)


def _full(rays: NDArray[Any], request: Request) -> NDArray[Any]:
    """What each ray has, for its four pixels."""
    assert request.size is not None
    columns, rows = request.size
    return np.repeat(np.repeat(rays, 2, axis=0), 2, axis=1)[:rows, :columns].copy()


def _unit(v: NDArray[Any]) -> NDArray[Any]:
    return v / np.linalg.norm(v)


def _bytes(color: Any) -> NDArray[np.uint8]:
    return np.round(255 * np.array(color)).astype(np.uint8)
