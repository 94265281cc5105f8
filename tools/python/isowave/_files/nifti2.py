"""NIfTI-2 by nibabel. The compiled part reads NIfTI-1."""

from __future__ import annotations

import gzip
import importlib
from collections.abc import Mapping

from isowave._arrays.errors import bad_value
from isowave._arrays.found import Found
from isowave._arrays.nifti import nibabel_volume

from .contents import Contents

_HEADER_BYTES = 540
"""The first number in a NIfTI-2 header, its size."""
_FURTHER = ("t", "c", "u", "v")
"""Names of the axes after x, y and z."""


def is_nifti2(path: str) -> bool:
    """Whether a file begins as NIfTI-2 does, in any byte order. Compressed files are inflated."""
    try:
        with open(path, "rb") as file:
            is_packed = file.read(2) == b"\x1f\x8b"
        with gzip.open(path) if is_packed else open(path, "rb") as file:
            size = file.read(4)
    except (OSError, EOFError):
        return False
    return _HEADER_BYTES in (int.from_bytes(size, "little"), int.from_bytes(size, "big"))


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader."""
    nibabel = importlib.import_module("nibabel")
    if dataset is not None:
        raise bad_value(f"dataset {dataset}", "a NIfTI file has one array, without a name")
    image = nibabel.load(path)
    sizes = image.shape[3:]
    if len(image.shape) < 3 or len(sizes) > len(_FURTHER):
        raise bad_value("image", f"{len(image.shape)} axes: need 3 to {3 + len(_FURTHER)}")
    axes = dict(zip(_FURTHER, map(int, sizes)))

    def volume(index: Mapping[str, int]) -> Found:
        return nibabel_volume(image, tuple(index[name] for name in axes))

    return Contents("image", axes, volume)
