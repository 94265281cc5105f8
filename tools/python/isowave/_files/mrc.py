"""MRC and CCP4 maps by mrcfile, mapped into memory unless they are compressed."""

from __future__ import annotations

import importlib
from typing import Any

from isowave._arrays.errors import bad_value
from isowave._arrays.grid import Placement

from .contents import Contents, of_array


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. Lengths are in angstroms. A volume stack's axis is t."""
    mrcfile = importlib.import_module("mrcfile")
    if dataset is not None:
        raise bad_value(f"dataset {dataset}", "an MRC file has one array, without a name")
    if path.lower().endswith((".gz", ".bz2")):
        mrc = mrcfile.open(path, mode="r")
    else:
        mrc = mrcfile.mmap(path, mode="r")
    header = mrc.header
    order = [int(header[name]) for name in ("maps", "mapr", "mapc")]
    if order == [0, 0, 0]:  # of old files
        order = [3, 2, 1]
    if sorted(order) != [1, 2, 3]:
        raise bad_value("header", f"mapc, mapr, maps are {order[::-1]}: need 1, 2 and 3")
    angles = [float(header.cellb[name]) for name in ("alpha", "beta", "gamma")]
    if any(angle not in (0.0, 90.0) for angle in angles):
        raise bad_value("header", f"cell angles {angles} degrees: only right angles are supported")
    axes = ["xyz"[axis - 1] for axis in order]
    names = ["t"] * (mrc.data.ndim - 3) + axes
    return of_array(mrc.data, names, "map", placement=_placement(mrc, axes))


def _placement(mrc: Any, axes: list[str]) -> Placement:
    """The origin is that of the header, or if that is 0 the start (nxstart ...) of the map."""
    header = mrc.header
    size = [float(mrc.voxel_size[axis]) or 1.0 for axis in "xyz"]
    origin = [float(header.origin[axis]) for axis in "xyz"]
    if not any(origin):
        starts = dict(zip(axes, (int(header[f"n{name}start"]) for name in "zyx")))
        origin = [starts[axis] * step for axis, step in zip("xyz", size)]
    return Placement((size[0], size[1], size[2]), (origin[0], origin[1], origin[2]))
