"""xarray.DataArray: coordinates say where voxels lie."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .errors import bad_value, short
from .found import Found, named
from .grid import checked_shape, of_steps
from .layers import even_rows
from .stores import uneven_rows

_EVEN_TOLERANCE = 1e-2
"""How far, in steps, a coordinate may be from an even one: files round to float32 or decimals."""


def xarray_dataarray(array: Any, has_spacing: bool) -> Found:
    """Adapts an xarray.DataArray. Its dims, in their order, are z, y and x, whatever their names.

    A dimension's coordinate gives spacing and origin; a falling one a direction of -1, so that
    every voxel stays where its coordinates say. Without a coordinate: spacing 1, origin 0.

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

    steps, origin = [1.0] * 3, [0.0] * 3
    for axis, dim in enumerate(dims):
        if dim not in array.coords:
            continue
        try:
            steps[axis], origin[axis] = _even_steps(
                array.coords[dim].values, shape[axis], dim, what
            )
        except ValueError:
            if not has_spacing:
                raise
    placement = of_steps((steps[2], steps[1], steps[0]), (origin[2], origin[1], origin[0]))

    def fetch(begin: int, end: int) -> Any:
        # Of the variable, because indexing an array indexes all its coordinates, too.
        return array.variable.isel({dims[0]: slice(begin, end)}).values

    return Found(what, shape, array.dtype, fetch, _rows(array, dims, shape, what), placement)


def _even_steps(values: Any, count: int, dim: Any, what: str) -> tuple[float, float]:
    """Returns the step, negative if coordinates fall, and the first coordinate.

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
    return step, float(positions[0])


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
