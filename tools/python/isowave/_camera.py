"""Cameras."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from isowave._checked import whole
from isowave._placed import Placed


@dataclasses.dataclass(frozen=True)
class Camera:
    """A camera in world space, a pinhole or in parallel projection; vectors are (x, y, z)."""

    eye: tuple[float, float, float]
    at: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    fovy: float = 60.0  #: pinhole: angle between the picture's lower and upper edge [degrees]
    #: Height of the picture in parallel (orthographic) projection [world units]; None: a pinhole.
    #: Depth is then the distance from the eye's plane.
    parallel_height: float | None = None

    def pixel_size(self, height: int, distance: float) -> float:
        """Height of a pixel at a distance, in a picture of `height` pixels [world units]."""
        if self.parallel_height is not None:
            return self.parallel_height / height
        return distance * 2 * math.tan(math.radians(self.fovy) / 2) / height

    @staticmethod
    def orbit(volume: Placed[Any], count: int) -> list[Camera]:
        """Cameras around the volume's box, as those of `isowave render --orbit`.

        They stand on a circle about the y axis, 20 degrees above its plane, 0.8 diagonals of the
        box from its centre.
        """
        corner = np.array(volume.origin[::-1])
        extent = (np.array(volume.shape[::-1]) - 1) * volume.spacing[::-1]
        centre = corner + volume.direction @ (extent / 2)
        distance = 0.8 * float(np.linalg.norm(extent))
        elevation = math.radians(20)
        cameras = []
        count = whole("count", count)
        for i in range(count):
            azimuth = 2 * math.pi * i / count + 0.3
            towards = (
                math.sin(azimuth) * math.cos(elevation),
                math.sin(elevation),
                math.cos(azimuth) * math.cos(elevation),
            )
            cameras.append(Camera(vector(centre + distance * np.array(towards)), vector(centre)))
        return cameras

    @staticmethod
    def from_pyvista(camera: Any) -> Camera:
        """The view of a pyvista.Camera, or of a plotter's `camera`."""
        is_parallel = getattr(camera, "parallel_projection", False)
        return Camera(
            vector(camera.position),
            vector(camera.focal_point),
            vector(camera.up),
            float(camera.view_angle),
            2 * float(camera.parallel_scale) if is_parallel else None,
        )


def view_count(count: Any) -> int:
    """How many views a turntable has: 1 to 100,000."""
    if not 1 <= whole("num_views", count) <= 100_000:
        raise ValueError(f"num_views={count}: give 1 to 100,000")
    return int(count)


def vector(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
