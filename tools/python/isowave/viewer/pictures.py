"""Sizes and encodings: what the scene computes without a renderer."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as pillow

from isowave._request import Request


def count_rays(size: tuple[int, int], samples: int) -> int:
    """Number of rays of a picture: samples x samples a pixel."""
    return size[0] * size[1] * samples * samples


@dataclass(frozen=True)
class Extent:
    """How much is drawn for a picture.

    size     width, height [pixels]
    samples  rays per pixel along each axis
    ambient, shadow  ambient rays and shadow rays per hit
    """

    size: tuple[int, int]
    samples: int
    ambient: int = 0
    shadow: int = 0

    @staticmethod
    def of(request: Request) -> Extent:
        """The extent of a request with a size."""
        assert request.size is not None
        return Extent(request.size, request.samples, request.ambient, request.shadow_rays)

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
        """Ambient rays and shadow rays, per hit."""
        return self.ambient + self.shadow

    @property
    def of_camera(self) -> Extent:
        """The same without rays of hits."""
        return Extent(self.size, self.samples)

    def within(self, max_rays: int, max_all_rays: int) -> Extent:
        """A smaller extent. It has fewer pixels, then fewer ambient rays, then fewer shadow rays.

        max_rays bounds the camera's rays, max_all_rays those of the hits, too.
        """
        size = fit_size(self.size, self.samples, min(max_rays, max_all_rays))
        left = max(0, max_all_rays // count_rays(size, self.samples) - 1)  # for each hit
        shadow = min(self.shadow, left)
        return Extent(size, self.samples, min(self.ambient, left - shadow), shadow)


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
