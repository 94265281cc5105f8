"""An adapter's description of an object, and how adapters look at objects of other packages.

An adapter imports nothing. It needs only an object's own methods and sys.modules, which has the
object's package already.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .errors import bad_value, short, type_name
from .grid import Placement, Vector
from .layers import Fetch


@dataclass(frozen=True)
class Found:
    """An array as its package describes it.

    what         names it in messages
    shape        (nz, ny, nx), checked
    stored       type of its voxels as they are stored
    fetch        reads layers
    row_edges    layers at which chunk rows begin (LayerReader), None without chunks
    placement    where it lies, unchecked: what a caller gives replaces parts of it
    first_index  index (x, y, z), in the placement, of its first voxel
    is_masked    whether some of its voxels are masked; of a lazy array, whether some may be
    no_data      value of voxels without data, as its metadata says; None: it says none
    """

    what: str
    shape: tuple[int, int, int]
    stored: np.dtype[Any]
    fetch: Fetch
    row_edges: Sequence[int] | None = None
    placement: Placement = field(default_factory=Placement)
    first_index: Vector = (0.0, 0.0, 0.0)
    is_masked: bool = False
    no_data: Any = None


Adapter = Callable[[Any, bool], Found]
"""(object, whether the caller gave a spacing) -> what was found."""


def named(obj: Any) -> str:
    """Returns the class of an object and its name, if it has one: "h5py.Dataset '/ct'"."""
    name = getattr(obj, "name", None)
    return f"{type_name(obj)} {short(name)}" if isinstance(name, str) and name else type_name(obj)


def no_data_in(attributes: Any) -> Any:
    """Returns the value that attributes of netCDF name for voxels without data, None for none."""
    return attributes.get("_FillValue", attributes.get("missing_value"))


def chunk_size(size: Any, what: str) -> int:
    """Returns the layers of a chunk. Raises ArrayValueError unless they are a number above 0."""
    try:
        layers = operator.index(size)
    except TypeError:
        layers = 0
    if layers < 1:
        raise bad_value(what, f"chunks of {short(size)} layers: need whole numbers above 0")
    return layers
