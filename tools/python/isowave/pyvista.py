"""Isosurfaces in the scenes of PyVista: a picture with depth among other meshes.

    import pyvista
    import isowave.pyvista

    plotter = pyvista.Plotter()
    plotter.add_mesh(pyvista.Sphere())
    surface = isowave.pyvista.add_isosurface(plotter, volume, 80)
    plotter.show()
    surface.isovalue = 90

Before VTK draws the scene, isowave draws the surface with the scene's camera and size, if the
camera, the size or the surface has changed. A rectangle as large as the view then writes colour and
depth of each pixel among VTK's opaque meshes. So meshes and surface hide each other pixel by pixel;
translucent meshes are blended over the surface.
"""

from __future__ import annotations

import math
import warnings
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pyvista
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkPolyDataMapper, vtkTexture

from isowave._camera import Camera, vector
from isowave._checked import Isovalue
from isowave._clip import ClipPlane
from isowave._image import Image
from isowave._request import Request
from isowave._surface import Color
from isowave._volume import Volume

__all__ = ["Isosurface", "add_isosurface", "screenshot"]

TEXTURE = "isowaveFrame"
# Two numbers by which OpenGL's projection maps distances to depths, and 1: it is parallel.
PLANES = "isowavePlanes"

# The actor's bounds must be the volume's: PyVista sets cameras and clipping planes by them. So its
# points are the corners of the volume's box. The shader moves the first four to the corners of the
# view, and the others to one point, at which they cover no pixel.
VERTEX = {
    "PositionVC::Dec": "out vec2 isowavePlace;\n",
    "PositionVC::Impl": """
  vec2 isowaveCorner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1);
  isowavePlace = isowaveCorner;
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
  if (gl_VertexID < 4) { gl_Position.xy = 2.0 * isowaveCorner - 1.0; }
""",
}
# The texture holds distances, not the depth buffer's values: these depend on the clipping planes,
# which may move while the picture stays. What is beyond the planes is not seen, as with meshes.
FRAGMENT = {
    "PositionVC::Dec": "in vec2 isowavePlace;\n",
    "Depth::Impl": f"""
  ivec2 isowaveSize = textureSize({TEXTURE}, 0);
  ivec2 isowaveTexel = min(ivec2(isowavePlace * vec2(isowaveSize)), isowaveSize - 1);
  vec4 isowavePixel = texelFetch({TEXTURE}, isowaveTexel, 0);
  if (isowavePixel.a <= 0.0) {{ discard; }}
  float isowaveDepth = {PLANES}.z > 0.0 ? {PLANES}.y - {PLANES}.x * isowavePixel.a
                                        : {PLANES}.y / isowavePixel.a - {PLANES}.x;
  if (abs(isowaveDepth) > 1.0) {{ discard; }}
  gl_FragDepth = 0.5 * isowaveDepth + 0.5;
""",
    "Light::Impl": "  gl_FragData[0] = vec4(isowavePixel.rgb, 1.0);\n",
}

surfaces_of: weakref.WeakKeyDictionary[Any, list[Isosurface]] = weakref.WeakKeyDictionary()


class Isosurface:
    """An isosurface in a plotter's scene, made by add_isosurface().

    Changes are seen when the scene is drawn next.
    """

    def __init__(
        self, plotter: Any, volume: Volume, request: Request, **renderer_options: Any
    ) -> None:
        self.volume = volume
        self.isovalue = request.isovalue  #: value of the field on the surface
        self.color = request.color
        self.clip: Sequence[ClipPlane] = request.clip  #: see Renderer.render
        self.image: Image | None = None  #: the last picture, with "rgb" and "depth"
        self.error: Exception | None = None  #: why the last frame was drawn without the surface
        self._failure: Exception | None = None  # the same, of any frame since screenshot() began
        self._request, self._renderer_options = request, renderer_options
        self._drawn: tuple[Any, ...] | None = None
        self._plotter = weakref.ref(plotter)
        self._renderer = weakref.ref(plotter.renderer)
        self._texture = vtkTexture()
        self._texture.SetColorModeToDirectScalars()
        self._texture.InterpolateOff()
        self.actor = make_actor(corners_of(volume), self._texture)  #: the vtkActor in the scene
        self._show(np.zeros((1, 1, 4), np.float32))
        self._observer: int | None = plotter.renderer.AddObserver("StartEvent", self._update)

    @property
    def visible(self) -> bool:
        return bool(self.actor.GetVisibility())

    @visible.setter
    def visible(self, value: bool) -> None:
        self.actor.SetVisibility(value)

    def remove(self) -> None:
        """Removes the surface from the scene. May be called again."""
        renderer, plotter = self._renderer(), self._plotter()
        if self._observer is None:
            return
        if renderer is not None:
            renderer.RemoveObserver(self._observer)
            renderer.remove_actor(self.actor, render=False)
        if plotter is not None:
            surfaces_of[plotter].remove(self)
        self._observer = None

    def _update(self, renderer: Any, _event: str) -> None:
        """Draws the surface for the renderer, which is about to draw its scene."""
        if not self.visible or not renderer.HasViewProp(self.actor):
            return
        try:
            view = view_of(renderer)
            if not self.actor.GetIsIdentity():
                raise ValueError("isosurfaces cannot be scaled or moved with the scene")
            wanted = (self.isovalue, self.color, tuple(self.clip), view)
            if wanted != self._drawn:
                request = replace(
                    self._request,
                    isovalue=self.isovalue,
                    camera=view.camera,
                    size=view.size,
                    color=self.color,
                    clip=self.clip,
                )
                self.image = self.volume.draw(request, **self._renderer_options)
                (left, bottom), (width, height) = view.corner, view.part
                frame = frame_of(self.image)
                self._show(frame[bottom : bottom + height, left : left + width])
                self._drawn = wanted
            projection = projection_of(renderer)
            uniforms = self.actor.GetShaderProperty().GetFragmentCustomUniforms()
            is_parallel = float(view.camera.parallel_height is not None)
            uniforms.SetUniform3f(PLANES, [projection[2, 2], projection[2, 3], is_parallel])
            self.error = None
        except Exception as error:  # noqa: BLE001: VTK would print it, and go on
            self._show(np.zeros((1, 1, 4), np.float32))
            self._drawn = None
            self.error = self._failure = error
            warnings.warn(f"no isosurface is shown: {error}", RuntimeWarning, stacklevel=2)

    def _show(self, frame: npt.NDArray[np.float32]) -> None:
        image = vtkImageData()
        image.SetDimensions(frame.shape[1], frame.shape[0], 1)
        image.GetPointData().SetScalars(vtk_array(frame.reshape(-1, 4)))
        self._texture.SetInputData(image)

    def __repr__(self) -> str:
        return f"<isowave.pyvista.Isosurface isovalue {self.isovalue:g}>"


