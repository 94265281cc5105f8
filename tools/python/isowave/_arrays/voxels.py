"""How the voxels of an array become one of the types that isowave reads, exactly or not at all.

| stored | read as |
|---|---|
| uint8 int8 uint16 int16 uint32 int32 float32 float64, any byte order | the same, native |
| uint64, int64 | the same; a value that float64 does not hold is refused with its position |
| bool | uint8, 0 and 1 |
| float16 | float32 |
| an integer of up to 16 bits, with masked voxels | float32, NaN for masked voxels |
| a longer integer, with masked voxels | float64, NaN for masked voxels |

The type of what is read follows from the stored type, from masks in memory, and from whether a lazy
array says that its chunks are masked, never from the values: a lazy array is not read to find it,
and each time step of a series has the same one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import bad_type, bad_value, short
from .grid import finite_number

_READ_AS: dict[str, str] = {
    "u1": "u1",
    "i1": "i1",
    "u2": "u2",
    "i2": "i2",
    "u4": "u4",
    "i4": "i4",
    "f4": "f4",
    "f8": "f8",
    "b1": "u1",
    "f2": "f4",
    "i8": "i8",
    "u8": "u8",
}
VOXEL_TYPES = "uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32 or float64"
_EXACT = 1 << 53
"""Every whole number up to this magnitude is a float64."""


def read_type(stored: Any, what: str) -> np.dtype[Any]:
    """Returns the type, in native byte order, as which voxels of the stored type are read.

    Raises ArrayTypeError for every type that the table above has not.
    """
    try:
        dtype = np.dtype(stored)
    except Exception:
        raise bad_type(what, f"{short(stored)} is not a type of voxels") from None
    code = _READ_AS.get(f"{dtype.kind}{dtype.itemsize}")
    if code is not None and dtype.subdtype is None:
        return np.dtype(code)
    help_text = f"convert them to {VOXEL_TYPES}"
    if dtype.names is not None:
        help_text = f"take one field of them, for example array['{dtype.names[0]}']"
    elif dtype.kind == "c":
        help_text = "take abs(array), array.real or array.imag"
    elif dtype.kind == "f" or dtype.name == "bfloat16":
        help_text = "convert them, for example with array.astype('float32')"
    raise bad_type(what, f"voxels of type {dtype} are not supported: {help_text}")


def type_with_nan(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Returns a type of float that holds all values of what read_type() returns, and NaN."""
    if dtype.kind == "f":
        return dtype
    return np.dtype("f4" if dtype.itemsize < 4 else "f8")


def no_data_of(value: Any) -> float | None:
    """Returns the number that metadata gives for voxels without data.

    None if it gives none, and for NaN: NaN voxels have no data in any case.
    """
    try:
        (number,) = np.asarray(value).ravel().tolist()
        number = math.nan if isinstance(number, (bool, str, bytes)) else float(number)
    except Exception:
        return None
    return None if math.isnan(number) else number


def checked_fill(fill_value: Any, dtype: np.dtype[Any], what: str) -> Any:
    """Returns fill_value as a number of dtype. NaN is one if dtype is a float.

    Raises ArrayValueError if dtype does not hold it.
    """
    if (
        isinstance(fill_value, (float, np.floating))
        and dtype.kind == "f"
        and fill_value != fill_value
    ):
        return dtype.type(np.nan)
    number = finite_number(fill_value, what, "fill_value")
    limits = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
    is_held = float(limits.min) <= number <= float(limits.max)
    if not is_held or (dtype.kind != "f" and number != int(number)):
        raise bad_value(what, f"fill_value {short(fill_value)} is not a value of {dtype}")
    return dtype.type(number if dtype.kind == "f" else int(number))


def to_voxels(
    block: Any, dtype: np.dtype[Any], fill_value: Any, z_begin: int, what: str
) -> NDArray[Any]:
    """Returns layers as a C-contiguous array of dtype; a view of them if they are that already.

    block       layers of the store, (z, y, x); a masked array's masked voxels become fill_value
    dtype       read_type() of the stored type
    fill_value  of dtype, as checked_fill() returns it; None: masked voxels are refused
    z_begin     the block's first layer in the volume, for messages

    Raises ArrayValueError for masked voxels without a fill_value, and for whole numbers of 64
    bits that float64 does not hold.
    """
    mask = None
    if isinstance(block, np.ma.MaskedArray):
        mask = np.ma.getmask(block)
        block = np.ma.getdata(block)
        if mask is np.ma.nomask or not mask.any():
            mask = None
        elif fill_value is None:
            raise masked_without_fill(what)
    voxels: NDArray[Any] = np.asarray(block)
    if voxels.dtype.kind in "ui" and voxels.dtype.itemsize == 8:
        _check_exact(voxels, mask, z_begin, what)
    with np.errstate(invalid="ignore"):  # a signalling NaN of float16 becomes a quiet one
        out = np.ascontiguousarray(voxels, dtype=dtype)
    if mask is not None:
        if out is voxels or np.may_share_memory(out, voxels):
            out = out.copy()
        out[mask] = fill_value
    return out


def masked_without_fill(what: str) -> Exception:
    """Returns the error of masked voxels for which the caller gave no value."""
    return bad_value(
        what,
        "some voxels are masked, which this lazy array of whole numbers does not say: pass "
        "fill_value=, the value that they shall have, or convert it to float32 or float64",
    )


def _check_exact(voxels: NDArray[Any], mask: Any, z_begin: int, what: str) -> None:
    """Raises ArrayValueError at the first whole number that float64 does not hold."""
    if mask is not None:
        voxels = np.where(mask, voxels.dtype.type(0), voxels)
    if voxels.size == 0 or (int(voxels.min()) >= -_EXACT and int(voxels.max()) <= _EXACT):
        return
    native = voxels.astype(voxels.dtype.newbyteorder("="))
    magnitude = native.view(np.uint64)
    if native.dtype.kind == "i":
        # Two's complement: the negative of the smallest number is its magnitude, too.
        magnitude = np.where(native < 0, ~magnitude + np.uint64(1), magnitude)
    # A float64 has 53 bits from its first to its last one.
    last_bit = np.maximum(magnitude & (~magnitude + np.uint64(1)), np.uint64(1))
    is_inexact = magnitude // last_bit >= np.uint64(_EXACT)
    if not is_inexact.any():
        return
    z, y, x = np.unravel_index(int(np.argmax(is_inexact)), native.shape)
    raise bad_value(
        what,
        f"voxel (z, y, x) = ({z_begin + int(z)}, {int(y)}, {int(x)}) is {int(native[z, y, x])}, "
        f"which no float64 holds: convert the array, for example with array.astype('float64')",
    )
