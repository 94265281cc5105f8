"""Volumes in napari: a reader (napari.yaml), layers of levels of detail, isosurfaces.

napari chooses a level by the zoom in 2D, and in 3D always shows the coarsest of a layer. So a layer
has the levels from the volume itself to the finest that a texture holds, and none coarser:
3D shows that one. Slices decode their own blocks of 4 x 4 x 4 voxels, each time; a level that is
shown whole is kept as float32 for as long as the layer lives.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave._camera import Camera, vector
from isowave._checked import Isovalue
from isowave._compress import open
from isowave._core import Error
from isowave._image import Image
from isowave._levels import Level, split_key
from isowave._volume import Volume

#: What is sure to fit into a texture: 512 MiB of float32.
LARGEST_TEXTURE = 1 << 27
#: OpenGL's limit of a 3D texture's side on common devices.
LONGEST_SIDE = 2048
#: napari's orthographic view is drawn from afar, with this angle [degrees].
NARROW_VIEW = 5.0
#: A step in depth between neighbouring pixels that is more pixels long than this is a silhouette.
SILHOUETTE = 10.0

LayerData = tuple[Any, dict[str, Any], str]


class ShownLevel(Level):
    """A level of a volume as napari wants arrays.

    Voxel k of level n lies at voxel 2^n k of the volume. napari takes the ratio of the sides of two
    levels for the ratio of their voxels' sizes. So a level shows only as many voxels as make this
    true: its sides are those of the volume divided by 2^n, rounded up. If 2^n does not divide a
    side, napari shows the level up to one of its voxels away from its place.

    napari cuts out what its canvas shows, through all slices, before it takes one slice. So a box
    of a level is decoded only when the box is indexed, or made an array.
    """

    def __init__(self, volume: Volume, number: int) -> None:
        super().__init__(volume, number, [-(-n // (1 << number)) for n in volume.shape])
        self._lock = threading.Lock()
        self._voxels: npt.NDArray[np.float32] | None = None

    @property
    def is_kept(self) -> bool:
        """Whether the whole level has been decoded."""
        return self._voxels is not None

    def __getitem__(self, key: Any) -> Any:
        ranges, then = split_key(key, self.shape)
        if then == (slice(None),) * 3:
            return Box(self, ranges)
        return self._decode(ranges)[then]

    def _decode(self, ranges: Sequence[range]) -> npt.NDArray[np.float32]:
        if self._voxels is None:
            if [*ranges] != [range(n) for n in self.shape]:
                return super()._decode(ranges)
            with self._lock:  # napari slices in threads, too
                if self._voxels is None:
                    self._voxels = super()._decode(ranges)
                    self._voxels.setflags(write=False)  # what is indexed is a part of it
        z, y, x = (slice(r.start, r.stop, r.step) for r in ranges)
        return self._voxels[z, y, x]


class Box(Level):
    """A box of a level's voxels, not decoded yet."""

    def __init__(self, level: ShownLevel, ranges: Sequence[range]) -> None:
        super().__init__(level._volume, level._number, [len(r) for r in ranges])
        self._level, self._ranges = level, ranges

    def _decode(self, ranges: Sequence[range]) -> npt.NDArray[np.float32]:
        inside = zip(self._ranges, ranges)
        return self._level._decode([box[r.start : r.stop : r.step] for box, r in inside])


def levels_of(volume: Volume, *, texture: int = LARGEST_TEXTURE) -> list[ShownLevel]:
    """The levels of a layer, finest first.

    texture: most voxels of a 3D texture. The layer ends with the first level that fits into it, or
    with the volume's coarsest.
    """
    levels = [ShownLevel(volume, number) for number in range(volume.num_levels)]
    last = 0
    while last + 1 < len(levels) and not fits_texture(levels[last], texture):
        last += 1
    return levels[: last + 1]


def fits_texture(level: ShownLevel, texture: int) -> bool:
    return level.size <= texture and max(level.shape) <= LONGEST_SIDE


def layer_data(volume: Volume, **options: Any) -> LayerData:
    """The data that napari makes a multiscale image layer of.

    Scale and translate are the volume's spacing and origin, (z, y, x). If the volume's axes are not
    those of the world, there is an affine, too. options: for levels_of().
    """
    levels = levels_of(volume, **options)
    attributes: dict[str, Any] = {
        "multiscale": True,
        "scale": list(volume.spacing),
        "translate": list(volume.origin),
        "metadata": {"isowave": volume},
    }
    least, largest = volume.value_range
    if np.isfinite([least, largest]).all() and least < largest:
        attributes["contrast_limits"] = [least, largest]
    turn = volume.direction[::-1, ::-1]  # (x, y, z) to (z, y, x)
    if not np.array_equal(turn, np.eye(3)):
        # napari applies it after scale and translate: about the origin.
        affine = np.eye(4)
        affine[:3, :3] = turn
        affine[:3, 3] = np.array(volume.origin) - turn @ volume.origin
        attributes["affine"] = affine
    return levels, attributes, "image"


def add_volume(viewer: Any, volume: Volume, **options: Any) -> Any:
    """Adds a volume to a napari viewer as a multiscale image layer, and returns the layer.

    options: for levels_of(), and for viewer.add_image().
    """
    own = {"texture": options.pop("texture")} if "texture" in options else {}
    levels, attributes, _ = layer_data(volume, **own)
    return viewer.add_image(levels, **{**attributes, **options})


