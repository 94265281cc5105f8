"""Scene files."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isowave import _core
from isowave._annotate import Annotations, annotations_from_core
from isowave._camera import Camera, vector
from isowave._clip import ClipPlane
from isowave._color_map import ColorMap
from isowave._compress import OpenArguments
from isowave._compress import open as open_volume
from isowave._handed_on import takes
from isowave._levels import Voxels
from isowave._request import LIGHTS
from isowave._scene import Scene, SceneVolume
from isowave._slice import Slice
from isowave._surface import Surface
from isowave._volume import Volume

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(open_volume, without=("path",))
def open_scene(
    path: str | os.PathLike[str],
    *,
    volume: SceneVolume | None = None,
    field: Voxels | None = None,
    **options: Unpack[OpenArguments],
) -> Scene:
    """Reads a scene file, as Scene.save(), `isowave render --save-scene` and the viewer write it.

    Parameters
    ----------
    path
        The file's name.
    volume
        The volume to draw. None: the one that the file names, opened with open()'s `options`, and
        with the dataset and index that it names unless these are given.
    field
        The second volume, if colours are by one. None: the one that the file names, opened with
        the `options` of compression.

    If the volume is opened here, annotations without a title get the name of its file.

    Raises
    ------
    Error
        The file is no scene: what is wrong, and where, in one line. It names no volume or no field,
        and none is given. A volume cannot be opened.
    """
    fields = _core.read_scene(os.fsdecode(path))
    wants_field = field is None and fields["color_by_field"]
    if wants_field and not fields["field"]:
        raise _core.Error(f"{os.fsdecode(path)}: it names no field: give field=")
    is_drawn = fields["field"] == "volume" or (volume is None and _is_volume(fields, dict(options)))
    if wants_field and not is_drawn:
        field = open_field(fields["field"], dict(options), **part_of_scene(fields, "field_"))
    title = ""
    if volume is None:
        if not fields["volume"]:
            raise _core.Error(f"{os.fsdecode(path)}: it names no volume: give volume=")
        title = Path(fields["volume"]).name
        asked = {name: each for name, each in options.items() if each is not None}
        arguments: dict[str, Any] = {**part_of_scene(fields), **asked}
        volume = open_volume(fields["volume"], **arguments)
    elif options:
        raise TypeError(f"{', '.join(options)}: the volume is open already")
    drawn: Any = volume
    return Scene(
        volume,
        tuple(
            Surface(
                None if "labels" in each else each["isovalue"],
                vector(each["color"]),
                each["opacity"],
                each["clipped"],
                tuple(each.get("labels", ())),
                each["mapped"],
            )
            for each in fields["surfaces"]
        ),
        tuple(
            Slice(vector(each["normal"]), each["offset"], each["opacity"], each["clipped"])
            for each in fields["slices"]
        ),
        tuple(ClipPlane(vector(plane["normal"]), plane["offset"]) for plane in fields["clip"]),
        fields["caps"],
        slice_map_of_scene(fields),
        color_map_of_scene(fields),
        None if fields["transparent"] else vector(fields["background"]),
        None if fields["transparent"] else optional_vector(fields["background_top"]),
        fields["transparent"],
        {name: fields[name] for name in LIGHTS},
        optional_vector(fields["light_direction"]),
        fields["shadow_rays"],
        fields["light_angle"],
        fields["bounce_rays"],
        drawn if wants_field and field is None else field,
        camera_of_scene(fields["camera"]),
        annotations_of_scene(fields["annotations"], title),
    )


_OF_ONE_FILE = ("shape", "dtype", "spacing", "dataset", "index")


def _is_volume(fields: dict[str, Any], options: dict[str, Any]) -> bool:
    """Whether the field's file is the scene's volume; not of labels, as `isowave render`."""
    part = part_of_scene(fields, "field_")
    if part and part != part_of_scene(fields):
        return False
    if fields["color_by_label"] or any(options.get(key) is not None for key in _OF_ONE_FILE):
        return False
    try:
        return os.path.samefile(fields["field"], fields["volume"])
    except OSError:
        return False


def part_of_scene(fields: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """What a scene chooses in its volume's file, or in its field's, as arguments of open()."""
    return {name: fields[prefix + name] for name in ("dataset", "index") if fields[prefix + name]}


def open_field(name: str, options: dict[str, Any], **own: Any) -> Volume:
    """Opens a second volume beside one that is opened with these options.

    own  dataset and index of this one; None: no
    """
    if name.endswith(".zfp"):  # compressed already
        return open_volume(name, **own)
    shared = {key: each for key, each in options.items() if key not in _OF_ONE_FILE}
    return open_volume(name, **shared, **own)


def optional_vector(value: Any) -> Any:
    return None if value is None else vector(value)


def color_map_of_scene(fields: dict[str, Any]) -> ColorMap | None:
    colors = fields["color_table"] or fields["color_map"]
    if not colors:
        return None
    low, high = fields["color_low"], fields["color_high"]
    return ColorMap(
        colors,
        vector(fields["color_axis"]),
        None if low is None else (low, high),
        colors_by(fields),
    )


def colors_by(fields: dict[str, Any]) -> str:
    if not fields["color_by_field"]:
        return "depth" if fields["color_by_depth"] else "axis"
    if fields["color_by_label"]:
        return "labels"
    return "caps" if fields["color_caps_alone"] else "field"


def slice_map_of_scene(fields: dict[str, Any]) -> ColorMap:
    low, high = fields["slice_low"], fields["slice_high"]
    return ColorMap(
        fields["slice_table"] or fields["slice_map"], range=None if low is None else (low, high)
    )


def annotations_of_scene(fields: dict[str, Any] | None, title: str) -> Annotations | None:
    """title: if the scene gives none."""
    if fields is None:
        return None
    found = annotations_from_core(fields)
    return replace(found, title=found.title or title)


def camera_of_scene(fields: dict[str, Any] | None) -> Camera | None:
    if fields is None:
        return None
    return Camera(
        vector(fields["eye"]),
        vector(fields["at"]),
        vector(fields["up"]),
        fields["fovy_degrees"],
        fields["parallel_height"],
    )
