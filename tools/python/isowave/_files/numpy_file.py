"""NPY and NPZ. An NPY file is mapped into memory, an array of an NPZ file is read whole."""

from __future__ import annotations

import zipfile
from typing import Any

import numpy as np

from isowave._arrays.errors import bad_value

from .contents import Contents, choose, named_axes, of_array


_MAGIC = b"\x93NUMPY"


def read_npy(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader."""
    if dataset is not None:
        raise bad_value(f"dataset {dataset}", "an NPY file has one array, without a name")
    with open(path, "rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("no NPY file")
    return _unnamed(np.load(path, mmap_mode="r"), "array")


def read_npz(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader."""
    if not zipfile.is_zipfile(path):
        raise ValueError("no NPZ file")
    with np.load(path) as arrays:
        with zipfile.ZipFile(path) as members:
            axes = {name: _num_axes(members, name) for name in arrays.files}
        name = choose(axes, dataset)
        return _unnamed(arrays[name], name)


def _num_axes(members: zipfile.ZipFile, name: str) -> int:
    """Axes of an array, from its header alone."""
    with members.open(f"{name}.npy") as file:
        read = (
            np.lib.format.read_array_header_1_0
            if np.lib.format.read_magic(file) == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        return len(read(file)[0])


def _unnamed(array: Any, what: str) -> Contents:
    """An array whose axes have no names."""
    return of_array(array, named_axes([""] * array.ndim), what)
