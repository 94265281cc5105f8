"""Slices: planes of a picture that show the voxels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isowave._camera import vector
from isowave._checked import flag, number, numbers, refuse
from isowave._color_map import AXES, CheckedColorMap, ColorMap, color_map_of


@dataclass(frozen=True)
class Slice:
    """A plane that shows the voxels: the points p with dot(normal, p) = offset. World space.

    For Renderer.render(slices=[...]). Voxels are trilinear, and have the colours of slice_map,
    without light. Those without data are not seen. In the picture's outputs, a slice is a surface
    behind the others, and a cap.
    """

    normal: str | Sequence[float]  #: "x", "y", "z", or a direction (x, y, z), of any length above 0
    offset: float = 0.0  #: [world units times the normal's length]
    opacity: float = 1.0  #: above 0; at 1, nothing behind the slice is seen
    clipped: bool = True  #: False: clipping planes leave it whole

    @staticmethod
    def through(
        point: Sequence[float], normal: str | Sequence[float], opacity: float = 1.0
    ) -> Slice:
        """The slice through a point (x, y, z) in world space."""
        direction = direction_of(normal)
        return Slice(direction, float(np.dot(direction, numbers("point", point, 3))), opacity)


def direction_of(normal: str | Sequence[float]) -> tuple[float, float, float]:
    if isinstance(normal, str):
        if normal not in AXES:
            raise ValueError(f"Slice.normal {normal!r}: give 'x', 'y', 'z' or a direction")
        return AXES[normal]
    return vector(numbers("Slice.normal", normal, 3))


def slices_of(slices: object) -> tuple[Slice, ...]:
    """The argument `slices`. Raises TypeError, ValueError."""
    if not isinstance(slices, Sequence):
        raise refuse("slices", slices, "a list of isowave.Slice")
    return tuple(slice_of(each) for each in slices)


def slice_of(each: object) -> Slice:
    if not isinstance(each, Slice):
        raise refuse("slices", each, "an isowave.Slice")
    return Slice(
        direction_of(each.normal),
        number("Slice.offset", each.offset),
        number("Slice.opacity", each.opacity),
        flag("Slice.clipped", each.clipped),
    )


def slice_map_of(slice_map: object) -> CheckedColorMap:
    """The argument `slice_map`. Raises TypeError, ValueError."""
    if isinstance(slice_map, (str, ColorMap, CheckedColorMap)):
        checked = color_map_of(slice_map)
        if checked is not None:
            return checked
    raise refuse("slice_map", slice_map, "an isowave.ColorMap, or a name")


def slice_map_for_core(slice_map: CheckedColorMap) -> dict[str, Any]:
    """As fields of isowave::Appearance."""
    low, high = slice_map.range or (None, None)
    return {
        "slice_map": slice_map.name,
        "slice_table": slice_map.table,
        "slice_low": low,
        "slice_high": high,
    }
