"""Arrays that are read from a store in chunks: dask, zarr, OME-Zarr, h5py, tensorstore."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from itertools import accumulate, islice
from typing import Any

import numpy as np

from .errors import bad_type, bad_value, short, type_name
from .found import Found, chunk_size, named, no_data_in
from .grid import checked_shape, finite_numbers, of_steps
from .layers import even_rows
from .voxels import no_data_of, read_type


def dask_array(array: Any, has_spacing: bool) -> Found:
    """Adapts a dask.array.Array. Chunks along z may have different sizes.

    Its _meta says whether chunks will be masked arrays; masks themselves come with the chunks.
    """
    what = type_name(array)  # its name is a hash
    shape = checked_shape(array.shape, what)
    return Found(
        what,
        shape,
        array.dtype,
        lambda begin, end: array[begin:end].compute(),
        uneven_rows(array.chunks[0], shape[0], what),
        is_masked=isinstance(getattr(array, "_meta", None), np.ma.MaskedArray),
    )


def uneven_rows(sizes: Any, num_layers: int, what: str) -> Sequence[int]:
    """Returns the edges of chunk rows of the given sizes, in layers.

    Raises ArrayValueError unless they add up to the layers that there are.
    """
    try:
        rows = [operator.index(size) for size in islice(iter(sizes), num_layers * 2 + 2)]
    except Exception:
        rows = [0]
    if min(rows, default=-1) < 0 or sum(rows) != num_layers:
        raise bad_value(what, f"chunks of {short(sizes)} layers do not make up {num_layers}")
    rows = [size for size in rows if size]  # dask allows chunks without layers
    return [0, *accumulate(rows[:-1])]


def zarr_array(array: Any, has_spacing: bool) -> Found:
    """Adapts a zarr.Array of zarr 2 or 3. Shards are read by their inner chunks."""
    what = named(array)
    shape = checked_shape(array.shape, what)
    return Found(
        what,
        shape,
        array.dtype,
        lambda begin, end: array[begin:end],
        _rows_of_zarr(array, 0, shape[0], what),
        no_data=_no_data_of(getattr(array, "fill_value", None)),
    )


def _no_data_of(fill_value: Any) -> float | None:
    """Returns a store's fill value unless it is 0: that is the default, and means background."""
    return no_data_of(fill_value) or None


def _rows_of_zarr(array: Any, axis: int, num_layers: int, what: str) -> Sequence[int]:
    chunks = tuple(islice(iter(array.chunks), 33))
    if len(chunks) <= axis:
        raise bad_value(what, f"chunks {short(chunks)} do not fit its shape")
    return even_rows(chunk_size(chunks[axis], what), num_layers)


def h5py_dataset(dataset: Any, has_spacing: bool) -> Found:
    """Adapts an h5py.Dataset, chunked or not."""
    if not dataset:
        raise bad_value(type_name(dataset), "its file is closed")
    what = named(dataset)
    if dataset.shape is None:
        raise bad_value(what, "an empty dataset has no shape")
    shape = checked_shape(dataset.shape, what)
    read_type(dataset.dtype, what)  # before its fill value is looked at
    rows = None
    if dataset.chunks is not None:
        rows = even_rows(chunk_size(dataset.chunks[0], what), shape[0])
    return Found(
        what,
        shape,
        dataset.dtype,
        lambda begin, end: dataset[begin:end],
        rows,
        no_data=_no_data_of_h5py(dataset),
    )


def _no_data_of_h5py(dataset: Any) -> Any:
    """Returns what attributes of netCDF name, or else the fill value.

    netCDF's library gives every variable a fill value of its own, but bytes without an attribute
    have none by its conventions: each of their values may be data.
    """
    named_value = no_data_in(dataset.attrs)
    if named_value is not None:
        return named_value
    if dataset.dtype.itemsize == 1 and "_NCProperties" in dataset.file.attrs:
        return None
    is_defined = dataset.id.get_create_plist().fill_value_defined()
    return _no_data_of(dataset.fillvalue) if is_defined else None


def tensorstore_store(store: Any, has_spacing: bool) -> Found:
    """Adapts a tensorstore.TensorStore. Its domain need not begin at 0."""
    what = type_name(store)
    shape = checked_shape(store.shape, what)
    origin = operator.index(store.domain.origin[0])
    layout = store.chunk_layout
    rows: Sequence[int] | None = None
    layers = layout.read_chunk.shape[0] if layout.read_chunk.shape else None
    if layers is not None:
        layers = chunk_size(layers, what)
        first = (operator.index(layout.grid_origin[0]) - origin) % layers
        rows = even_rows(layers, shape[0], first)
    return Found(
        what,
        shape,
        read_store_type(store),
        lambda begin, end: store[origin + begin : origin + end].read().result(),
        rows,
        no_data=_no_data_of(store.fill_value),
    )


def read_store_type(store: Any) -> Any:
    """Returns the numpy type of a TensorStore's voxels."""
    dtype = store.dtype.numpy_dtype
    read_type(dtype, type_name(store))
    return dtype


def group(obj: Any, has_spacing: bool) -> Found:
    """Refuses a collection of arrays, with how to choose one."""
    raise bad_type(named(obj), "holds several arrays: pass one of them, for example group['name']")


