"""xarray.DataArray: coordinates say where voxels lie."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .errors import bad_value, short
from .found import Found, named, no_data_in
from .grid import checked_shape, of_steps
from .layers import even_rows
from .stores import uneven_rows

_EVEN_TOLERANCE = 1e-2
"""How far, in steps, a coordinate may be from an even one: files round to float32 or decimals."""
AXES = {
    "z": "z",
    "depth": "z",
    "height": "z",
    "altitude": "z",
    "lev": "z",
    "level": "z",
    "plev": "z",
    "y": "y",
    "lat": "y",
    "latitude": "y",
    "northing": "y",
    "x": "x",
    "lon": "x",
    "longitude": "x",
    "easting": "x",
}
"""Names of dims, in small letters, that say which axis they are."""


def xarray_dataarray(array: Any, has_spacing: bool) -> Found:
    """Adapts an xarray.DataArray. Names of its dims say which is z, y and x, in any order.

    Dims with other names take the axes that are left, in their order. A dimension's coordinate
    gives spacing and origin; a falling one a direction of -1, so that every voxel stays where its
    coordinates say. Without a coordinate: spacing 1, origin 0.

    The attribute _FillValue, or missing_value, names voxels without data. If xarray has decoded the
    file, it has replaced them by NaN. rioxarray's nodata is the same attribute.

    Raises ArrayValueError for two dims of one axis, and for a coordinate that is not of numbers,
    not even or not moving, unless the caller gave a spacing; then such a coordinate is ignored.
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
    order = _order(array, dims, what)
    if order is not None:
        dims = tuple(dims[axis] for axis in order)
    sizes = array.shape if order is None else tuple(array.shape[axis] for axis in order)
    shape = checked_shape(sizes, what)

    steps, origin = [1.0] * 3, [0.0] * 3
    for axis, dim in enumerate(dims):
        if dim not in array.coords:
            continue
        try:
            steps[axis], origin[axis] = even_steps(array.coords[dim].values, shape[axis], dim, what)
        except ValueError:
            if not has_spacing:
                raise
    placement = of_steps((steps[2], steps[1], steps[0]), (origin[2], origin[1], origin[0]))

    def fetch(begin: int, end: int) -> Any:
        # Indexes the variable, because indexing an array indexes all its coordinates, too.
        layers = array.variable.isel({dims[0]: slice(begin, end)}).values
        return layers if order is None else layers.transpose(order)

    along_z = 0 if order is None else order[0]
    rows = _rows(array, dims[0], along_z, shape[0], what)
    return Found(what, shape, array.dtype, fetch, rows, placement, no_data=no_data_in(array.attrs))


def _order(array: Any, dims: tuple[Any, ...], what: str) -> tuple[int, int, int] | None:
    """Returns which of the dims are z, y and x; None: they are in this order.

    A coordinate's attribute `axis` (CF conventions) goes before the dimension's name.
    """
    if len(dims) != 3:
        return None  # checked_shape() refuses it
    named_axes: dict[str, int] = {}
    for index, dim in enumerate(dims):
        axis = axis_of(array, dim)
        if axis is None:
            continue
        if axis in named_axes:
            raise bad_value(what, f"dims {short(dims)}: two of them are {axis}: rename one")
        named_axes[axis] = index
    others = iter(sorted({0, 1, 2} - set(named_axes.values())))
    z, y, x = (named_axes[axis] if axis in named_axes else next(others) for axis in "zyx")
    return None if (z, y, x) == (0, 1, 2) else (z, y, x)


def axis_of(array: Any, dim: Any) -> str | None:
    """Returns which of z, y and x a dimension is, if it says so."""
    if dim in array.coords:
        attributes = getattr(array.coords[dim], "attrs", None)
        said = attributes.get("axis") if isinstance(attributes, Mapping) else None
        if isinstance(said, str) and said in ("X", "Y", "Z"):
            return said.lower()
    return AXES.get(dim.lower()) if isinstance(dim, str) else None


def even_steps(values: Any, count: int, dim: Any, what: str) -> tuple[float, float]:
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


def _rows(array: Any, dim: Any, axis: int, num_layers: int, what: str) -> Sequence[int] | None:
    """Returns the edges of chunk rows along an axis: dask's, or those that a file's reader noted.

    A slice of a file's variable keeps the note of the whole; chunks at the edges of its rows are
    then read twice.
    """
    if array.chunks is not None:
        return uneven_rows(array.chunks[axis], num_layers, what)
    encoding = array.encoding
    if not isinstance(encoding, Mapping):
        return None
    preferred = encoding.get("preferred_chunks")
    layers = preferred.get(dim) if isinstance(preferred, Mapping) else None
    if layers is None and encoding.get("original_shape") == tuple(array.shape):
        sizes = encoding.get("chunksizes")
        layers = sizes[axis] if isinstance(sizes, (list, tuple)) and len(sizes) == 3 else None
    try:
        layers = operator.index(layers)  # type: ignore[arg-type]
    except TypeError:
        return None  # chunks of different sizes, or no note
    return even_rows(layers, num_layers) if layers > 0 else None
