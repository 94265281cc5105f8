"""Arrays that are read from a store in chunks: dask, zarr, h5py, tensorstore."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from itertools import accumulate, islice
from typing import Any

import numpy as np

from .errors import bad_type, bad_value, short, type_name
from .found import Found, chunk_size, named, no_data_in
from .grid import checked_shape
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
        rows_of_zarr(array, 0, shape[0], what),
        no_data=no_data_of_store(getattr(array, "fill_value", None)),
    )


def no_data_of_store(fill_value: Any) -> float | None:
    """Returns a store's fill value unless it is 0: that is the default, and means background."""
    return no_data_of(fill_value) or None


def rows_of_zarr(array: Any, axis: int, num_layers: int, what: str) -> Sequence[int]:
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
        no_data=no_data_of_h5py(dataset),
    )


def no_data_of_h5py(dataset: Any) -> Any:
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
    return no_data_of_store(dataset.fillvalue) if is_defined else None


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
        no_data=no_data_of_store(store.fill_value),
    )


def read_store_type(store: Any) -> Any:
    """Returns the numpy type of a TensorStore's voxels."""
    dtype = store.dtype.numpy_dtype
    read_type(dtype, type_name(store))
    return dtype


def group(obj: Any, has_spacing: bool) -> Found:
    """Refuses a collection of arrays, with how to choose one."""
    raise bad_type(named(obj), "holds several arrays: pass one of them, for example group['name']")
