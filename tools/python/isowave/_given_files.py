"""Files that packages of Python read, for the program: as NRRD in a temporary folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from isowave._arrays import ArraySource
from isowave._core import Error
from isowave._files import (
    errors_with,
    is_read_by_packages,
    is_volume_folder,
    source_of_file,
)

COMMANDS = ("info", "convert", "render", "extract")
_SLAB_BYTES = 64 << 20
"""About so much of a volume is in memory."""
_NRRD_TYPES = {"float32": "float", "float64": "double", "int64": "double", "uint64": "double"}
"""Names of voxel types in NRRD that are not numpy's. Integers of 64 bits were read exactly."""


def given_files(arguments: Sequence[str]) -> list[str]:
    """The arguments of the program that are such files.

    Behind an option, .npy and folders without voxels are what the program writes.
    """
    if not arguments or arguments[0] not in COMMANDS:
        return []

    def is_given(before: str, text: str) -> bool:
        if text.startswith("-") or not os.path.exists(text) or not is_read_by_packages(text):
            return False
        if not before.startswith("-"):
            return True
        return is_volume_folder(text) if os.path.isdir(text) else not text.endswith(".npy")

    return [text for before, text in zip(arguments, arguments[1:]) if is_given(before, text)]


def take_option(arguments: list[str], name: str) -> str | None:
    """Takes an option and its value out of the arguments, as "--name value" or "--name=value"."""
    for i, text in enumerate(arguments):
        if text == name:
            if i + 1 == len(arguments):
                raise Error(f"{name}: 1 required TEXT missing")
            del arguments[i]
            return arguments.pop(i)
        if text.startswith(f"{name}="):
            return arguments.pop(i).partition("=")[2]
    return None


def with_nrrd(arguments: Sequence[str], files: Sequence[str], folder: str) -> list[str]:
    """Returns the arguments with NRRD files, written to `folder`, in place of these.

    --dataset and --index choose in each of them. The program gets --no-data as a file says it.
    Raises Error in one line.
    """
    changed = list(arguments)
    dataset, index = take_option(changed, "--dataset"), take_option(changed, "--index")
    says = {text.partition("=")[0] for text in changed}
    spacing = (1.0, 1.0, 1.0) if "--spacing" in says else None  # the program replaces it
    for number, path in enumerate(dict.fromkeys(files)):
        source = source_of_file(path, dataset, index, spacing)
        nrrd = os.path.join(folder, str(number), f"{Path(path).stem}.nrrd")
        with errors_with(path):
            os.mkdir(os.path.dirname(nrrd))
            write_nrrd(source, nrrd)
        changed = [nrrd if text == path else text for text in changed]
        if number == 0 and source.no_data is not None and "--no-data" not in says:
            changed += ["--no-data", repr(source.no_data)]
    return changed


def write_nrrd(source: ArraySource, path: str) -> None:
    """Writes a volume layer by layer, in its own type."""
    nz, ny, nx = source.shape
    kind = source.dtype.name
    stored = np.dtype("float64") if kind in ("int64", "uint64") else source.dtype
    steps = (source.direction * source.spacing[::-1]).T.tolist()
    vectors = [f"({','.join(map(repr, step))})" for step in [*steps, source.origin[::-1]]]
    space = "space: left-posterior-superior" if source.is_anatomical else "space dimension: 3"
    header = (
        f"NRRD0004\ntype: {_NRRD_TYPES.get(kind, kind)}\ndimension: 3\n{space}\n"
        f"sizes: {nx} {ny} {nz}\nspace directions: {' '.join(vectors[:3])}\n"
        f"space origin: {vectors[3]}\nendian: little\nencoding: raw\n\n"
    )
    layers = max(1, _SLAB_BYTES // (ny * nx * stored.itemsize))
    layers = -(-layers // source.chunk_layers) * source.chunk_layers  # whole chunks
    with open(path, "wb") as file:
        file.write(header.encode())
        for begin in range(0, nz, layers):
            voxels = source.read(begin, min(begin + layers, nz))
            file.write(voxels.astype(stored.newbyteorder("<"), copy=False).data)
