"""Arrays that lie in this process's memory: numpy's, buffers, and what gives them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import bad_type, type_name
from .found import Found
from .grid import checked_shape
from .voxels import read_type

_CPU_DEVICES = (1, 3, 11, 13)
"""DLPack's kDLCPU, kDLCUDAHost, kDLROCMHost, kDLCUDAManaged: the CPU reads these."""


def numpy_array(array: Any, what: str) -> Found:
    """Adapts a numpy.ndarray of any strides, byte order and subclass."""
    read_type(array.dtype, what)  # before masks of fields are looked at
    is_masked = False
    if isinstance(array, np.ma.MaskedArray):
        is_masked = bool(np.ma.getmask(array).any())
        if not is_masked:
            array = np.ma.getdata(array)
    if not isinstance(array, np.ma.MaskedArray):
        array = np.asarray(array)
    return Found(
        what,
        checked_shape(array.shape, what),
        array.dtype,
        lambda begin, end: array[begin:end],
        is_masked=is_masked,
    )


def from_memory(obj: Any, has_spacing: bool) -> Found:
    """Adapts an ndarray, a buffer, nested lists, or what has __array__ or __dlpack__ on the CPU.

    Raises ArrayTypeError for memory of a GPU and for what is no array.
    """
    what = type_name(obj)
    if isinstance(obj, np.ndarray):
        return numpy_array(obj, what)
    if _is_on_gpu(obj):
        raise bad_type(
            what,
            "its voxels lie in GPU memory: copy them to the host first, for example with "
            "array.get() (CuPy) or tensor.cpu() (PyTorch)",
        )
    view = _buffer(obj)
    if view is not None:
        return numpy_array(np.asarray(view), what)
    if isinstance(obj, (list, tuple)) or _has_any(
        obj, "__array__", "__array_interface__", "__array_struct__"
    ):
        return numpy_array(_as_array(obj, what), what)
    if _has_any(obj, "__dlpack__"):
        return numpy_array(np.from_dlpack(obj), what)
    if isinstance(obj, str) or hasattr(obj, "__fspath__"):
        raise bad_type(what, "a path is not an array: isowave.open() reads files")
    raise bad_type(
        what,
        "not an array that can be read: need numpy, a buffer, xarray, dask, zarr, h5py, "
        "tensorstore, SimpleITK, itk, nibabel, pyvista, or an object with __array__ or __dlpack__",
    )


def _as_array(obj: Any, what: str) -> Any:
    array = np.asarray(obj)
    if array.dtype.kind == "O":
        raise bad_type(what, "its values are objects, not numbers: need an array of numbers")
    return array


def _buffer(obj: Any) -> memoryview | None:
    """Returns the object's memory, if it has the protocol of buffers."""
    if isinstance(obj, memoryview):
        return obj
    try:
        return memoryview(obj)
    except Exception:
        return None


def _has_any(obj: Any, *names: str) -> bool:
    return any(getattr(type(obj), name, None) is not None for name in names) or any(
        hasattr(obj, name) for name in names
    )


def _is_on_gpu(obj: Any) -> bool:
    """Whether the object says that a GPU has its voxels. A PyTorch tensor on the CPU says not."""
    if hasattr(obj, "__cuda_array_interface__"):
        return True
    if not hasattr(obj, "__dlpack_device__"):
        return False
    return int(obj.__dlpack_device__()[0]) not in _CPU_DEVICES
