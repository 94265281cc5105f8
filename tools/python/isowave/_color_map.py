"""Colours of surfaces by the distance along an axis, or by a second volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._camera import vector
from isowave._checked import numbers, refuse

BY = ("axis", "depth", "field", "caps", "labels")
BY_FIELD = ("field", "caps", "labels")  # of a second volume
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class ColorMap:
    """Colours surfaces by their hits' distance from the world's origin along an axis.

    Or by the value of a second volume at each hit, trilinear between its voxels: Renderer(field=).
    Or by labels: those of a second volume, or of the drawn one.

    For Renderer.render(color_map=...). Lights shade the colours.
    """

    #: "viridis", "magma", "cividis", "coolwarm", "gray", "labels"; or (256, 3) colours, red, green,
    #: blue from 0 to 1. None: "viridis", and by labels "labels"
    colors: str | npt.ArrayLike | None = None
    axis: str | Sequence[float] = "z"  #: "x", "y", "z", or a direction in world space
    #: Distances of the first and the last colour [world units]; None: those of the volume's box.
    #: By a field, values; None: the least and the largest at the hits, or with several or
    #: translucent surfaces, of the field.
    range: tuple[float, float] | None = None
    #: "axis"; "depth": the axis along which the camera looks; "field": hits without a value have
    #: the surface's own colour; "caps": caps show the field, the volume itself unless there is
    #: another, and surfaces have their own colour;
    #: "labels": label L has colour L % 256. Voxels of the field, or without one of the volume
    #: itself, are labels, exact whole numbers from 0 to 65,535. A hit has the label of the nearest
    #: voxel with one other than 0, the background; on a surface of labels of the volume itself, of
    #: the nearest one with a label of it
    by: str = "axis"


@dataclass(frozen=True)
class CheckedColorMap:
    """A ColorMap of plain numbers."""

    name: str
    table: tuple[tuple[float, ...], ...]
    axis: tuple[float, float, float]
    range: tuple[float, float] | None
    by: str = "axis"


def color_map_of(color_map: object) -> CheckedColorMap | None:
    """The argument `color_map`. Raises TypeError, ValueError."""
    if color_map is None or isinstance(color_map, CheckedColorMap):
        return color_map
    if isinstance(color_map, str):
        color_map = ColorMap(color_map)
    if not isinstance(color_map, ColorMap):
        raise refuse("color_map", color_map, "an isowave.ColorMap, or a name")
    name, table = "", tuple[tuple[float, ...], ...]()
    colors = color_map.colors
    if colors is None:
        colors = "labels" if color_map.by == "labels" else "viridis"
    if isinstance(colors, str):
        name = colors
        if name not in _core.color_map_names():
            names = ", ".join(_core.color_map_names())
            raise ValueError(f"there is no colour map {name!r}: {names}")
    else:
        array = np.asarray(colors, np.float32)
        if array.shape != (256, 3):
            raise ValueError(f"ColorMap.colors of shape {array.shape}: give (256, 3), or a name")
        table = tuple(tuple(map(float, color)) for color in array)
    if color_map.by not in BY:
        raise ValueError(f"ColorMap.by {color_map.by!r:.60}: there are {', '.join(BY)}")
    axis = color_map.axis
    if isinstance(axis, str):
        if axis not in AXES:
            raise ValueError(f"ColorMap.axis {axis!r}: x, y, z, or three numbers")
        axis = AXES[axis]
    limits = color_map.range
    return CheckedColorMap(
        name,
        table,
        vector(numbers("ColorMap.axis", axis, 3)),
        None if limits is None else pair("ColorMap.range", limits),
        color_map.by,
    )


def pair(name: str, value: object) -> tuple[float, float]:
    low, high = numbers(name, value, 2)
    return low, high


def color_map_for_core(color_map: CheckedColorMap | None) -> dict[str, Any]:
    """As fields of isowave::Appearance."""
    if color_map is None:
        return {}
    low, high = color_map.range or (None, None)
    return {
        "color_map": color_map.name,
        "color_table": color_map.table,
        "color_axis": color_map.axis,
        "color_by_depth": color_map.by == "depth",
        "color_by_field": color_map.by in BY_FIELD,
        "color_caps_alone": color_map.by == "caps",
        "color_by_label": color_map.by == "labels",
        "color_low": low,
        "color_high": high,
    }
