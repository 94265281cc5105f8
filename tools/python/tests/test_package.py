"""The package on a device: volumes, renderers, pictures; the program's bits."""

import ast
import gc
import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import zlib

import numpy as np
import pytest
from conftest import FUEL, TOP, sphere_voxels

import isowave
from isowave._renderer import host_renderer
from isowave._request import Request


SIZE = (64, 48)


@pytest.fixture(scope="module")
def renderer(volume):
    return volume.renderer(size=SIZE)


def test_picture_has_the_programs_bits(program, tmp_path):
    image = isowave.open(FUEL, exact=True).render(10, size=(320, 240))
    image.save(tmp_path / "package.png")
    program("render", FUEL, "-i", 10, "--exact", "--size", "320x240", "-o", tmp_path / "a.png",
            "--depth", tmp_path / "a.npy")  # fmt: skip
    assert (tmp_path / "package.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    assert image._repr_png_() == (tmp_path / "a.png").read_bytes()
    depth = np.load(tmp_path / "a.npy")
    assert np.array_equal(image.depth, depth)


def test_saved_files_keep_the_mode_of_what_they_replace(tmp_path):
    volume = isowave.open(FUEL, exact=True)
    image = volume.render(10, size=SIZE)
    saves = {"a.png": image.save, "a.zfp": volume.save, "a.ply": volume.extract(10).save}
    for name, save in saves.items():
        (tmp_path / name).touch(mode=0o600)
        save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 0
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o600
    with pytest.raises(isowave.Error, match="pictures are written as PNG"):
        image.save(tmp_path / "a.jpg")
    assert not (tmp_path / "a.jpg").exists()


def test_orbit_is_the_programs(program, tmp_path):
    volume = isowave.open(FUEL, exact=True)
    program("render", FUEL, "-i", 10, "--exact", "--size", "64x48", "--orbit", 3, "-o",
            tmp_path / "a.png", "--depth", tmp_path / "a.npy")  # fmt: skip
    for i, camera in enumerate(isowave.Camera.orbit(volume, 3)):
        image = volume.render(10, size=SIZE, camera=camera)
        files = sorted(tmp_path.glob("a*.npy"))
        assert len(files) == 3
        assert np.allclose(image.depth, np.load(files[i]), rtol=1e-5)


def test_axes(renderer):
    """The sphere is a ball of index space: in the world its extents are those of the spacing."""
    radius = 6.0
    image = renderer.render(radius)
    hit = np.isfinite(image.depth)
    assert hit.sum() > 50
    assert image.rgb.shape == (48, 64, 3) and image.rgb.dtype == np.uint8
    assert image.rgba.shape == (48, 64, 4)
    assert np.array_equal(image.rgba[..., 3] == 255, hit)
    assert np.isnan(image.position[~hit]).all() and (image.normals[~hit] == 0).all()
    volume = renderer.volume
    middle = np.array(volume.origin) + np.array(volume.spacing) * (np.array(volume.shape) - 1) / 2
    index = (image.position[hit][:, ::-1] - middle) / volume.spacing  # (z, y, x)
    assert np.allclose(np.linalg.norm(index, axis=1), radius, atol=0.2)
    # Positions are as far from the eye as depth says.
    away = np.linalg.norm(image.position[hit] - image.camera.eye, axis=1)
    assert np.allclose(away, image.depth[hit], rtol=1e-5)
    # The field grows outwards, so normals point inwards.
    assert np.allclose(np.linalg.norm(image.normals[hit], axis=1), 1, atol=1e-5)
    inwards = -(index / volume.spacing)[:, ::-1]
    inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
    assert (np.sum(inwards * image.normals[hit], axis=1) > 0.9).all()


def test_rgba_is_the_surfaces_colour_without_a_fringe(renderer):
    """Laid over a background, it is the picture drawn with that background."""
    big = renderer.volume.renderer(size=SIZE, samples=3)
    black, white = (big.render(6, samples=3, background=b) for b in ("#000000", "#ffffff"))
    assert np.array_equal(big.render(6, samples=3).rgba, white.rgba)
    alpha = white.rgba[..., 3:] / 255
    assert ((alpha > 0) & (alpha < 1)).sum() > 30
    for image in (black, white):
        for other, behind in ((black, 0), (white, 255)):
            laid_over = alpha * image.rgba[..., :3] + (1 - alpha) * behind
            # rounded: the picture, the colour that is divided by alpha, and alpha
            assert np.abs(laid_over - other.rgb).max() <= 1.5
    one = renderer.render(6)
    assert np.array_equal(one.rgba[..., :3], one.rgb)
    opaque = renderer.render(6, outputs=("rgb",)).rgba
    assert np.array_equal(opaque[..., :3], one.rgb) and (opaque[..., 3] == 255).all()


def test_pictures_are_saved_with_alpha(renderer, tmp_path):
    PIL = pytest.importorskip("PIL.Image", reason="pillow is not installed")
    image = renderer.render(6)
    image.save(tmp_path / "a.png", alpha=True)
    image.save(tmp_path / "b.png")
    assert np.array_equal(np.asarray(PIL.open(tmp_path / "a.png")), image.rgba)
    assert np.array_equal(np.asarray(PIL.open(tmp_path / "b.png")), image.rgb)
    with pytest.raises(TypeError, match="alpha='yes': give True or False"):
        image.save(tmp_path / "c.png", alpha="yes")


def test_names_of_other_formats_are_refused(volume, renderer, tmp_path):
    saves = {"a.tif": renderer.render(6).save, "a.nrrd": volume.save}
    for name, save in saves.items():
        with pytest.raises(isowave.Error, match=name) as raised:
            save(tmp_path / name)
        assert "\n" not in str(raised.value) and not (tmp_path / name).exists()


def test_renderers_say_what_they_are(renderer):
    assert repr(renderer).startswith("<isowave.Renderer 64 x 48, ")
    assert renderer.device["name"] in repr(renderer)


@pytest.mark.parametrize("outputs", ["rgb", None, 5, [5], ("rgb", None)])
def test_outputs_are_names(volume, renderer, outputs):
    for render in (volume.render, renderer.render):
        with pytest.raises(TypeError, match="outputs=.*: give a sequence of names, such as"):
            render(6, size=SIZE, outputs=outputs)


@pytest.mark.parametrize(
    "call, error, text",
    [
        (lambda v: isowave.Camera.orbit(v, "3"), TypeError, "count='3': give a whole number"),
        (lambda v: v.histogram("3"), TypeError, "bins='3': give a whole number"),
        (lambda v: v.cast_rays("abc", 6), TypeError, "rays='abc': give numbers"),
        (lambda v: isowave.compress(v, rate=8, direction="abc"), ValueError, "need 3 rows"),
        (lambda v: v.render("6", size=SIZE), TypeError, "isovalue='6': give a number"),
        (lambda v: v.render(6, size=64), TypeError, "size=64: give width and height"),
        (lambda v: v.render(6, camera=((0, 0, 1),)), TypeError, "give an isowave.Camera"),
        (lambda v: isowave.compress(v, tolerance="0.1"), TypeError, "tolerance='0.1': give a nu"),
    ],
)
def test_arguments_of_a_wrong_type_are_named(volume, call, error, text):
    with pytest.raises(error, match=text) as raised:
        call(volume)
    assert "\n" not in str(raised.value)


def test_direction_turns_the_world():
    turned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]], float)
    volume = isowave.compress(sphere_voxels(), rate=16, spacing=(3, 2, 1), direction=turned)
    assert np.array_equal(volume.direction, turned)
    image = volume.render(6, size=SIZE)
    hit = np.isfinite(image.depth)
    middle = turned @ (np.array([1, 2, 3]) * (np.array([30, 25, 20]) - 1) / 2)
    index = np.linalg.solve(turned * [1, 2, 3], (image.position[hit] - middle).T)
    assert np.allclose(np.linalg.norm(index, axis=0), 6, atol=0.2)


