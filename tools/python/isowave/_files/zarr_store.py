"""Zarr stores by zarr: arrays, OME-Zarr images, and stores that xarray wrote."""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from typing import Any

from isowave._arrays.errors import bad_value
from isowave._arrays.found import Found
from isowave._arrays.ome_zarr import (
    OmeImage,
    image_metadata,
    levels_of,
    ome_image,
    ome_volume,
)
from isowave._arrays.stores import no_data_of_store

from . import netcdf
from .contents import Contents, choose, named_axes, of_array

_MARKERS = ("zarr.json", ".zgroup", ".zarray")


def is_zarr(folder: str) -> bool:
    return any(os.path.exists(os.path.join(folder, name)) for name in _MARKERS)


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is the path of an array, an image, or an image's level."""
    zarr = importlib.import_module("zarr")
    if not is_zarr(path):
        raise ValueError(f"no zarr store: it has none of {', '.join(_MARKERS)}")
    path, dataset = _whole(path, dataset)
    store = zarr.open(path, mode="r")
    if not hasattr(store, "members"):
        if dataset is not None:
            raise bad_value(f"dataset {dataset}", "the store is one array, without a name")
        return _of_zarr(store, "array")
    if dataset is not None and dataset not in store:
        choose({name: 0 for name, _ in sorted(store.members(max_depth=None))}, dataset)
    node = store if dataset is None else store[dataset]
    if hasattr(node, "members"):
        image = ome_image(node)
        if image is not None:
            return _of_ome(image)
    elif dataset is not None:
        folder, _, name = dataset.rpartition("/")
        parent = store[folder] if folder else store
        image = ome_image(parent, name) if _is_level(parent, name) else None
        if image is not None:
            return _of_ome(image)
    return _of_group(path, store, node, dataset, has_spacing)


def _whole(path: str, dataset: str | None) -> tuple[str, str | None]:
    """Returns the outermost store around a path, and the dataset in that: groups say what their
    arrays are."""
    path = os.path.abspath(path)
    parts = [dataset.strip("/")] if dataset else []
    while is_zarr(os.path.dirname(path)):
        path, name = os.path.split(path)
        parts.insert(0, name)
    return path, "/".join(parts) or None


def _is_level(group: Any, name: str) -> bool:
    """Whether a group is an OME-Zarr image with a level of that path."""
    metadata = image_metadata(group, "group")
    return metadata is not None and name in levels_of(metadata)


def _of_group(path: str, store: Any, node: Any, dataset: str | None, has_spacing: bool) -> Contents:
    """An array of a group that is no image."""
    prefix = "" if dataset is None or not hasattr(node, "members") else dataset + "/"
    if hasattr(node, "members"):
        arrays = {
            prefix + name: each.ndim
            for name, each in sorted(node.members(max_depth=None))
            if not hasattr(each, "members")
        }
        dataset = choose(arrays, None)
        node = store[dataset]
    assert dataset is not None
    if _dims(node):  # xarray knows what coordinates say
        return netcdf.of_xarray(path, "zarr", dataset, has_spacing)
    return _of_zarr(node, dataset)


def _dims(array: Any) -> list[str]:
    """Names of an array's axes, as zarr 3 and xarray note them; none: []."""
    found = getattr(array.metadata, "dimension_names", None)
    if found is None:
        found = array.attrs.get("_ARRAY_DIMENSIONS")
    names = [] if found is None else [name or "" for name in found]
    return names if any(names) else []


def _of_zarr(array: Any, what: str) -> Contents:
    names = named_axes(_dims(array) or [""] * array.ndim)
    return of_array(array, names, what, no_data=no_data_of_store(array.fill_value))


def _of_ome(image: OmeImage) -> Contents:
    further = [axis for axis in range(len(image.names)) if axis not in image.spatial]

    def volume(index: Mapping[str, int]) -> Found:
        names = image.names
        return ome_volume(image, [index.get(name, 0) for name in names])

    return Contents(image.path, {image.names[axis]: image.sizes[axis] for axis in further}, volume)