def add_isosurface(
    plotter: pyvista.Plotter,
    volume: Volume,
    isovalue: Isovalue,
    *,
    color: Color | None = None,
    device: str | int | None = None,
    max_surface_error: float | None = None,
    by: str = "proof",
    voxel_pixels: float = 0.0,
    normals: str = "smooth",
    clip: Sequence[ClipPlane] = (),
    caps: bool = True,
    memory_budget: int | None = None,
    reset_camera: bool | None = None,
) -> Isosurface:
    """Adds an isosurface to the plotter's active scene.

    The surface is opaque, has one ray for each pixel, and its own light: a headlight, and one from
    above. Shadows (plotter.enable_shadows()) are wrong in scenes with it, since VTK draws them from
    the lights' places.

    Parameters
    ----------
    plotter
        The plotter whose active scene gets the surface.
    volume
        Lies in the scene's world space. isowave.compress(pyvista.ImageData) lies where the image
        does.
    isovalue
        The surface is where the trilinear field crosses this value. "auto": the first of
        Volume.suggested_isovalues().
    color
        "#rrggbb", a name such as "bone", or red, green, blue from 0 to 1.
    device, memory_budget
        As for Volume.render.
    max_surface_error, by, voxel_pixels, normals, clip, caps
        As for Renderer.render. PyVista's planes are ClipPlane.through(origin, normal).
    reset_camera
        Whether to set the camera so that all of the scene is seen; None: unless it was set.

    Returns
    -------
    Isosurface
        Changes isovalue, colour and clipping planes, and removes the surface.

    If the scene cannot be drawn with the surface, there is a warning, and screenshot() raises
    ValueError.
    """
    request = Request(
        volume._isovalue(isovalue),
        color=color,
        normals=normals,
        clip=clip,
        caps=caps,
        outputs=("rgb", "depth"),
        max_surface_error=max_surface_error,
        by=by,
        voxel_pixels=voxel_pixels,
    )
    surface = Isosurface(plotter, volume, request, device=device, memory_budget=memory_budget)
    plotter.add_actor(surface.actor, reset_camera=reset_camera, pickable=False, render=False)
    surfaces_of.setdefault(plotter, []).append(surface)
    return surface


def screenshot(plotter: pyvista.Plotter, **options: Any) -> npt.NDArray[np.uint8]:
    """Returns what the plotter shows now, with isosurfaces: uint8 (height, width, 3).

    options: for pyvista.Plotter.screenshot. Raises the error of a surface that cannot be drawn.
    """
    surfaces = list(surfaces_of.get(plotter, []))
    for surface in surfaces:
        surface._failure = None
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no isosurface is shown", RuntimeWarning)
        plotter.render()  # what changed since the last time; nothing before the first
        rgb = plotter.screenshot(return_img=True, **options)
    for surface in surfaces:
        if surface._failure is not None:
            raise surface._failure
    return np.asarray(rgb)


@dataclass(frozen=True)
class View:
    """The part of a picture that a vtkRenderer draws; the camera looks at the picture's middle.

    The part is smaller than the picture if VTK draws pictures larger than the window in tiles.
    """

    camera: Camera
    size: tuple[int, int]  #: width and height of the whole picture
    corner: tuple[int, int]  #: columns left of the part, and rows below it
    part: tuple[int, int]  #: width and height of the part


