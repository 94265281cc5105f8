"""Arrays of the voxels of a volume and its levels of detail, which indexing decodes."""

from __future__ import annotations

import html
import operator
import os
import uuid
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._checked import Isovalue, number, whole
from isowave._placed import Placed

LARGEST_SAMPLE = 1 << 24  # voxels that a histogram is made of

Shape = tuple[int, int, int]
Same = TypeVar("Same", bound="Voxels")


class Level:
    """The voxels of a level of detail, (z, y, x), as an array that indexing decodes.

    Volume.levels makes them. Indexing takes what numpy takes, and gives numpy arrays of float32 (a
    number, if all three indices are integers). Only the blocks of 4 x 4 x 4 voxels that hold what
    is asked for are read from a file, and decoded. Lists and arrays of indices also decode the
    voxels between the least and the largest index. numpy.asarray(level) decodes everything.
    dask.array.from_array(level, chunks=...) decodes chunks when they are computed; if the sides of
    chunks are multiples of 4, no block is decoded twice.
    """

    ndim = 3
    dtype = np.dtype(np.float32)

    def __init__(self, volume: Voxels, number: int, shape: Sequence[int] | None = None) -> None:
        """shape: voxels from (0, 0, 0) on; None: all."""
        self._volume, self._number = volume, number
        nz, ny, nx = reversed(volume._core.level_dims(number)) if shape is None else shape
        self._shape = (nz, ny, nx)

    @property
    def shape(self) -> Shape:
        """Voxels along (z, y, x). Voxel k of level n lies at voxel 2^n k of the volume."""
        return self._shape

    @property
    def size(self) -> int:
        """Number of voxels."""
        nz, ny, nx = self._shape
        return nz * ny * nx

    @property
    def nbytes(self) -> int:
        """Size of all voxels when they are decoded [bytes]."""
        return self.size * self.dtype.itemsize

    def __len__(self) -> int:
        return self._shape[0]

    def __iter__(self) -> Iterator[npt.NDArray[np.float32]]:
        return (self[z] for z in range(len(self)))

    def __getitem__(self, key: Any) -> Any:
        ranges, then = split_key(key, self._shape)
        return self._decode(ranges)[then]

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        if copy is False:
            raise ValueError("voxels are decoded into a new array: copy=False is not possible")
        voxels: npt.NDArray[Any] = self[...]
        return voxels if dtype is None else voxels.astype(dtype, copy=False)

    def __dask_tokenize__(self) -> object:
        """A name for dask's chunks of these voxels, and of no others."""
        return self._volume.__dask_tokenize__(), self._number, self._shape

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self._shape)
        return f"<isowave.Level {self._number}, {shape} (z, y, x) {self.dtype}>"

    def _decode(self, ranges: Sequence[range]) -> npt.NDArray[np.float32]:
        """The voxels of ascending ranges within the shape."""
        if not all(ranges):  # the library knows no empty regions
            return np.empty([len(r) for r in ranges], np.float32)
        z, y, x = ranges
        return self._volume._core.decode(
            self._number,
            (x.start, y.start, z.start),
            (x[-1] + 1, y[-1] + 1, z[-1] + 1),
            (x.step, y.step, z.step),
        )


