"""Sizes and encodings: what the scene computes without a renderer."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image as pillow

from isowave._annotate import Annotations, annotated
from isowave._camera import Camera
from isowave._request import Request, optional_color

from .interfaces import ImageLike

LEAST_ANNOTATED: Final = (200, 150)  # pixels of a picture, as the library has it


def count_rays(size: tuple[int, int], samples: int) -> int:
    """Number of rays of a picture: samples x samples a pixel."""
    return size[0] * size[1] * samples * samples


@dataclass(frozen=True)
class Extent:
    """How much is drawn for a picture.

    size     width, height [pixels]
    samples  rays per pixel along each axis; the most, if the renderer chooses them
    ambient, shadow  ambient rays and shadow rays per hit
    bounce   least ambient rays that bring light, each by a ray more; 0: none does
    chooses  whether the renderer chooses the rays per pixel, to keep an error of the picture
    """

    size: tuple[int, int]
    samples: int
    ambient: int = 0
    shadow: int = 0
    bounce: int = 0
    chooses: bool = False

    @staticmethod
    def of(request: Request) -> Extent:
        """The extent of a request with a size."""
        assert request.size is not None
        return Extent(
            request.size,
            request.samples,
            request.ambient_rays,
            request.shadow_rays,
            request.bounce_rays,
            request.max_image_error is not None,
        )

    @property
    def rays(self) -> int:
        """Rays of the camera."""
        return count_rays(self.size, self.samples)

    @property
    def all_rays(self) -> int:
        """Most rays, with those of hits."""
        return self.rays * (1 + self.rays_of_hits)

    @property
    def rays_of_hits(self) -> int:
        """Those of light, per hit."""
        return max(self.ambient, self.bounce) * (2 if self.bounce else 1) + self.shadow

    @property
    def ability(self) -> int:
        """What a renderer must be made for: 0, no rays of hits; 1, some; 2, with bounced light."""
        return 2 if self.bounce else min(self.rays_of_hits, 1)

    @property
    def is_refined(self) -> bool:
        """Whether it has more than a ray a pixel, as they were asked for."""
        return not self.chooses and (self.samples > 1 or self.rays_of_hits > 0)

    @property
    def of_camera(self) -> Extent:
        """The same without rays of hits."""
        return replace(self, ambient=0, shadow=0, bounce=0)

    def within(self, max_rays: int, max_all_rays: int) -> Extent:
        """A smaller extent: it has fewer rays per pixel, then fewer pixels, then fewer ambient
        rays, then fewer shadow rays.

        max_rays bounds the camera's rays, max_all_rays those of the hits, too.
        """
        of_pixel = 1 + self.rays_of_hits if self.chooses else 1
        most_rays = min(max_rays, max_all_rays // of_pixel)
        samples = max(1, min(self.samples, math.isqrt(most_rays // count_rays(self.size, 1))))
        size = fit_size(self.size, samples, min(max_rays, max_all_rays))
        left = max(0, max_all_rays // count_rays(size, samples) - 1)  # for each hit
        shadow = min(self.shadow, left)
        most = (left - shadow) // (2 if self.bounce else 1)
        ambient, bounce = min(self.ambient, most), min(self.bounce, most)
        return Extent(size, samples, ambient, shadow, bounce, self.chooses)

    def request(self, wish: Request, camera: Camera) -> Request:
        """The request of a picture of this extent."""
        return replace(
            wish,
            camera=camera,
            size=self.size,
            samples=self.samples,
            ambient_rays=self.ambient,
            shadow_rays=self.shadow,
            bounce_rays=self.bounce,
            max_image_error=wish.max_image_error if self.chooses else None,
        )


def fit_size(size: tuple[int, int], samples: int, max_rays: int) -> tuple[int, int]:
    """The size [pixels], made smaller in its shape if it has too many rays."""
    if count_rays(size, samples) <= max_rays:
        return size
    scale = math.sqrt(max_rays / count_rays(size, samples))
    width, height = (max(1, int(side * scale)) for side in size)
    # A side of one pixel cannot become smaller: the other one makes up for it.
    limit = max(1, max_rays // (samples * samples))
    return max(1, min(width, limit // height)), max(1, min(height, limit))


def share_within(
    depth: NDArray[np.float32], bounds: NDArray[np.float32], limit: float
) -> float | None:
    """The share of the rays with a surface, or perhaps one, that are off by at most `limit`.

    depth, bounds  as in Image
    Returns None if there is no such ray.
    """
    surface = np.isfinite(depth) | (bounds > 0)
    count = int(np.count_nonzero(surface))
    return float(np.count_nonzero(bounds[surface] <= limit)) / count if count else None


def picture_of(image: ImageLike, request: Request) -> NDArray[np.uint8]:
    """uint8 [h, w, 3], or 4 if it is transparent."""
    if request.transparent:
        return image.rgba
    rgb = image.rgb
    assert rgb is not None  # it was asked for
    return rgb


def chosen_voxel_pixels(image: ImageLike, size: tuple[int, int], extent: Extent) -> float:
    """Distance between voxels [pixels of the wish] that was chosen to keep the picture's error."""
    if not extent.chooses:
        return 0.0
    chosen = float(image.statistics["detail"]["voxel_pixels"])
    return chosen * size[1] / extent.size[1]


