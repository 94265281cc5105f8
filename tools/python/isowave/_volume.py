"""Compressed volumes: from arrays and files to pictures."""

from __future__ import annotations

import html
import os
import pathlib
import sys
import tempfile
import threading
import uuid
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._arrays import as_source
from isowave._checked import flag, function, number, numbers, whole
from isowave._levels import Level
from isowave._mesh import Mesh
from isowave._placed import Placed
from isowave._renderer import (
    CAPABILITIES,
    Camera,
    Image,
    Renderer,
    cast_rays,
    draw,
    needed_options,
    positions_of,
    request_for,
    size_of,
    warn_of_isovalue,
)

#: Called with what is done ("compressing") and how much of it, 0 to 1.
Progress = Callable[[str, float], object]

SUPPORTED_TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")
LARGEST_SAMPLE = 1 << 24  # voxels that a histogram is made of


def reversed_axes(values: Sequence[float]) -> tuple[float, float, float]:
    z, y, x = numbers("spacing", values, 3)
    return x, y, z


def dims_of(shape: Sequence[int]) -> tuple[int, int, int]:
    try:
        z, y, x = tuple(shape)
    except (TypeError, ValueError):
        raise TypeError(f"shape={shape!r:.60}: give three whole numbers") from None
    return whole("shape", x), whole("shape", y), whole("shape", z)


