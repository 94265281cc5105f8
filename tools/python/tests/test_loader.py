"""Drivers that are not registered, as in GPU containers, are found by their name."""

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


def plant(folder):
    """Gives a folder to another user."""
    if os.geteuid() != 0:
        pytest.skip("only root can give files away")
    folder.mkdir(parents=True)
    os.chown(folder, 65534, 65534)
    folder.chmod(0o777)
    return folder


def test_folders_that_other_users_can_change_are_not_private(tmp_path):
    own = tmp_path / "own"
    own.mkdir()
    (own / "link").symlink_to("../own")
    (own / "circle").symlink_to("circle")
    assert loader.is_private(own)
    assert loader.is_private(own / "link" / ".." / "own")
    assert not loader.is_private(own / "circle")
    (own / "open").mkdir()
    (own / "open").chmod(0o777)
    (own / "open" / "own").mkdir()
    assert not loader.is_private(own / "open")
    assert not loader.is_private(own / "open" / "own")
    (own / "open").chmod(0o1777)  # as /tmp
    assert loader.is_private(own / "open" / "own")
    (own / "to_open").symlink_to("open")
    assert not loader.is_private(own / "to_open")


def test_what_another_user_made_is_not_private(tmp_path):
    planted = plant(tmp_path / "planted")
    (tmp_path / "link").symlink_to(tmp_path)
    os.chown(tmp_path / "link", 65534, 65534, follow_symlinks=False)
    assert not loader.is_private(planted)
    assert not loader.is_private(tmp_path / "link")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "evil.icd").touch()
    assert loader.is_private(tmp_path / "own")
    os.chown(tmp_path / "own" / "evil.icd", 65534, 65534)
    assert not loader.is_private(tmp_path / "own")


def test_drivers_are_registered_where_only_this_user_can(tmp_path, monkeypatch):
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    monkeypatch.setattr(loader.tempfile, "tempdir", str(temporary))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("OCL_ICD_VENDORS", "")

    def registered_in():
        monkeypatch.delenv("OCL_ICD_VENDORS", raising=False)
        loader.register({"a.icd": "liba.so"})
        folder = pathlib.Path(os.environ["OCL_ICD_VENDORS"])
        assert loader.registered(folder) == {"a.icd": "liba.so"}
        return folder

    usual = registered_in()
    assert usual.parent == tmp_path / "cache" / "isowave"
    assert registered_in() == usual
    monkeypatch.setenv("XDG_CACHE_HOME", str(plant(tmp_path / "planted")))
    mine = registered_in()
    assert mine.parent == temporary / f"isowave-{os.geteuid()}"
    assert registered_in() == mine
    os.chown(mine.parent, 65534, 65534)
    fresh = registered_in()
    assert fresh.parent == temporary and fresh.name.startswith("isowave_opencl_")
    temporary.chmod(0o777)
    monkeypatch.delenv("OCL_ICD_VENDORS", raising=False)
    with pytest.warns(UserWarning, match="cannot register OpenCL drivers"):
        loader.register({"a.icd": "liba.so"})
    assert "OCL_ICD_VENDORS" not in os.environ
