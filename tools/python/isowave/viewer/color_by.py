"""--color-by and --color-map of the command `isowave view`, as `isowave render` has them."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

from isowave._color_map import AXES, ColorMap
from isowave._core import color_map_names
from isowave._files import is_pattern


@dataclass(frozen=True)
class ColorBy:
    """What colours surfaces. field: a file, or "volume": the drawn one; "": none."""

    color_map: ColorMap
    field: str = ""


def parse_color_map(text: str) -> str:
    """A name of a colour map. Raises ValueError."""
    if text not in color_map_names():
        raise ValueError(f"'{text}' is none of {', '.join(color_map_names())}")
    return text


def parse_color_by(text: str) -> ColorBy:
    """x, y, z, NX,NY,NZ, depth, FILE or volume, and [,LOW,HIGH]; labels, or FILE,labels.

    Raises ValueError.
    """
    found = _labelled(text) or _valued(text) or _along(text)
    if found is None:
        raise ValueError(
            f"{text}: give x, y, z, NX,NY,NZ, depth, volume or a file, and LOW,HIGH if wanted; "
            "or labels, or a file and labels"
        )
    return found


def _is_volume(name: str) -> bool:
    return name == "volume" or os.path.exists(name) or is_pattern(name)


def _labelled(text: str) -> ColorBy | None:
    name = "volume" if text == "labels" else text.removesuffix(",labels")
    if (name == text and text != "labels") or os.path.exists(text) or not _is_volume(name):
        return None
    return ColorBy(ColorMap(by="labels"), name)


def _valued(text: str) -> ColorBy | None:
    """An axis stays one if a file has its name: ./z is that file."""
    if text.partition(",")[0] in (*AXES, "depth"):
        return None
    name, numbers = text, list[float]()
    while len(numbers) < 2 and not os.path.exists(name):
        name, comma, last = name.rpartition(",")
        number = _finite(last)
        if not comma or number is None:
            name = text
            break
        numbers.insert(0, number)
    if name == text:
        numbers = []
    if not _is_volume(name) or len(numbers) == 1:
        return None
    by = "caps" if name == "volume" else "field"
    return ColorBy(ColorMap(by=by, range=_range(text, numbers)), name)


def _along(text: str) -> ColorBy | None:
    first, *rest = text.split(",")
    by, axis = ("depth" if first == "depth" else "axis"), AXES.get(first, (0.0, 0.0, 1.0))
    numbers = [_finite(each) for each in (rest if first in (*AXES, "depth") else [first, *rest])]
    known = [each for each in numbers if each is not None]
    if len(known) < len(numbers):
        return None
    if first not in (*AXES, "depth"):
        if len(known) < 3:
            return None
        (x, y, z), known = known[:3], known[3:]
        length = math.hypot(x, y, z)
        if not length:
            raise ValueError(f"{text}: an axis of length 0")
        axis = (x / length, y / length, z / length)
    if len(known) not in (0, 2):
        return None
    return ColorBy(ColorMap(axis=axis, by=by, range=_range(text, known)))


def _range(text: str, numbers: list[float]) -> tuple[float, float] | None:
    if not numbers:
        return None
    low, high = numbers
    if low == high:
        raise ValueError(f"{text}: the first and the last colour have the same value")
    return low, high


def _finite(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
