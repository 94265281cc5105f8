"""nibabel's images. Where they lie follows the rules of our NIfTI reader (core/io), so that an
image gives the same volume in memory as from its file.

nibabel's world is RAS (right, anterior, superior); ours is ITK's LPS. Its arrays are (x, y, z).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .errors import bad_value, short, type_name
from .found import Found
from .grid import (
    Matrix,
    Placement,
    Vector,
    checked_shape,
    columns,
    dot,
    finite_number,
    norm,
    placement_of_affine,
    vector,
)
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
    shape = checked_shape(sizes[:3][::-1], what)
    data = image.dataobj
    surplus = (0,) * (len(sizes) - 3)

    def fetch(begin: int, end: int) -> Any:
        index = (slice(None), slice(None), slice(begin, end), *surplus)
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
    header = image.header
    keys = getattr(header, "keys", None)
    names = set(keys()) if callable(keys) else set()
    if {"sform_code", "qform_code", "pixdim"} <= names:
        return _of_nifti(_current_header(image), what)
    if image.affine is None:
        return Placement()
    rows, origin = _rows_of_affine(image.affine, what)
    return _to_lps(placement_of_affine(rows, origin, what))


def _current_header(image: Any) -> Any:
    """Returns the header that nibabel would write: an affine that was changed since goes first."""
    header = image.header
    affine = image.affine
    if affine is None:
        return header
    affine = np.asarray(affine, dtype=np.float64)
    if np.allclose(affine, header.get_best_affine()):
        return header
    header = header.copy()
    header.set_sform(affine, code="aligned")
    header.set_qform(affine, code="unknown")
    return header


def _rows_of_affine(affine: Any, what: str) -> tuple[Matrix, Vector]:
    rows = np.asarray(affine)
    if rows.shape != (4, 4):
        raise bad_value(what, f"the affine has shape {rows.shape}, need (4, 4)")
    a, b, c = (vector(row[:3], what, "the affine") for row in rows[:3])
    return (a, b, c), vector(rows[:3, 3], what, "the affine")


def _to_lps(placement: Placement, unit: float = 1.0) -> Placement:
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
    )


def _of_nifti(header: Any, what: str) -> Placement:
    """Returns the placement that core/io/nifti_header.cpp reads from such a header."""
    matrix_intent = 1004
    if "intent_code" in set(header.keys()) and int(header["intent_code"]) == matrix_intent:
        raise bad_value(what, "matrices as voxels are not supported")
    flip, *steps = _numbers(header["pixdim"], 4, what, "pixdim")
    if min(steps) < 0:
        raise bad_value(what, f"broken header: pixdim {min(steps):g}: must be positive")
    x, y, z = (step or 1.0 for step in steps)  # 0 is unknown
    spacing = (x, y, z)
    unit = _length_unit(header, what)
    qform, sform = (_code(header[name], what) for name in ("qform_code", "sform_code"))
    if qform == 0 and sform == 0:
        return Placement((x * unit, y * unit, z * unit))
    scanner = 1
    by_qform = _qform(header, spacing, flip, what) if qform > 0 else None
    by_sform = _sform(header, spacing, what) if sform > 0 else None
    if by_sform is not None and (by_qform is None or sform == scanner):
        return _to_lps(by_sform, unit)
    if by_qform is not None:
        return _to_lps(by_qform, unit)
    raise bad_value(
        what,
        "its sform has shear or other spacings than pixdim, and there is no qform: not supported",
    )


def _numbers(values: Any, count: int, what: str, name: str) -> list[float]:
    """Returns the first `count` numbers of a field of the header."""
    return [finite_number(values[i], what, name) for i in range(count)]


def _code(value: Any, what: str) -> int:
    last = 5
    code = int(finite_number(value, what, "a form's code"))
    if not 0 <= code <= last:
        raise bad_value(what, f"broken header: code {code} of a qform or sform")
    return code


def _length_unit(header: Any, what: str) -> float:
    """Returns the millimetres in the unit of lengths."""
    units = int(finite_number(header["xyzt_units"], what, "xyzt_units"))
    millimetres = {0: 1.0, 1: 1e3, 2: 1.0, 3: 1e-3}.get(units & 7)
    if millimetres is None:
        raise bad_value(what, "broken header: unknown unit of lengths in xyzt_units")
    return millimetres


def _qform(header: Any, spacing: Vector, flip: float, what: str) -> Placement:
    """Returns the placement by quaternion, whose first number is left out since its length is 1."""
    b, c, d = (
        finite_number(header[name], what, name) for name in ("quatern_b", "quatern_c", "quatern_d")
    )
    rounding = 1e-5
    squares = b * b + c * c + d * d
    if squares > 1.0 + rounding:
        raise bad_value(what, "broken header: the qform's quaternion is longer than 1")
    a = math.sqrt(max(0.0, 1.0 - squares))
    length = math.sqrt(a * a + squares)
    w, x, y, z = a / length, b / length, c / length, d / length
    sign = -1.0 if flip < 0 else 1.0
    axes = (
        (w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), w * w + y * y - x * x - z * z, 2 * (y * z + w * x)),
        (
            sign * (2 * (x * z + w * y)),
            sign * (2 * (y * z - w * x)),
            sign * (w * w + z * z - x * x - y * y),
        ),
    )
    ox, oy, oz = (
        finite_number(header[name], what, name) for name in ("qoffset_x", "qoffset_y", "qoffset_z")
    )
    return Placement(spacing, (ox, oy, oz), columns(axes))


def _sform(header: Any, spacing: Vector, what: str) -> Placement | None:
    """Returns the placement by affine; None where it has shear or other spacings than given."""
    rows: list[list[float]] = [
        _numbers(header[name], 4, what, "the sform") for name in ("srow_x", "srow_y", "srow_z")
    ]
    spacing_tolerance, spacing_ratio, most_cosine = 1e-3, 1e-2, 1e-4
    axes: list[Vector] = []
    for axis, step in enumerate(spacing):
        column = (rows[0][axis], rows[1][axis], rows[2][axis])
        length = norm(column)
        if not abs(length - step) <= min(spacing_tolerance, spacing_ratio * step):
            return None
        axes.append((column[0] / length, column[1] / length, column[2] / length))
    if any(not abs(dot(axes[i], axes[(i + 1) % 3])) <= most_cosine for i in range(3)):
        return None
    return Placement(
        spacing, (rows[0][3], rows[1][3], rows[2][3]), columns((axes[0], axes[1], axes[2]))
    )
