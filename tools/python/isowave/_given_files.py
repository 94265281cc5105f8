"""Files that packages of Python read, for the program: as NRRD in a temporary folder."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from isowave._arrays import ArraySource
from isowave._core import Error
from isowave._files import (
    Index,
    are_layers,
    errors_with,
    files_of_pattern,
    is_pattern,
    is_read_by_packages,
    is_volume_folder,
    source_of_file,
    source_of_layers,
)
from isowave._source_file import SourceFile, text_of_index

COMMANDS = ("info", "convert", "render", "extract", "export", "compare")
FIELD = "--color-by"
"""The option that names a second volume, in its own fields between commas."""
OPTIONS = ("--dataset", "--index", "--field-dataset", "--field-index")
"""What they choose: an array of a file, and entries of its further axes."""
_SLAB_BYTES = 64 << 20
"""About so much of a volume is in memory."""
_NRRD_TYPES = {"float32": "float", "float64": "double"}
"""Names of voxel types in NRRD that are not numpy's."""


@dataclass(frozen=True)
class Given:
    """An argument of the program that is such a file, at a place of the arguments.

    path   file, folder, or pattern
    tail   what follows it in the argument: ",0,100" of --color-by
    count  number of arguments: files of a pattern that the shell has put in its place
    """

    at: int
    path: str
    tail: str = ""
    count: int = 1
    is_field: bool = False


def given_files(arguments: Sequence[str]) -> list[Given]:
    """The arguments of the program that are such files.

    Behind an option, .npy and folders without voxels are what the program writes. compare takes
    .npy of two axes itself.
    """
    if not arguments or arguments[0] not in COMMANDS:
        return []
    found: list[Given] = []
    for at, (before, text) in enumerate(zip(arguments, arguments[1:]), 1):
        if before == FIELD or text.startswith(f"{FIELD}="):
            name = text.removeprefix(f"{FIELD}=")
            path = max((name[:end] for end in _ends(name) if is_there(name[:end])), default="")
            if path:
                found.append(Given(at, path, name[len(path) :], is_field=True))
        elif not text.startswith("-") and is_there(text):
            if not before.startswith("-"):
                is_given = arguments[0] != "compare" or not _is_picture(text)
            else:
                is_given = is_volume_folder(text) if os.path.isdir(text) else _is_no_output(text)
            if is_given:
                found.append(Given(at, text))
    return _with_layers_together(found, arguments)


def _ends(name: str) -> list[int]:
    """Where a file's name may end that is followed by fields."""
    return [i for i, letter in enumerate(name) if letter == ","] + [len(name)]


def is_there(path: str) -> bool:
    """Whether packages read a file, a folder, or files of a pattern, which are there."""
    is_there = os.path.exists(path) or is_pattern(path)
    return is_there and is_read_by_packages(path)


def _is_no_output(path: str) -> bool:
    return not path.endswith(".npy")


def _is_picture(path: str) -> bool:
    """Whether an .npy file has two axes, as depth images."""
    if not path.endswith(".npy"):
        return False
    with errors_with(path):
        return bool(np.load(path, mmap_mode="r").ndim == 2)


def _with_layers_together(given: list[Given], arguments: Sequence[str]) -> list[Given]:
    """Takes layers one after the other, as a shell makes them of slices_*.tif, for one volume."""
    if arguments[0] == "compare":
        return given
    found: list[Given] = []
    for each in given:
        last = found[-1] if found else None
        if last and not last.is_field and last.at + last.count == each.at and not each.is_field:
            found[-1] = replace(last, count=last.count + 1)
        else:
            found.append(each)
    return [each for run in found for each in _as_layers(run, arguments)]


def _as_layers(run: Given, arguments: Sequence[str]) -> list[Given]:
    paths = arguments[run.at : run.at + run.count]
    if run.count == 1 or are_layers(paths):
        return [run]
    return [Given(run.at + i, path) for i, path in enumerate(paths)]


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


@dataclass(frozen=True)
class Chosen:
    """What options choose in files of several arrays: --dataset, --index, ..."""

    dataset: str | None = None
    index: str | None = None


def take_chosen(arguments: list[str]) -> tuple[Chosen, Chosen]:
    """Takes the options of the volume's file and of the field's out of the arguments."""
    dataset, index, of_field, field_index = (take_option(arguments, name) for name in OPTIONS)
    return Chosen(dataset, index), Chosen(of_field, field_index)


class SceneOfFiles(Protocol):
    """--scene, if a file that it names is such a file: GivenScene."""

    @property
    def volume(self) -> bool:
        ...

    @property
    def field(self) -> bool:
        ...

    def option(self, path: str) -> Iterator[tuple[int, str]]:
        ...

    def write(
        self,
        folder: str,
        chosen: Chosen,
        of_field: Chosen,
        spacing: Sequence[float] | None,
        real: dict[str, SourceFile | None],
    ) -> tuple[str, Any]:
        ...


