"""VTK's isosurface mapper as a peer: it draws our surface, in our colours."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import isowave

TOP = pathlib.Path(__file__).resolve().parents[3]
VOLUME = TOP / "tests/data/fuel_64x33x32_uint8.raw.gz"
PEER = TOP / "bench/vtk_peer"
ISOVALUE = 40
SIZE = (96, 54)


def run(*options, volume=VOLUME):
    command = [sys.executable, PEER, volume, "--isovalue", ISOVALUE, *options]
    return subprocess.run(map(str, command), capture_output=True, text=True)


def place(folder):
    """The volume at another place. Its axes are turned, and one is mirrored."""
    turn = np.array([[0.8, 0, 0.6], [0, -1, 0], [-0.6, 0, 0.8]])
    voxels = np.asarray(isowave.open(VOLUME)).astype(np.uint8)
    isowave.compress(
        voxels, exact=True, spacing=(1, 2, 1.5), origin=(30, -20, 500), direction=turn
    ).save(folder / "placed.zfp")
    return folder / "placed.zfp"


@pytest.fixture(scope="module", params=["as it is", "placed"])
def drawn(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("vtk")
    volume = VOLUME if request.param == "as it is" else place(folder)
    size = "x".join(map(str, SIZE))
    options = ("--size", size, "--views", 2, "--rounds", 1)
    done = run(*options, "--pictures", folder, "--json", folder / "p", volume=volume)
    assert done.returncode == 0, done.stderr
    return folder, json.loads((folder / "p").read_text())["pareto_peers"], volume


def test_rows_are_those_of_a_peer(drawn):
    folder, rows, _ = drawn
    assert [row["side"] for row in rows] == ["vtk", "vtk_fine"]
    for row in rows:
        assert set(row["ms"]) == {"new", "next", "warm"} and min(row["ms"].values()) > 0
        assert (row["size"], row["views"], row["isovalue"]) == (list(SIZE), 2, ISOVALUE)
        assert all((folder / name).exists() for name in row["pictures"]) and row["bytes"] > 0


def test_pictures_are_those_of_the_library(drawn):
    folder, rows, volume = drawn
    volume = isowave.open(volume)
    cameras = isowave.Camera.orbit(volume, 2, size=SIZE)
    own = [volume.render(ISOVALUE, camera=camera, size=SIZE).rgb for camera in cameras]
    errors = {}
    for row in rows:
        pictures = [np.asarray(Image.open(folder / name)) for name in row["pictures"]]
        errors[row["side"]] = np.mean(np.abs(np.subtract(pictures, own, dtype=float)))
    other_view = np.mean(np.abs(np.subtract(own[0], own[1], dtype=float)))
    assert errors["vtk_fine"] < errors["vtk"] < other_view / 4, (errors, other_view)


def test_it_is_measured_beside_our_ways_to_draw(tmp_path):
    programs = pathlib.Path(os.environ.get("ISOWAVE_PROGRAM", TOP / "build/release/isowave")).parent
    if not (programs / "bench/isowave_bench").exists():
        pytest.skip("tools/measure needs bench/, which was not built")
    device = os.environ.get("ISOWAVE_DEVICE", "cpu")
    command = [TOP / "tools/measure", "--quick", "--only", "vtk", "--device", device]
    command += ["--volumes", VOLUME.parent, "--python", sys.executable, "--programs", programs]
    done = subprocess.run(
        [*map(str, command), "-o", str(tmp_path / "m.json")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (row,) = json.loads((tmp_path / "m.json").read_text())["sections"]["vtk"]["rows"]
    errors = {point["way"]: point["flip"] for point in row["points"]}
    assert errors["VTK, steps of 0.1 voxel"] < errors["VTK, steps of a voxel"]
    assert errors["default"] == errors["--device host"] < errors["VTK, steps of a voxel"]


@pytest.mark.parametrize(
    "options, words",
    [
        (["--size", "7"], "WIDTHxHEIGHT"),
        (["--views", "0"], "1 or more"),
        (["--sides", "opengl"], "vtk, vtk_fine"),
    ],
)
def test_bad_options_are_one_line(tmp_path, options, words):
    done = run(*options, "--pictures", tmp_path, "--json", tmp_path / "p")
    assert done.returncode == 1 and words in done.stderr and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_missing_volume_is_one_line(tmp_path):
    done = run("--pictures", tmp_path, "--json", tmp_path / "p", volume=tmp_path / "none.nrrd")
    assert done.returncode == 1 and done.stderr.startswith("vtk_peer: ")
    assert done.stderr.count("\n") == 1
