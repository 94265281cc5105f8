"""Which reader a path has, and errors that name the path."""

from __future__ import annotations

import contextlib
import glob
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from isowave._arrays import ArraySource, source_of
from isowave._arrays.errors import bad_value, one_line
from isowave._core import Error

from . import dicom, hdf5, mrc, netcdf, nifti2, numpy_file, tiff, vtk_file, zarr_store
from .contents import Contents, Index, parse_index, pick, time_axis
from .order import natural_order

Reader = Callable[[str, "str | None", bool], Contents]
"""(path, dataset, whether the caller gave a spacing) -> contents. Raises any exception."""

OF_THE_COMPILED_PART = (
    *(".zfp", ".raw", ".raw.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz"),
)
_READERS: dict[str, Reader] = {
    ".tif": tiff.read,
    ".tiff": tiff.read,
    ".btf": tiff.read,
    ".tf8": tiff.read,
    ".dcm": dicom.read,
    ".dicom": dicom.read,
    ".ima": dicom.read,
    ".h5": hdf5.read,
    ".hdf5": hdf5.read,
    ".hdf": hdf5.read,
    ".he5": hdf5.read,
    ".nc": netcdf.read,
    ".nc4": netcdf.read,
    ".cdf": netcdf.read,
    ".netcdf": netcdf.read,
    ".zarr": zarr_store.read,
    ".npy": numpy_file.read_npy,
    ".npz": numpy_file.read_npz,
    ".mrc": mrc.read,
    ".mrc.gz": mrc.read,
    ".mrc.bz2": mrc.read,
    ".map": mrc.read,
    ".map.gz": mrc.read,
    ".ccp4": mrc.read,
    ".rec": mrc.read,
    ".vti": vtk_file.read_xml,
    ".pvti": vtk_file.read_xml,
    ".vtk": vtk_file.read_legacy,
}


def is_read_by_packages(path: str) -> bool:
    """Whether a path, or a pattern of paths, is for the readers here, not for the compiled part."""
    return not path.startswith("generate:") and _reader_of(path) is not None


def is_pattern(path: str) -> bool:
    """Whether a path stands for several files: it has *, ? or [, and there is no such file."""
    return glob.has_magic(path) and not os.path.exists(path)


def files_of_pattern(path: str) -> list[str]:
    """The files of a pattern, in natural order; of another path, itself. Raises Error if none."""
    if not is_pattern(path):
        return [path]
    found = sorted(glob.glob(path), key=natural_order)
    if not found:
        raise Error(one_line(f"{path}: no file has such a name"))
    return found


def are_layers(paths: Sequence[str]) -> bool:
    """Whether these are TIFF files with a layer of one volume each. Raises Error."""
    if not all(path.lower().endswith((".tif", ".tiff")) for path in paths):
        return False
    with errors_with(paths[0]):
        return tiff.is_layer(paths[0])


def is_volume_folder(path: str) -> bool:
    """Whether a folder has voxels: a zarr store, TIFF files, or a file that begins as DICOM."""
    if zarr_store.is_zarr(path) or tiff.layers_in(path):
        return True
    return any(map(dicom.is_dicom, dicom.files_in(path)))


def _reader_of(path: str) -> Reader | None:
    if os.path.isdir(path):
        return _reader_of_folder(path)
    name = os.path.basename(path).lower()
    if name.endswith((".nii", ".nii.gz")):
        return nifti2.read if nifti2.is_nifti2(path) else None
    for suffix, reader in _READERS.items():
        if name.endswith(suffix):
            return reader
    if not name.endswith(OF_THE_COMPILED_PART) and dicom.is_dicom(path):
        return dicom.read
    return None


def _reader_of_folder(path: str) -> Reader:
    if zarr_store.is_zarr(path):
        return zarr_store.read
    if tiff.layers_in(path):
        return tiff.read_folder
    return dicom.read


@contextlib.contextmanager
def errors_with(path: str) -> Iterator[None]:
    """Turns any exception of a package into an isowave.Error of one line with the path."""
    try:
        yield
    except (Error, MemoryError):
        raise
    except ImportError as error:
        missing = error.name or one_line(error)
        raise Error(f"{path}: {missing} is missing: pip install 'isowave[files]'") from error
    except OSError as error:
        raise Error(one_line(f"{path}: {error.strerror or error}")) from error
    except Exception as error:
        raise Error(one_line(f"{path}: {error or type(error).__name__}")) from error


def contents_of(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """Raises what a package raises: call it in errors_with()."""
    reader = _reader_of(path)
    assert reader is not None
    if is_pattern(path):
        if reader is not tiff.read:
            raise ValueError("a pattern of files is a series: open_series() opens it")
        return tiff.read_layers(files_of_pattern(path), dataset)
    if not os.path.exists(path):
        raise FileNotFoundError(2, os.strerror(2))
    return reader(path, dataset, has_spacing)


def source_of_file(
    path: str, dataset: str | None, index: Index | None, spacing: Sequence[float] | None
) -> ArraySource:
    """Returns the source of a file's volume, which reads the file layer by layer if it can.

    path     one for which is_read_by_packages(); a pattern of TIFF files: its layers
    dataset  name of an array of the file; None: there is only one
    index    entries of further axes
    spacing  (z, y, x), replaces the file's

    Raises isowave.Error in one line.
    """
    with errors_with(path):
        contents = contents_of(path, dataset, spacing is not None)
        return source_of(pick(contents, parse_index(index)), spacing=spacing)


def source_of_layers(
    files: Sequence[str], index: Index | None, spacing: Sequence[float] | None
) -> ArraySource:
    """As source_of_file(), of TIFF files that are the layers of one volume, in natural order.

    A shell puts slices_10.tif before slices_9.tif.
    """
    layers = sorted(files, key=natural_order)
    with errors_with(files[0]):
        return source_of(pick(tiff.read_layers(layers, None), parse_index(index)), spacing=spacing)


def steps_of_file(path: str, dataset: str | None, index: Index | None) -> tuple[str, int] | None:
    """Returns the name and the number of entries of the axis of steps, None for a single volume.

    Raises isowave.Error in one line.
    """
    with errors_with(path):
        contents = contents_of(path, dataset, True)
        axis = time_axis(contents, parse_index(index))
        return None if axis is None else (axis, contents.axes[axis])
