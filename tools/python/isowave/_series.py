"""Series of volumes, such as the time steps of a simulation."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._checked import Isovalue, refuse, reversed_axes
from isowave._compress import compress, compression_options, dims_of, open_source, step_of
from isowave._files import (
    Index,
    are_layers,
    files_of_pattern,
    is_read_by_packages,
    parse_index,
    source_of_file,
    source_of_layers,
    steps_of_file,
)
from isowave._handed_on import takes
from isowave._image import Image
from isowave._request import isovalue_or_surfaces
from isowave._source_file import SourceFile, as_absolute, source_file
from isowave._volume import Volume

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from isowave._scene import SceneFrame


class Series(Sequence[Volume]):
    """Volumes on one grid, in an order; open_series() makes it.

    series[3] opens a step, and series[::10] is the series of every tenth one. A loop over the
    series gets the volumes one by one, while a thread reads and compresses the next one: memory
    holds two of them.
    """

    def __init__(self, names: Sequence[str], load: Callable[[int], Volume]) -> None:
        """load: opens a step; called by any thread."""
        self.names = tuple(names)  #: What messages call the steps: "step_3.nrrd", "run.nii, step 3"
        self._load = load

    def __len__(self) -> int:
        return len(self.names)

    def source(self, step: int) -> SourceFile | None:
        """The step's Volume.source, without opening it."""
        find = getattr(self._load, "source_of", None)
        found: SourceFile | None = find(step) if find else None
        return found

    @overload
    def __getitem__(self, index: int) -> Volume:
        ...

    @overload
    def __getitem__(self, index: slice) -> Series:
        ...

    def __getitem__(self, index: int | slice) -> Volume | Series:
        steps = range(len(self))
        if isinstance(index, slice):
            chosen = steps[index]
            return Series([self.names[i] for i in chosen], Chosen(self._load, chosen))
        return self._load(steps[index])

    def __iter__(self) -> Iterator[Volume]:
        with ThreadPoolExecutor(1, "isowave-series") as thread:
            ahead = None
            for step in range(len(self)):
                volume = self._load(step) if ahead is None else ahead.result()
                if step + 1 < len(self):
                    ahead = thread.submit(self._load, step + 1)
                yield volume
                del volume  # before the next but one takes its memory

    def __repr__(self) -> str:
        return f"<isowave.Series of {len(self)} steps>"

    @takes(Volume.render)
    def render(
        self, isovalue: Isovalue | None = None, **frame: Unpack[SceneFrame]
    ) -> Iterator[Image]:
        """Draws each step, as Volume.render() does: a picture at a time, when it is asked for.

        Without a camera, all pictures have the same: the view that the volumes' box fills.
        isovalue="auto" is the first step's suggestion.
        """
        isovalue_or_surfaces(isovalue, frame.get("surfaces", ()))
        for volume in self:
            if isovalue is not None:
                isovalue = volume._isovalue(isovalue)
            yield volume.render(isovalue, **frame)


def open_series(
    source: Any,
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
    num_threads: int = 0,
    origin: Sequence[float] | None = None,
    direction: npt.ArrayLike | None = None,
    fill_value: float | None = None,
) -> Series:
    """Opens a series of volumes on one grid.

    Parameters
    ----------
    source
        A pattern of files, as in a shell (*, ?, [a-z]), taken in natural order: step_2 before
        step_10. TIFF files of one picture each are the layers of one step, in natural order. Or
        a file with an axis t beside z, y and x, a list of paths, or an array with the
        axes (t, z, y, x), whose parts array[t] compress() takes.
    tolerance, tolerance_relative, rate, exact, levels, map_nan, no_data, num_threads
        As compress() has them, for each step.
    shape, dtype, spacing, dataset, index
        As open() has them, for files.
    origin, direction, fill_value, spacing
        As compress() has them, for arrays.

    Raises
    ------
    Error
        No file; one that cannot be opened; one with another grid than the first.
    """
    options = (tolerance, tolerance_relative, rate, exact, levels, map_nan, no_data, num_threads)
    checked = compression_options(*options)
    places = {"origin": origin, "direction": direction, "fill_value": fill_value}
    placed = {name: each for name, each in places.items() if each is not None}
    if is_path(source) or (isinstance(source, (list, tuple)) and all(map(is_path, source))):
        if placed:
            raise TypeError(f"{next(iter(placed))}: files say it themselves")
        paths = [os.fsdecode(path) for path in ([source] if is_path(source) else source)]
        if paths and all(path.endswith(".zfp") for path in paths):
            checked["measure_error"] = False
        if any(map(is_read_by_packages, paths)):
            if shape is not None or dtype is not None:
                raise _core.Error(
                    f"{paths[0]}: shape and dtype are for raw files; this has its own"
                )
            return of_read_files(paths, dataset, index, spacing, checked)
        if dataset is not None:
            raise _core.Error(f"{paths[0]}: dataset {dataset}: this file has one array")
        load = FileSteps(
            paths,
            checked,
            None if shape is None else dims_of(shape),
            None if dtype is None else np.dtype(dtype).name,
            None if spacing is None else reversed_axes(spacing),
        )
        for notice in load.core.notices:
            warnings.warn(notice, RuntimeWarning, stacklevel=2)
        series = Series([load.core.name(i) for i in range(load.core.size)], load)
        if index is None:
            return series
        step = step_of(paths[0], index, len(series))
        return series[step : step + 1]
    if any(given is not None for given in (shape, dtype, dataset, index)):
        raise TypeError("shape, dtype, dataset and index are for files: the array has its own")
    if len(getattr(source, "shape", ())) != 4:
        raise refuse("source", source, "a pattern, a list of paths or an array (t, z, y, x)")
    names = (*("tolerance", "tolerance_relative", "rate", "exact"), "levels", "map_nan", "no_data")
    how = {**dict(zip((*names, "num_threads"), options)), "spacing": spacing, **placed}
    count = int(source.shape[0])
    return Series([f"step {i}" for i in range(count)], ArraySteps(source, how))


