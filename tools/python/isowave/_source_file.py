"""Where the voxels of a volume came from: a file, or a part of it."""

from __future__ import annotations

import os
from dataclasses import dataclass

from isowave._files import Index, parse_index


@dataclass(frozen=True)
class SourceFile:
    """What open() was told of a volume's file; scenes name it.

    path     absolute, or generate:...; a pattern of TIFF files
    dataset  name of the array in the file; "": the only one
    index    entries of further axes, "t=3,c=0"; "": there are none
    """

    path: str
    dataset: str = ""
    index: str = ""


def source_file(path: str, dataset: str | None = None, index: Index | None = None) -> SourceFile:
    """Raises ArrayValueError: an index that is none."""
    return SourceFile(as_absolute(path), dataset or "", text_of_index(index))


def as_absolute(path: str) -> str:
    return path if path.startswith("generate:") else os.path.abspath(path)


def text_of_index(index: Index | None) -> str:
    return ",".join(f"{axis}={entry}" for axis, entry in parse_index(index).items())