def zarr_group(obj: Any, has_spacing: bool) -> Found:
    """Adapts the finest level of an OME-Zarr image, metadata 0.4 or 0.5.

    Scale and translation of the spatial axes give spacing and origin; a negative scale gives a
    direction of -1, so that every voxel stays where the metadata says. Further axes (t, c) must
    have one entry.

    Raises ArrayValueError for metadata that is not as the format says.
    """
    what = f"OME-Zarr {named(obj)}"
    attributes = dict(obj.attrs)
    nested = attributes.get("ome")
    multiscales = nested.get("multiscales") if isinstance(nested, Mapping) else None
    if multiscales is None:
        multiscales = attributes.get("multiscales")
    if multiscales is None:
        return group(obj, has_spacing)

    image = _entry(multiscales, "multiscales", what)
    dataset = _entry(image.get("datasets"), "datasets", what)
    path = dataset.get("path")
    if not isinstance(path, str) or not path:
        raise bad_value(what, f"the path of its first dataset is {short(path)}, need text")
    names, spatial = _axes(image.get("axes"), what)
    scale, translation = [1.0] * len(names), [0.0] * len(names)
    for transforms in (
        dataset.get("coordinateTransformations"),
        image.get("coordinateTransformations"),
    ):
        _apply(transforms, scale, translation, what)

    try:
        array = obj[path]
        sizes = tuple(operator.index(size) for size in islice(iter(array.shape), 33))
    except Exception:
        raise bad_value(what, f"its dataset {short(path)} is missing or no array") from None
    if len(sizes) != len(names):
        raise bad_value(
            what, f"its dataset {short(path)} has {len(sizes)} axes, its metadata {len(names)}"
        )
    for axis, size in enumerate(sizes):
        if axis in spatial or size == 1:
            continue
        index = ", ".join(":" if i in spatial else "0" for i in range(len(names)))
        steps = ", ".join(f"{scale[i]:g}" for i in spatial)
        raise bad_value(
            what,
            f"axis {short(names[axis])} has {size} entries: take one of them, for example "
            f"dask.array.from_zarr(group[{short(path)}])[{index}], with spacing=({steps})",
        )
    shape = checked_shape([sizes[i] for i in spatial], what)
    z, y, x = spatial

    def fetch(begin: int, end: int) -> Any:
        index: list[Any] = [0] * len(sizes)
        index[z], index[y], index[x] = slice(begin, end), slice(None), slice(None)
        return array[tuple(index)]

    placement = of_steps(
        (scale[x], scale[y], scale[z]), (translation[x], translation[y], translation[z])
    )
    return Found(
        what,
        shape,
        array.dtype,
        fetch,
        _rows_of_zarr(array, z, shape[0], what),
        placement,
        no_data=_no_data_of(getattr(array, "fill_value", None)),
    )


def _entry(entries: Any, name: str, what: str) -> Mapping[Any, Any]:
    """Returns the first of a list of objects of metadata."""
    if not isinstance(entries, (list, tuple)) or not entries or not isinstance(entries[0], Mapping):
        raise bad_value(what, f"{name} is {short(entries)}: need a list of objects")
    return entries[0]


def _axes(axes: Any, what: str) -> tuple[list[str], tuple[int, int, int]]:
    """Returns the axes' names, and which of them are z, y and x."""
    if not isinstance(axes, (list, tuple)) or not 1 <= len(axes) <= 32:
        raise bad_value(what, f"axes is {short(axes)}: need a list of axes (OME-Zarr 0.4 or later)")
    names: list[str] = []
    spatial: list[int] = []
    for i, axis in enumerate(axes):
        name = axis.get("name") if isinstance(axis, Mapping) else None
        if not isinstance(name, str):
            raise bad_value(what, f"an axis is {short(axis)}: need a name (OME-Zarr 0.4 or later)")
        names.append(name)
        if axis.get("type", "space" if name in ("z", "y", "x") else None) == "space":
            spatial.append(i)
    if len(spatial) != 3:
        raise bad_value(what, f"axes {short(names)}: {len(spatial)} of them are spatial, need 3")
    order = [names[i] for i in spatial]
    if sorted(order) == ["x", "y", "z"] and order != ["z", "y", "x"]:
        raise bad_value(what, f"axes {short(names)}: need the order z, y, x")
    z, y, x = spatial
    return names, (z, y, x)


def _apply(transforms: Any, scale: list[float], translation: list[float], what: str) -> None:
    """Lets coordinateTransformations follow what scale and translation already do."""
    if transforms is None:
        return
    name = "coordinateTransformations"
    if not isinstance(transforms, (list, tuple)):
        raise bad_value(what, f"{name} is {short(transforms)}: need a list")
    for transform in transforms:
        kind = transform.get("type") if isinstance(transform, Mapping) else None
        if kind == "identity":
            continue
        if kind not in ("scale", "translation"):
            raise bad_value(what, f"{name} has {short(transform)}: need a scale or translation")
        values = finite_numbers(transform.get(kind), len(scale), what, f"{name}' {kind}")
        for axis, value in enumerate(values):
            if kind == "translation":
                translation[axis] += value
            else:
                scale[axis] *= value
                translation[axis] *= value