def get_reader(
    path: str | Sequence[str],
) -> Callable[[str | Sequence[str]], list[LayerData]] | None:
    """Called by napari: returns a function that reads the path, or None for several paths."""
    return read if isinstance(path, str) else None


def read(path: str | Sequence[str]) -> list[LayerData]:
    """Reads a file as a layer.

    Files other than .zfp are compressed into memory: exactly if float32 holds their values,
    otherwise with errors of at most 2^-16 of their range.
    """
    assert isinstance(path, str)
    levels, attributes, kind = layer_data(open_with_levels(path))
    name = os.path.basename(path)
    return [(levels, {"name": name.removesuffix(".gz").rpartition(".")[0], **attributes}, kind)]


def open_with_levels(path: str) -> Volume:
    if path.endswith(".zfp"):
        return open(path)
    try:
        return open(path, exact=True, levels=0, progress=False)
    except Error:  # float32 does not hold the values, or no volume: the next open() then fails
        pass
    return open(path, tolerance_relative=2**-16, levels=0, progress=False)


def add_isosurface(
    viewer: Any,
    volume: Volume,
    isovalue: Isovalue,
    *,
    size: tuple[int, int] = (1280, 720),
    name: str = "isosurface",
    **request: Any,
) -> Any:
    """Draws the isosurface from the viewer's 3D camera, and returns it as a surface layer.

    Vertices are the places where the pixels' rays hit the isosurface, so the layer lies in its
    place among other layers, and is exact from this camera, while the viewer may turn. The layer
    lacks what this camera cannot see: call add_isosurface() again to replace it by what the next
    camera sees. Neighbouring pixels are joined unless the depth steps by more than ten pixels.

    Parameters
    ----------
    viewer
        napari.Viewer, showing (z, y, x) in 3D.
    isovalue
        The surface is where the trilinear field crosses this value. "auto": the first of
        Volume.suggested_isovalues().
    size
        Width and height of the picture [pixels]: at best those of the viewer's canvas.
    name
        Name of the layer. A surface layer of this name is replaced.
    request
        Arguments of Volume.render(): color, normals, device, max_surface_error and so on.

    Raises
    ------
    ValueError
        The viewer does not show (z, y, x) in 3D, or no ray hits the surface.
    """
    isovalue = volume._isovalue(isovalue)
    order = tuple(viewer.dims.order)  # two axes if the viewer is empty
    if viewer.dims.ndisplay != 3 or len(order) > 3 or order != tuple(sorted(order)):
        raise ValueError("the viewer does not show (z, y, x) in 3D: viewer.dims.ndisplay = 3")
    scene = getattr(viewer, "scene", viewer)  # it has the camera since napari 0.9
    view = scene.camera
    image = volume.render(
        isovalue,
        size=size,
        camera=camera_of(view, size[1]),
        samples=1,  # a vertex for each pixel
        outputs=("rgb", "depth", "position"),
        **request,
    )
    vertices, faces, colors = mesh_of(image)
    if not len(faces):
        raise ValueError(f"no surface of value {isovalue:g} is in the viewer's picture")
    if name in viewer.layers and hasattr(viewer.layers[name], "vertex_colors"):
        layer = viewer.layers[name]
        layer.vertex_colors = None  # never of as many vertices as before
        layer.data = (vertices, faces)
        layer.vertex_colors = colors
        return layer
    seen = (view.center, view.zoom, view.angles)
    layer = viewer.add_surface((vertices, faces), vertex_colors=colors, shading="none", name=name)
    view.center, view.zoom, view.angles = seen  # napari turns to the first layer of a viewer
    return layer


def camera_of(camera: Any, height: int) -> Camera:
    """The view of a napari camera on a canvas of `height` pixels; orthographic ones from afar."""
    angle = camera.perspective or NARROW_VIEW
    distance = height / camera.zoom / 2 / math.tan(math.radians(angle) / 2)
    at = np.array(camera.center[::-1], float)
    eye = at - distance * np.array(camera.view_direction[::-1])
    up = camera.up_direction[::-1]
    return Camera(vector(eye), vector(at), vector(up), float(angle))


def mesh_of(
    image: Image,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Vertices [n][3], (z, y, x) in world space, triangles [m][3] and colours [n][4] of a picture
    with a ray for each pixel."""
    assert image.rgb is not None and image.depth is not None and image.position is not None
    depth = image.depth
    pixel = image.camera.pixel_size(depth.shape[0], 1)
    ids = np.arange(depth.size).reshape(depth.shape)
    a, b, c, d = ids[:-1, :-1], ids[:-1, 1:], ids[1:, :-1], ids[1:, 1:]
    faces = np.stack([np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)]).reshape(-1, 3)
    depths = depth.reshape(-1)[faces]
    nearest = depths.min(axis=1)
    with np.errstate(invalid="ignore"):  # inf - inf: no surface
        joined = depths.max(axis=1) - nearest <= SILHOUETTE * pixel * nearest
    faces = faces[joined]
    used, faces = np.unique(faces, return_inverse=True)
    vertices = image.position.reshape(-1, 3)[used][:, ::-1]
    colors = np.ones((len(used), 4), np.float32)
    colors[:, :3] = image.rgb.reshape(-1, 3)[used] / 255
    return np.ascontiguousarray(vertices), faces.reshape(-1, 3).astype(np.int32), colors
