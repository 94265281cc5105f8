"""Lets the compiled part find OpenCL: a loader, and drivers that no administrator registered.

Installed parts come first. Only missing parts are added, and only for this process:

- libOpenCL.so.1 of the system, else the one that the wheel has;
- PoCL from PyPI (`pip install isowave[cpu]`), if the system has a linker and no PoCL;
- NVIDIA's driver by its name, if it is there and not registered, as in many GPU containers.

If OCL_ICD_VENDORS or OCL_ICD_FILENAMES is set, the user has decided, and nothing is added.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import pathlib
import shutil
import stat
import tempfile
import warnings

PACKAGE = pathlib.Path(__file__).resolve().parent
SYSTEM_VENDORS = pathlib.Path("/etc/OpenCL/vendors")
LOADER = "libOpenCL.so.1"
BUNDLED_LOADER = PACKAGE / "opencl" / LOADER
NVIDIA_DRIVER = "libnvidia-opencl.so.1"

#: What prepare() found, for isowave.Report: "loader", "added", the drivers that it registered, and
#: "left out", a driver that cannot be used, and why.
found: dict[str, str] = {}


def load_library(name: str) -> bool:
    try:
        ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
    except OSError:
        return False
    return True


def pip_pocl() -> pathlib.Path | None:
    """The driver that the package pocl-binary-distribution brings."""
    for package, folder in (("pocl_binary_distribution", ".."), ("pyopencl", ".")):
        spec = importlib.util.find_spec(package)  # finds it without importing it
        for place in (spec.submodule_search_locations or ()) if spec else ():
            drivers = sorted((pathlib.Path(place) / folder / "pyopencl/.libs").glob("libpocl*.so*"))
            drivers += sorted((pathlib.Path(place) / ".libs").glob("libpocl*.so*"))
            if drivers:
                return drivers[0].resolve()
    return None


def can_link(usr: pathlib.Path = pathlib.Path("/usr")) -> bool:
    """Whether PoCL from PyPI can link the kernels that it compiles.

    It needs `ld`, libgcc and libc's development files, and ends the process without them.
    """
    path = os.pathsep.join((os.environ.get("PATH", ""), str(usr / "bin")))
    libgcc, libc = "lib*/gcc*/*/*/crtbeginS.o", ("lib*/crti.o", "lib/*/crti.o")
    return (
        shutil.which("ld", path=path) is not None
        and any(usr.glob(libgcc))
        and any(file for pattern in libc for file in usr.glob(pattern))
    )


def registered(vendors: pathlib.Path) -> dict[str, str]:
    """File name and driver of each registration in a folder."""
    try:
        files = sorted(vendors.glob("*.icd"))
        return {file.name: file.read_text().strip() for file in files}
    except OSError:
        return {}


def unregistered(drivers: dict[str, str]) -> dict[str, str]:
    """Drivers of this machine that are not registered."""
    added = {}
    if not any("nvidia" in driver for driver in drivers.values()) and load_library(NVIDIA_DRIVER):
        added["isowave_nvidia.icd"] = NVIDIA_DRIVER
    if not any("pocl" in driver for driver in drivers.values()):
        pocl = pip_pocl()
        if pocl and can_link():
            added["isowave_pocl.icd"] = str(pocl)
        elif pocl:
            found["left out"] = f"{pocl}, which needs a linker: apt install gcc libc6-dev"
    return added


def trusted_users() -> set[int]:
    """This user and root, also in a container that maps only this user and shows root as 65534."""
    try:
        with open("/proc/self/uid_map", encoding="ascii") as file:
            mapped = [int(line.split()[0]) for line in file]
    except (OSError, ValueError):
        mapped = [0]
    return {os.geteuid(), 0 if 0 in mapped else 65534, 0}


def is_private(folder: pathlib.Path) -> bool:
    """Whether no other user can change the folder's contents, or the way to it.

    core/platform/private_folder.cpp has the same rules; it cannot be called before there is OpenCL.
    """
    trusted, most_links = trusted_users(), 40
    rest = list(folder.absolute().parts[1:])
    path = pathlib.Path("/")
    while True:
        status = path.lstat()
        is_open = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if status.st_uid not in trusted:
            return False
        if is_open and not (rest and status.st_mode & stat.S_ISVTX):
            return False
        if not rest:
            return all(entry.lstat().st_uid in trusted for entry in path.iterdir())
        part = rest.pop(0)
        if part == "..":
            path = path.parent
        elif (path / part).is_symlink():
            most_links -= 1
            if (path / part).lstat().st_uid not in trusted or most_links < 0:
                return False
            target = pathlib.Path(os.readlink(path / part)).parts
            if target[0] == "/":
                path, target = pathlib.Path("/"), target[1:]
            rest[:0] = target
        else:
            path /= part


def registration_folder(name: str) -> pathlib.Path | None:
    """A folder of this user's alone: drivers that others register would run as this user."""
    home = os.path.expanduser("~")  # stays as it is if there is none
    cache = os.environ.get("XDG_CACHE_HOME") or (home != "~" and os.path.join(home, ".cache"))
    places = [pathlib.Path(cache) / "isowave"] if cache else []
    places.append(pathlib.Path(tempfile.gettempdir()) / f"isowave-{os.geteuid()}")
    for place in places:
        folder = place / name
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            for made in (place, folder):
                made.mkdir(mode=0o700, exist_ok=True)
            if is_private(folder) and os.access(folder, os.W_OK):
                return folder.resolve()
        except OSError:  # a home that cannot be written to
            continue
    folder = pathlib.Path(tempfile.mkdtemp(prefix="isowave_opencl_"))
    if is_private(folder):
        return folder.resolve()
    folder.rmdir()
    return None


def register(drivers: dict[str, str]) -> None:
    """Points the loader at a folder with these registrations.

    It stays for the next process, since programs that this one starts may outlive it.
    """
    text = "".join(f"{name} {driver}\n" for name, driver in drivers.items())
    folder = registration_folder("opencl-" + hashlib.sha256(text.encode()).hexdigest()[:16])
    if folder is None:
        where = f"other users can write to {tempfile.gettempdir()}: set TMPDIR to another folder"
        warnings.warn(f"isowave cannot register OpenCL drivers, since {where}", stacklevel=3)
        return
    write_registrations(folder, drivers)
    os.environ["OCL_ICD_VENDORS"] = f"{folder}/"


def write_registrations(folder: pathlib.Path, drivers: dict[str, str]) -> None:
    for name, driver in drivers.items():
        file = folder / name
        if registered(folder).get(name) == driver:
            continue
        part = folder / f"{name}.{os.getpid()}"
        part.write_text(driver + "\n")
        part.replace(file)


def prepare() -> None:
    """Call before the compiled part is loaded. Raises ImportError if there is no loader."""
    if load_library(LOADER):
        found["loader"] = LOADER
    elif BUNDLED_LOADER.exists() and load_library(str(BUNDLED_LOADER)):
        found["loader"] = str(BUNDLED_LOADER)
    else:
        raise ImportError(
            f"isowave needs {LOADER}, the OpenCL loader: on Debian and Ubuntu, "
            "apt install ocl-icd-libopencl1; wheels from PyPI bring one"
        )
    if "OCL_ICD_VENDORS" in os.environ or "OCL_ICD_FILENAMES" in os.environ:
        return
    drivers = registered(SYSTEM_VENDORS)
    added = unregistered(drivers)
    if added:
        found["added"] = ", ".join(added.values())
        register({**drivers, **added})
    elif not drivers and "left out" in found:
        warnings.warn(f"isowave has no OpenCL device but {found['left out']}", stacklevel=2)