def test_rays_of_any_origin(volume):
    """Those of a camera's pixels hit what its picture has; the result has the rays' axes."""
    camera = volume.camera(6, size=SIZE)
    image = volume.render(6, size=SIZE, camera=camera)
    hit = np.isfinite(image.depth)
    towards = np.where(hit[..., None], image.position - camera.eye, (0, 0, 1)).astype(float)
    rays = np.concatenate([np.broadcast_to(camera.eye, towards.shape), towards], axis=-1)
    found = volume.cast_rays(rays, 6)
    assert found["t_hit"].shape == hit.shape and found["cell"].shape == (*hit.shape, 3)
    # The direction is as long as the way to the hit. Float32 positions move grazing rays.
    assert np.abs(found["t_hit"][hit] - 1).max() < 0.05
    assert np.median(np.abs(found["t_hit"][hit] - 1)) < 1e-5
    index = (found["position"][hit][:, ::-1] - volume.origin) / volume.spacing
    assert (np.abs(index - found["cell"][hit] - 0.5) <= 0.5001).all()
    one = volume.cast_rays(rays[24, 32], 6)
    assert one["t_hit"].shape == () and one["normals"].shape == (3,)
    away = volume.cast_rays([[*camera.eye, *(np.array(camera.eye) - camera.at)]], 6)
    assert np.isinf(away["t_hit"]).all() and np.isnan(away["position"]).all()
    for device in (None, "cpu"):
        again = volume.cast_rays(rays, 6, device=device)
        for name, values in found.items():
            assert np.array_equal(again[name], values, equal_nan=name == "position")
        for bad in ([1, 2, 3], np.zeros((2, 6)), [[0, 0, 0, np.nan, 0, 1]]):
            with pytest.raises((ValueError, isowave.Error)) as raised:
                volume.cast_rays(bad, 6, device=device)
            assert "\n" not in str(raised.value)


