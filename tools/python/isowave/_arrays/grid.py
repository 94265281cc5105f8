"""Places of an array's voxels in the world, and the grids that are accepted.

World = origin + direction * (spacing * index). Vectors in world space and index vectors beside
them are (x, y, z) here, as in ITK and VTK; what an ArraySource shows is (z, y, x). All of it is
plain Python: a grid is a dozen numbers.
"""

from __future__ import annotations

import math
import numbers
import operator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from .errors import bad_value, short

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

MAX_DIM = 1 << 16
"""Most voxels along an axis, as in core/volume."""
_LEAST_DETERMINANT = 1e-6
"""Least determinant of a direction matrix that can be inverted, as in core/volume."""
_UNIT_TOLERANCE = 1e-3
"""How far the length of a given direction's columns may be from 1: they come rounded."""

_MOST_CHANNELS = 4
"""Most channels in the last axis of an array of colours, such as RGBA."""

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Placement:
    """Place of a grid: spacing in world units (x, y, z), origin (x, y, z), direction by rows."""

    spacing: Vector = (1.0, 1.0, 1.0)
    origin: Vector = (0.0, 0.0, 0.0)
    direction: Matrix = IDENTITY
    is_anatomical: bool = False  #: whether the world is a patient's, LPS


def finite_number(value: Any, what: str, name: str) -> float:
    """Returns a real number as float.

    Raises ArrayValueError if the value is no number, is a bool or complex, or is not finite.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise bad_value(what, f"{name} has {short(value)}, which is not a number")
    try:
        number = float(value)
    except (OverflowError, ValueError, TypeError):
        number = math.inf
    if not math.isfinite(number):
        raise bad_value(what, f"{name} has {short(value)}: need finite numbers")
    return number


def finite_numbers(values: Any, count: int, what: str, name: str) -> list[float]:
    """Returns `count` finite numbers of a sequence as floats.

    Raises ArrayValueError if it has another length, or holds what is not a finite real number.
    """
    try:
        if isinstance(values, (str, bytes, dict, set, frozenset)):
            raise TypeError
        items = list(islice(iter(values), count + 1))  # SWIG's vectors are sequences, too
    except Exception:
        raise bad_value(what, f"{name} is {short(values)}: need {count} numbers") from None
    if len(items) != count:
        raise bad_value(what, f"{name} is {short(values)}: need {count} numbers")
    return [finite_number(item, what, name) for item in items]


def vector(values: Any, what: str, name: str) -> Vector:
    """Returns three finite numbers. Raises ArrayValueError as finite_numbers() does."""
    a, b, c = finite_numbers(values, 3, what, name)
    return a, b, c


def matrix(values: Any, what: str, name: str = "direction") -> Matrix:
    """Returns a 3 x 3 matrix of finite numbers by rows. Raises ArrayValueError."""
    try:
        rows = [] if isinstance(values, (str, bytes)) else list(islice(iter(values), 4))
    except Exception:
        rows = []
    if len(rows) != 3:
        raise bad_value(what, f"{name} is {short(values)}: need 3 rows of 3 numbers")
    return (
        vector(rows[0], what, name),
        vector(rows[1], what, name),
        vector(rows[2], what, name),
    )


def columns(rows: Matrix) -> Matrix:
    """Returns the transposed matrix."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, d, g), (b, e, h), (c, f, i)


def determinant(rows: Matrix) -> float:
    """Returns the determinant; NaN or infinite if it overflows."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def norm(v: Vector) -> float:
    """Returns the Euclidean length, without overflow on the way."""
    return math.hypot(*v)


def dot(a: Vector, b: Vector) -> float:
    """Returns the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def of_steps(steps: Vector, origin: Vector) -> Placement:
    """Returns the placement of a grid along the world's axes; a negative step is a direction of -1,
    so that every voxel stays where the steps put it."""
    x, y, z = (-1.0 if step < 0 else 1.0 for step in steps)
    return Placement(
        (abs(steps[0]), abs(steps[1]), abs(steps[2])),
        origin,
        ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)),
    )


def moved(placement: Placement, index: Vector) -> Vector:
    """Returns the world position (x, y, z) of an index (x, y, z)."""
    spacing = placement.spacing
    step = (spacing[0] * index[0], spacing[1] * index[1], spacing[2] * index[2])
    origin, rows = placement.origin, placement.direction
    return (
        origin[0] + dot(rows[0], step),
        origin[1] + dot(rows[1], step),
        origin[2] + dot(rows[2], step),
    )