def opaque(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """uint8 [h, w, 3]: a transparent picture over white."""
    if picture.shape[2] == 3:
        return picture
    alpha = picture[:, :, 3:].astype(np.uint16)
    mixed = (picture[:, :, :3] * alpha + 255 * (255 - alpha) + 127) // 255
    return mixed.astype(np.uint8)


def laid_over(
    under: NDArray[np.uint8], rgb: NDArray[np.uint8], request: Request
) -> NDArray[np.uint8]:
    """A picture of a pass, with what was there before in place of its background.

    under  uint8 [h, w, 3], of any size
    """
    rows, columns = rgb.shape[:2]
    if under.shape != rgb.shape:
        large = pillow.fromarray(under).resize((columns, rows), pillow.Resampling.BILINEAR)
        under = np.asarray(large)
    bottom = np.array((1, 1, 1) if request.background is None else rgb_floats(request.background))
    top = bottom if request.background_top is None else rgb_floats(request.background_top)
    up = 1 - (np.arange(rows)[:, None] + 0.5) / rows
    behind = np.rint(255 * (bottom + up * (top - bottom)))[:, None].astype(np.int16)
    is_behind = (np.abs(rgb - behind) <= 1).all(axis=2, keepdims=True)
    return np.where(is_behind, under, rgb)


def rgb_floats(color: Any) -> NDArray[np.float64]:
    return np.array(optional_color(color), np.float64)


def annotate(
    picture: NDArray[np.uint8],
    request: Request,
    wanted: Annotations,
    title: str,
    ranges: tuple[Any, Any],
) -> NDArray[np.uint8]:
    """The picture with annotations. A picture that is too small for them stays as it is.

    request  of the whole picture, with its camera and size. A smaller picture is made as large, so
             that texts are legible and stay at their places
    title    if `wanted` has none
    ranges   as in isowave._annotate.annotated()
    """
    assert request.size is not None
    if any(side < least for side, least in zip(request.size, LEAST_ANNOTATED)):
        return picture
    if picture.shape[1::-1] != request.size:
        large = pillow.fromarray(picture).resize(request.size, pillow.Resampling.BILINEAR)
        picture = np.asarray(large)
    wanted = replace(wanted, title=wanted.title or title)
    return annotated(picture, request.for_core(), ranges, wanted)


class Stopped(Exception):
    """The picture was not encoded to its end, since it is no longer wanted."""


class _Stream(io.BytesIO):
    """Raises Stopped if more is written and the picture is no longer wanted."""

    def __init__(self, is_wanted: Callable[[], bool]) -> None:
        super().__init__()
        self._is_wanted = is_wanted

    def write(self, data: Any) -> int:
        if not self._is_wanted():
            raise Stopped
        return super().write(data)


def encode_png(rgb: NDArray[np.uint8], is_wanted: Callable[[], bool]) -> bytes:
    """The lossless picture. rgb: uint8 [h, w, 3]. Raises Stopped soon after it is not wanted."""
    stream = _Stream(is_wanted)
    pillow.fromarray(rgb).save(stream, "png", compress_level=1)
    return stream.getvalue()
