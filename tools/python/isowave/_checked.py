"""Arguments of users as the compiled part takes them; errors name the argument."""

from __future__ import annotations

import operator
from typing import Any, Literal

import numpy as np

Isovalue = float | Literal["auto"]  # "auto": the first of Volume.suggested_isovalues()


def refuse(name: str, value: Any, wanted: str) -> TypeError:
    return TypeError(f"{name}={value!r:.60}: give {wanted}")


def flag(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise refuse(name, value, "True or False")
    return bool(value)


def whole(name: str, value: Any, largest: int = 2**32 - 1) -> int:
    """A whole number from 0 to `largest`."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise refuse(name, value, "a whole number") from None
    if not 0 <= number <= largest:
        raise ValueError(f"{name}={number}: give a whole number from 0 to {largest}")
    return number


def number(name: str, value: Any) -> float:
    try:
        if isinstance(value, (bool, np.bool_, str, bytes, bytearray)):
            raise TypeError
        return float(value)
    except OverflowError:
        raise ValueError(f"{name}: the number is too large for a float") from None
    except (TypeError, ValueError):
        raise refuse(name, value, "a number") from None


def numbers(name: str, values: Any, count: int) -> tuple[float, ...]:
    try:
        if isinstance(values, (str, bytes)):
            raise TypeError
        items = tuple(values)
    except TypeError:
        raise refuse(name, values, f"{count} numbers") from None
    if len(items) != count:
        raise ValueError(f"{name}={items!r:.60}: give {count} numbers")
    return tuple(number(name, item) for item in items)


def reversed_axes(values: Any) -> tuple[float, float, float]:
    """A spacing or origin, (z, y, x), as (x, y, z)."""
    z, y, x = numbers("spacing", values, 3)
    return x, y, z


def names(name: str, values: Any) -> tuple[str, ...]:
    try:
        if isinstance(values, str):
            raise TypeError
        items = tuple(values)
        if not all(isinstance(item, str) for item in items):
            raise TypeError
    except TypeError:
        raise refuse(name, values, "a sequence of names, such as ('rgb', 'depth')") from None
    return items


def size_of(size: Any) -> tuple[int, int]:
    try:
        sides = tuple(size)
    except TypeError:
        raise refuse("size", size, "width and height") from None
    if len(sides) != 2:
        raise ValueError(f"size={size!r:.60}: give width and height")
    width, height = (whole("size", side) for side in sides)
    return width, height


def function(name: str, value: Any) -> Any:
    if value is not None and not callable(value):
        raise refuse(name, value, "a function")
    return value
