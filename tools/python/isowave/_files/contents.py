"""What is in a file: arrays and their axes. One array is chosen."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from isowave._arrays.errors import bad_value, one_line, short
from isowave._arrays.found import Found, chunk_size
from isowave._arrays.grid import Placement, checked_shape
from isowave._arrays.labelled import AXES
from isowave._arrays.layers import even_rows

Index = str | Mapping[str, int]
"""Entries of further axes: "t=3,c=0" or {"t": 3, "c": 0}."""

UNNAMED = {3: "zyx", 4: "tzyx", 5: "tczyx"}
"""Axes of an array whose file names none, by their number."""
_MOST_NAMES = 12
"""Most names that a message lists."""


@dataclass(frozen=True)
class Contents:
    """An array of a file: a volume at each index of its further axes.

    what    names the array in messages, beside the path
    axes    further axes than z, y and x, with the number of their entries
    volume  returns the volume at an index that has each of these axes
    """

    what: str
    axes: Mapping[str, int]
    volume: Callable[[Mapping[str, int]], Found]


def parse_index(index: Index | None) -> dict[str, int]:
    """Returns entries by axis. Raises ArrayValueError in one line."""
    if index is None:
        return {}
    if isinstance(index, str):
        parts = [part.partition("=") for part in index.split(",")]
        entries: Sequence[tuple[Any, Any]] = [(name.strip(), entry) for name, _, entry in parts]
    elif isinstance(index, Mapping):
        entries = list(index.items())
    else:
        entries = [("", None)]
    found: dict[str, int] = {}
    for name, entry in entries:
        try:
            number = int(entry) if isinstance(entry, str) else operator.index(entry)
        except (TypeError, ValueError):
            number = -1
        if not isinstance(name, str) or not name or number < 0 or isinstance(entry, bool):
            raise bad_value(f"index {short(index)}", "give axes with an entry, such as t=3,c=0")
        if name in found:
            raise bad_value(f"index {short(index)}", f"gives axis {name} twice")
        found[name] = number
    return found


def pick(contents: Contents, index: Mapping[str, int]) -> Found:
    """Returns the volume at an index. Axes of one entry need none.

    A name stands for the only axis that begins with it: "t" for "time".
    Raises ArrayValueError if an axis has several entries and the index has none of it, and for axes
    and entries that do not exist.
    """
    axes = contents.axes
    full = {name: 0 for name, size in axes.items() if size == 1}
    for name, entry in index.items():
        axis = _axis_called(name, axes)
        if axis is None:
            known = ", ".join(f"{each} ({size} entries)" for each, size in axes.items())
            raise bad_value(f"index {name}={entry}", f"its further axes are {known or 'none'}")
        if entry >= axes[axis]:
            raise bad_value(
                f"index {name}={entry}", f"axis {axis} has {axes[axis]} entries, counted from 0"
            )
        full[axis] = entry
    for name, size in axes.items():
        if name not in full:
            raise bad_value(
                contents.what, f"axis {name} has {size} entries: choose one by index, as {name}=0"
            )
    return contents.volume(full)


def time_axis(contents: Contents, index: Mapping[str, int]) -> str | None:
    """Returns the axis whose entries are steps; None if there is none, or the index chooses one."""
    given = {_axis_called(name, contents.axes) for name in index}
    for name, size in contents.axes.items():
        if is_time(name) and size > 1 and name not in given:
            return name
    return None


def is_time(name: str) -> bool:
    return name.lower() in ("t", "time")


def _axis_called(name: str, axes: Mapping[str, int]) -> str | None:
    if name in axes:
        return name
    alike = [axis for axis in axes if axis.lower().startswith(name.lower())]
    return alike[0] if len(alike) == 1 else None


def choose(arrays: Mapping[str, int], dataset: str | None, what: str = "array") -> str:
    """Returns the name of the array that `dataset` asks for, or of the only one that may be meant.

    arrays  names of a file's arrays, with their number of axes
    what    names such an array in messages

    Raises ArrayValueError.
    """
    if dataset is not None:
        if dataset not in arrays:
            raise bad_value(f"dataset {short(dataset)}", f"the file has {_listed(arrays)}")
        return dataset
    able = [name for name, num_axes in arrays.items() if num_axes >= 3]
    if len(able) == 1:
        return able[0]
    if not able:
        raise bad_value(f"no {what} of 3 axes or more", f"the file has {_listed(arrays)}")
    raise bad_value(f"{len(able)} {what}s", f"choose one by dataset: {_listed(able)}")


def _listed(names: Any) -> str:
    names = list(names)
    more = ", ..." if len(names) > _MOST_NAMES else ""
    return (", ".join(one_line(name) for name in names[:_MOST_NAMES]) or "none") + more


def named_axes(names: Sequence[str], said: Sequence[str | None] | None = None) -> list[str]:
    """Returns the names of axes, with three of them called z, y and x.

    names  of the axes, in their order; "" if the file does not name one
    said   which of z, y and x each axis is, if the file says so

    Names that are known for z, y or x (lat, depth ...) and what is said come first. Then axes from
    the last on that are no time take what is left. Up to five axes without any name are t, c, z, y,
    x, four t, z, y, x.
    """
    if not any(names) and len(names) in UNNAMED:
        return list(UNNAMED[len(names)])
    axes = [
        (said[i] if said is not None else None) or AXES.get(name.lower(), "")
        for i, name in enumerate(names)
    ]
    for letter in "xyz":
        if axes.count(letter) > 1:
            raise bad_value(f"axes {', '.join(names)}", f"two of them are {letter}")
    missing = [letter for letter in "xyz" if letter not in axes]
    free = [i for i in reversed(range(len(names))) if not axes[i] and not is_time(names[i])]
    for letter, i in zip(missing, free):
        axes[i] = letter
    return unlike([axes[i] or name or f"axis{i}" for i, name in enumerate(names)])


def unlike(names: Sequence[str]) -> list[str]:
    """Returns the names, with the axis' number behind a name that occurs once more."""
    return [name if name not in names[:i] else f"{name}{i}" for i, name in enumerate(names)]


def of_array(
    array: Any,
    names: Sequence[str],
    what: str,
    *,
    placement: Placement = Placement(),
    no_data: Any = None,
) -> Contents:
    """Returns the contents of an array that numpy's indices of slices and numbers read lazily.

    names  of its axes, in their order; z, y and x among them
    """
    if len(names) != len(array.shape) or not {"z", "y", "x"} <= set(names):
        axes = ", ".join(names)
        raise bad_value(what, f"shape {short(tuple(array.shape))}, axes {axes}: need z, y and x")
    size = dict(zip(names, (int(n) for n in array.shape)))
    order = [name for name in names if name in "zyx"]
    turn = tuple(order.index(letter) for letter in "zyx")

    def volume(index: Mapping[str, int]) -> Found:
        shape = checked_shape([size[letter] for letter in "zyx"], what)

        def fetch(begin: int, end: int) -> Any:
            spatial = {"z": slice(begin, end), "y": slice(None), "x": slice(None)}
            layers = array[tuple(spatial[n] if n in spatial else index[n] for n in names)]
            return np.asanyarray(layers).transpose(turn)

        chunks = getattr(array, "chunks", None)
        rows = None
        if chunks is not None:
            rows = even_rows(chunk_size(chunks[names.index("z")], what), shape[0])
        return Found(what, shape, array.dtype, fetch, rows, placement, no_data=no_data)

    return Contents(what, {name: size[name] for name in names if name not in "zyx"}, volume)