def is_path(source: Any) -> bool:
    return isinstance(source, (str, bytes, os.PathLike))


@dataclass
class Chosen:
    """Opens steps of another series, by its numbers."""

    load: Callable[[int], Volume]
    steps: Sequence[int]

    def __call__(self, step: int) -> Volume:
        return self.load(self.steps[step])

    def source_of(self, step: int) -> Any:
        find = getattr(self.load, "source_of", None)
        return find(self.steps[step]) if find else None


@dataclass
class ArraySteps:
    """Compresses parts of an array (t, z, y, x). how: arguments of compress()."""

    source: Any
    how: dict[str, Any]

    def __call__(self, step: int) -> Volume:
        return compress(self.source[step], progress=False, **self.how)


class FileSteps:
    """Opens files that the compiled part reads. Pickled as arguments of _core.open_series()."""

    def __init__(self, paths: Sequence[str], *arguments: Any) -> None:
        self.paths, self.arguments = [as_absolute(path) for path in paths], arguments
        self.core, self.lock = _core.open_series([*paths], *arguments), threading.Lock()

    def __call__(self, step: int) -> Volume:
        with self.lock:
            volume = Volume(self.core.open(step))
        volume.source = self.source_of(step)
        return volume

    def source_of(self, step: int) -> SourceFile:
        name, end = self.core.name(step), f", step {step}"
        if name.endswith(end) and not os.path.exists(name):
            return source_file(name.removesuffix(end), None, {"t": step})
        return source_file(name)

    def __reduce__(self) -> Any:
        return FileSteps, (self.paths, *self.arguments)


@dataclass
class ReadSteps:
    """Opens files that packages of Python read.

    steps    files, and entries of their further axes; several files are the layers of a step
    pattern  of such layers; "": there is none
    """

    steps: Sequence[tuple[Sequence[str], Index | None]]
    dataset: str | None
    spacing: Sequence[float] | None
    options: dict[str, Any]
    pattern: str = ""

    def __call__(self, step: int) -> Volume:
        files, entries = self.steps[step]
        if len(files) > 1:
            source = source_of_layers(files, entries, self.spacing)
        else:
            source = source_of_file(files[0], self.dataset, entries, self.spacing)
        volume = open_source(files[0], source, self.options, progress=False)
        volume.source = self.source_of(step)
        return volume

    def source_of(self, step: int) -> SourceFile | None:
        files, entries = self.steps[step]
        name = self.pattern if len(files) > 1 else files[0]
        return source_file(name, self.dataset, entries) if name else None


def of_read_files(
    paths: Sequence[str],
    dataset: str | None,
    index: Index | None,
    spacing: Sequence[float] | None,
    options: dict[str, Any],
) -> Series:
    """Steps that packages of Python read: files, or the entries of one file's axis t.

    Several TIFF files of one picture each are the layers of the only step, in natural order.
    """
    files = [file for path in paths for file in files_of_pattern(path)]
    if len(files) > 1 and are_layers(files):
        if dataset is not None:
            raise _core.Error(f"{paths[0]}: dataset {dataset}: layers are one array")
        name = paths[0] if len(paths) == 1 else f"{files[0]} to {os.path.basename(files[-1])}"
        layers = [as_absolute(file) for file in files]
        pattern = paths[0] if len(paths) == 1 else ""
        return Series([name], ReadSteps([(layers, index)], None, spacing, options, pattern))
    steps = [(file, file, index) for file in files]
    along = steps_of_file(files[0], dataset, index)
    if along is not None and len(files) == 1:
        axis, count = along
        fixed = parse_index(index)
        steps = [(f"{files[0]}, step {i}", files[0], {**fixed, axis: i}) for i in range(count)]

    def grid(file: str, entries: Index | None) -> tuple[Any, ...]:
        source = source_of_file(file, dataset, entries, spacing)
        return (source.shape, source.spacing, source.origin, source.direction.tolist())

    first = grid(files[0], steps[0][2])
    for file in files[1:]:
        if grid(file, index) != first:
            raise _core.Error(f"{file}: it has another grid than {files[0]}")

    load = ReadSteps(
        [([as_absolute(file)], entries) for _, file, entries in steps], dataset, spacing, options
    )
    return Series([name for name, _, _ in steps], load)
