"""Sizes, encodings and first isovalues: what the scene computes without a renderer."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image as pillow

from .interfaces import VolumeLike

JPEG_QUALITY: Final = 70


def count_rays(size: tuple[int, int], samples: int) -> int:
    """Rays of a picture: samples x samples a pixel."""
    return size[0] * size[1] * samples * samples


def fit_size(size: tuple[int, int], samples: int, max_rays: int) -> tuple[int, int]:
    """The size [pixels], made smaller in its shape where it has more rays than there may be."""
    if count_rays(size, samples) <= max_rays:
        return size
    scale = math.sqrt(max_rays / count_rays(size, samples))
    width, height = (max(1, int(side * scale)) for side in size)
    # A side of one pixel cannot become smaller: the other one makes up for it.
    limit = max(1, max_rays // (samples * samples))
    return max(1, min(width, limit // height)), max(1, min(height, limit))


def box_corners(volume: VolumeLike) -> NDArray[np.float64]:
    """The corners of a volume in world space: [8, 3], (x, y, z)."""
    steps = np.array([(i & 1, i >> 1 & 1, i >> 2 & 1) for i in range(8)], np.float64)
    sides = (np.array(volume.shape[::-1]) - 1) * np.array(volume.spacing[::-1])
    corners = (steps * sides) @ np.asarray(volume.direction, np.float64).T
    return np.asarray(corners + np.array(volume.origin[::-1]), np.float64)


def narrow_factor(
    corners: NDArray[np.float64],
    away: NDArray[np.float64],
    up: NDArray[np.float64],
    fovy: float,
    aspect: float,
    fitting_aspect: float,
) -> float:
    """How much further away the eye must be, so that what fits a wide picture fits this one.

    corners         of a box around what is looked at, and away: of the eye, relative to `at`
    aspect          width / height of this picture; fitting_aspect: of the one it fits
    """
    distance = float(np.linalg.norm(away))
    toward = away / distance
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    tangent = math.tan(math.radians(fovy) / 2)
    # A corner is inside if its offset is at most its depth times the tangent of the half angle.
    wide = np.abs(corners @ right) / (tangent * aspect)
    high = np.abs(corners @ np.cross(toward, right)) / tangent
    for_the_box = float(np.max(corners @ toward + np.maximum(wide, high))) / distance
    return max(1.0, min(for_the_box, fitting_aspect / aspect))


def dividing_value(counts: Sequence[int], low: float, high: float) -> float:
    """The value that divides a histogram into two classes of the least variance (Otsu 1979).

    counts  of equally wide bins from low to high
    """
    weights = np.asarray(counts, np.float64)
    edges = np.linspace(low, high, len(weights) + 1)
    middles = (edges[:-1] + edges[1:]) / 2
    below, above = np.cumsum(weights)[:-1], np.cumsum(weights[::-1])[::-1][1:]
    sums = np.cumsum(weights * middles)
    with np.errstate(divide="ignore", invalid="ignore"):
        between = below * above * (sums[:-1] / below - (sums[-1] - sums[:-1]) / above) ** 2
    between = np.where(np.isfinite(between), between, -1.0)
    if len(between) == 0 or between.max() <= 0:
        return float((low + high) / 2)
    # An empty stretch divides equally well anywhere: its middle is farthest from both classes.
    best = np.flatnonzero(between >= between.max() * (1 - 1e-12))
    return float((edges[best[0] + 1] + edges[best[-1] + 1]) / 2)


def encode_jpeg(rgb: NDArray[np.uint8]) -> bytes:
    """A picture on the way. rgb: uint8 [h, w, 3]."""
    stream = io.BytesIO()
    pillow.fromarray(rgb).save(stream, "jpeg", quality=JPEG_QUALITY)
    return stream.getvalue()


def encode_png(rgb: NDArray[np.uint8]) -> bytes:
    """The lossless picture. rgb: uint8 [h, w, 3]."""
    stream = io.BytesIO()
    pillow.fromarray(rgb).save(stream, "png", compress_level=1)
    return stream.getvalue()
