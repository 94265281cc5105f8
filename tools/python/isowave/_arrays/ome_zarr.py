"""OME-Zarr images: which of their axes are z, y and x, where they lie, their levels."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from .errors import bad_value, short
from .found import Found, named
from .grid import checked_shape, finite_numbers, of_steps
from .stores import group, no_data_of_store, rows_of_zarr


@dataclass(frozen=True)
class OmeImage:
    """A level of an OME-Zarr image.

    what         names it in messages
    path         of its array in the group
    array        a zarr.Array
    names        of its axes
    sizes        entries along each axis
    spatial      which of the axes are z, y and x
    scale        world units between entries of each axis
    translation  world position of the first entry of each axis
    """

    what: str
    path: str
    array: Any
    names: Sequence[str]
    sizes: Sequence[int]
    spatial: tuple[int, int, int]
    scale: Sequence[float]
    translation: Sequence[float]


def zarr_group(obj: Any, has_spacing: bool) -> Found:
    """Adapts the finest level of an OME-Zarr image, metadata 0.4 or 0.5.

    Scale and translation of the spatial axes give spacing and origin; a negative scale gives a
    direction of -1, so that every voxel stays where the metadata says. Further axes (t, c) must
    have one entry.

    Raises ArrayValueError for metadata that is not as the format says.
    """
    image = ome_image(obj)
    if image is None:
        return group(obj, has_spacing)
    for axis, size in enumerate(image.sizes):
        if axis in image.spatial or size == 1:
            continue
        index = ", ".join(":" if i in image.spatial else "0" for i in range(len(image.names)))
        steps = ", ".join(f"{image.scale[i]:g}" for i in image.spatial)
        raise bad_value(
            image.what,
            f"axis {short(image.names[axis])} has {size} entries: take one of them, for example "
            f"dask.array.from_zarr(group[{short(image.path)}])[{index}], with spacing=({steps})",
        )
    return ome_volume(image, [0] * len(image.sizes))


def ome_image(obj: Any, level: str | None = None) -> OmeImage | None:
    """Returns the level of a zarr.Group's image whose dataset has the path `level`.

    level=None: the first, which is the finest. Returns None if the group is no image. Raises
    ArrayValueError for metadata that is not as the format says, and if there is no such level.
    """
    what = f"OME-Zarr {named(obj)}"
    image = image_metadata(obj, what)
    if image is None:
        return None
    dataset = _entry(image.get("datasets"), "datasets", what)
    if level is not None:
        levels = levels_of(image)
        if level not in levels:
            raise bad_value(what, f"no level {short(level)}: it has {', '.join(levels)}")
        dataset = levels[level]
    path = dataset.get("path")
    if not isinstance(path, str) or not path:
        raise bad_value(what, f"the path of its first dataset is {short(path)}, need text")
    names, spatial = _axes(image.get("axes"), what)
    scale, translation = [1.0] * len(names), [0.0] * len(names)
    for transforms in (
        dataset.get("coordinateTransformations"),
        image.get("coordinateTransformations"),
    ):
        _apply(transforms, scale, translation, what)

    try:
        array = obj[path]
        sizes = tuple(operator.index(size) for size in islice(iter(array.shape), 33))
    except Exception:
        raise bad_value(what, f"its dataset {short(path)} is missing or no array") from None
    if len(sizes) != len(names):
        raise bad_value(
            what, f"its dataset {short(path)} has {len(sizes)} axes, its metadata {len(names)}"
        )
    return OmeImage(what, path, array, names, sizes, spatial, scale, translation)


def image_metadata(obj: Any, what: str) -> Mapping[Any, Any] | None:
    """Returns the first of a zarr.Group's multiscales, None if it has none."""
    attributes = dict(obj.attrs)
    nested = attributes.get("ome")
    multiscales = nested.get("multiscales") if isinstance(nested, Mapping) else None
    if multiscales is None:
        multiscales = attributes.get("multiscales")
    return None if multiscales is None else _entry(multiscales, "multiscales", what)


def levels_of(image: Mapping[Any, Any]) -> dict[str, Mapping[Any, Any]]:
    """Returns the datasets of an image's metadata by their paths."""
    datasets = image.get("datasets")
    return {
        each["path"]: each
        for each in (datasets if isinstance(datasets, (list, tuple)) else [])
        if isinstance(each, Mapping) and isinstance(each.get("path"), str)
    }


def ome_volume(image: OmeImage, index: Sequence[int]) -> Found:
    """Returns the volume at an index of the further axes; entries of z, y and x are ignored."""
    array, scale, translation = image.array, image.scale, image.translation
    z, y, x = image.spatial
    shape = checked_shape([image.sizes[i] for i in image.spatial], image.what)

    def fetch(begin: int, end: int) -> Any:
        key: list[Any] = list(index)
        key[z], key[y], key[x] = slice(begin, end), slice(None), slice(None)
        return array[tuple(key)]

    placement = of_steps(
        (scale[x], scale[y], scale[z]), (translation[x], translation[y], translation[z])
    )
    return Found(
        image.what,
        shape,
        array.dtype,
        fetch,
        rows_of_zarr(array, z, shape[0], image.what),
        placement,
        no_data=no_data_of_store(getattr(array, "fill_value", None)),
    )


def _entry(entries: Any, name: str, what: str) -> Mapping[Any, Any]:
    """Returns the first of a list of objects of metadata."""
    if not isinstance(entries, (list, tuple)) or not entries or not isinstance(entries[0], Mapping):
        raise bad_value(what, f"{name} is {short(entries)}: need a list of objects")
    return entries[0]


def _axes(axes: Any, what: str) -> tuple[list[str], tuple[int, int, int]]:
    """Returns the axes' names, and which of them are z, y and x."""
    if not isinstance(axes, (list, tuple)) or not 1 <= len(axes) <= 32:
        raise bad_value(what, f"axes is {short(axes)}: need a list of axes (OME-Zarr 0.4 or later)")
    names: list[str] = []
    spatial: list[int] = []
    for i, axis in enumerate(axes):
        name = axis.get("name") if isinstance(axis, Mapping) else None
        if not isinstance(name, str):
            raise bad_value(what, f"an axis is {short(axis)}: need a name (OME-Zarr 0.4 or later)")
        names.append(name)
        if axis.get("type", "space" if name in ("z", "y", "x") else None) == "space":
            spatial.append(i)
    if len(spatial) != 3:
        raise bad_value(what, f"axes {short(names)}: {len(spatial)} of them are spatial, need 3")
    order = [names[i] for i in spatial]
    if sorted(order) == ["x", "y", "z"] and order != ["z", "y", "x"]:
        raise bad_value(what, f"axes {short(names)}: need the order z, y, x")
    z, y, x = spatial
    return names, (z, y, x)


def _apply(transforms: Any, scale: list[float], translation: list[float], what: str) -> None:
    """Lets coordinateTransformations follow what scale and translation already do."""
    if transforms is None:
        return
    name = "coordinateTransformations"
    if not isinstance(transforms, (list, tuple)):
        raise bad_value(what, f"{name} is {short(transforms)}: need a list")
    for transform in transforms:
        kind = transform.get("type") if isinstance(transform, Mapping) else None
        if kind == "identity":
            continue
        if kind not in ("scale", "translation"):
            raise bad_value(what, f"{name} has {short(transform)}: need a scale or translation")
        values = finite_numbers(transform.get(kind), len(scale), what, f"{name}' {kind}")
        for axis, value in enumerate(values):
            if kind == "translation":
                translation[axis] += value
            else:
                scale[axis] *= value
                translation[axis] *= value
