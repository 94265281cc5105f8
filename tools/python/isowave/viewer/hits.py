"""What is seen at a place of a picture: the hit's position, and the values there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isowave._camera import Camera

from .interfaces import VolumeLike


@dataclass(frozen=True)
class Hits:
    """The first hits of a picture's rays.

    depth   distance from the eye, or from the eye's plane in parallel projection [world units],
            by rows and columns of rays; inf: no surface
    camera  the picture's
    step    of the series
    """

    depth: NDArray[np.float32]
    camera: Camera
    step: int

    def position(self, at: tuple[float, float]) -> NDArray[np.float64] | None:
        """World position of the hit at a place of the picture, 0 to 1; None: there is none."""
        rows, columns = self.depth.shape
        row, column = (min(int(p * n), n - 1) for p, n in ((at[1], rows), (at[0], columns)))
        distance = float(self.depth[row, column])
        if not math.isfinite(distance):
            return None
        camera = self.camera
        eye = np.array(camera.eye, np.float64)
        forward = _unit(np.array(camera.at) - eye)
        right = _unit(np.cross(forward, camera.up))
        half = (
            math.tan(math.radians(camera.fovy) / 2)
            if camera.parallel_height is None
            else camera.parallel_height / 2
        )
        u = (2 * (column + 0.5) / columns - 1) * half * columns / rows
        v = (1 - 2 * (row + 0.5) / rows) * half
        aside = u * right + v * np.cross(right, forward)
        position: NDArray[np.float64] = (
            eye + distance * _unit(forward + aside)
            if camera.parallel_height is None
            else eye + aside + distance * forward
        )
        return position


def _unit(v: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(v / np.linalg.norm(v))


def value_at(volume: VolumeLike, position: NDArray[np.float64]) -> float | None:
    """The trilinear value at a world position; None: outside, or without data."""
    spacing, origin = np.array(volume.spacing[::-1]), np.array(volume.origin[::-1])
    index = np.linalg.solve(volume.direction * spacing, position - origin)[::-1]
    last = np.array(volume.shape) - 1
    if not np.all((index > -0.5) & (index < last + 0.5)):
        return None
    index = np.clip(index, 0, last)
    begin = np.minimum(index.astype(int), np.maximum(last - 1, 0))
    z, y, x = (slice(int(b), int(b) + 2) for b in begin)
    cell = np.asarray(volume[z, y, x], np.float64)
    for part in index - begin:  # along z, then y, then x
        cell = cell[0] if len(cell) == 1 else (1 - part) * cell[0] + part * cell[1]
    value = float(cell)
    return value if math.isfinite(value) else None


def seen(
    hits: Hits, at: tuple[float, float], volume: VolumeLike, field: VolumeLike | None
) -> dict[str, Any]:
    """Position at a place of the picture, and both volumes' values there; {}: nothing is there."""
    position = hits.position(at)
    if position is None:
        return {}
    place: dict[str, Any] = {"position": [float(x) for x in position]}
    try:
        place["value"] = value_at(volume, position)
        place["field"] = None if field is None else value_at(field, position)
    except Exception:  # the file is gone: pictures tell of it
        pass
    return place
