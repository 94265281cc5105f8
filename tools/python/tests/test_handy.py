"""What makes results of isowave handy: show(), repr(), pickling, other packages, progress."""

from __future__ import annotations

import concurrent.futures
import copy
import dataclasses
import multiprocessing
import os
import pickle
import stat
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import sphere_voxels

import isowave
from isowave import _progress
from isowave._progress import TqdmProgress

SIZE = (32, 24)


@pytest.fixture(scope="module")
def image(volume):
    return volume.render(6, size=SIZE, device="host")


def again(thing):
    return pickle.loads(pickle.dumps(thing))


# Showing.


def test_a_picture_is_shown_by_the_desktop(image, tmp_path, monkeypatch):
    opener = tmp_path / "xdg-open"
    opener.write_text(
        f"#!/bin/sh\ncp \"$1\" '{tmp_path}/part' && mv '{tmp_path}/part' '{tmp_path}/shown'\n"
    )
    opener.chmod(opener.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("DISPLAY", ":9")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    image.show()
    end = time.monotonic() + 60
    while not (tmp_path / "shown").exists() and time.monotonic() < end:
        time.sleep(0.01)
    assert (tmp_path / "shown").read_bytes() == image._repr_png_()


def test_without_a_display_it_says_what_to_do(image, tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(isowave.Error, match="there is no .* to show the picture: image.save"):
        image.show()
    assert not any(tmp_path.iterdir())


IN_NOTEBOOK = """
import sys, types
class Shell:
    kernel = object()
shown = []
ipython, display = types.ModuleType("IPython"), types.ModuleType("IPython.display")
ipython.get_ipython, display.display = Shell, shown.append
sys.modules |= {"IPython": ipython, "IPython.display": display}
import isowave
image = isowave.open("generate:sphere_8x8x8_uint8").render("auto", size=(16, 12), device="host")
image.show()
assert shown == [image]
"""


def test_in_a_notebook_it_is_the_cells_output():
    subprocess.run([sys.executable, "-c", IN_NOTEBOOK], check=True)


# Texts.


def test_everything_has_a_short_repr(volume, image):
    renderer = volume.renderer(size=SIZE, device="host")
    texts = {
        repr(volume): "Volume 20 x 25 x 30",
        repr(volume.levels[0]): "Level 0",
        repr(renderer): "Renderer 32 x 24, host",
        repr(renderer.device): "Device host",
        repr(image): "Image 32 x 24, isovalue 6",
        repr(volume.extract(6)): "Mesh ",
        repr(
            volume.scene().surface(6).surface(3).slice("z", 9)
        ): "Scene isovalue 6; isovalue 3; 1 sl",
        repr(volume.scene()): "Scene empty",
        repr(isowave.open_series(np.zeros((2, 4, 4, 4)))): "Series of 2 steps",
    }
    for text, begin in texts.items():
        assert text.startswith(f"<isowave.{begin}") and len(text) < 120, text
    for device in isowave.devices():
        assert repr(device).startswith(f"<isowave.Device {device['index']}: {device['name']} (")
        assert dict(device)["memory_bytes"] == device["memory_bytes"] and again(device) == device
    for name in isowave.__all__:
        made = getattr(isowave, name)
        if isinstance(made, type) and not issubclass(made, Exception):
            assert made.__repr__ is not object.__repr__, name


# Pickling.


def test_results_are_pickled(volume, image):
    loaded = again(image)
    for name in ("rgb", "rgba", "depth", "normals", "position"):
        assert getattr(loaded, name).tobytes() == getattr(image, name).tobytes(), name
    assert (loaded.camera, loaded.statistics) == (image.camera, image.statistics)
    assert loaded._fields == image._fields
    mesh = volume.extract(6)
    for field in dataclasses.fields(mesh):
        name = field.name
        assert np.array_equal(getattr(again(mesh), name), getattr(mesh, name)), name
    scene = volume.scene().surface(6, "red", 0.5).slice("z", 9).clip(isowave.ClipPlane((1, 0, 0)))
    loaded = again(scene)
    assert dataclasses.replace(loaded, volume=volume) == scene
    drawn = loaded.render(size=SIZE, device="host", camera=image.camera).rgb
    assert np.array_equal(drawn, scene.render(size=SIZE, device="host", camera=image.camera).rgb)


def test_series_are_pickled(tmp_path, monkeypatch):
    arrays = np.stack([sphere_voxels((8, 9, 10)) + t for t in range(4)])
    for t in range(4):
        isowave.compress(arrays[t]).save(tmp_path / f"s_{t}.zfp")
    np.save(tmp_path / "a.npy", arrays[0])
    monkeypatch.chdir(tmp_path)
    of_arrays = isowave.open_series(arrays, tolerance=0.5)
    pairs = [
        (isowave.open_series("s_*.zfp"), 2),
        (of_arrays, 1),
        (of_arrays[1::2], 1),
        (isowave.open_series(["a.npy"]), 0),
    ]
    pickled = [(pickle.dumps(series), series[step], step) for series, step in pairs]
    monkeypatch.chdir("/")
    for data, expected, step in pickled:
        loaded = pickle.loads(data)
        assert np.array_equal(loaded[step][...], expected[...])
    assert [*again(of_arrays).names] == ["step 0", "step 1", "step 2", "step 3"]


def test_what_cannot_be_pickled_says_what_can(volume):
    renderer = volume.renderer(size=SIZE, device="host")
    for way in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="pickle the volume, and call volume.renderer"):
            way(renderer)


def depth_of(volume):
    return volume.render(6, size=SIZE, device="host").depth


def fail(volume):
    volume.render(float("nan"), size=SIZE, device="host")


def test_other_processes_draw_and_raise(volume, image):
    spawn = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, spawn) as pool:
        assert np.array_equal(pool.submit(depth_of, volume).result(), image.depth)
        with pytest.raises(isowave.Error, match="NaN"):
            pool.submit(fail, volume).result()