def test_ambient_rays_darken_what_sees_little_of_the_sky():
    """The inside of a hollow ball, the same on host and device; depth stays."""
    z, y, x = np.indices((30, 28, 26))
    shell = np.abs(np.sqrt((z - 14.5) ** 2 + (y - 13.5) ** 2 + (x - 12.5) ** 2) - 9)
    hollow = isowave.compress(10 - shell, rate=16)
    camera = isowave.Camera((12.5, 13.5, 14.5), (13.5, 13.5, 14.5))
    plain = hollow.render(9, size=SIZE, camera=camera)
    renderer = hollow.renderer(size=SIZE, rays=True)
    dark = renderer.render(9, camera=camera, ambient_rays=8)
    assert np.array_equal(dark.depth, plain.depth)
    assert (dark.rgb < plain.rgb).all(), "none of the sky is seen from within"
    assert dark.statistics["ambient_passes"] >= 8
    assert np.array_equal(hollow.render(9, size=SIZE, camera=camera, ambient_rays=8).rgb, dark.rgb)
    outside = hollow.camera(9, size=SIZE)
    plain, lit = (renderer.render(9, camera=outside, ambient_rays=n) for n in (0, 8))
    assert np.array_equal(lit.rgb, plain.rgb), "a ball from outside sees all of the sky"
    last = [image.rgb for image in renderer.passes(9, camera=camera, ambient_rays=3)][-1]
    assert np.array_equal(last, renderer.render(9, camera=camera, ambient_rays=3).rgb)
    with pytest.raises(isowave.Error, match="rays=True"):
        hollow.renderer(size=SIZE).render(9, ambient_rays=1)
    with pytest.raises(isowave.Error, match="256 ambient rays of a hit are too many"):
        renderer.render(9, ambient_rays=256)


def test_device_and_host_draw_the_same_bits(volume):
    said = volume.verify(6, size=SIZE)
    assert said["equal"] and said["hits"] > 50


def test_the_host_draws_all_that_a_device_draws():
    options = (
        {"voxel_pixels": 2.0},
        {"max_surface_error": 1.0},
        {"time_budget_ms": 1e6},
        {"ambient_rays": 2},
    )
    options += ({"max_surface_error": 1.0, "by": "sample"},)
    finer = isowave.compress(sphere_voxels(), tolerance=0.01, levels=3)
    needed = {"levels": True, "bounds": True, "time_budget": True, "rays": True}
    on_device, on_host = finer.renderer(size=SIZE, **needed), host_renderer(finer)
    camera = on_device.camera(6)
    for option in options:
        request = Request(6, camera, SIZE, outputs=("rgb", "depth"), **option)
        expected, got = on_device.draw(request), on_host.draw(request)
        assert np.array_equal(got.rgb, expected.rgb), option
        assert np.array_equal(got.depth, expected.depth), option
    bounds = [r.draw(Request(6, camera, SIZE, outputs=("bounds",))) for r in (on_device, on_host)]
    assert np.array_equal(bounds[0].bounds, bounds[1].bounds)


def test_normals_are_smooth_unless_asked(renderer):
    smooth, cell = renderer.render(6), renderer.render(6, normals="cell")
    assert np.array_equal(smooth.depth, cell.depth)
    assert not np.array_equal(smooth.normals, cell.normals)
    with pytest.raises(ValueError, match="smooth"):
        renderer.render(6, normals="flat")


COLD = """
import numpy as np
import isowave
volume = isowave.compress(np.indices((32, 32, 32)).sum(axis=0).astype(np.float32), rate=16)
renderer = volume.renderer(size=(64, 48), device="cpu", quick=True)
rgb = renderer.render(40).rgb
print(renderer.ready, rgb.std() > 10, flush=True)
"""