def with_nrrd(
    arguments: Sequence[str],
    files: Sequence[Given],
    folder: str,
    names_of: dict[str, SourceFile | None] | None = None,
    scene: SceneOfFiles | None = None,
) -> list[str]:
    """Returns the arguments with NRRD files, written to `folder`, in place of these.

    --dataset and --index choose in each of them, --field-dataset and --field-index in that of
    --color-by. The program gets --no-data as a file says it. Raises Error in one line.

    names_of  gets the files of these NRRD files; None: of several, which no name says
    scene     --scene, if files of it are to be such files, too
    """
    chosen, of_field = take_chosen([*arguments])
    has_volume = any(not each.is_field for each in files) or (scene and scene.volume)
    has_field = any(each.is_field for each in files) or (scene and scene.field)
    if not has_field and of_field.dataset:
        raise Error(f"--field-dataset: no file of {FIELD} has several arrays: leave it out")
    if not has_volume and chosen.dataset:
        raise Error("--dataset: VOLUME has one array: leave it out")
    says = {text.partition("=")[0] for text in arguments}
    changed: list[str | None] = [*arguments]
    more: list[str] = []
    real = names_of if names_of is not None else {}
    spacing = (1.0, 1.0, 1.0) if "--spacing" in says else None  # the program replaces it
    for number, each in enumerate(files):
        paths = arguments[each.at : each.at + each.count] if each.count > 1 else [each.path]
        part = of_field if each.is_field else chosen
        takes_no_data = not each.is_field and arguments[0] != "compare"
        target = os.path.join(folder, str(number))
        of_volume = None if each.is_field else spacing
        nrrd, no_data = as_nrrd(paths, part, of_volume, target, takes_no_data, each.is_field)
        option = f"{FIELD}=" if arguments[each.at].startswith(f"{FIELD}=") else ""
        changed[each.at : each.at + each.count] = [
            f"{option}{nrrd}{each.tail}",
            *(each.count - 1) * [None],
        ]
        if takes_no_data and no_data is not None:
            more = ["--no-data", repr(no_data)]
        source = SourceFile(each.path, part.dataset or "", text_of_index(part.index))
        real[nrrd] = source if each.count == 1 else None
    if scene is not None:
        name, no_data = scene.write(folder, chosen, of_field, spacing, real)
        for at, text in scene.option(name):
            changed[at] = text
        more = more or ([] if no_data is None else ["--no-data", repr(no_data)])
    is_annotated = take_option([*arguments], "--annotate") not in (None, "none")
    shows_title = arguments[0] == "export" or is_annotated
    title = next(_names(real.values()), None) if shows_title else None
    left = [text for text in changed if text is not None]
    is_done = {"--index": has_volume, "--field-index": has_field}  # else the program reads the file
    for name in OPTIONS:
        if is_done.get(name, True):
            take_option(left, name)
    if "--save-scene" in says and None in real.values():
        raise Error("--save-scene: a scene names one volume: put the layers' pattern in quotes")
    left += [] if "--no-data" in says else more
    return left + ([] if title is None or "--title" in says else ["--title", title])


def _names(sources: Iterable[SourceFile | None]) -> Iterator[str]:
    return (Path(each.path).name for each in sources if each is not None)


def as_nrrd(
    paths: Sequence[str],
    part: Chosen,
    spacing: Sequence[float] | None,
    folder: str,
    takes_no_data: bool,
    is_field: bool = False,
) -> tuple[str, Any]:
    """Writes a volume, or steps, to a new folder: their name, and the value without data."""
    written = _Written(paths, part.dataset, part.index, spacing)
    try:
        return written.write(folder, takes_no_data), written.no_data
    except Error as error:
        raise Error(_in_options(str(error), is_field)) from None


def _in_options(message: str, is_field: bool) -> str:
    """A message that speaks of the program's options, not of Python's arguments."""
    prefix = "--field-" if is_field else "--"
    return re.sub(r"choose one by (dataset|index)", rf"choose one by {prefix}\1", message)


def _stem_of(names: Sequence[str]) -> str:
    """What names of layers have in common, or a pattern without its wildcards."""
    if len(names) == 1:
        stem = re.sub(r"[-_.]*(\[[^]]*\]|[*?])+", "", names[0])
    else:
        stem = re.sub(r"[-_.0-9]*$", "", os.path.commonprefix([*names]))
    return stem or "layers"


class _Written:
    """A volume, or the steps of a pattern of volumes, as NRRD."""

    def __init__(
        self,
        paths: Sequence[str],
        dataset: str | None,
        index: Index | None,
        spacing: Sequence[float] | None,
    ) -> None:
        """paths: one, or layers that the shell has found."""
        self.path, self.stem = paths[0], Path(paths[0]).stem
        self.no_data: Any = None
        files = files_of_pattern(paths[0]) if len(paths) == 1 else paths
        if len(files) > 1 and are_layers(files):
            self.stem = _stem_of([Path(path).stem for path in paths])
            self.sources = [partial(source_of_layers, files, index, spacing)]
        else:
            self.sources = [
                partial(source_of_file, file, dataset, index, spacing) for file in files
            ]

    def write(self, folder: str, takes_no_data: bool) -> str:
        """Returns the name for the program. Voxels without data are NaN, or no_data is set."""
        os.mkdir(folder)
        for step, open_source in enumerate(self.sources):
            source = open_source()
            name = f"{self.stem}.nrrd" if len(self.sources) == 1 else f"step_{step}.nrrd"
            with errors_with(self.path):
                write_nrrd(source, os.path.join(folder, name), not takes_no_data)
            self.no_data = source.no_data
        if len(self.sources) == 1:
            return os.path.join(folder, f"{self.stem}.nrrd")
        return os.path.join(folder, "step_*.nrrd")


def write_nrrd(source: ArraySource, path: str, with_nan: bool = False) -> None:
    """Writes a volume layer by layer, in its own type.

    with_nan  voxels without data become NaN, and integers numbers that can be
    """
    nz, ny, nx = source.shape
    stored, no_data = source.dtype, source.no_data if with_nan else None
    if stored.name in ("int64", "uint64"):  # read exactly
        stored = np.dtype("float64")
    if no_data is not None and stored.kind in "iu":
        stored = np.dtype("float32" if stored.itemsize <= 2 else "float64")
    kind = stored.name
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
            if no_data is not None:
                voxels = np.where(voxels == no_data, np.nan, voxels.astype(stored))
            file.write(voxels.astype(stored.newbyteorder("<"), copy=False).data)