def view_of(renderer: Any) -> View:
    """The view, from the matrices that VTK is about to draw with."""
    camera, aspect = renderer.GetActiveCamera(), renderer.GetTiledAspectRatio()
    is_parallel = bool(camera.GetParallelProjection())
    part = part_of(renderer)
    if min(part) < 1:
        raise ValueError("isosurfaces need a view of at least one pixel")
    view, projection = matrix_of(camera.GetModelViewTransformMatrix()), projection_of(renderer)
    rotation = view[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3)):
        raise ValueError("isosurfaces need a camera that does not scale the scene")
    if not np.isclose(projection[0, 0] * aspect, projection[1, 1]):
        raise ValueError("isosurfaces need a camera with square pixels")
    # The middle's shift, in halves of the part.
    shift = -projection[:2, 3] if is_parallel else projection[:2, 2]
    exact = part * (1 + np.abs(shift))
    whole = np.rint(exact).astype(int)
    if np.abs(exact - whole).max() > 0.01:
        raise ValueError("isosurfaces need a camera that looks through the middle of its view")
    corner = np.where(shift > 0, whole - part, 0)
    eye = -rotation.T @ view[:3, 3]
    towards = eye - camera.GetDistance() * rotation[2]
    half = whole[1] / part[1] / projection[1, 1]  # of the whole's height; of a pinhole, at 1
    lens = (60.0, 2 * half) if is_parallel else (math.degrees(2 * math.atan(half)), None)
    return View(
        Camera(vector(eye), vector(towards), vector(rotation[1]), *lens),
        (int(whole[0]), int(whole[1])),
        (int(corner[0]), int(corner[1])),
        part,
    )


def part_of(renderer: Any) -> tuple[int, int]:
    """Width and height [pixels] of what is drawn at once."""
    width, height = renderer.GetSize()
    columns, rows = renderer.GetVTKWindow().GetTileScale()
    if (columns, rows) != (1, 1) and tuple(renderer.GetViewport()) != (0, 0, 1, 1):
        raise ValueError(
            "isosurfaces cannot be enlarged (scale=) where a plotter has several scenes"
        )
    return width // columns, height // rows


def projection_of(renderer: Any) -> npt.NDArray[np.float64]:
    aspect = renderer.GetTiledAspectRatio()
    return matrix_of(renderer.GetActiveCamera().GetProjectionTransformMatrix(aspect, -1, 1))


def matrix_of(matrix: Any) -> npt.NDArray[np.float64]:
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def eye_depth(image: Image) -> npt.NDArray[np.float64]:
    """Distance from the eye's plane [world units], (height, width); inf: no surface."""
    assert image.depth is not None
    if image.camera.parallel_height is not None:
        return np.asarray(image.depth, np.float64)
    height, width = image.depth.shape
    pixel = image.camera.pixel_size(height, 1)
    x = pixel * (np.arange(width) + 0.5 - width / 2)
    y = pixel * (np.arange(height) + 0.5 - height / 2)
    return np.asarray(image.depth / np.sqrt(1 + x[None, :] ** 2 + y[:, None] ** 2), np.float64)


def frame_of(image: Image) -> npt.NDArray[np.float32]:
    """Red, green, blue from 0 to 1, and eye_depth(), 0 for none; rows from bottom to top."""
    assert image.rgb is not None
    depth = eye_depth(image)
    frame = np.empty((*depth.shape, 4), np.float32)
    frame[..., :3] = image.rgb[::-1] / np.float32(255)
    frame[..., 3] = np.where(np.isfinite(depth), depth, 0)[::-1]
    return frame


def vtk_array(rows: npt.NDArray[Any]) -> Any:
    contiguous = np.ascontiguousarray(rows)
    return numpy_to_vtk(contiguous, deep=True)  # type: ignore[no-untyped-call,unused-ignore]


def corners_of(volume: Volume) -> npt.NDArray[np.float64]:
    """The corners of the volume's box in world space, (8, 3)."""
    extent = (np.array(volume.shape[::-1]) - 1) * volume.spacing[::-1]
    index = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)])
    corners = np.array(volume.origin[::-1]) + (index * extent) @ np.asarray(volume.direction).T
    return np.asarray(corners, np.float64)


def make_actor(corners: npt.NDArray[np.float64], texture: Any) -> Any:
    """What writes the texture's colours and depths to all pixels of the view."""
    points = vtkPoints()
    points.SetData(vtk_array(corners))
    cells = vtkCellArray()
    for first in (0, 4):
        cells.InsertNextCell(4, [first, first + 1, first + 3, first + 2])
    box = vtkPolyData()
    box.SetPoints(points)
    box.SetPolys(cells)
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(box)
    actor = pyvista.Actor(mapper=mapper)
    actor.ForceOpaqueOn()  # the texture's fourth component is no opacity
    actor.GetProperty().LightingOff()
    actor.GetProperty().SetTexture(TEXTURE, texture)
    shader = actor.GetShaderProperty()
    for place, code in VERTEX.items():
        shader.AddVertexShaderReplacement(f"//VTK::{place}", True, code, False)
    for place, code in FRAGMENT.items():
        shader.AddFragmentShaderReplacement(f"//VTK::{place}", True, code, False)
    return actor
