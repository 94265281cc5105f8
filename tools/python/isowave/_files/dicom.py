"""DICOM by pydicom: a folder of images, or a file of several frames.

Layers are sorted by their position along the normal of the image, and every value is rescaled, as
the files say. Their world is LPS in millimetres, as ours. Images at the same positions are steps
(axis t), in the order of their numbers.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isowave._arrays.errors import bad_value
from isowave._arrays.found import Found
from isowave._arrays.grid import Placement, checked_shape, placement_of_affine

from .contents import Contents
from .order import natural_order

_TAGS = [
    *("SeriesInstanceUID", "SeriesNumber", "SeriesDescription", "InstanceNumber"),
    *("AcquisitionNumber", "TemporalPositionIdentifier", "NumberOfFrames", "Rows", "Columns"),
    *("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SliceThickness"),
    *("SpacingBetweenSlices", "RescaleSlope", "RescaleIntercept", "ModalityLUTSequence"),
    *("SamplesPerPixel", "BitsAllocated", "PixelRepresentation"),
    *("SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"),
]
_MOST_UNEVEN = 0.1
"""How far, in steps, a layer may be from even ones: positions come rounded."""
_MOST_TURNED = 1e-3
"""How far the directions of two images may differ."""
_SAME_PLACE = 1e-3
"""Images that are nearer than this [mm] lie at the same position."""


@dataclass(frozen=True)
class _Layer:
    """An image: a file, or a frame of one.

    name      of the file, for messages
    frame     number of the frame; None: the file has one image
    order     sorts images that lie at the same position
    position  of the first voxel (x, y, z) [mm]; None: the file does not say it
    along     directions of rows and of columns (x, y, z, x, y, z)
    spacing   between columns, between rows, and to the next layer if there are no positions [mm]
    form      rows, columns, bits, signedness: all layers have the same
    rescale   slope and intercept
    """

    path: str
    frame: int | None
    order: tuple[float, ...]
    position: tuple[float, ...] | None
    along: tuple[float, ...]
    spacing: tuple[float, float, float]
    form: tuple[int, int, int, int]
    rescale: tuple[float, float]


def is_dicom(path: str) -> bool:
    """Whether a file begins as DICOM's files do."""
    try:
        with open(path, "rb") as file:
            return file.read(132)[128:] == b"DICM"
    except OSError:
        return False


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is a series: its UID, number or description."""
    pydicom = importlib.import_module("pydicom")
    is_folder = os.path.isdir(path)
    files = files_in(path) if is_folder else [path]
    headers = []
    for file in files:
        try:
            header = pydicom.dcmread(file, stop_before_pixels=True, specific_tags=_TAGS)
        except pydicom.errors.InvalidDicomError:
            if not is_folder:
                raise ValueError("no DICOM file") from None
            continue
        if "Rows" in header:
            headers.append((file, header))
    if not headers:
        raise ValueError("no images of DICOM, no TIFF files and no zarr store are in this folder")
    layers = [
        layer for file, header in _series(headers, dataset) for layer in _layers_of(file, header)
    ]
    if len(layers) == 1:
        raise bad_value(os.path.basename(layers[0].path), "one image: give the folder of all")
    return _contents(_sorted(layers), has_spacing)


def files_in(folder: str) -> list[str]:
    names = sorted(os.listdir(folder), key=natural_order)
    return [file for name in names if os.path.isfile(file := os.path.join(folder, name))]


def _series(headers: list[tuple[str, Any]], dataset: str | None) -> list[tuple[str, Any]]:
    """Returns the headers of the series that is asked for, or of the only one."""
    by_uid: dict[str, list[tuple[str, Any]]] = {}
    for file, header in headers:
        by_uid.setdefault(str(header.get("SeriesInstanceUID", "")), []).append((file, header))
    if dataset is None and len(by_uid) == 1:
        return headers
    named = {uid: each[0][1] for uid, each in by_uid.items()}
    fitting = [
        uid
        for uid, header in named.items()
        if dataset is None
        or dataset
        in (uid, str(header.get("SeriesNumber")), str(header.get("SeriesDescription", "")))
    ]
    if len(fitting) == 1:
        return by_uid[fitting[0]]
    listed = ", ".join(
        f"{header.get('SeriesNumber', '')} ({header.get('SeriesDescription') or uid}, "
        f"{len(by_uid[uid])} images)"
        for uid, header in named.items()
        if not fitting or uid in fitting
    )
    what = f"{len(fitting)} series" if fitting else f"no series {dataset}"
    raise bad_value(what, f"choose one by dataset, its number: {listed}")


def _layers_of(file: str, header: Any) -> list[_Layer]:
    name = os.path.basename(file)
    if int(header.get("SamplesPerPixel", 1)) != 1:
        raise bad_value(name, "an image in colour, need one value per voxel")
    frames = int(header.get("NumberOfFrames") or 1)
    if frames == 1 and "PerFrameFunctionalGroupsSequence" not in header:
        return [_layer(file, None, header, [header])]
    shared = list(header.get("SharedFunctionalGroupsSequence") or [])
    own = header.get("PerFrameFunctionalGroupsSequence") or [None] * frames
    if len(own) != frames:
        raise bad_value(name, f"{frames} frames, but functional groups of {len(own)}")
    found = []
    for frame, groups in enumerate(own):
        parts = [
            sequence.value[0]
            for group in ([groups] if groups is not None else []) + shared
            for sequence in group
            if sequence.VR == "SQ" and sequence.value
        ]
        found.append(_layer(file, frame, header, [*parts, header]))
    return found


def _layer(file: str, frame: int | None, header: Any, parts: Sequence[Any]) -> _Layer:
    """parts: where an attribute may stand, the most special first."""

    def numbers(keyword: str, count: int) -> tuple[float, ...] | None:
        for part in parts:
            value = part.get(keyword)
            if value is None or value == "":
                continue
            is_list = isinstance(value, Sequence) and not isinstance(value, str)
            values = tuple(float(v) for v in (value if is_list else [value]))
            if len(values) != count or not all(map(math.isfinite, values)):
                raise bad_value(os.path.basename(file), f"{keyword} is {value}: need {count}")
            return values
        return None

    if "PixelRepresentation" not in header or "BitsAllocated" not in header:
        raise bad_value(os.path.basename(file), "its voxels are no integers: not supported")
    if "ModalityLUTSequence" in header:
        raise bad_value(os.path.basename(file), "values by a table (Modality LUT): not supported")
    y, x = numbers("PixelSpacing", 2) or (1.0, 1.0)
    (z,) = numbers("SpacingBetweenSlices", 1) or numbers("SliceThickness", 1) or (1.0,)
    (slope,) = numbers("RescaleSlope", 1) or (1.0,)
    (intercept,) = numbers("RescaleIntercept", 1) or (0.0,)
    order = [numbers(keyword, 1) or (0.0,) for keyword in (
        *("TemporalPositionIdentifier", "TemporalPositionIndex", "AcquisitionNumber"),
        "InstanceNumber",
    )]  # fmt: skip
    return _Layer(
        file,
        frame,
        (*(each[0] for each in order), float(frame or 0)),
        numbers("ImagePositionPatient", 3),
        numbers("ImageOrientationPatient", 6) or (1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
        (x, y, z),
        (
            *(int(header.Rows), int(header.Columns)),
            *(int(header.BitsAllocated), int(header.PixelRepresentation)),
        ),
        (slope, intercept),
    )


def _sorted(layers: list[_Layer]) -> list[list[_Layer]]:
    """Returns the images at each position, by position. Raises if images do not fit together."""
    first = layers[0]
    for layer in layers:
        name, other = os.path.basename(layer.path), os.path.basename(first.path)
        if layer.form != first.form or layer.spacing[:2] != first.spacing[:2]:
            raise bad_value(name, f"size, type or spacing of pixels are not those of {other}")
        if max(abs(a - b) for a, b in zip(layer.along, first.along)) > _MOST_TURNED:
            raise bad_value(name, f"another orientation than {other}: give one of the series")
    if any(layer.position is None for layer in layers):
        return [[layer] for layer in sorted(layers, key=lambda layer: layer.order)]
    normal = np.cross(first.along[:3], first.along[3:])

    def depth(layer: _Layer) -> float:
        return float(np.dot(normal, np.array(layer.position)))

    places: list[list[_Layer]] = []
    for layer in sorted(layers, key=depth):
        if places and depth(layer) - depth(places[-1][0]) < _SAME_PLACE:
            places[-1].append(layer)
        else:
            places.append([layer])
    if len({len(place) for place in places}) > 1:
        least, most = (end(len(place) for place in places) for end in (min, max))
        raise bad_value("images", f"{least} to {most} at one position: need the same number")
    return [sorted(place, key=lambda layer: layer.order) for place in places]


def _contents(places: list[list[_Layer]], has_spacing: bool) -> Contents:
    layers = [layer for place in places for layer in place]
    rows, columns, bits, is_signed = layers[0].form
    shape = checked_shape((len(places), rows, columns), "images")
    stored = _type_of(bits, bool(is_signed), layers)

    def volume(index: Mapping[str, int]) -> Found:
        def fetch(begin: int, end: int) -> Any:
            return np.stack([_pixels(place[index["t"]], stored) for place in places[begin:end]])

        placement = _placement([place[index["t"]] for place in places], has_spacing)
        return Found("images", shape, stored, fetch, range(shape[0]), placement)

    return Contents("images", {"t": len(places[0])}, volume)


def _type_of(bits: int, is_signed: bool, layers: Sequence[_Layer]) -> np.dtype[Any]:
    """Returns the least type of integers that holds all rescaled values, or else float64."""
    if bits not in (8, 16, 32):
        if bits in (1, 64):
            raise bad_value("images", f"voxels of {bits} bits are not supported")
        raise bad_value("images", f"BitsAllocated is {bits}: need 8, 16 or 32")
    limits = np.iinfo(f"{'i' if is_signed else 'u'}{bits // 8}")
    ends = [slope * end + at for slope, at in {layer.rescale for layer in layers}
            for end in (int(limits.min), int(limits.max))]  # fmt: skip
    if all(number.is_integer() for layer in layers for number in layer.rescale):
        for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32"):
            if np.iinfo(name).min <= min(ends) and max(ends) <= np.iinfo(name).max:
                return np.dtype(name)
    return np.dtype(np.float64)


def _pixels(layer: _Layer, stored: np.dtype[Any]) -> Any:
    pixels = importlib.import_module("pydicom.pixels").pixel_array(layer.path, index=layer.frame)
    if pixels.shape != layer.form[:2]:
        raise bad_value(os.path.basename(layer.path), f"pixels of shape {pixels.shape}")
    slope, intercept = layer.rescale
    if stored.kind == "f":
        return pixels.astype(stored) * slope + intercept
    return (pixels.astype(np.int64) * int(slope) + int(intercept)).astype(stored)


def _placement(layers: Sequence[_Layer], has_spacing: bool) -> Placement:
    first = layers[0]
    x, y, z = first.spacing
    normal = np.cross(first.along[:3], first.along[3:])
    start, step = (0.0, 0.0, 0.0), normal * z
    if first.position is not None:
        positions = np.array([layer.position for layer in layers])
        step = (positions[-1] - positions[0]) / (len(layers) - 1)
        even = positions[0] + step * np.arange(len(layers))[:, None]
        off = np.linalg.norm(positions - even, axis=1)
        if not has_spacing and off.max() > _MOST_UNEVEN * np.linalg.norm(step):
            gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
            raise bad_value(
                "images",
                f"{gaps.min():g} to {gaps.max():g} mm apart, not evenly: one may be missing; "
                "give spacing to draw them as they are",
            )
        start = (float(positions[0][0]), float(positions[0][1]), float(positions[0][2]))
    matrix = np.column_stack([np.array(first.along[:3]) * x, np.array(first.along[3:]) * y, step])
    rows: Any = tuple(tuple(map(float, row)) for row in matrix)
    placement = placement_of_affine(rows, start, "images")
    return replace(placement, is_anatomical=first.position is not None)