def test_host_draws_while_kernels_are_compiled(tmp_path):
    environment = {**os.environ, "POCL_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", COLD], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "False True\n"


def test_a_quick_renderer_becomes_the_devices(volume, renderer):
    quick = volume.renderer(size=SIZE, quick=True)
    first = quick.render(6)
    quick.wait()
    assert quick.ready and quick.memory_bytes > 0
    for image in (first, quick.render(6), renderer.render(6)):
        assert np.array_equal(image.rgb, first.rgb) and np.array_equal(image.depth, first.depth)


def test_arrays_are_the_renderers_memory_and_stay(volume):
    """They are not copied. Kept arrays do not change; the memory of others is used again."""
    renderer = volume.renderer(size=SIZE)
    camera = renderer.camera(6)
    views = [isowave.Camera(camera.eye[::-1], camera.at), camera]
    kept = [renderer.render(6, camera=view) for view in 6 * views]
    copies = [(image.rgb.copy(), image.depth.copy()) for image in kept]
    for image, (rgb, depth) in zip(kept, copies):
        for array in (image.rgb, image.depth, image.normals):
            assert not array.flags.owndata and array.flags.writeable
        assert np.array_equal(image.rgb, rgb) and np.array_equal(image.depth, depth)
    assert not np.array_equal(copies[0][0], copies[1][0])
    assert image.statistics["total_ms"] >= image.statistics["hits_ms"] > 0
    addresses = {image.rgb.ctypes.data for image in kept}
    assert len(addresses) == len(kept)
    last = kept[-1].rgb
    del kept, image
    gc.collect()
    assert renderer.render(6).rgb.ctypes.data in addresses - {last.ctypes.data}
    del renderer
    gc.collect()
    assert np.array_equal(last, copies[-1][0])


def test_passes_end_with_the_finished_picture(volume):
    renderer = volume.renderer(size=SIZE, cache_blocks=16)
    whole = renderer.render(6)
    pictures = list(renderer.passes(6))
    assert len(pictures) > 2
    assert not any(picture.complete for picture in pictures[:-1])
    assert pictures[-1].complete and np.array_equal(pictures[-1].rgb, whole.rgb)
    assert np.array_equal(pictures[-1].depth, whole.depth)
    for picture in renderer.passes(6):
        assert picture.statistics["passes"] == 1
        break  # the frame ends here
    assert np.array_equal(renderer.render(6).rgb, whole.rgb)


def test_on_pass_stops_and_raises(volume):
    renderer = volume.renderer(size=SIZE, cache_blocks=16)
    kept = []

    def stop(progress):
        kept.append(progress)
        return progress.passes < 2

    image = renderer.render(6, on_pass=stop)
    assert not image.complete and image.statistics["cancelled"]
    with pytest.raises(isowave.Error, match="over"):
        kept[0].rgb

    def fail(progress):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        renderer.render(6, on_pass=fail)
    assert renderer.render(6).complete


def test_bounds_of_files_rest_on_what_they_state(tmp_path):
    measured = isowave.compress(sphere_voxels((20, 22, 24)), tolerance=0.001)
    measured.save(tmp_path / "a.zfp")
    stated = isowave.open(tmp_path / "a.zfp")
    assert not measured.errors_are_stated and stated.errors_are_stated
    for volume in (measured, stated):
        image = volume.render(5, size=SIZE, outputs=("depth", "bounds"))
        assert image.statistics["errors_are_stated"] == volume.errors_are_stated


def test_ranges_that_blocks_leave_give_no_bounds(tmp_path):
    path = tmp_path / "a.zfp"
    isowave.compress(sphere_voxels((20, 22, 24)), tolerance=0.001).save(path)
    data = path.read_bytes()
    version, text_bytes, crc = struct.unpack("<3I", data[-24:-12])
    before, text = data[: -24 - text_bytes], data[-24 - text_bytes : -24]
    trailer = json.loads(text)
    trailer["value_range"][1] *= 0.75
    text = json.dumps(trailer).encode()
    numbers = struct.pack("<3I", version, len(text), crc)
    check = struct.pack("<I", zlib.crc32(text + numbers))
    path.write_bytes(before + text + numbers + check + b"ISOWAVE\n")
    volume = isowave.open(path)
    volume.render(5, size=SIZE)
    with pytest.raises(isowave.Error, match="its trailer says that values are"):
        volume.render(5, size=SIZE, outputs=("depth", "bounds"))


