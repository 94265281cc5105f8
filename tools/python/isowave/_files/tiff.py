"""TIFF by tifffile: stacks, OME-TIFF, ImageJ's, and folders with a file for each layer.

A page is read when its layer is needed. OME-XML and ImageJ's metadata give the spacing in their own
unit; resolutions of other TIFF files are those of print, which are ignored.
"""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np

from isowave._arrays.errors import bad_value, short
from isowave._arrays.found import Found
from isowave._arrays.grid import Placement, checked_shape

from .contents import Contents, choose, of_array, unlike
from .order import natural_order

_MICROMETRES = {"nm": 1e-3, "µm": 1.0, "um": 1.0, "mm": 1e3, "cm": 1e4, "m": 1e6}


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is the number of an image, from 0."""
    tifffile, zarr = importlib.import_module("tifffile"), importlib.import_module("zarr")
    tiff = tifffile.TiffFile(path)  # stays open for the layers
    series = {str(i): len(each.axes) for i, each in enumerate(tiff.series)}
    number = int(choose(series, dataset, "image"))
    image = tiff.series[number]
    array = zarr.open(image.aszarr(level=0, chunkmode="page"), mode="r")
    placement = Placement(_spacing(tiff, number))
    return of_array(array, _names(image.axes), f"image {number}", placement=placement)


def _names(axes: str) -> list[str]:
    """tifffile's letters as names. Pages without a meaning (I, Q), or else steps, are layers."""
    names = list(axes.lower())
    if "z" not in names:
        for letter in "iqt":
            if letter in names:
                names[names.index(letter)] = "z"
                break
    return unlike(names)


def _spacing(tiff: Any, number: int) -> tuple[float, float, float]:
    """Returns the spacing (x, y, z) of an image, 1 if its metadata do not say it."""
    if tiff.is_ome:
        return _ome_spacing(tiff.ome_metadata, number)
    if tiff.is_imagej:
        tags = tiff.pages[0].tags
        x, y = (_length(tags.get(name)) for name in ("XResolution", "YResolution"))
        return x, y, abs(float((tiff.imagej_metadata or {}).get("spacing", 1.0))) or 1.0
    return 1.0, 1.0, 1.0


def _length(tag: Any) -> float:
    """Returns the length of a pixel, from pixels per unit of length. 72 are a default of print."""
    pixels, lengths = (1, 1) if tag is None else tag.value
    return lengths / pixels if pixels and lengths and pixels != 72 * lengths else 1.0


def _ome_spacing(xml: str, number: int) -> tuple[float, float, float]:
    """Returns PhysicalSizeX, Y and Z, in the unit of X."""
    images = ElementTree.fromstring(xml).findall("{*}Image/{*}Pixels")
    attributes = images[number].attrib if number < len(images) else {}
    sizes = [float(attributes.get(f"PhysicalSize{axis}", 1.0)) for axis in "XYZ"]
    units = [attributes.get(f"PhysicalSize{axis}Unit", "µm") for axis in "XYZ"]
    if len(set(units)) > 1:
        unknown = [unit for unit in units if unit not in _MICROMETRES]
        if unknown:
            raise bad_value("OME-XML", f"unknown unit of length {short(unknown[0])}: give spacing")
        sizes = [n * _MICROMETRES[unit] / _MICROMETRES[units[0]] for n, unit in zip(sizes, units)]
    return sizes[0], sizes[1], sizes[2]


def layers_in(folder: str) -> list[str]:
    """Returns the TIFF files of a folder, in natural order."""
    names = sorted(os.listdir(folder), key=natural_order)
    return [os.path.join(folder, name) for name in names if re.search(r"(?i)\.tiff?$", name)]


def is_layer(path: str) -> bool:
    """Whether a file has one picture, so that several are the layers of a volume."""
    tifffile = importlib.import_module("tifffile")
    with tifffile.TiffFile(path) as tiff:
        return len(tiff.series) == 1 and tiff.series[0].axes[:2] == "YX"


def read_folder(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. Each file is a layer."""
    return read_layers(layers_in(path), dataset)


def read_layers(files: Sequence[str], dataset: str | None) -> Contents:
    """Each file is a layer, in this order."""
    tifffile = importlib.import_module("tifffile")
    if dataset is not None:
        raise bad_value(f"dataset {dataset}", "layers in TIFF files are one array")
    with tifffile.TiffFile(files[0]) as tiff:
        first = tiff.series[0]
        if len(tiff.series) > 1 or first.axes[:2] != "YX":
            raise bad_value(
                os.path.basename(files[0]),
                f"axes {first.axes.lower()}: each of several files is one layer; open the file "
                "itself, or all by open_series()",
            )
        sizes, dtype = first.shape, first.dtype
        placement = Placement(_spacing(tiff, 0))

    def layer(file: str, key: Any) -> Any:
        found = tifffile.imread(file)
        if found.shape != sizes or found.dtype != dtype:
            raise bad_value(
                os.path.basename(file),
                f"{found.dtype} of shape {found.shape}, the first layer is {dtype} of {sizes}",
            )
        return found[key]

    further = {"s": int(sizes[2])} if len(sizes) == 3 else {}

    def volume(index: Any) -> Found:
        shape = checked_shape((len(files), *sizes[:2]), "layers")
        key = (slice(None), slice(None), *index.values())
        return Found(
            "layers",
            shape,
            dtype,
            lambda begin, end: np.stack([layer(file, key) for file in files[begin:end]]),
            range(len(files)),
            placement,
        )

    return Contents("layers", further, volume)
