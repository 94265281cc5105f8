"""The reader in ParaView: pvpython of the system, or what ISOWAVE_PVPYTHON names.

`tools/test --long` brings one (tests/paraview_test.sh).
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import sphere_voxels

import isowave

PLUGIN = pathlib.Path(isowave.__file__).parent / "paraview_reader.py"
SHAPE = (20, 25, 30)
SPACING = (3, 2, 1)
ORIGIN = (30, 20, 10)
C, S = np.cos(0.3), np.sin(0.3)
DIRECTION = np.array([[C, -S, 0], [S, C, 0], [0, 0, 1]]) @ np.array(
    [[1, 0, 0], [0, C, -S], [0, S, C]]
)

SCRIPT = """
import inspect
import json
import os
import sys

plugin, folder = sys.argv[1:]
sys.path.append(os.path.dirname(os.path.dirname(plugin)))
import isowave  # before the reader; libcfitsio is loaded, and has some of libzfp's names

if not hasattr(inspect, "getargspec"):  # Debian 12's ParaView is older than its Python
    inspect.getargspec = inspect.getfullargspec

from paraview.simple import *

LoadPlugin(plugin, ns=globals())

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy


def image_of(reader):
    image = servermanager.Fetch(reader)
    matrix = image.GetDirectionMatrix()
    return {
        "extent": image.GetExtent(),
        "spacing": image.GetSpacing(),
        "origin": image.GetOrigin(),
        "direction": [[matrix.GetElement(i, j) for j in range(3)] for i in range(3)],
        "arrays": [image.GetPointData().GetArrayName(i)
                   for i in range(image.GetPointData().GetNumberOfArrays())],
        "scalars": image.GetPointData().GetScalars().GetName(),
    }, vtk_to_numpy(image.GetPointData().GetScalars())


told, voxels = {}, {}
reader = IsowaveReader(FileName=folder + "/turned.zfp")
for level in (0, 1, 2, 15):
    reader.Level = level
    reader.UpdatePipeline()
    told[level], voxels[str(level)] = image_of(reader)
reader.FileName = folder + "/flat.zfp"
reader.UpdatePipeline()
told["flat"], voxels["flat"] = image_of(reader)
told["opened"] = type(OpenDataFile(folder + "/turned.zfp")).__name__
contour = Contour(Input=reader, ContourBy=["POINTS", "voxels"], Isosurfaces=[5])
contour.UpdatePipeline()
told["bounds"] = contour.GetDataInformation().GetBounds()
for name in ("none", "bad"):
    IsowaveReader(FileName=folder + "/" + name + ".zfp").UpdatePipeline()
np.savez(folder + "/voxels.npz", **voxels)
with open(folder + "/told.json", "w") as file:
    json.dump(told, file)
"""


def pvpython():
    path = os.environ.get("ISOWAVE_PVPYTHON") or shutil.which("pvpython")
    if not path:
        pytest.skip("ParaView is not installed: neither pvpython nor ISOWAVE_PVPYTHON")
    code = "import sys; import paraview.simple; print('version', *sys.version_info[:2])"
    done = subprocess.run([path, "-c", code], capture_output=True, text=True, check=False)
    expected = f"version {sys.version_info[0]} {sys.version_info[1]}"
    if expected not in done.stdout:
        pytest.skip(f"{path} has no paraview.simple, or another Python: {done.stdout.strip()}")
    return path


def world_of(direction):
    return {"spacing": SPACING, "origin": ORIGIN, "direction": direction}


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What ParaView has of the volumes, and what it wrote on its error channel."""
    path = pvpython()
    folder = tmp_path_factory.mktemp("paraview")
    for name, direction in (("turned", DIRECTION), ("flat", np.eye(3))):
        isowave.compress(
            sphere_voxels(SHAPE), tolerance=1e-3, levels=0, **world_of(direction)
        ).save(folder / f"{name}.zfp")
    (folder / "bad.zfp").write_bytes(b"no volume")
    (folder / "script.py").write_text(SCRIPT)
    done = subprocess.run(
        [path, "--force-offscreen-rendering", folder / "script.py", PLUGIN, folder],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (folder / "told.json").exists(), done.stderr
    told = json.loads((folder / "told.json").read_text())
    return folder, told, np.load(folder / "voxels.npz"), done.stdout + done.stderr


@pytest.mark.parametrize("asked, level", [(0, 0), (1, 1), (2, 2), (15, 2)])
def test_a_level_is_an_image(seen, asked, level):
    folder, told, voxels, _ = seen
    volume = isowave.open(folder / "turned.zfp")
    assert volume.num_levels == 3
    image, expected = told[str(asked)], volume.decode(level)
    assert image["extent"] == [b for n in expected.shape[::-1] for b in (0, n - 1)]
    assert image["spacing"] == [s * 2**level for s in SPACING[::-1]]
    assert image["origin"] == list(ORIGIN[::-1])
    assert np.array_equal(image["direction"], DIRECTION)
    assert image["arrays"] == ["voxels"] and image["scalars"] == "voxels"
    assert voxels[str(asked)].dtype == np.float32
    assert np.array_equal(voxels[str(asked)], expected.ravel())


def test_the_next_file_is_read(seen):
    folder, told, voxels, _ = seen
    assert np.array_equal(told["flat"]["direction"], np.eye(3))
    assert np.array_equal(voxels["flat"], isowave.open(folder / "flat.zfp").decode(2).ravel())


def test_files_are_opened_by_their_type(seen):
    assert seen[1]["opened"] == "IsowaveReader"


def test_filters_take_the_image(seen):
    """The contour of the coarsest level lies in the volume's box, around its middle."""
    bounds = np.reshape(seen[1]["bounds"], (3, 2))
    middle = [o + s * (n - 1) / 2 for o, s, n in zip(ORIGIN, SPACING, SHAPE)][::-1]
    extent = [s * (n - 1) for s, n in zip(SPACING, SHAPE)][::-1]
    assert (bounds[:, 0] < middle).all() and (middle < bounds[:, 1]).all()
    assert (bounds[:, 1] - bounds[:, 0] < extent).all()


def test_bad_files_get_a_line(seen):
    folder, _, _, log = seen
    for name in ("none", "bad"):
        assert f"isowave: {folder}/{name}.zfp: " in log
    assert "Traceback" not in log