def placement_of_affine(rows: Matrix, origin: Vector, what: str) -> Placement:
    """Splits an affine transform of indices (x, y, z) into spacing, origin and direction.

    Shear stays in the direction, whose columns have length 1. Raises ArrayValueError if an axis has
    no length.
    """
    units: list[Vector] = []
    lengths: list[float] = []
    for axis, column in zip("xyz", columns(rows)):
        length = norm(column)
        if not 0.0 < length < math.inf:
            raise bad_value(what, f"the affine's column of axis {axis} has length {length}")
        unit = (column[0] / length, column[1] / length, column[2] / length)
        if not abs(norm(unit) - 1.0) < 0.5:  # a denormal length has too few bits to divide by
            raise bad_value(what, f"the affine's column of axis {axis} has length {length}")
        units.append(unit)
        lengths.append(length)
    return Placement(
        (lengths[0], lengths[1], lengths[2]), origin, columns((units[0], units[1], units[2]))
    )


def checked_shape(shape: Any, what: str) -> tuple[int, int, int]:
    """Returns (nz, ny, nx).

    Raises ArrayValueError unless there are three axes of 2 to MAX_DIM voxels.
    """
    try:
        sizes = tuple(operator.index(size) for size in islice(iter(shape), 65))
    except Exception:
        raise bad_value(
            what,
            f"shape {short(shape)} is not known (a dask array: compute_chunk_sizes() finds it)",
        ) from None
    text = "(" + ", ".join(map(str, sizes)) + ("," if len(sizes) == 1 else "") + ")"
    if len(sizes) != 3:
        raise bad_value(what, f"shape {text}: {_advice_on_axes(sizes)}")
    for axis, size in zip("zyx", sizes):
        if not 2 <= size <= MAX_DIM:
            raise bad_value(
                what,
                f"shape {text}: {size} voxels along {axis}, each axis (z, y, x) must have 2 to "
                f"{MAX_DIM}",
            )
    return sizes[0], sizes[1], sizes[2]


def _advice_on_axes(sizes: tuple[int, ...]) -> str:
    """Says how to get three axes (z, y, x) out of these."""
    need = "need 3 axes (z, y, x)"
    surplus = len(sizes) - 3
    if surplus <= 0:
        return need
    if surplus == 1 and 2 <= sizes[-1] <= _MOST_CHANNELS < min(sizes[:-1]):
        return f"{need}: the last axis looks like channels, pass one channel: array[..., 0]"
    if sum(size != 1 for size in sizes) > 3:
        return f"{need}: take one volume of it, for example array[{', '.join('0' * surplus)}]"
    leading = 0
    while leading < surplus and sizes[leading] == 1:
        leading += 1
    trailing = 0
    while trailing < surplus - leading and sizes[-1 - trailing] == 1:
        trailing += 1
    if leading + trailing < surplus:
        return f"{need}: take away the axes of size 1, for example with array.squeeze()"
    index = ["0"] * leading + (["..."] + ["0"] * trailing if trailing else [])
    return f"{need}: pass array[{', '.join(index)}]"


def checked_direction(values: Any, what: str) -> Matrix:
    """Returns a direction that a caller gave: 3 x 3, columns of length 1.

    Raises ArrayValueError if a column has another length, as the columns of an affine have, which
    hold the spacing, too.
    """
    rows = matrix(values, what)
    for axis, column in zip("xyz", columns(rows)):
        if not abs(norm(column) - 1.0) <= _UNIT_TOLERANCE:
            raise bad_value(
                what,
                f"direction: the column of axis {axis} has length {norm(column):g}, need 1; "
                "lengths belong to spacing",
            )
    return rows


def checked_spacing(values: Any, what: str) -> Vector:
    """Returns a spacing that a caller gave, (z, y, x) or one number for all, as (x, y, z)."""
    if isinstance(values, numbers.Real) and not isinstance(values, (bool, np.bool_)):
        step = finite_number(values, what, "spacing")
        return step, step, step
    z, y, x = vector(values, what, "spacing (z, y, x)")
    return x, y, z


def check_placement(placement: Placement, what: str) -> None:
    """Applies the rules of check_volume_info() in core/volume.

    Raises ArrayValueError unless spacing is finite and above 0, the origin finite, and the
    direction finite and invertible.
    """
    x, y, z = placement.spacing
    if not (0.0 < x < math.inf and 0.0 < y < math.inf and 0.0 < z < math.inf):
        raise bad_value(
            what, f"spacing ({z:g}, {y:g}, {x:g}) (z, y, x): each must be finite and above 0"
        )
    if not all(map(math.isfinite, placement.origin)):
        raise bad_value(what, f"origin {short(placement.origin[::-1])} (z, y, x) is not finite")
    flat = [value for row in placement.direction for value in row]
    size = abs(determinant(placement.direction))
    if not all(map(math.isfinite, flat)) or not _LEAST_DETERMINANT < size < math.inf:
        raise bad_value(what, "the direction matrix is singular or not finite")