class Voxels(Placed[_core.Volume]):
    """A volume's voxels: an array of float32, (z, y, x), that indexing decodes."""

    ndim = 3
    dtype = Level.dtype  # type of what indexing gives

    def __init__(self, core: _core.Volume) -> None:
        self._core = core
        self._token = uuid.uuid4().hex
        self._suggested: list[float] | None = None

    @property
    def size(self) -> int:
        """Number of voxels."""
        return self.levels[0].size

    @property
    def source_dtype(self) -> np.dtype[Any]:
        """Type of the voxels before compression."""
        return np.dtype(self._core.source_type)

    @property
    def value_range(self) -> tuple[float, float]:
        """Least and largest voxel before compression; infinite if a file does not say."""
        least, largest = self._core.value_range
        return least, largest

    @property
    def nbytes(self) -> int:
        """Size of the compressed voxels [bytes]."""
        return self._core.compressed_bytes

    @property
    def compression(self) -> str:
        """How blocks are stored: "reversible" (all bits of float32), "whole numbers" (rounded to
        the source's integers), "fixed accuracy" or "fixed rate"."""
        return self._core.compression

    @property
    def bits_per_voxel(self) -> float:
        return self._core.bits_per_voxel

    @property
    def max_error(self) -> float | None:
        """Largest difference between a decoded voxel and the source; None: not measured."""
        return self._core.max_voxel_error

    @property
    def errors_are_stated(self) -> bool:
        """Whether a .zfp file states the errors and `value_range`.

        They cannot be checked without the source, so bounds of images hold if the file's writer is
        right. False: they were measured when this volume was compressed.
        """
        return self._core.errors_are_stated

    def isovalue_notice(self, isovalue: float) -> str:
        """The warning of an isovalue outside the source's values, or "" for other isovalues."""
        return self._core.isovalue_notice(number("isovalue", isovalue))

    @property
    def num_levels(self) -> int:
        """Number of levels of detail, with the volume itself."""
        return self._core.num_levels

    def level_shape(self, level: int) -> tuple[int, int, int]:
        """Voxels of a level along (z, y, x). Its voxel k lies at voxel 2^level k of the volume.

        Sides are halved, and one is added: a level may end up to a voxel of its own behind the
        volume.
        """
        x, y, z = self._core.level_dims(self._checked(level))
        return z, y, x

    def _checked(self, level: int) -> int:
        if isinstance(level, (bool, float, str)):
            whole("level", level)
        if not 0 <= level < self.num_levels:
            raise ValueError(f"level {level} of a volume that has {self.num_levels}: from 0 on")
        return level

    @property
    def levels(self) -> tuple[Level, ...]:
        """The levels of detail as arrays, the volume itself first: volume.levels[2][5]."""
        return tuple(Level(self, number) for number in range(self.num_levels))

    def decode(self, level: int = 0, region: Any = ...) -> npt.NDArray[np.float32]:
        """Voxels of a level of detail, float32, (z, y, x).

        Parameters
        ----------
        level
            Level of detail; each has half the voxels of the last along each axis.
        region
            Key that would index an array of the level: numpy.s_[10:20, :, 5]. Only the blocks
            of 4 x 4 x 4 voxels that hold these voxels are decoded.

        Raises
        ------
        ValueError
            There is no such level.
        IndexError
            The region is none of the level, in one line.
        """
        voxels: npt.NDArray[np.float32] = np.asarray(self.levels[self._checked(level)][region])
        return voxels

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[npt.NDArray[np.float32]]:
        return iter(self.levels[0])

    def __getitem__(self, key: Any) -> Any:
        return self.levels[0][key]

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        return self.levels[0].__array__(dtype, copy)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a .zfp file, which open() and the program read, whole or not at all."""
        self._core.save(os.fsdecode(path))

    def __copy__(self: Same) -> Same:
        return self

    def __deepcopy__(self: Same, memo: object) -> Same:
        return self

    def __dask_tokenize__(self) -> object:
        """A name for dask's chunks of these voxels, and of no others."""
        return self._token

    def histogram(self, bins: int = 256) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Counts [bins] and edges [bins + 1] of the values, as numpy.histogram gives them.

        A large volume is sampled by blocks that are spread over it: at most 2^24 voxels.
        """
        bins = whole("bins", bins)
        values = self._core.sample(LARGEST_SAMPLE)
        least, largest = self.value_range
        if not np.isfinite([least, largest]).all():
            least, largest = float(values.min()), float(values.max())
        counts, edges = np.histogram(np.clip(values, least, largest), bins, (least, largest))
        return counts.astype(np.int64), edges.astype(np.float64)

    def suggested_isovalues(self) -> list[float]:
        """Isovalues that are worth a first look, found in a sample of at most 2^22 voxels.

        Otsu's threshold, which divides the histogram, comes first. Up to three values follow where
        the mean gradient magnitude has a peak, the most prominent first. The same ones each time;
        [] if all voxels have the same value, or none has data.
        """
        if self._suggested is None:
            self._suggested = self._core.suggested_isovalues()
        return list(self._suggested)

    def _isovalue(self, isovalue: Isovalue) -> float:
        """A number as it is; "auto": the first suggestion. Raises Error if there is none."""
        if not (isinstance(isovalue, str) and isovalue == "auto"):
            return number("isovalue", isovalue)
        if not self.suggested_isovalues():
            raise _core.Error(
                "isovalue='auto': all voxels have the same value, or none has data: give a number"
            )
        return self.suggested_isovalues()[0]

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self.shape)
        return (
            f"<isowave.Volume {shape} (z, y, x) {self.source_dtype}, "
            f"{self.nbytes / 2**20:.1f} MiB, {self.bits_per_voxel:.2f} bits a voxel>"
        )

    def _repr_html_(self) -> str:
        least, largest = self.value_range
        rows = {
            "shape (z, y, x)": " x ".join(str(n) for n in self.shape),
            "spacing": ", ".join(f"{s:g}" for s in self.spacing),
            "values": f"{self.source_dtype}, {least:g} to {largest:g}",
            "compressed": f"{self.nbytes / 2**20:.1f} MiB, {self.bits_per_voxel:.2f} bits a voxel",
            "largest error": "not known" if self.max_error is None else f"{self.max_error:.3g}",
            "levels of detail": str(self.num_levels),
        }
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{html.escape(text)}</td>"
            for name, text in rows.items()
        )
        return f"<table>{cells}</table>"


def split_key(key: Any, shape: Sequence[int]) -> tuple[list[range], tuple[Any, ...]]:
    """What must be decoded for array[key], and what to index that with.

    Returns an ascending range of voxels for each axis, and a key of numpy's for the array of them.

    Raises
    ------
    IndexError
        As numpy does: out of bounds, too many indices, something else than indices.
    """
    ranges: list[range] = []
    then: list[Any] = []
    for item in whole_key(key, shape):
        if item is None or item is Ellipsis:
            then.append(item)
            continue
        axis = len(ranges)
        wanted, rest = (
            split_slice(item, shape[axis])
            if isinstance(item, slice)
            else split_indices(item, axis, shape[axis])
        )
        ranges.append(wanted)
        then.append(rest)
    return ranges, tuple(then)


def whole_key(key: Any, shape: Sequence[int]) -> list[Any]:
    """With an item for each axis; masks as arrays of indices. '...' stands for no more axes."""
    items = [as_item(item) for item in (key if isinstance(key, tuple) else (key,))]
    given = sum(axes_of(item) for item in items)
    if given > len(shape):
        raise IndexError(f"{given} indices for voxels that have {len(shape)} axes")
    gaps = [i for i, item in enumerate(items) if item is Ellipsis]
    if len(gaps) > 1:
        raise IndexError("'...' can stand only once in an index")
    at = gaps[0] if gaps else len(items)
    items[at:at] = [slice(None)] * (len(shape) - given)
    whole: list[Any] = []
    axis = 0
    for item in items:
        if is_mask(item):
            sides = tuple(shape[axis : axis + item.ndim])
            if item.shape != sides:
                raise IndexError(f"a mask of shape {item.shape} for voxels of shape {sides}")
            whole.extend(item.nonzero())
        else:
            whole.append(item)
        axis += axes_of(item)
    return whole


def as_item(item: Any) -> Any:
    """Indices as an array, without axes for a single one."""
    if item is None or item is Ellipsis or isinstance(item, slice):
        return item
    array = np.asarray(item)
    if array.size == 0 and array.dtype.kind == "f":  # numpy's choice for []
        array = array.astype(np.intp)
    if array.dtype == object:
        try:
            array = np.asarray(operator.index(item))
        except TypeError:
            pass
    if array.dtype.kind not in "iub" or (array.dtype == bool and array.ndim == 0):
        raise IndexError(f"voxels are indexed by integers, slices and '...': not by {item!r:.60}")
    return array


def is_mask(item: Any) -> bool:
    return isinstance(item, np.ndarray) and item.dtype == bool


def axes_of(item: Any) -> int:
    """How many axes it indexes."""
    if item is None or item is Ellipsis:
        return 0
    return int(item.ndim) if is_mask(item) else 1


def split_slice(item: slice, size: int) -> tuple[range, slice]:
    wanted = range(*item.indices(size))
    if wanted.step > 0 or not wanted:
        return wanted, slice(None)
    return wanted[::-1], slice(None, None, -1)


def split_indices(item: npt.NDArray[Any], axis: int, size: int) -> tuple[range, Any]:
    outside = item[(item < -size) | (item >= size)]
    if outside.size:
        raise IndexError(f"index {outside.flat[0]} on axis {axis}, which has {size} voxels")
    if not item.size:
        return range(0), item
    indices = np.where(item < 0, item + size, item)
    first, last = int(indices.min()), int(indices.max())
    rest = indices - first
    return range(first, last + 1), rest if rest.ndim else int(rest)
