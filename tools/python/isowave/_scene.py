"""Scenes: what is drawn of a volume, put together step by step, and as files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from isowave import _core
from isowave._annotate import Annotations, annotations_for_core
from isowave._camera import Camera, camera_for_core, vector
from isowave._checked import Isovalue, number
from isowave._clip import ClipPlane, clip_of
from isowave._color_map import BY_FIELD, ColorMap, color_map_for_core, color_map_of
from isowave._files import Index
from isowave._handed_on import takes
from isowave._image import Image
from isowave._levels import Voxels
from isowave._page import save_page, save_site
from isowave._request import (
    FrameArguments,
    Look,
    camera_of,
    lights_of,
    optional_color,
)
from isowave._renderer import Renderer
from isowave._source_file import SourceFile, text_of_index
from isowave._slice import Slice, slice_map_for_core, slice_map_of, slices_of
from isowave._surface import Color, Surface, surface_for_core, surfaces_of

if TYPE_CHECKING:
    from typing_extensions import Unpack


#: Fields of a Scene that are colours and lights, and arguments of Volume.render().
LOOK = ("field", *Look.__annotations__)
AS_BEFORE: Any = ...  # the default of an argument that leaves a field as it is


class SceneFrame(FrameArguments, total=False):
    """Arguments of Volume.render() beside the isovalue."""

    device: str | int | None
    memory_budget: int | None
    field: Voxels | None


class SceneVolume(Protocol):
    """What scenes need of a Volume."""

    def _isovalue(self, isovalue: Isovalue) -> float:
        ...

    def camera(self, *args: Any, **more: Any) -> Camera:
        ...

    def render(self, *args: Any, **more: Any) -> Image:
        ...


@dataclass(frozen=True)
class Scene:
    """What is drawn of a volume; Volume.scene() makes an empty one, open_scene() reads a file.

        scene = volume.scene().surface(500, "skin", opacity=0.3).surface(1150, "bone")
        image = scene.clip(isowave.ClipPlane((0, 0, -1), -60)).render(size=(1280, 720))
        scene.save("head.json", volume="head.nrrd")  # for `isowave render --scene head.json`

    A scene cannot be changed: each method returns another one.
    """

    volume: SceneVolume
    surfaces: tuple[Surface, ...] = ()
    slices: tuple[Slice, ...] = ()
    planes: tuple[ClipPlane, ...] = ()  #: clipping planes
    caps: bool = True  #: as the argument of Volume.render(), and the next eleven
    slice_map: ColorMap | str = "gray"
    color_map: ColorMap | str | None = None
    background: Color | None = None
    background_top: Color | None = None
    transparent: bool = False
    lights: Mapping[str, float] | None = None
    light: Sequence[float] | None = None
    shadow_rays: int = 0
    light_angle: float = 3.0
    bounce_rays: int = 0
    field: Voxels | None = None
    view: Camera | None = None  #: None: a view that the surfaces fill
    annotations: Annotations | None = None  #: what Image.annotated() draws over pictures

    def surface(
        self,
        isovalue: Isovalue,
        color: Color | None = None,
        opacity: float = 1.0,
        *,
        clipped: bool = True,
        mapped: bool = True,
    ) -> Scene:
        """The scene with one more surface, up to 8; arguments as Surface.

        isovalue: "auto" is the first of Volume.suggested_isovalues().
        """
        more = Surface(self.volume._isovalue(isovalue), color, opacity, clipped, mapped=mapped)
        return replace(self, surfaces=(*self.surfaces, more))

    def labels(
        self,
        labels: int | Sequence[int],
        color: Color | None = None,
        opacity: float = 1.0,
        *,
        clipped: bool = True,
        mapped: bool = True,
    ) -> Scene:
        """The scene with one more surface, that of a label or of several; arguments as Surface."""
        more = Surface(None, color, opacity, clipped, labels, mapped)
        return replace(self, surfaces=(*self.surfaces, more))

    def slice(
        self,
        normal: str | Sequence[float],
        offset: float = 0.0,
        opacity: float = 1.0,
        *,
        clipped: bool = True,
    ) -> Scene:
        """The scene with one more slice; arguments as Slice, whose colours are slice_map's."""
        return replace(self, slices=(*self.slices, Slice(normal, offset, opacity, clipped)))

    def clip(self, planes: ClipPlane | Sequence[ClipPlane], *, caps: bool = True) -> Scene:
        """The scene with one more clipping plane, or several such as those of clip_box()."""
        more = (planes,) if isinstance(planes, ClipPlane) else planes
        return replace(self, planes=(*self.planes, *more), caps=caps)

    def seen_from(self, camera: Camera | None) -> Scene:
        """The scene with another view; None: one that the volume's box fills."""
        return replace(self, view=camera)

    def look(
        self,
        *,
        color_map: ColorMap | str | None = AS_BEFORE,
        slice_map: ColorMap | str = AS_BEFORE,
        field: Voxels | None = AS_BEFORE,
        background: Color | None = AS_BEFORE,
        background_top: Color | None = AS_BEFORE,
        transparent: bool = AS_BEFORE,
        lights: Mapping[str, float] | None = AS_BEFORE,
        light: Sequence[float] | None = AS_BEFORE,
        shadow_rays: int = AS_BEFORE,
        light_angle: float = AS_BEFORE,
        bounce_rays: int = AS_BEFORE,
    ) -> Scene:
        """The scene with other colours and lights; those that are not given stay."""
        given = {name: each for name, each in locals().items() if each is not AS_BEFORE}
        del given["self"]
        return replace(self, **given)

    def annotate(
        self, what: str | Sequence[str] = "all", *, units: str = "", title: str = ""
    ) -> Scene:
        """The scene with other annotations; arguments as Image.annotated(). what=(): none.

        Image.annotated() draws them over the scene's picture; rgb and save() are without them.
        """
        annotations = Annotations(what, units, title)
        return replace(self, annotations=annotations if annotations.what else None)

    def camera(
        self, *, size: tuple[int, int] = (1280, 720), device: str | int | None = None
    ) -> Camera:
        """A view that the surfaces fill; arguments as Volume.camera()."""
        return self.volume.camera(surfaces=self.surfaces, size=size, device=device)

    def save_html(self, path: str | os.PathLike[str], *, title: str = "") -> None:
        """Writes a page: one HTML file that shows the scene in any browser, without a server.

        The page holds the compressed volume and all that draws it, with the same bits. People can
        turn the scene and change it. Without JavaScript, it shows a picture with the scene's
        annotations.

        Parameters
        ----------
        path
            The file's name, which ends in .html.
        title
            The page's title.

        Raises
        ------
        Error
            No surface; what a page does not show: tables of colours, surfaces with clipped or
            mapped False, more than eight clipping planes; a volume of more than 350 MiB; a package
            without the engine for browsers; a file that cannot be written.
        """
        save_page(self.volume, scene_fields(self), path, title, self.field)

    def save_site(self, folder: str | os.PathLike[str], *, title: str = "") -> None:
        """Writes a folder for a server of static files: index.html and, beside it, the volume.

        The page is that of save_html(), but its volume may have any size: the page reads the parts
        that rays come to, by HTTP range requests, which the server must answer. First pictures are
        of coarser levels of detail.

        Parameters
        ----------
        folder
            The folder, which is made if it is missing.
        title
            The page's title.

        Raises
        ------
        Error
            As save_html(), but for the size; colours by a second volume.
        """
        save_site(self.volume, scene_fields(self), folder, title)

    def __repr__(self) -> str:
        shown = [each.text for each in self.surfaces]
        for name, things in (("slice", self.slices), ("clipping plane", self.planes)):
            if things:
                shown.append(f"{len(things)} {name}{'s' if len(things) > 1 else ''}")
        return f"<isowave.Scene {'; '.join(shown) or 'empty'}>"

    @takes(Renderer.render, without=("isovalue",), device=None, memory_budget=None, field=None)
    def render(self, **more: Unpack[SceneFrame]) -> Image:
        """Draws the scene; arguments as Volume.render(), which replace those of the scene.

        Image.annotated() draws the annotations.
        """
        image = self.volume.render(**self._arguments() | dict(more))
        image.annotations = self.annotations
        return image

    def _arguments(self) -> dict[str, Any]:
        """Arguments of Volume.render()."""
        arguments: dict[str, Any] = {
            "slices": self.slices,
            "clip": self.planes,
            "caps": self.caps,
            "camera": self.view,
            **{name: getattr(self, name) for name in LOOK},
        }
        first = self.surfaces[0] if len(self.surfaces) == 1 else None
        if (
            first is not None
            and first.opacity == 1
            and first.clipped
            and first.mapped
            and first.isovalue is not None
        ):
            # One opaque surface is drawn with whatever Renderer.render() offers.
            arguments["isovalue"] = first.isovalue
            color_map = color_map_of(self.color_map)
            is_whole = color_map is not None and color_map.by not in BY_FIELD
            arguments["color"] = None if is_whole else first.color
        else:
            arguments["surfaces"] = self.surfaces
        return arguments

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        volume: str | os.PathLike[str] | None = None,
        dataset: str | None = None,
        index: Index | None = None,
        field: str | os.PathLike[str] | None = None,
        field_dataset: str | None = None,
        field_index: Index | None = None,
    ) -> None:
        """Writes a scene file, JSON, for open_scene(), `isowave render --scene` and C++.

        Parameters
        ----------
        path
            The file's name, which ends in .json.
        volume
            The name of the volume's file, which is then opened with the scene. None: the file, the
            dataset and the index that the volume was opened from, if it was.
        dataset, index
            As open() has them.
        field, field_dataset, field_index
            The same of the field's file. "volume": the drawn volume; None: that if the field is
            the drawn volume.

        Raises
        ------
        Error
            A scene that cannot be drawn; a file that cannot be written.
        """
        fields = scene_fields(self)
        if volume is not None or dataset is not None or index is not None:
            fields["volume"] = None if volume is None else os.fsdecode(volume)
            fields["dataset"], fields["index"] = dataset, text_of_index(index)
        if field is not None or field_dataset is not None or field_index is not None:
            fields["field"] = fields["field"] if field is None else os.fsdecode(field)
            fields["field_dataset"] = field_dataset
            fields["field_index"] = text_of_index(field_index)
        _core.write_scene(fields, os.fsdecode(path))


