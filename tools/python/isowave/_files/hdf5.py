"""HDF5 by h5py. Dimension scales, or `element_size_um` (Fiji, ilastik), give the spacing."""

from __future__ import annotations

import importlib
from typing import Any

from isowave._arrays.errors import bad_value
from isowave._arrays.grid import Placement, finite_numbers, of_steps
from isowave._arrays.labelled import even_steps
from isowave._arrays.stores import no_data_of_h5py
from isowave._arrays.voxels import read_type

from .contents import Contents, choose, named_axes, of_array


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is the path of one in the file."""
    h5py = importlib.import_module("h5py")
    file = h5py.File(path, "r")  # stays open for the layers
    axes: dict[str, int] = {}

    def note(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.shape is not None and node.dtype.kind in "biuf":
            axes[name] = node.ndim

    file.visititems(note)
    name = choose(axes, None if dataset is None else dataset.strip("/"), "dataset")
    array = file[name]
    read_type(array.dtype, name)
    names = named_axes([_name_of(dim) for dim in array.dims])
    if not {"z", "y", "x"} <= set(names):
        raise bad_value(name, f"shape {array.shape}: need 3 axes (z, y, x)")
    placement = _placement(array, names, has_spacing)
    return of_array(array, names, name, placement=placement, no_data=no_data_of_h5py(array))


def _name_of(dim: Any) -> str:
    """The label of an axis, or else the name of its scale."""
    scale = dim[0].name.rpartition("/")[2] if len(dim) else ""
    return dim.label or str(scale)


def _placement(array: Any, names: list[str], has_spacing: bool) -> Placement:
    steps = dict.fromkeys("xyz", 1.0)
    origin = dict.fromkeys("xyz", 0.0)
    sizes = array.attrs.get("element_size_um")
    if sizes is not None:
        found = finite_numbers(sizes, 3, array.name, "element_size_um")
        steps = dict(zip("zyx", found))
    for name, dim, size in zip(names, array.dims, array.shape):
        if name not in steps or len(dim) == 0 or size < 2:
            continue
        try:
            steps[name], origin[name] = even_steps(dim[0][...], size, _name_of(dim), array.name)
        except ValueError:
            if not has_spacing:
                raise
    return of_steps((steps["x"], steps["y"], steps["z"]), (origin["x"], origin["y"], origin["z"]))
