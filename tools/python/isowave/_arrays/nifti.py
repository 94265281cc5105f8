"""nibabel's images lie where their affine says, in the unit of lengths that their header names.

nibabel's world is RAS (right, anterior, superior), in the unit that a NIfTI header names; ours is
ITK's LPS in millimetres. Its arrays are (x, y, z). From an image's file, our NIfTI reader (core/io)
gives the same volume, by the same choice between sform and qform. Only if the file has neither, it
lies at the origin, while nibabel makes up an affine.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import bad_value, short, type_name
from .found import Found
from .grid import Placement, checked_shape, finite_number, placement_of_affine, vector
from .layers import even_rows

_INFLATED_BYTES = 64 << 20
"""Read at once from a compressed file, which is inflated from its start each time."""
_LEAST_INFLATED_LAYERS = 32


def nibabel_image(image: Any, has_spacing: bool) -> Found:
    """Adapts an image of nibabel: an array in memory, or one that its file gives by slabs."""
    what = type_name(image)
    sizes = tuple(image.shape)
    if len(sizes) > 3 and any(size != 1 for size in sizes[3:]):
        raise bad_value(
            what,
            f"shape {short(sizes)}: need one volume (x, y, z): take it, for example with "
            f"image.slicer[..., {', '.join(['0'] * (len(sizes) - 3))}]",
        )
    return nibabel_volume(image, (0,) * (len(sizes) - 3))


def nibabel_volume(image: Any, further: tuple[int, ...]) -> Found:
    """Returns the volume at an index of the axes after x, y and z."""
    what = type_name(image)
    shape = checked_shape(tuple(image.shape)[:3][::-1], what)
    data = image.dataobj

    def fetch(begin: int, end: int) -> Any:
        index = (slice(None), slice(None), slice(begin, end), *further)
        layers = data[index]
        # A masked array must stay one.
        return (layers if isinstance(layers, np.ndarray) else np.asarray(layers)).T

    is_proxy = bool(getattr(data, "is_proxy", False))
    # A file's scale may make other voxels of those that are stored: only reading them tells.
    stored = fetch(0, 1).dtype if is_proxy else data.dtype
    rows = None
    if is_proxy and str(getattr(data, "file_like", "")).endswith((".gz", ".bz2", ".zst")):
        layers = _INFLATED_BYTES // max(1, shape[1] * shape[2] * stored.itemsize)
        rows = even_rows(max(_LEAST_INFLATED_LAYERS, layers), shape[0])
    return Found(
        what,
        shape,
        stored,
        fetch,
        rows,
        _placement(image, what),
        is_masked=isinstance(data, np.ma.MaskedArray) and bool(np.ma.getmask(data).any()),
    )


def _placement(image: Any, what: str) -> Placement:
    """Returns the placement by the image's affine, in millimetres."""
    if image.affine is None:
        return Placement()
    affine = np.asarray(image.affine)
    if affine.shape != (4, 4):
        raise bad_value(what, f"the affine has shape {affine.shape}, need (4, 4)")
    a, b, c = (vector(row[:3], what, "the affine") for row in affine[:3])
    origin = vector(affine[:3, 3], what, "the affine")
    return _to_lps(placement_of_affine((a, b, c), origin, what), _length_unit(image.header, what))


def _to_lps(placement: Placement, unit: float) -> Placement:
    """Turns RAS in some unit into LPS in millimetres; `+ 0.0` leaves no negative zeros."""
    x, y, z = placement.spacing
    right, anterior, superior = placement.direction
    ox, oy, oz = placement.origin
    return Placement(
        (x * unit, y * unit, z * unit),
        (-ox * unit + 0.0, -oy * unit + 0.0, oz * unit + 0.0),
        (
            (-right[0] + 0.0, -right[1] + 0.0, -right[2] + 0.0),
            (-anterior[0] + 0.0, -anterior[1] + 0.0, -anterior[2] + 0.0),
            (superior[0] + 0.0, superior[1] + 0.0, superior[2] + 0.0),
        ),
        is_anatomical=True,
    )


def _length_unit(header: Any, what: str) -> float:
    """Returns the millimetres in the unit of lengths; 1 if the header names none."""
    keys = getattr(header, "keys", None)
    if not callable(keys) or "xyzt_units" not in set(keys()):
        return 1.0
    units = int(finite_number(header["xyzt_units"], what, "xyzt_units"))
    millimetres = {0: 1.0, 1: 1e3, 2: 1.0, 3: 1e-3}.get(units & 7)
    if millimetres is None:
        raise bad_value(what, "broken header: unknown unit of lengths in xyzt_units")
    return millimetres
