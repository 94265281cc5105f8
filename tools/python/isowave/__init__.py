"""Isosurfaces of volumes too large for the device that draws them.

    import isowave

    volume = isowave.compress(array, tolerance=0.5, spacing=(2, 1, 1))  # or open("head.nrrd")
    image = volume.render(isovalue=80, size=(1280, 720))
    image.save("head.png")  # image.rgba, .depth, .normals, .position are numpy arrays
    isowave.view(volume)  # in a browser or notebook

Shape, spacing, origin and cells are in the order of an array's axes, (z, y, x). Vectors in world
space are (x, y, z): cameras, normals, positions.
"""

from isowave import _loader

_loader.prepare()

from isowave._annotate import Annotations  # noqa: E402
from isowave._bricks import BrickRenderer  # noqa: E402
from isowave._camera import Camera  # noqa: E402
from isowave._clip import ClipPlane, clip_box  # noqa: E402
from isowave._color_map import ColorMap  # noqa: E402
from isowave._compress import compress, open  # noqa: E402
from isowave._core import Error, __version__  # noqa: E402
from isowave._image import Image  # noqa: E402
from isowave._levels import Level  # noqa: E402
from isowave._mesh import Mesh  # noqa: E402
from isowave._movie import save_movie  # noqa: E402
from isowave._renderer import Renderer  # noqa: E402
from isowave._report import Report, devices  # noqa: E402
from isowave._scene import Scene  # noqa: E402
from isowave._scene_file import open_scene  # noqa: E402
from isowave._series import Series, open_series  # noqa: E402
from isowave._slice import Slice  # noqa: E402
from isowave._surface import Surface  # noqa: E402
from isowave._volume import Volume  # noqa: E402
from isowave.viewer import view  # noqa: E402

__all__ = [
    "Annotations",
    "BrickRenderer",
    "Camera",
    "ClipPlane",
    "ColorMap",
    "Error",
    "Image",
    "Level",
    "Mesh",
    "Renderer",
    "Report",
    "Scene",
    "Series",
    "Slice",
    "Surface",
    "Volume",
    "__version__",
    "clip_box",
    "compress",
    "devices",
    "open",
    "open_scene",
    "open_series",
    "save_movie",
    "view",
]