def test_errors_are_kept_and_bounds_given():
    volume = isowave.compress(sphere_voxels((40, 44, 48)), tolerance=0.001, levels=2)
    image = volume.render(10, size=SIZE, max_surface_error=0.5, outputs=("rgb", "depth", "bounds"))
    assert image.statistics["detail"]["reachable"]
    hit = np.isfinite(image.depth)
    assert np.isfinite(image.bounds[hit]).mean() > 0.5
    assert image.normals is None
    timed = volume.render(10, size=SIZE, time_budget_ms=1e6)
    assert timed.complete
    shapes = []

    def stop(progress):
        shapes.append(progress.rgb.shape)
        return False

    # The first picture of an isovalue is small.
    stopped = volume.render(11, size=SIZE, time_budget_ms=1e6, on_pass=stop)
    assert shapes == [(6, 8, 3)] and not stopped.complete
    assert stopped.rgb.shape == (48, 64, 3)


def test_an_error_is_kept_by_sample():
    volume = isowave.compress(sphere_voxels((40, 44, 48)), tolerance=0.001, levels=0)
    view = volume.camera(10, size=SIZE)
    image = volume.render(
        10, camera=view, size=SIZE, max_surface_error=1.0, by="sample", device="host"
    )
    detail = image.statistics["detail"]
    assert detail["reachable"] and 0.99 <= detail["lowest_share"] <= 1
    assert 299 <= detail["within"] <= detail["sampled_hits"] <= detail["sampled_rays"] == 64 * 48
    with pytest.raises(isowave.Error, match="give max_surface_error"):
        volume.render(10, size=SIZE, by="sample")
    series = isowave.Camera.orbit(volume, 3)
    renderer = volume.renderer(size=SIZE, levels=True, device="host")
    shared = [
        renderer.render(10, camera=camera, series=series, max_surface_error=1.0, by="sample")
        for camera in series
    ]
    first, *others = (each.statistics["detail"] for each in shared)
    assert others == [first, first]
    with pytest.raises(isowave.Error, match="give max_surface_error"):
        renderer.render(10, series=series)


def test_an_error_of_the_picture_is_kept():
    volume = isowave.compress(sphere_voxels((40, 44, 48)), tolerance=0.001, levels=0)
    image = volume.render(10, size=SIZE, samples=4, max_image_error=0.05)
    detail = image.statistics["detail"]
    samples = detail["samples"]
    assert detail["reachable"] and 1 <= samples <= 4 and detail["tiles"] >= 12
    assert 0 < detail["flip"] <= detail["highest_flip"] <= 0.05
    assert image.rgb.shape == (48, 64, 3)
    assert image.depth.shape == (48 * samples, 64 * samples)
    assert image.rgba.shape == (48, 64, 4)
    chosen = {"samples": samples, "voxel_pixels": detail["voxel_pixels"]}
    assert np.array_equal(volume.render(10, size=SIZE, **chosen).rgb, image.rgb)
    beyond = volume.render(10, size=SIZE, max_image_error=1e-6).statistics["detail"]
    assert not beyond["reachable"] and "up to 8 x 8" in beyond["advice"]
    for argument in ({"max_surface_error": 1.0}, {"time_budget_ms": 1000}, {"voxel_pixels": 1.0}):
        with pytest.raises(isowave.Error):
            volume.render(10, size=SIZE, max_image_error=0.05, **argument)


def test_bad_requests_are_one_line(volume, renderer):
    cases = [
        lambda: renderer.render(float("nan")),
        lambda: renderer.render(6, size=(640, 480)),
        lambda: renderer.render(6, max_surface_error=1.0),
        lambda: renderer.render(6, time_budget_ms=1000),
        lambda: renderer.render(6, voxel_pixels=1.0),
        lambda: renderer.render(6, outputs=("rgb", "alpha")),
        lambda: renderer.render(6, color="reddish"),
        lambda: renderer.render(6, color=(1, 2, 3)),
        lambda: renderer.render(6, camera=isowave.Camera((0, 0, 0), (0, 0, 0))),
        lambda: volume.renderer(device="no such device"),
        lambda: volume.renderer(memory_budget=1000),
        lambda: volume.decode(1),
        lambda: isowave.open("missing.nrrd"),
        lambda: isowave.compress(np.zeros((4, 4))),
        lambda: isowave.compress(np.zeros((4, 4, 4)), rate=33),
        lambda: isowave.compress(np.zeros((4, 4, 4)), rate=4, exact=True),
        lambda: isowave.compress(np.full((4, 4, 4), np.inf)),
    ]
    for case in cases:
        with pytest.raises((isowave.Error, ValueError, TypeError)) as raised:
            case()
        assert str(raised.value) and "\n" not in str(raised.value)
    assert renderer.render(6).complete


