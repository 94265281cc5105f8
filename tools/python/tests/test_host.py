"""What draws if no device is named: the host on a machine without a GPU."""

import os
import subprocess
import sys

import numpy as np
import pytest

import isowave
from conftest import FUEL, sphere_voxels

SIZE = (64, 48)


@pytest.fixture
def no_name(monkeypatch):
    """A machine without a GPU, and without a device that the user names."""
    if any(device["type"] in ("gpu", "accelerator") for device in isowave.devices()):
        pytest.skip("a GPU draws by default")
    monkeypatch.delenv("ISOWAVE_DEVICE", raising=False)


@pytest.fixture
def leveled():
    return isowave.compress(sphere_voxels((40, 40, 40)), tolerance=0.05, levels=2)


def on_host(renderer):
    return renderer.device["name"] == ""


def test_the_host_draws_by_default(no_name, leveled):
    renderer = leveled.renderer(size=SIZE)
    assert on_host(renderer) and renderer.ready and renderer.device["notice"] == ""
    assert repr(renderer) == "<isowave.Renderer 64 x 48, host>"
    assert renderer.memory_bytes > 0
    image = renderer.render(12)
    assert image.rgb.shape == (48, 64, 3), "the renderer's size"
    on_device = leveled.renderer(size=SIZE, device="cpu", levels=True, rays=True, bounds=True)
    assert not on_host(on_device)
    camera = on_device.camera(12)
    assert renderer.camera(12) == camera
    for more in ({}, {"voxel_pixels": 3}, {"ambient_rays": 3}, {"outputs": ("bounds", "depth")}):
        got, expected = renderer.render(12, **more), on_device.render(12, **more)
        for name in ("rgb", "depth", "bounds"):
            np.testing.assert_array_equal(getattr(got, name), getattr(expected, name))


def test_the_users_size_counts_on_the_host(no_name, leveled):
    assert leveled.render(12, size=(50, 40)).rgb.shape == (40, 50, 3)
    first = leveled._renderer
    assert on_host(first)
    assert leveled.render(12, size=(1500, 1000), ambient_rays=1).rgb.shape == (1000, 1500, 3)
    assert leveled._renderer is first, "it is not made anew for more rays, nor for ambient ones"
    camera = leveled.camera(12, size=(100, 300))
    assert camera == leveled.camera(12, size=(100, 300), device="cpu")
    hits = leveled.cast_rays([[20, 20, -50, 0, 0, 1]], 12)
    assert np.isfinite(hits["t_hit"]).all() and leveled._host is first


def test_a_device_can_be_named(no_name, leveled, monkeypatch):
    assert not on_host(leveled.renderer(size=SIZE, device="cpu"))
    monkeypatch.setenv("ISOWAVE_DEVICE", "cpu")
    assert not on_host(leveled.renderer(size=SIZE))
    assert on_host(leveled.renderer(size=SIZE, device="host"))
    monkeypatch.setenv("ISOWAVE_DEVICE", "host")
    assert on_host(leveled.renderer(size=SIZE))
    leveled.render(12, size=SIZE)
    assert on_host(leveled._renderer)


def test_options_of_devices_take_one(no_name, leveled):
    assert not on_host(leveled.renderer(size=SIZE, cache_blocks=64))
    renderer = leveled.renderer(size=SIZE, profiling=True)
    assert renderer.render(12).statistics["stage_ms"]
    with pytest.raises(isowave.Error, match="cache_blocks is for devices alone"):
        leveled.renderer(size=SIZE, cache_blocks=64, device="host")
    with pytest.raises(isowave.Error, match="profiling is for devices alone"):
        leveled.renderer(size=SIZE, profiling=True, device="host")
    with pytest.raises(isowave.Error, match="raise the limit"):
        leveled.renderer(size=SIZE, memory_budget=1000, device="host")
    assert on_host(leveled.renderer(size=SIZE, memory_budget=10_000_000))


def test_verify_compares_a_device(no_name, leveled, monkeypatch):
    assert leveled.verify(12, size=SIZE)["equal"]
    assert not on_host(leveled._renderer)
    with pytest.raises(isowave.Error, match="name a device"):
        leveled.verify(12, device="host")
    monkeypatch.setenv("ISOWAVE_DEVICE", "host")
    assert len(leveled.extract(12).faces) > 0


def test_without_opencl_the_host_draws(tmp_path):
    script = f"""
import isowave
assert isowave.devices() == []
image = isowave.open({str(FUEL)!r}, exact=True).render(10, size={SIZE})
image.save({str(tmp_path / "host.png")!r})
isowave.open({str(FUEL)!r}, exact=True).extract(10).save({str(tmp_path / "host.ply")!r})
"""
    hidden = {"OCL_ICD_VENDORS": "/nonexistent"}
    environment = {k: v for k, v in os.environ.items() if k != "ISOWAVE_DEVICE"} | hidden
    subprocess.run([sys.executable, "-W", "ignore", "-c", script], env=environment, check=True)
    expected = isowave.open(FUEL, exact=True).render(10, size=SIZE, device="cpu")
    expected.save(tmp_path / "device.png")
    assert (tmp_path / "host.png").read_bytes() == (tmp_path / "device.png").read_bytes()
    isowave.open(FUEL, exact=True).extract(10, device="cpu").save(tmp_path / "device.ply")
    assert (tmp_path / "host.ply").read_bytes() == (tmp_path / "device.ply").read_bytes()
