"""Makes volumes from arrays and files of voxels."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._arrays import ArraySource, as_source
from isowave._checked import flag, number, reversed_axes, whole
from isowave._files import (
    Index,
    errors_with,
    is_read_by_packages,
    parse_index,
    source_of_file,
)
from isowave._progress import Progress, shown
from isowave._source_file import SourceFile, source_file
from isowave._volume import Volume, warn_of_file


class OpenArguments(TypedDict, total=False):
    """Arguments of open() beside the path."""

    tolerance: float | None
    tolerance_relative: float | None
    rate: int | None
    exact: bool
    shape: Sequence[int] | None
    dtype: npt.DTypeLike | None
    spacing: Sequence[float] | None
    dataset: str | None
    index: Index | None
    levels: int
    map_nan: float | None
    no_data: float | None
    progress: bool | Progress | None
    num_threads: int


SUPPORTED_TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")


def dims_of(shape: Sequence[int]) -> tuple[int, int, int]:
    try:
        z, y, x = tuple(shape)
    except (TypeError, ValueError):
        raise TypeError(f"shape={shape!r:.60}: give three whole numbers") from None
    return whole("shape", x), whole("shape", y), whole("shape", z)


def compression_options(
    tolerance: float | None,
    tolerance_relative: float | None,
    rate: int | None,
    exact: bool,
    levels: int,
    map_nan: float | None,
    no_data: float | None,
    num_threads: int,
) -> dict[str, Any]:
    return {
        "tolerance": None if tolerance is None else number("tolerance", tolerance),
        "tolerance_relative": (
            None if tolerance_relative is None else number("tolerance_relative", tolerance_relative)
        ),
        "rate": None if rate is None else whole("rate", rate),
        "exact": flag("exact", exact),
        "levels": whole("levels", levels),
        "map_nan": None if map_nan is None else number("map_nan", map_nan),
        "no_data": None if no_data is None else number("no_data", no_data),
        "num_threads": whole("num_threads", num_threads),
        # If nothing bounds the error, it is measured: users ask for it.
        "measure_error": not exact and tolerance is None and tolerance_relative is None,
    }


def compress(
    array: Any,
    *,
    tolerance: float | None = None,
    tolerance_relative: float | None = None,
    rate: int | None = None,
    exact: bool = False,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    direction: npt.ArrayLike | None = None,
    anatomical: bool | None = None,
    levels: int = 1,
    map_nan: float | None = None,
    no_data: float | None = None,
    fill_value: float | None = None,
    path: str | os.PathLike[str] | None = None,
    progress: bool | Progress | None = None,
    num_threads: int = 0,
) -> Volume:
    """Compresses a three-dimensional array into memory, or into a file.

    Arrays in chunked stores (dask, zarr, h5py, tensorstore, and xarray of these) are read a few
    layers at a time, each chunk once. A temporary file of the array's size keeps layers that are
    needed twice: none at a rate, and none of float32 by default.

    Parameters
    ----------
    array
        Voxels, axes (z, y, x): numpy and what converts to it, memoryview, xarray, dask, zarr, h5py,
        tensorstore, SimpleITK, itk, nibabel, pyvista.ImageData.
    tolerance
        Largest error of a voxel [voxel values].
    tolerance_relative
        Largest error of a voxel, as a part of the range of values.
    rate
        Bits per voxel, 1 to 32.
    exact
        Refuse voxels that float32 does not hold. Without tolerance, tolerance_relative and rate,
        voxels keep all that float32 holds: integers below 2^24 and float32 have no error.
    spacing, origin
        World units between voxels, and position of voxel (0, 0, 0); each (z, y, x). None: what the
        array says (xarray, SimpleITK...), else 1 and 0.
    direction
        3 x 3; column a is the unit world direction (x, y, z) of index axis a, in the order x, y, z.
    anatomical
        Whether world space is a patient's, LPS: views then have superior up, and anterior in front.
        None: what the array says (SimpleITK, itk, nibabel), else False.
    levels
        Number of levels of detail, with the volume itself; 0: all that it can have.
    map_nan
        Value that replaces NaN and infinite voxels.
    no_data
        Value of voxels without data, which no surface touches; NaN voxels have no data, either.
        no_data is compared in the array's own type, and may be infinite. Other infinite voxels are
        refused. None: what the array says, by the attribute _FillValue or missing_value of xarray
        and h5py, or the fill value of zarr, h5py and tensorstore unless it is 0.
    fill_value
        Value that replaces masked values of masked arrays. None: masked voxels have no data.
    path
        A .zfp file that the volume is written to, layer by layer, and opened from, so that the
        result need not fit into memory. None: into memory.
    progress
        True for a bar (needs tqdm), False for none, or a function of (what, done), done from 0 to
        1. None: a bar on a terminal or in a notebook, if tqdm is installed.
    num_threads
        Number of threads; 0: one per processor. The result is the same for any number.

    Raises
    ------
    Error, TypeError, ValueError
        The array cannot be compressed; in one line.
    """
    source = as_source(
        array, spacing=spacing, origin=origin, direction=direction, fill_value=fill_value
    )
    if anatomical is not None:
        source = replace(source, is_anatomical=flag("anatomical", anatomical))
    if no_data is None:
        no_data = source.no_data
    options = compression_options(
        tolerance, tolerance_relative, rate, exact, levels, map_nan, no_data, num_threads
    )
    file = None if path is None else os.path.abspath(os.fsdecode(path))
    with shown(progress) as told:
        volume = Volume(compressed(array, source, options, file, told), file)
    volume.source = None if file is None else SourceFile(file)
    return volume


def compressed(
    array: Any,
    source: ArraySource,
    options: dict[str, Any],
    file: str | None,
    progress: Progress | None,
) -> _core.Volume:
    """source: what as_source() made of the array."""
    nz, ny, nx = source.shape
    columns: list[_core.Vector] = [column.tolist() for column in source.direction.T]
    spacing, origin = reversed_axes(source.spacing), reversed_axes(source.origin)
    voxels = (str(source.dtype), (nx, ny, nz), spacing, origin, columns, source.is_anatomical)
    if file is None and is_plain(array):
        return _core.compress_array(array, voxels, options, progress)
    keep = not isinstance(array, (np.ndarray, memoryview))  # these can be read again at no cost
    return _core.compress(source.read, voxels, options, keep, file, progress)


def is_plain(array: Any) -> bool:
    """Whether the compiled part can read the array's memory as it is."""
    return (
        type(array) is np.ndarray
        and array.flags.c_contiguous
        and array.dtype.isnative
        and array.dtype.name in SUPPORTED_TYPES
    )