class Turns:
    """A lock for calls that take turns; one from within another's on_pass gets an Error."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owner: tuple[int, int] | None = None  # process and thread

    def __enter__(self) -> None:
        owner, me = self._owner, (os.getpid(), threading.get_ident())
        if owner == me:
            raise _core.Error(
                "the volume's renderer is at work, and waits for the on_pass that makes this call: "
                "use it afterwards, or another one: volume.renderer()"
            )
        if owner is not None and owner[0] != me[0]:
            raise _core.Error(
                "this process was forked while the volume's renderer was at work: use the start "
                "method 'spawn'"
            )
        self._lock.acquire()
        self._owner = me

    def __exit__(self, *exception: object) -> None:
        self._owner = None
        self._lock.release()


def compression_options(
    tolerance: float | None,
    relative_tolerance: float | None,
    rate: int | None,
    exact: bool,
    levels: int,
    map_nan: float | None,
    no_data: float | None,
    num_threads: int,
) -> dict[str, Any]:
    return {
        "tolerance": None if tolerance is None else number("tolerance", tolerance),
        "relative_tolerance": (
            None if relative_tolerance is None else number("relative_tolerance", relative_tolerance)
        ),
        "rate": None if rate is None else whole("rate", rate),
        "exact": flag("exact", exact),
        "levels": whole("levels", levels),
        "map_nan": None if map_nan is None else number("map_nan", map_nan),
        "no_data": None if no_data is None else number("no_data", no_data),
        "num_threads": whole("num_threads", num_threads),
        # Where nothing bounds it, the error is measured: people ask.
        "measure_error": not exact and tolerance is None and relative_tolerance is None,
    }


class TqdmProgress:
    """A bar of tqdm's for each step."""

    def __init__(self, tqdm: Any) -> None:
        self.tqdm, self.bar, self.step = tqdm, None, ""

    def __call__(self, what: str, done: float) -> None:
        if what != self.step:
            self.close()
            self.step = what
            self.bar = self.tqdm(total=100, desc=what, unit="%", leave=False)
        if self.bar is not None:
            self.bar.update(int(100 * done) - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()


def make_progress(progress: bool | Progress | None) -> Progress | None:
    """None: a bar where tqdm is installed and somebody watches."""
    if callable(progress):
        return progress
    if progress is not None:
        flag("progress", progress)
    in_notebook = "ipykernel" in sys.modules
    if progress is False or (progress is None and not (sys.stderr.isatty() or in_notebook)):
        return None
    try:
        from tqdm.auto import tqdm  # type: ignore[import-untyped,unused-ignore]
    except ImportError:
        return None
    return TqdmProgress(tqdm)


def compress(
    array: Any,
    *,
    tolerance: float | None = None,
    relative_tolerance: float | None = None,
    rate: int | None = None,
    exact: bool = False,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    direction: npt.ArrayLike | None = None,
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
    layers at a time, each chunk once; meanwhile a temporary file of the array's size keeps them,
    unless voxels are float32 and nothing is given, or a rate is.

    Parameters
    ----------
    array
        Voxels, axes (z, y, x): numpy and what converts to it, memoryview, xarray, dask, zarr, h5py,
        tensorstore, SimpleITK, itk, nibabel, pyvista.ImageData.
    tolerance
        No voxel is off by more [voxel values].
    relative_tolerance
        The same, as a part of the range of values.
    rate
        Bits per voxel, 1 to 32.
    exact
        Refuse voxels that float32 does not hold. Without tolerance, relative_tolerance and rate,
        voxels keep all that float32 holds: integers below 2^24 and float32 have no error.
    spacing, origin
        World units between voxels, and position of voxel (0, 0, 0); each (z, y, x). What the array
        says itself (xarray, SimpleITK...) where None, else 1 and 0.
    direction
        3 x 3; column a is the unit world direction (x, y, z) of index axis a, in the order x, y, z.
    levels
        Levels of detail, the volume itself among them; 0: all that it can have.
    map_nan
        What replaces NaN and infinite voxels.
    no_data
        Voxels of this value have no data, as NaN voxels have none: no surface touches them. It is
        compared in the array's own type, and may be infinite; other infinite voxels are refused.
        If None, what the array says itself: the attributes _FillValue or missing_value of xarray
        and h5py, the fill value of zarr, h5py and tensorstore unless it is 0.
    fill_value
        What replaces masked values of masked arrays; if None, they have no data.
    path
        A .zfp file that the volume is written to, layer by layer, and opened from: then the result
        need not fit into memory. None: into memory.
    progress
        True for a bar (needs tqdm), False for none, or a function of (what, done), done from 0 to
        1. None: a bar on a terminal or in a notebook, where tqdm is installed.
    num_threads
        0: one per processor. The result is the same for any number.

    Raises
    ------
    Error, TypeError, ValueError
        What cannot be compressed, in one line.
    """
    source = as_source(
        array,
        spacing=spacing,
        origin=origin,
        direction=direction,
        fill_value=fill_value,
    )
    if no_data is None:
        no_data = source.no_data
    options = compression_options(
        tolerance, relative_tolerance, rate, exact, levels, map_nan, no_data, num_threads
    )
    nz, ny, nx = source.shape
    columns: list[_core.Vector] = [column.tolist() for column in source.direction.T]
    spacing_xyz, origin_xyz = reversed_axes(source.spacing), reversed_axes(source.origin)
    grid = (str(source.dtype), (nx, ny, nz), spacing_xyz, origin_xyz, columns)
    shown = make_progress(progress)
    try:
        if path is None and is_plain(array):
            return Volume(_core.compress_array(array, *grid, options, shown))
        keep = not isinstance(array, (np.ndarray, memoryview))  # these can be read again at no cost
        file = None if path is None else os.path.abspath(os.fsdecode(path))
        return Volume(_core.compress(source.read, *grid, options, keep, file, shown), file)
    finally:
        if isinstance(shown, TqdmProgress):
            shown.close()


def is_plain(array: Any) -> bool:
    """Whether the compiled part can read its memory as it is."""
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
    relative_tolerance: float | None = None,
    rate: int | None = None,
    exact: bool = False,
    shape: Sequence[int] | None = None,
    dtype: npt.DTypeLike | None = None,
    spacing: Sequence[float] | None = None,
    levels: int = 1,
    map_nan: float | None = None,
    no_data: float | None = None,
    progress: bool | Progress | None = None,
    num_threads: int = 0,
) -> Volume:
    """Opens a volume.

    A ``.zfp`` file stays where it is and is read when it is needed; it must not change. Others are
    compressed into memory as compress() does: ``.raw`` and ``.raw.gz`` (named
    ``NAME_XxYxZ_TYPE.raw``, or with shape (z, y, x) and dtype), ``.nrrd``, ``.nhdr``, ``.mha``,
    ``.mhd``, ``.nii``, ``.nii.gz``, and ``generate:FIELD_XxYxZ_TYPE``.

    spacing, (z, y, x), replaces that of the file.

    Raises
    ------
    Error
        The file is missing, broken or of another kind, in one line.
    """
    name = os.fsdecode(path)
    is_compressed = name.endswith(".zfp")
    options = compression_options(
        tolerance, relative_tolerance, rate, exact, levels, map_nan, no_data, num_threads
    )
    if is_compressed:
        options["measure_error"] = False
    shown = make_progress(progress)
    try:
        core = _core.open(
            name,
            options,
            None if shape is None else dims_of(shape),
            None if dtype is None else np.dtype(dtype).name,
            None if spacing is None else reversed_axes(spacing),
            shown,
        )
    finally:
        if isinstance(shown, TqdmProgress):
            shown.close()
    for notice in core.notices:
        warnings.warn(notice, RuntimeWarning, stacklevel=2)
    if not is_compressed:
        return Volume(core)
    return Volume(core, os.path.abspath(name), None if spacing is None else tuple(spacing))


class Volume(Placed[_core.Volume]):
    """A compressed volume. It cannot be changed, and threads may share it.

    Made by compress() and open(). It is an array of float32, (z, y, x), that is decoded where it is
    indexed: volume[10], volume[10:20, ::4, -1]. Level has more of that.

    A volume in a .zfp file is pickled as the file's path, so other processes of this machine open
    the same file. A volume in memory is pickled with its compressed voxels.
    """

    ndim = 3
    dtype = Level.dtype  # of what indexing gives

    def __init__(
        self,
        core: _core.Volume,
        file: str | None = None,
        spacing: tuple[float, ...] | None = None,
    ) -> None:
        """file: the .zfp that has the voxels; spacing: what open() was given in place of its."""
        self._core, self._file, self._file_spacing = core, file, spacing
        self._token = uuid.uuid4().hex
        self._lock = Turns()
        self._renderer: Renderer | None = None
        self._made_with: dict[str, Any] = {}
        self._host: _core.HostRenderer | None = None

    @property
    def size(self) -> int:
        """Voxels."""
        return self.levels[0].size

    @property
    def source_dtype(self) -> np.dtype[Any]:
        """Of the voxels before compression."""
        return np.dtype(self._core.source_type)

    @property
    def value_range(self) -> tuple[float, float]:
        """Least and largest voxel before compression; infinite where a file does not say."""
        least, largest = self._core.value_range
        return least, largest

    @property
    def nbytes(self) -> int:
        """Of the compressed voxels."""
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
        """Whether errors and `value_range` are those that a .zfp file states.

        The source is not there to check them: bounds of images hold if the file's writer is right.
        False: they were measured when this volume was compressed.
        """
        return self._core.errors_are_stated

    def isovalue_notice(self, isovalue: float) -> str:
        """The warning that drawing this isovalue gives if it is outside the source's values, or
        ""."""
        return self._core.isovalue_notice(number("isovalue", isovalue))

    @property
    def num_levels(self) -> int:
        """Levels of detail, the volume itself among them."""
        return self._core.num_levels

    def level_shape(self, level: int) -> tuple[int, int, int]:
        """Voxels of a level along (z, y, x). Voxel k of it lies at voxel 2^level k of the volume.

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
            Each has half the voxels of the last along each axis.
        region
            What one would index an array of the level with: numpy.s_[10:20, :, 5]. Only the blocks
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
        """Writes a .zfp file, which open() and the program read; whole, or not at all."""
        self._core.save(os.fsdecode(path))

    def __reduce__(self) -> tuple[Callable[..., Volume], tuple[Any, ...]]:
        if self._file is not None:
            return open_again, (self._file, self._file_spacing)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "volume.zfp")
            self.save(path)
            return from_bytes, (path.read_bytes(),)

    def __copy__(self) -> Volume:
        return self

    def __deepcopy__(self, memo: object) -> Volume:
        return self

    def __dask_tokenize__(self) -> object:
        """Whatever names dask's chunks of these voxels, and of no others."""
        return self._token

    def histogram(self, bins: int = 256) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Counts [bins] and edges [bins + 1] of the values, as numpy.histogram gives them.

        Of a large volume, of blocks that are spread over it: at most 2^24 voxels.
        """
        bins = whole("bins", bins)
        values = self._core.sample(LARGEST_SAMPLE)
        least, largest = self.value_range
        if not np.isfinite([least, largest]).all():
            least, largest = float(values.min()), float(values.max())
        counts, edges = np.histogram(np.clip(values, least, largest), bins, (least, largest))
        return counts.astype(np.int64), edges.astype(np.float64)

    def renderer(self, **options: Any) -> Renderer:
        """A Renderer of this volume; see there for the options."""
        return Renderer(self, **options)

    def camera(
        self,
        isovalue: float,
        *,
        size: tuple[int, int] = (1280, 720),
        device: str | int | None = None,
    ) -> Camera:
        """A view from the front right and above in which the isosurface fills the picture."""
        with self._lock:
            return self._renderer_for({"device": device}).camera(isovalue, size)

    def render(
        self,
        isovalue: float,
        *,
        size: tuple[int, int] = (1280, 720),
        camera: Camera | None = None,
        device: str | int | None = None,
        memory_budget: int | None = None,
        **request: Any,
    ) -> Image:
        """Draws the isosurface; Renderer.render has the other arguments.

        The renderer is kept for the next call. While a driver compiles its kernels, which may take
        half a minute the first time on a machine, the host draws; the bits are the same.

        Parameters
        ----------
        isovalue
            The surface is where the trilinear field crosses this value.
        size
            Width and height of the picture [pixels].
        camera
            None: the surface fills the picture.
        device
            "gpu", "cpu", an index, or a part of a name; None: $ISOWAVE_DEVICE, else the first GPU.
        memory_budget
            Of device memory [bytes]; None: three quarters of it.
        """
        wanted = {"device": device, "memory_budget": memory_budget, "size": size_of(size)}
        with self._lock:
            renderer = self._renderer_for({**wanted, **needed_options(request)})
            return renderer.render(isovalue, size=size, camera=camera, **request)

    def _renderer_for(self, wanted: dict[str, Any]) -> Renderer:
        """The kept renderer, or a new one where it lacks what is wanted."""
        made = self._made_with
        size = wanted.pop("size", (0, 0))
        samples = whole("samples", wanted.get("samples", 1))
        fits = (
            self._renderer is not None
            and size[0] * size[1] * samples**2 <= self._renderer.max_rays
            and made.get("device") == wanted.get("device")
            and made.get("memory_budget") == wanted.get("memory_budget", made.get("memory_budget"))
            and all(made.get(name) or not wanted.get(name) for name in CAPABILITIES)
        )
        if self._renderer is None or not fits:
            self._renderer = None  # its memory goes before that of the next is taken
            largest = max(size, (1280, 720), key=lambda s: s[0] * s[1])
            # Or two kinds of requests in turn would make it anew.
            more = {name: bool(wanted.get(name) or made.get(name)) for name in CAPABILITIES}
            self._made_with = {**wanted, **more}
            try:
                self._renderer = Renderer(self, size=largest, quick=True, **self._made_with)
            except _core.Error:  # what other calls asked for may be too much for the memory
                self._made_with = wanted
                self._renderer = Renderer(self, size=largest, quick=True, **wanted)
        return self._renderer

    def _host_renderer(self) -> _core.HostRenderer:
        if self._host is None:
            self._host = _core.HostRenderer(self._core, 0)
        return self._host

    def cast_rays(
        self,
        rays: npt.ArrayLike,
        isovalue: float,
        *,
        normals: str = "smooth",
        device: str | int | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Where rays of any origin and direction first cross the isosurface.

        Parameters
        ----------
        rays
            (..., 6): origin and direction, (x, y, z) in world space. float64 counts.
        isovalue
            The surface is where the trilinear field crosses this value.
        normals
            "smooth", or "cell": of the trilinear field itself.
        device
            "gpu", "cpu", an index, or a part of a name: casts them there, from compressed blocks.
            None: on the host, where the first call reads the whole volume for its value ranges.
            These, 0.17 bytes a voxel, and the blocks that rays come to stay in memory until the
            volume goes, a quarter of the host's at most; volumes whose ranges alone take more are
            left to the default device. The result is the same.

        Returns
        -------
        dict of arrays with the rays' leading axes
            t_hit: in lengths of the direction, inf where nothing is hit. normals: (..., 3), world
            space, of length 1, away from larger values. position: (..., 3), world space, nan where
            nothing is hit. cell: (..., 3), (z, y, x) of the voxel at the cell's lowest corner.
        """
        with self._lock:
            if device is None and self._fits_host():
                host = self._host_renderer()
            else:
                renderer = self._renderer_for({"device": device, "rays": True})
                return renderer.cast_rays(rays, isovalue, normals=normals)
        warn_of_isovalue(self._core, number("isovalue", isovalue))
        return cast_rays(host, self._core, rays, isovalue, normals)

    def _fits_host(self) -> bool:
        try:
            self._host_renderer()
        except _core.Error:
            return False
        return True

    def extract(
        self,
        isovalue: float,
        *,
        level: int = 0,
        normals: bool = True,
        vertices: str = "apart",
        device: str | int | None = None,
        memory_budget: int | None = None,
        progress: Progress | None = None,
    ) -> Mesh:
        """The isosurface as triangles, by marching cubes on the device.

        The result is in memory; `isowave extract` writes surfaces that are larger to a file.

        Parameters
        ----------
        isovalue
            The surface is where the field crosses this value along edges between voxels.
        level
            Of detail; each has half the voxels of the last along each axis.
        normals
            Of vertices: central differences of voxels. Without, fewer blocks are decoded.
        vertices
            "apart": at least 1/1024 of an edge from its voxels, so that no triangle is without
            area, and programs that merge vertices by position find the mesh closed. "exact": where
            the isovalue is crossed; on a voxel that equals it, vertices meet.
        device
            "gpu", "cpu", an index, or a part of a name; None: $ISOWAVE_DEVICE, else the first GPU.
        memory_budget
            Of device memory [bytes]; None: three quarters of it.
        progress
            Called with what is done and how much of it, 0 to 1.
        """
        if vertices not in ("apart", "exact"):
            raise ValueError(f"vertices={vertices!r:.60}: there are apart and exact")
        warn_of_isovalue(self._core, number("isovalue", isovalue))
        found = self._core.extract(
            "" if device is None else str(device),
            number("isovalue", isovalue),
            self._checked(level),
            flag("normals", normals),
            vertices == "exact",
            0 if memory_budget is None else whole("memory_budget", memory_budget, 2**64 - 1),
            function("progress", progress),
        )
        places = positions_of(self._core, found["vertices"])
        return Mesh(places, found["faces"], found["normals"] if normals else None)

    def verify(
        self,
        isovalue: float,
        *,
        size: tuple[int, int] = (640, 360),
        camera: Camera | None = None,
        device: str | int | None = None,
    ) -> dict[str, Any]:
        """Draws a frame on the device and on the host and compares all bits.

        `isowave verify` of a build with oracles judges hits by exact root finding and by Embree.

        Returns
        -------
        dict
            equal: whether all are the same; differing_pixels, differing_depths, differing_normals:
            how many are not; hits: rays that hit something.
        """
        with self._lock:
            renderer = self._renderer_for({"device": device, "size": size_of(size)})
            renderer.wait()
            image = renderer.render(isovalue, size=size, camera=camera)
            host = self._host_renderer()
        twin = draw(host, request_for(isovalue, image.camera, size))
        assert image.rgb is not None and image.depth is not None and image.normals is not None
        differing = {
            "differing_pixels": int((image.rgb != twin["picture"]).any(axis=-1).sum()),
            "differing_depths": int(
                (image.depth.view(np.uint32) != twin["depth"].view(np.uint32)).sum()
            ),
            "differing_normals": int((image.normals != twin["normals"]).any(axis=-1).sum()),
        }
        return {
            "equal": not any(differing.values()),
            **differing,
            "hits": int(np.isfinite(image.depth).sum()),
        }

    def view(self, **options: Any) -> Any:
        """Shows the volume in a notebook's widget or a browser's tab: isowave.view()."""
        return view(self, **options)

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


def open_again(path: str, spacing: tuple[float, ...] | None) -> Volume:
    """A pickled volume of a file."""
    return open(path, spacing=spacing)


def from_bytes(data: bytes) -> Volume:
    """A pickled volume of memory: it stays in a file without a name."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "volume.zfp")
        path.write_bytes(data)
        return Volume(_core.open(path, {}, None, None, None, None))


def view(volume: Volume, **options: Any) -> Any:
    """Shows a volume: in a notebook as a widget, else in a tab of the browser.

    Needs `pip install isowave[view]`, in notebooks `isowave[notebook]`. isowave.viewer has the
    options.
    """
    from isowave import viewer

    return viewer.view(volume, **options)