def test_kept_renderer_grows_with_what_is_asked(volume):
    small = volume.render(6, size=SIZE)
    large = volume.render(6, size=(1600, 900))
    assert large.rgb.shape == (900, 1600, 3)
    again = volume.render(6, size=SIZE, samples=2)
    assert again.depth.shape == (96, 128) and again.rgba.shape == (48, 64, 4)
    assert np.array_equal(volume.render(6, size=SIZE).rgb, small.rgb)


def test_threads_share_a_renderer(volume):
    renderer = volume.renderer(size=SIZE)
    expected = {isovalue: renderer.render(isovalue).rgb for isovalue in (5, 7)}
    wrong, stop = [], threading.Event()

    def draw(isovalue):
        for _ in range(8):
            image = renderer.render(isovalue, on_pass=lambda progress: True)
            if not np.array_equal(image.rgb, expected[isovalue]):
                wrong.append(isovalue)

    def churn():  # makes and drops renderers and collects garbage meanwhile
        while not stop.is_set():
            volume.renderer(size=(16, 16)).render(6)
            gc.collect()

    threads = [threading.Thread(target=draw, args=(isovalue,)) for isovalue in (5, 7, 5, 7)]
    churning = threading.Thread(target=churn)
    churning.start()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    stop.set()
    churning.join()
    assert not wrong


INTERRUPTED = """
import numpy as np, sys, isowave
voxels = np.random.default_rng(0).random((64, 64, 64), np.float32)
if sys.argv[1] == "compress":
    voxels = np.random.default_rng(0).random((512, 256, 256), np.float32)
    work = lambda: isowave.compress(voxels, tolerance=1e-4, num_threads=1)
else:
    volume = isowave.compress(voxels, rate=16)
    renderer = volume.renderer(size=(640, 480), cache_blocks=8, device="cpu")
    work = lambda: renderer.render(0.5)
print("ready", flush=True)
try:
    while True:
        work()
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


@pytest.mark.parametrize("what", ["compress", "render"])
def test_ctrl_c_stops(what):
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, what], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=120)
    assert out == "stopped\n"


def test_what_a_device_computes_differently_is_a_warning(volume, renderer, monkeypatch):
    assert renderer.device["notice"] == ""

    class OfAnotherDevice:
        device = {"name": "x", "notice": "device 'x' computes division differently"}

    monkeypatch.setattr(isowave._core, "make_renderer", lambda *arguments: OfAnotherDevice())
    with pytest.warns(RuntimeWarning, match="'x' computes division differently"):
        volume.renderer(size=SIZE)


def test_report_names_devices_and_loader():
    text = str(isowave.Report())
    assert isowave.__version__ in text and "OpenCL loader" in text
    for device in isowave.devices():
        assert device["name"] in text
        assert {"index", "name", "vendor", "platform", "driver", "type", "memory_bytes"} == set(
            device
        )


def test_stubs_name_what_the_compiled_part_has():
    """nanobind's functions show no signatures, so names are all that can be compared."""
    from isowave import _core

    def names(body):
        found = {node.name for node in body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
        return {name for name in found if not name.startswith("_")}

    stub = ast.parse((TOP / "tools/python/isowave/_core.pyi").read_text())
    assert names(stub.body) == {name for name in dir(_core) if not name.startswith("_")}
    for node in stub.body:
        if isinstance(node, ast.ClassDef) and node.name != "Error":
            members = {name for name in dir(getattr(_core, node.name)) if not name.startswith("_")}
            assert names(node.body) == members, node.name


def test_command_is_the_program():
    command = os.path.join(os.path.dirname(sys.executable), "isowave")
    version = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert isowave.__version__ in version.stdout
    failed = subprocess.run([command, "info", "missing.zfp"], capture_output=True, text=True)
    assert failed.returncode == 1 and failed.stderr.count("\n") == 1


def test_command_ends_quietly_when_its_reader_does():
    command = os.path.join(os.path.dirname(sys.executable), "isowave")
    with subprocess.Popen([command, "man"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        run.stdout.close()
        assert run.stderr.read() == b""
    assert run.returncode == -signal.SIGPIPE
