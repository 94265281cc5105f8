"""Draws a volume with the processes of mpirun; each process draws a brick of the volume."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._camera import Camera, turntable_of, view_count
from isowave._checked import Isovalue, number, size_of
from isowave._compress import compression_options
from isowave._handed_on import takes
from isowave._image import Image
from isowave._placed import Placed
from isowave._renderer import Renderer, draw, goes_on, renderer_options, warn_of_isovalue
from isowave._report import Device
from isowave._request import (
    FrameArguments,
    OnPass,
    Progress,
    Request,
    isovalue_or_surfaces,
    request_of,
)
from isowave._surface import Surface

if TYPE_CHECKING:
    from typing_extensions import Unpack

OUTPUTS = ("rgb", "depth", "normals")
ALL_OUTPUTS = (*OUTPUTS, "bounds", "field")

Result = TypeVar("Result")


class Processes:
    """A communicator of mpi4py, as the compiled part calls it."""

    def __init__(self, comm: Any) -> None:
        from mpi4py import MPI

        self._mpi, self._comm = MPI, comm
        self.rank, self.size = comm.Get_rank(), comm.Get_size()
        machine = comm.Split_type(MPI.COMM_TYPE_SHARED, self.rank)
        self.local_rank = machine.Get_rank()
        machine.Free()

    def all_gather(self, data: bytes) -> list[bytes]:
        return list(self._comm.allgather(data))

    def reduce(
        self, words: npt.NDArray[np.uint64] | npt.NDArray[np.uint32], smallest: bool, for_all: bool
    ) -> None:
        operation = self._mpi.MIN if smallest else self._mpi.BOR
        if for_all:
            self._comm.Allreduce(self._mpi.IN_PLACE, words, operation)
        elif self.rank == 0:
            self._comm.Reduce(self._mpi.IN_PLACE, words, operation)
        else:
            self._comm.Reduce(words, None, operation)

    def together(self, work: Callable[[], Result]) -> Result:
        """The result of work(). If work() raises at one process, all raise, so that none waits."""
        error: Exception | None = None
        try:
            result = work()
        except Exception as raised:  # noqa: BLE001: raised again below
            error = raised
        texts = self._comm.allgather(None if error is None else str(error))
        if error is not None:
            raise error
        for rank, text in enumerate(texts):
            if text is not None:
                raise _core.Error(f"rank {rank}: {text}")
        return result


def given_isovalue(isovalue: Isovalue) -> float:
    if isinstance(isovalue, str) and isovalue == "auto":
        raise _core.Error(
            "isovalue='auto': no process sees the whole volume: give a number; `isowave info` "
            "suggests some"
        )
    return number("isovalue", isovalue)


class BrickRenderer(Placed[_core.Renderer]):
    """Draws a volume that may be larger than one machine: each process has a brick of it.

    The pictures have the bits of Renderer's. All processes of the communicator make the same calls
    in the same order. An error of one process is raised in all. Needs mpi4py.

    Parameters
    ----------
    path
        A volume, as for isowave.open(). Each process reads only its blocks of a .zfp file; of other
        files it reads its layers, and compresses its brick.
    comm
        A communicator of mpi4py, e.g. MPI.COMM_WORLD. The processes of a machine share its devices.
    device, size, samples, memory_budget, cache_blocks, rays, bounce, surfaces, labels
        As Renderer's, for each process, which needs an OpenCL device. Several devices, with commas,
        are taken in turn.
    levels
        Frames may use the levels of detail that are in the .zfp file.
    bounds
        Frames may ask for `max_surface_error` and bounds. If the volume is compressed here, its
        error is then measured.
    field
        File of a second volume for `ColorMap(by="field")`, which may be `path`. Each process keeps
        what its brick needs of it. A file that is not compressed is compressed like the volume.
    bricks
        Number of bricks along x, y and z; None: bricks of equal size.
    tolerance, tolerance_relative, rate, exact, map_nan, no_data
        As isowave.open()'s.

    Raises
    ------
    Error
        In all processes: what Renderer raises; different arguments or volumes; more processes than
        there can be bricks.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        comm: Any,
        *,
        device: str | int | None = None,
        size: tuple[int, int] = (1280, 720),
        samples: int = 1,
        memory_budget: int | None = None,
        cache_blocks: int = 0,
        levels: bool = False,
        bounds: bool = False,
        rays: bool = False,
        bounce: bool = False,
        surfaces: int = 0,
        labels: bool = False,
        field: str | os.PathLike[str] | None = None,
        bricks: tuple[int, int, int] | None = None,
        tolerance: float | None = None,
        tolerance_relative: float | None = None,
        rate: int | None = None,
        exact: bool = False,
        map_nan: float | None = None,
        no_data: float | None = None,
    ) -> None:
        self._processes = Processes(comm)

        def read() -> tuple[dict[str, Any], dict[str, Any]]:
            compression = compression_options(
                tolerance, tolerance_relative, rate, exact, 1, map_nan, no_data, 0
            )
            compression["measure_error"] = False
            can = {"levels": levels, "bounds": bounds, "rays": rays, "bounce": bounce}
            can["labels"] = labels
            options = renderer_options(
                size, samples, memory_budget, cache_blocks, surfaces=surfaces, **can
            )
            options["device"] = "" if device is None else str(device)
            options["bricks"] = None if bricks is None else "{}x{}x{}".format(*bricks)
            options["field"] = None if field is None else os.fsdecode(field)
            return compression, options

        compression, options = self._processes.together(read)
        self.size: tuple[int, int] = (options["width"], options["height"])
        self._has_labels = labels
        self._core = _core.team_renderer(self._processes, os.fsdecode(path), compression, options)
        if self._processes.rank == 0:
            for notice in self._core.notices:
                warnings.warn(notice, RuntimeWarning, stacklevel=2)

    @property
    def device(self) -> Device:
        """This process's device, as Renderer.device."""
        return Device(self._core.device)

    def camera(
        self,
        isovalue: float | None = None,
        size: tuple[int, int] | None = None,
        *,
        surfaces: Sequence[Surface] = (),
    ) -> Camera:
        """As Renderer.camera()."""
        return self.turntable(1, isovalue, size, surfaces=surfaces)[0]

    def turntable(
        self,
        num_views: int,
        isovalue: float | None = None,
        size: tuple[int, int] | None = None,
        *,
        surfaces: Sequence[Surface] = (),
    ) -> list[Camera]:
        """As Renderer.turntable()."""

        def ask() -> tuple[Request, int, tuple[int, int]]:
            if isovalue is None and not surfaces:
                value = 0.0
            else:
                value = given_isovalue(isovalue_or_surfaces(isovalue, surfaces))
            wanted = self._checked(Request(value, surfaces=surfaces))
            count = view_count(num_views)
            return wanted, count, self.size if size is None else size_of(size)

        request, count, (width, height) = self._processes.together(ask)
        if isovalue is None and not surfaces:
            return turntable_of(self, count, "corner", (width, height), None, 1.0)
        cameras = self._core.turntable(request.values, count, width, height, request.has_labels)
        return [Camera(*camera) for camera in cameras]

    def __repr__(self) -> str:
        (width, height), processes = self.size, self._processes
        rank = f"rank {processes.rank} of {processes.size}"
        return f"<isowave.BrickRenderer {width} x {height}, {rank}, {self.device['name']}>"

    def __reduce__(self) -> Any:
        raise TypeError("a BrickRenderer cannot be pickled: each process makes its own")

    def _checked(self, request: Request) -> Request:
        if request.has_labels and not self._has_labels:
            raise _core.Error("labels needs a renderer that was made with labels=True")
        return request

    def _for_all(self, on_pass: OnPass) -> OnPass:
        """Calls rank 0's on_pass, when all processes have put the picture together."""
        processes = self._processes

        def call(progress: Progress) -> bool:
            progress._keep_picture()
            return processes.together(lambda: processes.rank != 0 or goes_on(on_pass, progress))

        return call

    @takes(Renderer.render, without=("time_budget_ms",), outputs=OUTPUTS)
    def render(
        self, isovalue: float | None = None, **frame: Unpack[FrameArguments]
    ) -> Image | None:
        """Draws a frame; arguments as Renderer.render(), without positions and time_budget_ms.

        `max_surface_error` by proof and the output "bounds" need bounds=True. One Renderer would
        choose the same detail, and find the same bounds. All processes give an `on_pass`, or none.
        That of rank 0 is called, with the picture of the whole volume, and may stop the frame.

        Returns
        -------
        Image
            At rank 0: the picture of the whole volume. Its statistics are rank 0's, except hits.
        None
            At the other ranks.

        Raises
        ------
        Error, TypeError, ValueError
            In all processes, as Renderer.render(); also if processes ask for different frames.
        """

        def ask() -> Request:
            value = given_isovalue(isovalue_or_surfaces(isovalue, frame.get("surfaces", ())))
            request = request_of(value, {"outputs": OUTPUTS, **frame})
            if request.size is None:
                request = replace(request, size=self.size)
            for name in request.outputs:
                if name not in ALL_OUTPUTS:
                    raise ValueError(f"outputs {name}: bricks have {', '.join(ALL_OUTPUTS)}")
            if request.time_budget_ms is not None:
                raise TypeError("a BrickRenderer draws without time_budget_ms")
            return self._checked(request)

        request = self._processes.together(ask)
        if len(set(self._processes.all_gather(b"" if request.camera is None else b"given"))) > 1:
            raise _core.Error("some processes give a camera, and others none: ask alike")
        if request.camera is None:
            request = replace(request, camera=self.camera(size=request.size))
        if request.on_pass is not None:
            request = replace(request, on_pass=self._for_all(request.on_pass))
        is_first = self._processes.rank == 0
        progress = request.progress if is_first else False
        drawn = draw(self._core, request, interrupts=False, progress=progress)
        if not is_first:
            return None
        for value in request.isovalues:
            warn_of_isovalue(self._core, value)
        return Image(drawn, request)
