"""xarray.DataArray: coordinates say where voxels lie."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .errors import bad_value, short
from .found import Found, named
from .grid import Placement, checked_shape
from .layers import even_rows
from .stores import uneven_rows

_EVEN_TOLERANCE = 1e-2
"""How far, in steps, a coordinate may be from an even one: files round to float32 or decimals."""


def xarray_dataarray(array: Any, has_spacing: bool) -> Found:
    """Adapts an xarray.DataArray. Its dims, in their order, are z, y and x, whatever their names.

    A dimension's coordinate gives spacing and origin; a falling one a direction of -1, so that
    every voxel stays where its coordinates say. Without a coordinate: spacing 1, origin 0.

    The attribute _FillValue, or missing_value, names voxels without data; xarray has replaced them
    by NaN where it decoded the file, and rioxarray's nodata is the same attribute.

    Raises ArrayValueError for a coordinate that is not of numbers, not even or not moving, unless
    the caller gave a spacing; then such a coordinate is ignored.
    """
    what = named(array)
    dims = tuple(array.dims)
    if len(dims) > 3:
        single = [dim for dim in dims if array.sizes[dim] == 1]
        if len(dims) - len(single) <= 3 and single:
            index = ", ".join(f"{dim}=0" for dim in single[: len(dims) - 3])
            raise bad_value(what, f"dims {short(dims)}: need 3 (z, y, x): pass .isel({index})")
        raise bad_value(
            what, f"dims {short(dims)}: need 3 (z, y, x): choose with .isel() or .sel()"
        )
    shape = checked_shape(array.shape, what)

    spacing, origin, signs = [1.0] * 3, [0.0] * 3, [1.0] * 3
    for axis, dim in enumerate(dims):
        if dim not in array.coords:
            continue
        try:
            spacing[axis], origin[axis], signs[axis] = _even_steps(
                array.coords[dim].values, shape[axis], dim, what
            )
        except ValueError:
            if not has_spacing:
                raise
    sz, sy, sx = signs
    placement = Placement(
        (spacing[2], spacing[1], spacing[0]),
        (origin[2], origin[1], origin[0]),
        ((sx, 0.0, 0.0), (0.0, sy, 0.0), (0.0, 0.0, sz)),
    )

    def fetch(begin: int, end: int) -> Any:
        # Of the variable, because indexing an array indexes all its coordinates, too.
        return array.variable.isel({dims[0]: slice(begin, end)}).values

    no_data = array.attrs.get("_FillValue", array.attrs.get("missing_value"))
    rows = _rows(array, dims, shape, what)
    return Found(what, shape, array.dtype, fetch, rows, placement, no_data=no_data)


def _even_steps(values: Any, count: int, dim: Any, what: str) -> tuple[float, float, float]:
    """Returns the step's length, the first coordinate, and the step's sign.

    Raises ArrayValueError, with the dimension's name, if there is no such step.
    """
    name = f"coordinate {short(dim)}"
    ways = "pass spacing= to ignore it, or resample with .interp()"
    coordinates = np.asarray(values)
    if coordinates.shape != (count,):
        raise bad_value(what, f"{name} has shape {coordinates.shape}, need ({count},)")
    if coordinates.dtype.kind not in "iuf":
        raise bad_value(
            what, f"{name} is of {short(coordinates.dtype.name)}, not numbers: pass spacing="
        )
    with np.errstate(all="ignore"):
        positions = coordinates.astype(np.float64)
        if not np.isfinite(positions).all():
            raise bad_value(what, f"{name} has values that are not finite: {ways}")
        step = (float(positions[-1]) - float(positions[0])) / (count - 1)
        even = positions[0] + step * np.arange(count)
        off = float(np.abs(positions - even).max())
    if step == 0 or not off <= _EVEN_TOLERANCE * abs(step):
        raise bad_value(what, f"{name} is not evenly spaced: {ways}")
    return abs(step), float(positions[0]), -1.0 if step < 0 else 1.0


def _rows(
    array: Any, dims: tuple[Any, ...], shape: tuple[int, int, int], what: str
) -> Sequence[int] | None:
    """Returns the edges of chunk rows: dask's, or those that a file's reader noted.

    A slice of a file's variable keeps the note of the whole; chunks at the edges of its rows are
    then read twice.
    """
    if array.chunks is not None:
        return uneven_rows(array.chunks[0], shape[0], what)
    encoding = array.encoding
    if not isinstance(encoding, Mapping):
        return None
    preferred = encoding.get("preferred_chunks")
    layers = preferred.get(dims[0]) if isinstance(preferred, Mapping) else None
    if layers is None and encoding.get("original_shape") == shape:
        sizes = encoding.get("chunksizes")
        layers = sizes[0] if isinstance(sizes, (list, tuple)) and sizes else None
    try:
        layers = operator.index(layers)  # type: ignore[arg-type]
    except TypeError:
        return None  # chunks of different sizes, or no note
    return even_rows(layers, shape[0]) if layers > 0 else None