def open(  # noqa: A001: as gzip.open, h5py.File's habit
    path: str | os.PathLike[str],
    *,
    tolerance: float | None = None,
    tolerance_relative: float | None = None,
    rate: int | None = None,
    exact: bool = False,
    shape: Sequence[int] | None = None,
    dtype: npt.DTypeLike | None = None,
    spacing: Sequence[float] | None = None,
    dataset: str | None = None,
    index: Index | None = None,
    levels: int = 1,
    map_nan: float | None = None,
    no_data: float | None = None,
    progress: bool | Progress | None = None,
    num_threads: int = 0,
) -> Volume:
    """Opens a volume.

    A ``.zfp`` file is read when it is needed; it must not change. Other volumes are compressed into
    memory, with the options of compress(): ``.raw`` and ``.raw.gz`` (named ``NAME_XxYxZ_TYPE.raw``,
    or with shape (z, y, x) and dtype), ``.nrrd``, ``.nhdr``, ``.mha``, ``.mhd``, ``.nii``,
    ``.nii.gz``, and ``generate:FIELD_XxYxZ_TYPE``. With the packages of ``isowave[files]``: TIFF
    (OME-TIFF, ImageJ's, a folder of layers), folders of DICOM, HDF5, NetCDF, zarr and OME-Zarr,
    NPY, NPZ, MRC, VTK's ImageData (``.vti``, ``.vtk``) and NIfTI-2; most are read layer by layer.
    A pattern of TIFF files, ``"slices_*.tif"``, is a volume with these layers, in natural order.

    Parameters
    ----------
    spacing
        (z, y, x), replaces the file's spacing.
    dataset
        Name of an array in a file that has several: a dataset or variable, an array of points or
        cells, a level of OME-Zarr, the number of a TIFF's image, the number, UID or description of
        a DICOM series.
    index
        Entries of axes beside z, y and x, counted from 0: "t=3,c=0" or {"t": 3, "c": 0}.

    Raises
    ------
    Error
        The file is missing, broken or of another kind, in one line.
    """
    name = os.fsdecode(path)
    is_compressed = name.endswith(".zfp")
    options = compression_options(
        tolerance, tolerance_relative, rate, exact, levels, map_nan, no_data, num_threads
    )
    if is_compressed:
        options["measure_error"] = False
    if is_read_by_packages(name):
        if shape is not None or dtype is not None:
            raise _core.Error(f"{name}: shape and dtype are for raw files; this file has its own")
        volume = open_source(name, source_of_file(name, dataset, index, spacing), options, progress)
        volume.source = source_file(name, dataset, index)
        return volume
    if dataset is not None:
        raise _core.Error(f"{name}: dataset {dataset}: this file has one array, without a name")
    if index is not None:
        volume = open_step(name, index, options, spacing)
        volume.source = source_file(name, None, index)
        return volume
    with shown(progress) as told:
        core = _core.open(
            name,
            options,
            None if shape is None else dims_of(shape),
            None if dtype is None else np.dtype(dtype).name,
            None if spacing is None else reversed_axes(spacing),
            told,
        )
    warn_of_file(core)
    volume = Volume(core)
    if is_compressed:
        own = None if spacing is None else tuple(spacing)
        volume = Volume(core, os.path.abspath(name), own)
    volume.source = source_file(name)
    return volume


def open_source(
    name: str, source: ArraySource, options: dict[str, Any], progress: bool | Progress | None
) -> Volume:
    """Compresses a file's volume. Errors of its reader are isowave.Errors."""
    if options["no_data"] is None:
        options = {**options, "no_data": source.no_data}
    with shown(progress) as told, errors_with(name):
        return Volume(compressed(None, source, options, None, told))


def step_of(name: str, index: Index, count: int) -> int:
    """The step that an index asks for of a file that the compiled part reads. Raises Error."""
    with errors_with(name):
        found = parse_index(index)
        if [*found] != ["t"] or found["t"] >= count:
            raise ValueError(f"index {index}: its further axes are t ({count} entries)")
        return found["t"]


def open_step(
    name: str, index: Index, options: dict[str, Any], spacing: Sequence[float] | None
) -> Volume:
    """A step of a NIfTI or NRRD file."""
    series = _core.open_series(
        [name], options, None, None, None if spacing is None else reversed_axes(spacing)
    )
    for notice in series.notices:
        warnings.warn(notice, RuntimeWarning, stacklevel=3)
    return Volume(series.open(step_of(name, index, series.size)))
