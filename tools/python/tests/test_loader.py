"""Drivers that nobody registered, as in GPU containers: found by their name."""

import json
import os
import pathlib
import subprocess
import sys

import pytest

import isowave
from isowave import _loader as loader

# The loader's part of the package runs before the rest, on a machine without registrations.
SCRIPT = """
import importlib.util
import json
import os
import pathlib
import sys

package, vendors, *drivers = map(pathlib.Path, sys.argv[1:])
spec = importlib.util.spec_from_file_location("loader", package / "_loader.py")
loader = importlib.util.module_from_spec(spec)
spec.loader.exec_module(loader)
loader.SYSTEM_VENDORS = vendors
loader.pip_pocl = lambda: None
if drivers:
    loader.pip_pocl = lambda: drivers[0]
    loader.can_link = lambda: False
loader.prepare()

import isowave

folder = os.environ.get("OCL_ICD_VENDORS")
print(json.dumps({
    "added": loader.found.get("added"),
    "left out": loader.found.get("left out"),
    "registered": loader.registered(pathlib.Path(folder)) if folder else None,
    "devices": [device["platform"] for device in isowave.devices()],
}))
"""


@pytest.fixture
def pocl():
    """PoCL's library, which poses as NVIDIA's."""
    for file in pathlib.Path("/etc/OpenCL/vendors").glob("pocl*.icd"):
        found = pathlib.Path(file.read_text().strip())
        for place in (found, pathlib.Path("/usr/lib/x86_64-linux-gnu") / found):
            if place.is_absolute() and place.exists():
                return place
    pytest.skip("the system has no PoCL that could pose as NVIDIA's driver")


def run_loader(tmp_path, libraries, *arguments):
    variables = {k: v for k, v in os.environ.items() if not k.startswith("OCL_ICD_")}
    paths = [str(libraries), os.environ.get("LD_LIBRARY_PATH", "")]
    variables["LD_LIBRARY_PATH"] = ":".join(filter(None, paths))
    variables["XDG_CACHE_HOME"] = str(tmp_path / "cache")
    package = pathlib.Path(isowave.__file__).parent
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, package, *arguments],
        cwd=tmp_path,
        env=variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1]), done.stderr


def found_with(tmp_path, libraries, vendors):
    return run_loader(tmp_path, libraries, vendors)[0]


@pytest.fixture
def folders(tmp_path, pocl):
    """One for registrations, one with a library that is called as NVIDIA's."""
    vendors, libraries = tmp_path / "vendors", tmp_path / "nvidia"
    vendors.mkdir()
    libraries.mkdir()
    (libraries / "libnvidia-opencl.so.1").symlink_to(pocl)
    (libraries / "pocl").symlink_to(pocl.parent / "pocl")  # it looks for its devices beside itself
    return vendors, libraries


def test_nvidias_driver_is_tried_by_its_name(tmp_path, folders):
    vendors, libraries = folders
    found = found_with(tmp_path, libraries, vendors)
    assert found["added"] == "libnvidia-opencl.so.1"
    assert found["registered"] == {"isowave_nvidia.icd": "libnvidia-opencl.so.1"}
    assert found["devices"] == ["Portable Computing Language"]


def test_what_is_registered_is_not_added_again(tmp_path, folders):
    vendors, libraries = folders
    (vendors / "nvidia.icd").write_text("libnvidia-opencl.so.1\n")
    assert found_with(tmp_path, libraries, vendors)["added"] is None


def test_other_registrations_stay(tmp_path, folders):
    vendors, libraries = folders
    (vendors / "other.icd").write_text("libother.so.1\n")
    found = found_with(tmp_path, libraries, vendors)
    assert found["registered"] == {
        "isowave_nvidia.icd": "libnvidia-opencl.so.1",
        "other.icd": "libother.so.1",
    }


def test_pocl_from_pypi_is_left_out_where_it_would_end_the_process(tmp_path, folders):
    vendors, libraries = folders
    (libraries / "libnvidia-opencl.so.1").unlink()  # else it would be found
    found, err = run_loader(tmp_path, libraries, vendors, "/somewhere/libpocl.so.2")
    assert found["added"] is None
    assert found["left out"].startswith("/somewhere/libpocl.so.2, which needs a linker")
    assert "isowave has no OpenCL device but /somewhere/libpocl.so.2" in err
    (vendors / "other.icd").write_text("libother.so.1\n")
    assert (
        "isowave has no OpenCL device"
        not in run_loader(tmp_path, libraries, vendors, "/somewhere/libpocl.so.2")[1]
    )


def test_what_linking_takes(tmp_path, monkeypatch):
    assert loader.can_link(), "this machine compiles"
    monkeypatch.setenv("PATH", "")
    files = ["bin/ld", "lib/gcc/x86_64-linux-gnu/12/crtbeginS.o", "lib/x86_64-linux-gnu/crti.o"]
    for file in files:
        assert not loader.can_link(tmp_path)
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch(mode=0o755)
    assert loader.can_link(tmp_path)
