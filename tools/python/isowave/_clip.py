"""Clipping planes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isowave._camera import vector
from isowave._checked import number, numbers, refuse


@dataclass(frozen=True)
class ClipPlane:
    """A clipping plane: the points p with dot(normal, p) >= offset stay. World space, (x, y, z)."""

    normal: tuple[float, float, float]  #: towards what stays, of any length above 0
    offset: float = 0.0  #: [world units times the normal's length]

    @staticmethod
    def through(point: Sequence[float], normal: Sequence[float]) -> ClipPlane:
        """The plane through a point: what stays lies towards the normal.

        Parameters
        ----------
        point, normal
            (x, y, z) in world space.
        """
        direction = vector(numbers("normal", normal, 3))
        return ClipPlane(direction, float(np.dot(direction, numbers("point", point, 3))))


def clip_box(begin: Sequence[float], end: Sequence[float]) -> list[ClipPlane]:
    """The planes of a box that stays, with edges along the world's axes.

    Parameters
    ----------
    begin, end
        Opposite corners of the box, (x, y, z) in world space. Sides at -inf and inf are open.

    Raises
    ------
    ValueError
        The box has no inside.
    """
    planes = []
    for axis, low, high in zip(range(3), numbers("begin", begin, 3), numbers("end", end, 3)):
        if not low < high:
            raise ValueError(f"the box ends at {high} along {'xyz'[axis]}, and begins at {low}")
        along = np.eye(3)[axis]
        planes += [ClipPlane(vector(along), low), ClipPlane(vector(-along), -high)]
    return [plane for plane in planes if math.isfinite(plane.offset)]


def clip_of(clip: object) -> tuple[ClipPlane, ...]:
    """The planes of the argument `clip`. Raises TypeError, ValueError."""
    if not isinstance(clip, Sequence):
        raise refuse("clip", clip, "a list of clipping planes")
    return tuple(plane_of(plane) for plane in clip)


def plane_of(plane: object) -> ClipPlane:
    if not isinstance(plane, ClipPlane):
        raise refuse("clip", plane, "an isowave.ClipPlane")
    return ClipPlane(
        vector(numbers("ClipPlane.normal", plane.normal, 3)),
        number("ClipPlane.offset", plane.offset),
    )
