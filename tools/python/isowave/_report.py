"""What this machine has, for bug reports."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import sys
from typing import Any

from isowave import _core, _loader

PACKAGES = (
    *("numpy", "pocl-binary-distribution", "pillow", "simplejpeg", "websockets", "anywidget"),
    *("h5py", "imagecodecs", "mrcfile", "netCDF4", "nibabel", "pydicom", "tifffile", "vtk"),
    *("xarray", "zarr"),
)
VARIABLES = ("ISOWAVE_DEVICE", "OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "POCL_CACHE_DIR")


class Device(dict[str, Any]):
    """An OpenCL device, as a dict; repr() is one short line."""

    def __repr__(self) -> str:
        if not self["name"]:
            return "<isowave.Device host>"
        memory = f"{self['memory_bytes'] / 2**30:.1f} GiB"
        return (
            "<isowave.Device {index}: {name} ({type}, {platform}, ".format(**self) + f"{memory})>"
        )


def devices() -> list[Device]:
    """The OpenCL devices of this machine, in the loader's order; none if there is no driver.

    Each is a dict of index, name, vendor, platform, driver, type ("gpu", "cpu", "accelerator",
    "other") and memory_bytes. `device=` of other functions takes an index, a type, or a part of a
    name or platform; where it chooses a renderer, also "host", which draws without a device.
    """
    return [Device(each) for each in _core.devices()]


class Report:
    """What to put into a bug report: print(isowave.Report())."""

    def __init__(self) -> None:
        self.lines = [
            ("isowave", _core.__version__),
            ("Python", f"{platform.python_version()}, {sys.executable}"),
            ("system", f"{platform.platform()}, {os.cpu_count()} processors"),
            ("OpenCL loader", _loader.found["loader"]),
        ]
        for name in ("added", "left out"):
            if name in _loader.found:
                self.lines.append((f"drivers {name}", _loader.found[name]))
        for package in PACKAGES:
            try:
                self.lines.append((package, importlib.metadata.version(package)))
            except importlib.metadata.PackageNotFoundError:
                pass
        self.lines += [(name, os.environ[name]) for name in VARIABLES if name in os.environ]
        try:
            found = devices()
        except _core.Error as error:
            self.lines.append(("devices", str(error)))
        else:
            if not found:
                self.lines.append(
                    ("devices", "none, the host draws: pip install isowave[cpu] brings one")
                )
            for device in found:
                memory = device["memory_bytes"] / 2**30
                text = "{name} ({type}, {platform}, driver {driver}".format(**device)
                self.lines.append((f"device {device['index']}", f"{text}, {memory:.1f} GiB)"))

    def __str__(self) -> str:
        width = max(len(name) for name, _ in self.lines)
        return "\n".join(f"{name:{width}}  {text}" for name, text in self.lines)

    __repr__ = __str__
