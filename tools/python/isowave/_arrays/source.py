"""as_source(), through which every array comes in."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import images, labelled, memory, nifti, ome_zarr, stores
from .errors import ArrayTypeError, ArrayValueError, bad_type, bad_value, one_line, type_name
from .found import Adapter, Found
from .grid import (
    check_placement,
    checked_direction,
    checked_spacing,
    moved,
    vector,
)
from .layers import LayerReader, most_layers
from .voxels import checked_fill, no_data_of, read_type, type_with_nan


@dataclass(frozen=True, eq=False)
class ArraySource:
    """A volume that is read layer by layer from an array of any package. Made by as_source().

    World = origin + direction * (spacing * index), where direction's columns and rows are
    (x, y, z) and all else is (z, y, x).

    shape         (nz, ny, nx), voxels; each 2 to 65,536
    dtype         type of what read() returns: uint8, int8, uint16, int16, uint32, int32, uint64,
                  int64, float32 or float64, in native byte order
    spacing       (z, y, x), world units between voxels, above 0
    origin        (z, y, x), world position of voxel (0, 0, 0)
    direction     [3, 3] float64, not writable; column a is the world direction (x, y, z) of index
                  axis a, a in the order x, y, z; can be inverted, may mirror
    chunk_layers  layers along z of the store's largest chunks, 1 if there are no chunks; slabs of a
                  multiple of it hold whole chunks
    no_data       value of voxels without data, as the array's metadata says; None: it says none
    is_anatomical whether the world is a patient's, LPS
    """

    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]
    direction: NDArray[np.float64]
    chunk_layers: int
    no_data: float | None
    is_anatomical: bool
    _what: str = field(repr=False)
    _reader: LayerReader = field(repr=False)

    def read(self, z_begin: int, z_end: int) -> NDArray[Any]:
        """Returns layers [z_begin, z_end): C-contiguous, of dtype, [z_end - z_begin, ny, nx].

        The result may be a view of the caller's array: do not write to it. Slabs in ascending
        order read each chunk of the store once, whatever their size; other orders are allowed.
        Holds at most one row of chunks between calls. Not for several threads at a time.

        Raises ValueError or TypeError, one line, if there are no such layers, if the store cannot
        be read, or if a voxel cannot be read exactly. A masked whole number raises it, too, if a
        lazy array did not say that it has masks, and there is no fill_value.
        """
        begin, end = operator.index(z_begin), operator.index(z_end)
        if not 0 <= begin < end <= self.shape[0]:
            raise bad_value(self._what, f"layers {begin} to {end} of {self.shape[0]} do not exist")
        try:
            return self._reader.read(begin, end)
        except (ArrayValueError, ArrayTypeError, MemoryError):
            raise
        except Exception as error:
            problem = f"layers {begin} to {end} cannot be read: {type(error).__name__}: {error}"
            raise bad_value(self._what, problem) from error


_ADAPTERS: dict[tuple[str, str], Adapter] = {
    ("xarray", "DataArray"): labelled.xarray_dataarray,
    ("xarray", "Dataset"): stores.group,
    ("xarray", "DataTree"): stores.group,
    ("dask", "Array"): stores.dask_array,
    ("zarr", "Array"): stores.zarr_array,
    ("zarr", "Group"): ome_zarr.zarr_group,
    ("h5py", "Dataset"): stores.h5py_dataset,
    ("h5py", "Group"): stores.group,
    ("tensorstore", "TensorStore"): stores.tensorstore_store,
    ("SimpleITK", "Image"): images.simpleitk_image,
    ("itk", "itkImageBase2"): images.itk_image,
    ("itk", "itkImageBase3"): images.itk_image,
    ("itk", "itkImageBase4"): images.itk_image,
    ("nibabel", "DataobjImage"): nifti.nibabel_image,
    ("vtkmodules", "vtkImageData"): images.vtk_image,
    ("vtkmodules", "vtkDataSet"): images.vtk_dataset,
}
"""Package and class of what has an adapter of its own; classes derived from these have it, too."""


def as_source(
    obj: Any,
    *,
    spacing: float | Sequence[float] | NDArray[Any] | None = None,
    origin: Sequence[float] | NDArray[Any] | None = None,
    direction: ArrayLike | None = None,
    fill_value: float | None = None,
) -> ArraySource:
    """Returns a source of the voxels of any array-like; imports nothing that is not imported.

    obj         an array of 3 axes (z, y, x): numpy, a buffer, nested lists, xarray, dask, zarr, an
                OME-Zarr group, h5py, tensorstore, SimpleITK, itk, nibabel (x, y, z there), a
                pyvista or VTK ImageData, or what has __array__ or __dlpack__ on the CPU. Chunked
                stores, and files behind xarray and nibabel, are read by layers, never whole.
    spacing     (z, y, x) or one number, world units between voxels; None: what obj says, else 1
    origin      (z, y, x), world position of voxel (0, 0, 0); None: what obj says, else 0
    direction   3 x 3, columns of length 1 in (x, y, z); None: what obj says, else the identity
    fill_value  what masked voxels become; None: NaN

    bool is read as uint8, float16 as float32, other types as they are. A 64-bit integer that
    float64 does not hold is refused, with its position, when its layer is read.

    Raises ValueError (shape, grid, metadata) or TypeError (no array, no such voxels), one line.
    """
    what = type_name(obj)
    try:
        found = _adapter(obj)(obj, spacing is not None)
        return source_of(
            found, spacing=spacing, origin=origin, direction=direction, fill_value=fill_value
        )
    except (ArrayValueError, ArrayTypeError, MemoryError):
        raise
    except TypeError as error:
        raise bad_type(what, f"cannot be read: {one_line(error)}") from error
    except Exception as error:
        problem = f"cannot be read: {type(error).__name__}: {one_line(error)}"
        raise bad_value(what, problem) from error


def _adapter(obj: Any) -> Adapter:
    for cls in type(obj).__mro__:
        package = str(cls.__module__).partition(".")[0]
        adapter = _ADAPTERS.get((package, cls.__name__))
        if adapter is not None:
            return adapter
    return memory.from_memory


def source_of(
    found: Found,
    *,
    spacing: Any = None,
    origin: Any = None,
    direction: Any = None,
    fill_value: Any = None,
) -> ArraySource:
    """Returns the source of what an adapter found; the other arguments are those of as_source().

    Raises ArrayValueError, ArrayTypeError.
    """
    what = found.what
    dtype = read_type(found.stored, what)
    fill = None if fill_value is None else checked_fill(fill_value, dtype, what)
    if fill is None and found.is_masked:
        dtype = type_with_nan(dtype)
    if fill is None and dtype.kind == "f":
        fill = dtype.type(np.nan)

    placement = found.placement
    if spacing is not None:
        placement = replace(placement, spacing=checked_spacing(spacing, what))
    if direction is not None:
        placement = replace(placement, direction=checked_direction(direction, what))
    if origin is not None:
        z, y, x = vector(origin, what, "origin (z, y, x)")
        placement = replace(placement, origin=(x, y, z))
    elif any(found.first_index):
        placement = replace(placement, origin=moved(placement, found.first_index))
    check_placement(placement, what)

    rows = np.array(placement.direction, dtype=np.float64)
    rows.setflags(write=False)
    nz = found.shape[0]
    stored = np.dtype(found.stored)
    return ArraySource(
        shape=found.shape,
        dtype=dtype,
        spacing=(placement.spacing[2], placement.spacing[1], placement.spacing[0]),
        origin=(placement.origin[2], placement.origin[1], placement.origin[0]),
        direction=rows,
        chunk_layers=most_layers(found.row_edges, nz),
        no_data=no_data_of(found.no_data),
        is_anatomical=placement.is_anatomical,
        _what=what,
        _reader=LayerReader(found.fetch, found.shape, stored, dtype, found.row_edges, fill, what),
    )
