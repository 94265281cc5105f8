"""Pictures, and what they show."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._annotate import Annotations, annotated
from isowave._camera import camera_for_core
from isowave._checked import flag
from isowave._request import Request, rgb_of
from isowave._surface import Surface

WHITE = (1.0, 1.0, 1.0)  # the background if none is given, as isowave::Appearance has it


class Image:
    """A picture, and what it shows. Arrays that were not asked for are None.

    Rows go from top to bottom. If each pixel has several rays, depth, normals, position and bounds
    have `samples` times as many rows and columns: one entry for each ray.
    """

    depth: npt.NDArray[np.float32] | None  #: distance from the eye [world units]; inf: no surface
    normals: npt.NDArray[np.float32] | None
    """(rows, columns, 3), (x, y, z) in world space, of length 1, away from larger values; 0
    without a surface."""
    position: npt.NDArray[np.float32] | npt.NDArray[np.float64] | None
    """(rows, columns, 3), world space; nan: no surface. float64 if float32 would lose more than
    1/4096 voxel, as it does far from the origin."""
    bounds: npt.NDArray[np.float32] | None
    """Largest possible distance to the surface of the volume before compression [pixels]; inf:
    nothing is certain. Bounds hold if the volume's errors do, which a file may state wrongly:
    `statistics["errors_are_stated"]`, as `Volume.errors_are_stated`."""

    field: npt.NDArray[np.float32] | None
    """(rows, columns): values of the renderer's field at the hits; nan: none."""
    surface: npt.NDArray[np.int8] | None
    """(rows, columns): the index of the surface in `surfaces`, 0 without them; -1: no surface."""
    cap: npt.NDArray[np.bool_] | None  #: (rows, columns): on a clipping plane

    def __init__(self, frame: dict[str, Any], request: Request) -> None:
        assert request.camera is not None
        # (height, width, 3), or 4 if it is transparent
        self._picture: npt.NDArray[np.uint8] | None = frame.get("picture")
        self.depth = frame.get("depth")
        self.normals = frame.get("normals")
        self.position = frame.get("positions")
        self.bounds = frame.get("bounds")
        self.field = frame.get("field")
        hits = set(request.outputs) if "surfaces" in frame else set()
        self.surface = frame["surfaces"] if "surface" in hits else None
        self.cap = frame["caps"].astype(bool) if "cap" in hits else None
        #: Counts and times of the frame: passes, rays, hits, decoded_blocks, total_ms and so on.
        self.statistics: dict[str, Any] = frame["statistics"]
        self.camera = request.camera
        self.isovalue = request.isovalue  #: the first surface's
        self.surfaces = tuple(request.surfaces)  #: with their colours; (): the isovalue's, opaque
        #: Those of the scene that was drawn, which annotated() draws; None: there are none.
        self.annotations: Annotations | None = None
        self._samples = self.statistics.get("detail", {}).get("samples", request.samples)
        self._background = WHITE if request.background is None else request.background
        self._background_top = request.background_top
        self._fields = request.for_core()

    @property
    def complete(self) -> bool:
        """False if the frame was stopped, or its time was over."""
        return bool(self.statistics["complete"])

    @property
    def rgb(self) -> npt.NDArray[np.uint8] | None:
        """(height, width, 3). Raises ValueError if the picture is transparent: see rgba."""
        return None if self._picture is None else rgb_of(self._picture)

    @property
    def rgba(self) -> npt.NDArray[np.uint8]:
        """(height, width, 4); alpha is the share of a pixel's rays that hit (straight alpha).

        Rays that go on behind translucent surfaces count as far as these hide what is behind.
        Colours are the surface's, without the background. A transparent picture has been drawn
        like this. Others become so if they have depth and their surfaces are opaque; otherwise all
        pixels are.
        """
        rgb = self._drawn()
        if rgb.shape[2] == 4:
            return rgb
        if self.depth is None or any(each.opacity < 1 for each in self.surfaces):
            return np.dstack((rgb, np.full(rgb.shape[:2], 255, np.uint8)))
        s = self._samples
        hit = np.isfinite(self.depth).reshape(rgb.shape[0], s, rgb.shape[1], s)
        covered = hit.mean(axis=(1, 3))
        edge = (covered > 0) & (covered < 1)
        if edge.any():  # there, rays that met nothing have mixed the background in
            part = covered[edge][:, None]
            behind = np.broadcast_to(self._background_rows(len(rgb))[:, None], rgb.shape)
            surface = (rgb[edge] - (1 - part) * 255 * behind[edge]) / part
            rgb = rgb.copy()
            rgb[edge] = np.rint(surface.clip(0, 255))
        return np.dstack((rgb, np.rint(255 * covered).astype(np.uint8)))

    def annotated(
        self,
        what: str | Sequence[str] | None = None,
        *,
        units: str | None = None,
        title: str | None = None,
    ) -> npt.NDArray[np.uint8]:
        """A copy of the picture with a scale bar and more, (height, width, 3), or 4 with alpha.

        The arrays of the image stay as they are.
        An argument that is None is that of the scene's annotations, if a scene with some was drawn.

        Parameters
        ----------
        what
            "scale-bar": a round length at the depth of the point that the camera looks at; "axes":
            directions of x, y and z; "color-bar" of colour map and slices; "caption": title,
            isovalues and their colours; "all" of them, or a list of these names. Default: "all".
        units
            Units of the world, such as "mm": for the scale bar, and for colours along an axis.
            Default: none.
        title
            First line of the caption, such as the name of the volume's file. Default: none.

        Raises
        ------
        Error
            The picture has less than 200 x 150 pixels; a colour bar without colour map and slices.
        """
        arguments = {"what": what, "units": units, "title": title}
        given: dict[str, Any] = {name: each for name, each in arguments.items() if each is not None}
        wanted = replace(self.annotations or Annotations(), **given)
        ranges = (self.statistics.get("color_range"), self.statistics.get("slice_range"))
        return annotated(self._drawn(), self._fields, ranges, wanted)

    def _background_rows(self, rows: int) -> npt.NDArray[np.float64]:
        """(rows, 3): the background at each row, from the top."""
        bottom = np.array(self._background, np.float64)
        top = bottom if self._background_top is None else np.array(self._background_top, np.float64)
        up = 1 - (np.arange(rows)[:, None] + 0.5) / rows
        return bottom + up * (top - bottom)

    def _drawn(self) -> npt.NDArray[np.uint8]:
        if self._picture is None:
            raise ValueError("the picture was not asked for: render(..., outputs=('rgb', ...))")
        return self._picture

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        return np.asarray(self.rgba, dtype)

    def _repr_png_(self) -> bytes:
        return _core.encode_png(self._drawn(), camera_for_core(self.camera))

    def show(self) -> None:
        """Shows the picture: in a notebook's cell, or in the desktop's viewer of PNG files.

        The viewer gets a file in the folder of temporary files, which stays there. Raises Error if
        there is no display.
        """
        shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
        if getattr(shell, "kernel", None) is not None:
            from IPython.display import display  # type: ignore[import-not-found,unused-ignore]

            display(self)  # type: ignore[no-untyped-call,unused-ignore]
            return
        opener = shutil.which("xdg-open")
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) or opener is None:
            lack = "xdg-open" if opener is None else "display"
            raise _core.Error(f"there is no {lack} to show the picture: image.save('a.png')")
        handle, path = tempfile.mkstemp(".png", "isowave_")
        os.close(handle)
        self.save(path)
        subprocess.Popen([opener, path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def save(self, path: str | os.PathLike[str], *, alpha: bool = False) -> None:
        """Writes a .png file, whole or not at all.

        alpha: writes `rgba`; pixels without surface are transparent. Otherwise the picture is
        written as it was drawn.
        """
        picture = self.rgba if flag("alpha", alpha) else self._drawn()
        _core.save_png(picture, os.fsdecode(path), camera_for_core(self.camera))

    def __repr__(self) -> str:
        shown = ""
        if self._picture is not None:
            shown = f"{self._picture.shape[1]} x {self._picture.shape[0]}, "
        surfaces = self.surfaces or (Surface(self.isovalue),)
        if surfaces[0].labels:
            return f"<isowave.Image {shown}{'; '.join(each.text for each in surfaces)}>"
        plural = "s" if len(surfaces) > 1 else ""
        isovalues = ", ".join(f"{each.isovalue:g}" for each in surfaces)
        return f"<isowave.Image {shown}isovalue{plural} {isovalues}>"
