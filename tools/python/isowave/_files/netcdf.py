"""NetCDF by xarray and netCDF4; xarray reads what it wrote to zarr, too."""

from __future__ import annotations

import importlib
from collections.abc import Mapping

from isowave._arrays.errors import bad_value
from isowave._arrays.found import Found
from isowave._arrays.labelled import axis_of, xarray_dataarray

from .contents import Contents, choose, named_axes


def read(path: str, dataset: str | None, has_spacing: bool) -> Contents:
    """See kinds.Reader. A dataset is a variable, or group/variable."""
    importlib.import_module("netCDF4")  # xarray's error names no package
    return of_xarray(path, "netcdf4", dataset, has_spacing)


def of_xarray(path: str, engine: str, dataset: str | None, has_spacing: bool) -> Contents:
    """The variable of a file or store; names and coordinates say where z, y and x lie."""
    xarray = importlib.import_module("xarray")
    group, _, name = (dataset or "").strip("/").rpartition("/")
    opened = xarray.open_dataset(
        path,
        engine=engine,
        group=group or None,
        cache=False,
        decode_times=False,
        decode_coords="all",
    )
    variables = {str(key): each.ndim for key, each in opened.data_vars.items()}
    chosen = choose(variables, name or None, "variable")
    array = opened[chosen]
    dims = [str(dim) for dim in array.dims]
    names = named_axes(dims, [axis_of(array, dim) for dim in array.dims])
    if not {"z", "y", "x"} <= set(names):
        raise bad_value(chosen, f"dims {', '.join(dims)}: need 3 axes (z, y, x)")
    further = {
        dim: int(array.sizes[dim]) for dim, n in zip(dims, names) if n not in ("z", "y", "x")
    }

    def volume(index: Mapping[str, int]) -> Found:
        return xarray_dataarray(array.isel({name: index[name] for name in further}), has_spacing)

    return Contents(chosen, further, volume)