# Other packages.


def test_a_mesh_of_trimesh_is_the_same():
    trimesh = pytest.importorskip("trimesh")
    mesh = isowave.compress(sphere_voxels()).extract(6)
    found = mesh.to_trimesh()
    assert isinstance(found, trimesh.Trimesh)
    assert np.array_equal(found.vertices, mesh.vertices)
    assert np.array_equal(found.faces, mesh.faces)
    assert np.allclose(found.vertex_normals, mesh.normals, atol=1e-6)
    assert found.is_watertight and found.is_winding_consistent
    # The field grows outwards: the mesh's outside is within the sphere.
    assert found.volume == pytest.approx(-4 / 3 * np.pi * 6**3, rel=0.02)
    bare = isowave.compress(sphere_voxels()).extract(6, normals=False).to_trimesh()
    assert len(bare.faces) == len(found.faces)


# Progress.


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_progress_within_a_frame(volume, device):
    """Passes that take long: ten times a second, no more."""
    told = []
    renderer = volume.renderer(size=(256, 192), device=device, rays=True)
    image = renderer.render(
        6,
        ambient_rays=4,
        on_pass=lambda so_far: time.sleep(0.12),
        progress=lambda what, done: told.append((what, done)),
    )
    assert {what for what, _ in told} == {"drawing"}
    parts = [done for _, done in told]
    assert 2 <= len(parts) <= 1000 and parts == sorted(parts)
    assert 0 < parts[0] < parts[-1] <= 1
    assert np.array_equal(image.rgb, renderer.render(6, ambient_rays=4).rgb)


def test_an_exception_of_progress_is_raised(volume):
    def broken(what, done):
        raise KeyError("my own")

    renderer = volume.renderer(size=SIZE, device="cpu", rays=True)
    with pytest.raises(KeyError, match="my own"):
        renderer.render(6, ambient_rays=2, on_pass=lambda p: time.sleep(0.12), progress=broken)
    assert renderer.render(6).complete
    with pytest.raises(TypeError, match="progress=5: give True or False"):
        renderer.render(6, progress=5)


class Bar:
    """Stands for tqdm's."""

    made: list = []

    def __init__(self, **options):
        self.options, self.n, self.closed = options, 0, False
        Bar.made.append(self)

    def update(self, more):
        assert more >= 0
        self.n += more

    def close(self):
        self.closed = True


def test_bars_wait_two_seconds_and_never_go_back():
    Bar.made.clear()
    told = TqdmProgress(Bar)
    for what, done in (("reading", 0.5), ("drawing", 0.25), ("drawing", 0.75), ("drawing", 0.5)):
        told(what, done)
    told.close()
    assert [(bar.options["desc"], bar.n, bar.closed) for bar in Bar.made] == [
        ("reading", 50, True),
        ("drawing", 75, True),
    ]
    assert all(bar.options["delay"] == _progress.QUIET_SECONDS == 2 for bar in Bar.made)


def test_without_a_terminal_there_is_no_bar(volume, monkeypatch):
    calls = []

    class Noted(TqdmProgress):
        def __init__(self, tqdm):
            super().__init__(tqdm)
            calls.append(self)

    monkeypatch.setattr(_progress, "TqdmProgress", Noted)
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)  # of a test of widgets
    volume.render(6, size=SIZE, device="host")
    assert not calls
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    pytest.importorskip("tqdm")
    volume.render(6, size=SIZE, device="host")
    assert len(calls) == 1
