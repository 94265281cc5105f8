"""Compressed volumes, which draw, extract and view themselves."""

from __future__ import annotations

import os
import pathlib
import tempfile
import threading
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from isowave import _core, viewer
from isowave._checked import Isovalue, flag, number, reversed_axes, whole
from isowave._camera import Camera, turntable_of
from isowave._handed_on import takes
from isowave._image import Image
from isowave._levels import Voxels
from isowave._mesh import Mesh
from isowave._page import save_page
from isowave._progress import Progress, shown
from isowave._renderer import (
    CAPABILITIES,
    Renderer,
    RendererArguments,
    draw,
    host_renderer,
    positions_of,
    warn_of_isovalue,
)
from isowave._request import FrameArguments, Request, isovalue_or_surfaces, request_of
from isowave._scene import Scene
from isowave._source_file import SourceFile
from isowave._surface import Surface

if TYPE_CHECKING:
    from typing_extensions import Unpack

DEFAULT_SIZE = (1280, 720)
NEED_LEVELS = {"levels", "bounds", "time_budget"}  # options with which levels may be drawn


class Turns:
    """A lock for calls that take turns. A call from another call's on_pass gets an Error."""

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


class Volume(Voxels):
    """A compressed volume. It cannot be changed, and threads may share it.

    compress() and open() make volumes. A volume is an array of float32, (z, y, x), that indexing
    decodes: volume[10], volume[10:20, ::4, -1] (see Level).

    A volume in a .zfp file is pickled as the file's path, so other processes of this machine open
    the same file. A volume in memory is pickled with its compressed voxels.
    """

    def __init__(
        self,
        core: _core.Volume,
        file: str | None = None,
        spacing: tuple[float, ...] | None = None,
    ) -> None:
        """file: the .zfp that has the voxels; spacing: given to open(), in place of the file's."""
        super().__init__(core)
        self._file, self._file_spacing = file, spacing
        #: The file that it was opened from, for scenes: path, dataset, index; None: an array
        self.source: SourceFile | None = None
        self._lock = Turns()
        self._renderer: Renderer | None = None
        self._made_with: dict[str, Any] = {}
        self._host: Renderer | None = None

    def __reduce__(self) -> tuple[Callable[..., Volume], tuple[Any, ...]]:
        if self._file is not None:
            return open_again, (self._file, self._file_spacing, self.source)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "volume.zfp")
            self.save(path)
            return from_bytes, (path.read_bytes(), self.source)

    @takes(Renderer, without=("volume",))
    def renderer(self, **options: Unpack[RendererArguments]) -> Renderer:
        """Makes a Renderer of this volume, with Renderer's options."""
        return Renderer(self, **options)

    def camera(
        self,
        isovalue: Isovalue | None = None,
        *,
        size: tuple[int, int] = (1280, 720),
        surfaces: Sequence[Surface] = (),
        device: str | int | None = None,
    ) -> Camera:
        """A view from the front right and above that the surfaces fill.

        Without an isovalue and surfaces: the view that render() takes by default, in which the
        volume's box fills the picture. It is the same for all steps of a series. Camera.of() has
        other sides.
        """
        if isovalue is None and not surfaces:
            return Camera.of(self, size=size)
        with self._lock:
            renderer = self._renderer_for({"device": device, **labels_wanted(surfaces)})
            return renderer.camera(isovalue, size, surfaces=surfaces)

    def turntable(
        self,
        num_views: int,
        isovalue: Isovalue | None = None,
        *,
        size: tuple[int, int] = (1280, 720),
        surfaces: Sequence[Surface] = (),
        device: str | int | None = None,
    ) -> list[Camera]:
        """Views once around the surfaces, or without any around the volume's box.

        They are those of `isowave render --turntable`, with `--fit surface` and without. They turn
        about `up`, from so far that all pictures of that size have the whole. The first view is
        from where camera() looks.
        """
        if isovalue is None and not surfaces:
            return turntable_of(self, num_views, "corner", size, None, 1.0)
        with self._lock:
            renderer = self._renderer_for({"device": device, **labels_wanted(surfaces)})
            return renderer.turntable(num_views, isovalue, size, surfaces=surfaces)

    def scene(self) -> Scene:
        """An empty scene of this volume: scene().surface(80, "bone").render()."""
        return Scene(self)

    def save_html(
        self, path: str | os.PathLike[str], isovalue: Isovalue = "auto", *, title: str = ""
    ) -> None:
        """Writes a page that shows an isosurface in any browser: see Scene.save_html()."""
        self.scene().surface(isovalue).save_html(path, title=title)

    def save_site(
        self, folder: str | os.PathLike[str], isovalue: Isovalue = "auto", *, title: str = ""
    ) -> None:
        """Writes such a page for a server, with a volume of any size: see Scene.save_site()."""
        self.scene().surface(isovalue).save_site(folder, title=title)

    def save_page(
        self, fields: dict[str, Any], path: str | os.PathLike[str], title: str, field: Any
    ) -> None:
        """The same of a scene's fields, and of the second volume; for the viewer."""
        save_page(self, fields, path, title, field)

    @takes(Renderer.render, size=DEFAULT_SIZE)
    def render(
        self,
        isovalue: Isovalue | None = None,
        *,
        device: str | int | None = None,
        memory_budget: int | None = None,
        field: Voxels | None = None,
        **frame: Unpack[FrameArguments],
    ) -> Image:
        """Draws the isosurface, or several; Renderer.render has the other arguments.

        The renderer is kept for the next call. If there is no GPU, the host draws. A GPU's driver
        may compile its kernels for half a minute the first time on a machine. The host draws
        meanwhile, with the same bits.

        Parameters
        ----------
        isovalue
            The surface is where the trilinear field crosses this value. "auto": the first of
            suggested_isovalues().
        device, memory_budget
            As Renderer's.
        field
            As Renderer's: a second volume, for color_map=ColorMap(by="field"). With by="caps",
            None: this volume.
        """
        value = self._isovalue(isovalue_or_surfaces(isovalue, frame.get("surfaces", ())))
        request = request_of(value, {"size": DEFAULT_SIZE, **frame})
        return self.draw(request, device=device, memory_budget=memory_budget, field=field)

    def draw(
        self,
        request: Request,
        *,
        device: str | int | None = None,
        memory_budget: int | None = None,
        field: Voxels | None = None,
    ) -> Image:
        """Draws a frame with a size, as render()."""
        if request.size is None:
            request = replace(request, size=DEFAULT_SIZE)
        for option, argument in request.needs.items():
            if request.has_labels and option not in ("labels", "rays"):
                raise _core.Error(f"labels are drawn without {argument}: leave out {argument}")
        wanted: dict[str, Any] = {"device": device, "memory_budget": memory_budget}
        wanted |= {"size": request.size, **dict.fromkeys(request.needs, True)}
        wanted["surfaces"] = request.num_surfaces
        if field is None and request.shows_volume:
            field = self
        if field is not None:
            wanted["field"] = field
        chooses = request.max_image_error is not None and self.num_levels > 1
        wanted["levels"] = chooses or not NEED_LEVELS.isdisjoint(request.needs)
        if request.samples != 1:
            wanted["samples"] = request.samples
        with self._lock:
            return self._renderer_for(wanted).draw(request)

    def _renderer_for(self, wanted: dict[str, Any]) -> Renderer:
        """The kept renderer, or a new one if the kept one lacks what is wanted."""
        made = self._made_with
        # A renderer of labels draws nothing else.
        draws_alike = bool(made.get("labels")) == bool(wanted.get("labels"))
        size = wanted.pop("size", (0, 0))
        samples = wanted.get("samples", 1)
        fits = (
            self._renderer is not None
            and size[0] * size[1] * samples**2 <= self._renderer.max_rays
            and draws_alike
            and made.get("device") == wanted.get("device")
            and made.get("memory_budget") == wanted.get("memory_budget", made.get("memory_budget"))
            and made.get("field") is wanted.get("field", made.get("field"))
            and all(self._renderer._can[name] >= wanted.get(name, 0) for name in CAPABILITIES)
        )
        if self._renderer is None or not fits:
            self._renderer = None  # its memory goes before that of the next is taken
            largest = max(size, (1280, 720), key=lambda s: s[0] * s[1])
            # The new one can do what the old one could, or two kinds of requests in turn would make
            # it anew each time.
            more = {
                name: max(wanted.get(name, default), made.get(name, default) if draws_alike else 0)
                for name, default in CAPABILITIES.items()
            }
            self._made_with = {**wanted, **more}
            try:
                self._renderer = self._make_renderer(largest, self._made_with)
            except _core.Error:  # what other calls asked for may be too much for the memory
                self._made_with = wanted
                self._renderer = self._make_renderer(largest, wanted)
        return self._renderer

    def _make_renderer(self, largest: tuple[int, int], options: dict[str, Any]) -> Renderer:
        device = "" if options.get("device") is None else str(options["device"])
        if options.get("memory_budget") is None and _core.draws_on_host(device):
            if options.get("field") is None and self._fits_host():
                return self._host_renderer()  # which cast_rays() uses, too
        return Renderer(self, size=largest, quick=True, **options)

    def _host_renderer(self) -> Renderer:
        if self._host is None:
            self._host = host_renderer(self)
        return self._host

    def cast_rays(
        self,
        rays: npt.ArrayLike,
        isovalue: Isovalue,
        *,
        normals: str = "smooth",
        device: str | int | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Finds where rays of any origin and direction first cross the isosurface.

        Parameters
        ----------
        rays
            (..., 6): origin and direction, (x, y, z) in world space, as float64.
        isovalue
            The surface is where the trilinear field crosses this value. "auto": the first of
            suggested_isovalues().
        normals
            "smooth": central differences; "cell": gradients of the trilinear field itself.
        device
            "gpu", "cpu", an index, or a part of a name: the device that casts the rays, through
            compressed blocks. None, "host": the host. Its first call reads the whole volume for
            value ranges, 0.17 bytes a voxel. The ranges and the blocks that rays come to stay in
            memory as long as the volume lives, at most a quarter of the host's memory. If the
            ranges alone take more, the default device casts the rays, unless the host was named.
            The result is the same.

        Returns
        -------
        dict of arrays with the rays' leading axes
            t_hit: in lengths of the direction, inf if nothing is hit. normals: (..., 3), world
            space, of length 1, away from larger values. position: (..., 3), world space, nan if
            nothing is hit. cell: (..., 3), (z, y, x) of the voxel at the cell's lowest corner.
        """
        with self._lock:
            if device not in (None, "host") or not self._fits_host():
                renderer = self._renderer_for({"device": device, "rays": True})
                return renderer.cast_rays(rays, isovalue, normals=normals)
            renderer = self._host_renderer()
        return renderer.cast_rays(rays, isovalue, normals=normals)

    def _fits_host(self) -> bool:
        try:
            self._host_renderer()
        except _core.Error:
            return False
        return True

    def extract(
        self,
        isovalue: Isovalue,
        *,
        level: int = 0,
        normals: bool = True,
        vertices: str = "apart",
        closed: bool = False,
        largest: int | None = None,
        simplify: float = 1.0,
        device: str | int | None = None,
        memory_budget: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Mesh:
        """Extracts the isosurface as triangles, by marching cubes.

        The result is in memory. `isowave extract` writes surfaces larger than memory to a file.

        Parameters
        ----------
        isovalue
            The surface is where the field crosses this value along edges between voxels. "auto":
            the first of suggested_isovalues().
        level
            Level of detail; 0: the volume itself. Each has half the voxels of the last along each
            axis.
        normals
            Whether vertices have normals, central differences of voxels. Without normals, fewer
            blocks are decoded.
        vertices
            "apart": at least 1/1024 of an edge away from voxels, so that every triangle has an
            area, and programs that merge vertices by position find the mesh closed. "exact": where
            the field equals the isovalue; vertices meet on a voxel that equals it.
        closed
            Closes the surface by flat caps in the faces of the volume's box, as printers want it:
            as if values lay below the isovalue all around. Not with voxels without data.
        largest
            Number of parts of the surface that are kept, those with the largest areas. None: all.
        simplify
            About this share of the triangles is left, above 0, up to 1, by meshoptimizer:
            Mesh.simplify_error. Closed meshes stay closed.
        device
            "host": this process extracts, without OpenCL. "gpu", "cpu", an index, or a part of a
            name: an OpenCL device. None: $ISOWAVE_DEVICE, else the first GPU, else the host. The
            mesh has the same bits.
        memory_budget
            Most device memory to take [bytes]; None: three quarters of it. On the host, of value
            ranges and decoded blocks; None: a quarter of its memory.
        progress
            As compress() has it.
        """
        if vertices not in ("apart", "exact"):
            raise ValueError(f"vertices={vertices!r:.60}: there are apart and exact")
        value = self._isovalue(isovalue)
        warn_of_isovalue(self._core, value)
        with shown(progress) as told:
            found = self._core.extract(
                "" if device is None else str(device),
                value,
                self._checked(level),
                flag("normals", normals),
                vertices == "exact",
                flag("closed", closed),
                0 if largest is None else whole("largest", largest, 2**32),
                number("simplify", simplify),
                0 if memory_budget is None else whole("memory_budget", memory_budget, 2**64 - 1),
                told,
            )
        places = positions_of(self, found["vertices"])
        normals_of_mesh = found["normals"] if normals else None
        return Mesh(places, found["faces"], normals_of_mesh, found["simplify_error"])

    def verify(
        self,
        isovalue: Isovalue,
        *,
        size: tuple[int, int] = (640, 360),
        camera: Camera | None = None,
        device: str | int | None = None,
    ) -> dict[str, Any]:
        """Draws a frame on the device and on the host and compares all bits.

        `isowave verify` of a build with oracles judges hits by exact root finding and by Embree.

        Parameters
        ----------
        device
            "gpu", "cpu", an index, or a part of a name; None: $ISOWAVE_DEVICE, else the first GPU,
            else an OpenCL device for the CPU.

        Returns
        -------
        dict
            equal: whether all bits are the same; differing_pixels, differing_depths,
            differing_normals: how many differ; hits: how many rays hit the surface.
        """
        request = Request(self._isovalue(isovalue), camera, size)
        if device is None and _core.draws_on_host(""):
            device = "cpu"
        if str(device).lower() == "host":
            raise _core.Error(
                "verify compares a device with the host: name a device, such as 'cpu'"
            )
        with self._lock:
            renderer = self._renderer_for({"device": device, "size": request.size})
            renderer.wait()
            image = renderer.draw(request)
            host = self._host_renderer()
        twin = draw(host._core, replace(request, camera=image.camera))
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

    view = viewer.view


def labels_wanted(surfaces: Sequence[Surface]) -> dict[str, Any]:
    """What a renderer of these surfaces must be made with if they are those of labels."""
    has_labels = Request(0.0, surfaces=surfaces).has_labels
    return {"labels": True, "surfaces": len(surfaces)} if has_labels else {}


def open_again(path: str, spacing: tuple[float, ...] | None, source: SourceFile | None) -> Volume:
    """Opens a pickled volume of a file."""
    core = _core.open(
        path, {}, None, None, None if spacing is None else reversed_axes(spacing), None
    )
    warn_of_file(core)
    volume = Volume(core, path, spacing)
    volume.source = source
    return volume


def from_bytes(data: bytes, source: SourceFile | None) -> Volume:
    """Opens a pickled volume of memory, which then stays in a file without a name."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "volume.zfp")
        path.write_bytes(data)
        volume = Volume(_core.open(path, {}, None, None, None, None))
    volume.source = source
    return volume


def warn_of_file(core: _core.Volume) -> None:
    """Warns the caller's caller of what is strange about a volume's file."""
    for notice in core.notices:
        warnings.warn(notice, RuntimeWarning, stacklevel=3)