def scene_fields(scene: Scene) -> dict[str, Any]:
    """The scene as fields of isowave::Scene. Raises TypeError, ValueError."""
    color_map = color_map_of(scene.color_map)
    field: Any = scene.field
    shows_volume = field is scene.volume or (
        field is None and color_map is not None and color_map.by in ("caps", "labels")
    )
    has_bar = bool(scene.slices) or (color_map is not None and color_map.by != "labels")
    of_field = {"field": "volume"} if shows_volume else source_fields(field, "field")
    return {
        **source_fields(scene.volume, "volume"),
        **of_field,
        "camera": None if scene.view is None else camera_for_core(camera_of(scene.view)),
        "surfaces": [surface_for_core(each) for each in surfaces_of(scene.surfaces)],
        "slices": [vars(each) for each in slices_of(scene.slices)],
        "clip": [vars(plane) for plane in clip_of(scene.planes)],
        "caps": scene.caps,
        "background": optional_color(scene.background),
        "background_top": optional_color(scene.background_top),
        "transparent": scene.transparent,
        **color_map_for_core(color_map),
        **slice_map_for_core(slice_map_of(scene.slice_map)),
        **lights_of(scene.lights),
        "light_direction": None if scene.light is None else vector(scene.light),
        "shadow_rays": scene.shadow_rays,
        "light_angle": scene.light_angle,
        "bounce_rays": scene.bounce_rays,
        "annotations": None
        if scene.annotations is None
        else annotations_for_core(scene.annotations, has_bar),
    }


def source_fields(volume: object, name: str) -> dict[str, Any]:
    """Where a volume came from, as fields of isowave::Scene. name: volume, field"""
    source = getattr(volume, "source", None)
    if not isinstance(source, SourceFile):
        return {name: None}
    prefix = "" if name == "volume" else f"{name}_"
    return {name: source.path, f"{prefix}dataset": source.dataset, f"{prefix}index": source.index}
