"""Cameras."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._checked import number, numbers, size_of, whole
from isowave._placed import Placed

#: Sides from which volumes are seen, in the order of isowave::Side.
SIDES = ("corner", "front", "back", "left", "right", "top", "bottom", "iso")


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
    def of(
        volume: Placed[Any],
        view: str = "corner",
        *,
        size: tuple[int, int] = (1280, 720),
        up: Sequence[float] | None = None,
        zoom: float = 1.0,
    ) -> Camera:
        """A view of a volume that depends on its box alone: all steps of a series have the same.

        The box fills a picture of that size.

        Parameters
        ----------
        view
            Side from which the volume is seen: "front", "back", "left", "right", "top", "bottom";
            "iso": from the front right and above, where all edges look equally long; "corner": less
            far to the right, and above, as render() does without a camera. If Volume.anatomical,
            front is anterior, and left and right are the patient's own; else front is +z, right +x.
        up
            Direction (x, y, z) that is up; None: Volume.up. The sides turn with it.
        zoom
            Magnifies the picture about its middle, 0.01 to 1000.
        """
        return turntable_of(volume, 1, view, size, up, zoom)[0]

    @staticmethod
    def front(volume: Placed[Any], **more: Any) -> Camera:
        """The view from the front; arguments as of()."""
        return Camera.of(volume, "front", **more)

    @staticmethod
    def back(volume: Placed[Any], **more: Any) -> Camera:
        return Camera.of(volume, "back", **more)

    @staticmethod
    def left(volume: Placed[Any], **more: Any) -> Camera:
        return Camera.of(volume, "left", **more)

    @staticmethod
    def right(volume: Placed[Any], **more: Any) -> Camera:
        return Camera.of(volume, "right", **more)

    @staticmethod
    def top(volume: Placed[Any], **more: Any) -> Camera:
        return Camera.of(volume, "top", **more)

    @staticmethod
    def bottom(volume: Placed[Any], **more: Any) -> Camera:
        return Camera.of(volume, "bottom", **more)

    @staticmethod
    def iso(volume: Placed[Any], **more: Any) -> Camera:
        return Camera.of(volume, "iso", **more)

    @staticmethod
    def orbit(
        volume: Placed[Any],
        count: int,
        *,
        size: tuple[int, int] = (1280, 720),
        up: Sequence[float] | None = None,
    ) -> list[Camera]:
        """Cameras around the volume's box, as those of `isowave render --orbit`.

        They stand on a circle about `up` (None: Volume.up), 20 degrees above its plane, 0.8
        diagonals of the box from its centre, or as much further as pictures are narrower than high.
        """
        if whole("count", count) == 0:
            return []
        extent = (np.array(volume.shape[::-1]) - 1) * volume.spacing[::-1]
        width, height = size_of(size)
        diagonal = float(np.linalg.norm(volume.direction @ extent))
        distance = 0.8 * diagonal * max(1.0, height / width)
        cameras = turntable_of(volume, count, "corner", size, up, 1.0)
        return [camera._at_distance(distance) for camera in cameras]

    def fit(self, volume: Placed[Any], size: tuple[int, int] = (1280, 720)) -> Camera:
        """The camera, moved without turning, until the volume's box fills a picture."""
        return Camera(*_core.fitted(camera_for_core(self), volume._grid, size_of(size)))

    def look_at(self, point: Sequence[float], up: Sequence[float] | None = None) -> Camera:
        """The camera, turned about its eye towards a point (x, y, z); up: None stays as it is."""
        return dataclasses.replace(
            self,
            at=vector(numbers("point", point, 3)),
            up=self.up if up is None else vector(numbers("up", up, 3)),
        )

    def turned(
        self, degrees: float, above: float = 0.0, up: Sequence[float] | None = None
    ) -> Camera:
        """The camera, moved around what it looks at.

        degrees: about `up` (None: the camera's own), anticlockwise from above. above: then towards
        up, at most to 89 degrees from the horizon.
        """
        axis = np.array(self.up if up is None else vector(numbers("up", up, 3)), float)
        length = float(np.linalg.norm(axis))
        if not length > 0:
            raise ValueError("up has no direction")
        axis /= length
        back = np.array(self.eye) - self.at
        own_up = _rotated(np.array(self.up), axis, number("degrees", degrees))
        back = _rotated(back, axis, degrees)
        if number("above", above):
            right = np.cross(own_up, back)
            now = math.degrees(math.asin(np.clip(axis @ back / np.linalg.norm(back), -1, 1)))
            wanted = min(max(now + above, -89.0), 89.0)
            back = _rotated(back, right / np.linalg.norm(right), now - wanted)
            own_up = axis
        at = np.array(self.at)
        return dataclasses.replace(self, eye=vector(at + back), up=vector(own_up))

    def zoomed(self, zoom: float) -> Camera:
        """The camera, whose picture is magnified about its middle; the eye stays."""
        if not 0.01 <= number("zoom", zoom) <= 1000:
            raise ValueError(f"zoom={zoom}: give 0.01 to 1000")
        tangent = math.tan(math.radians(self.fovy) / 2) / zoom
        height = None if self.parallel_height is None else self.parallel_height / zoom
        return dataclasses.replace(
            self, fovy=math.degrees(2 * math.atan(tangent)), parallel_height=height
        )

    def _at_distance(self, distance: float) -> Camera:
        at = np.array(self.at)
        back = np.array(self.eye) - at
        return dataclasses.replace(self, eye=vector(at + distance / np.linalg.norm(back) * back))

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


def turntable_of(
    volume: Placed[Any],
    count: int,
    view: str,
    size: tuple[int, int],
    up: Sequence[float] | None,
    zoom: float,
) -> list[Camera]:
    """Views once around a volume's box; the first is that of Camera.of()."""
    if view not in SIDES:
        raise ValueError(f"view {view!r:.60}: there are {', '.join(SIDES)}")
    axis = None if up is None else vector(numbers("up", up, 3))
    cameras = _core.box_turntable(
        volume._grid,
        view_count(count),
        SIDES.index(view),
        axis,
        number("zoom", zoom),
        size_of(size),
    )
    return [Camera(*camera) for camera in cameras]


def camera_for_core(camera: Camera) -> dict[str, Any]:
    """The camera as fields of isowave::Camera."""
    return {
        "eye": camera.eye,
        "at": camera.at,
        "up": camera.up,
        "fovy_degrees": camera.fovy,
        "parallel_height": camera.parallel_height,
    }


def _rotated(v: npt.NDArray[np.float64], axis: npt.NDArray[np.float64], degrees: float) -> Any:
    """v, turned about an axis of length 1 (Rodrigues)."""
    along = axis * (axis @ v)
    angle = math.radians(degrees)
    return along + math.cos(angle) * (v - along) + math.sin(angle) * np.cross(axis, v)


def view_count(count: Any) -> int:
    """How many views a turntable has: 1 to 100,000."""
    if not 1 <= whole("num_views", count) <= 100_000:
        raise ValueError(f"num_views={count}: give 1 to 100,000")
    return int(count)


def vector(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
