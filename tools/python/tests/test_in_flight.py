"""What happens beside a frame at work: threads, exits, forks, calls from on_pass."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import sphere_voxels

import isowave

SIZE = (64, 48)
VOLUME = """
import sys, threading, time
import numpy as np, isowave
voxels = (np.random.default_rng(0).random((64, 64, 64)) * 255).astype(np.uint8)
volume = isowave.compress(voxels, exact=True)
def beside(work):
    threading.Thread(target=lambda: [work() for _ in range(999)], daemon=True).start()
    time.sleep(0.5)
"""
EXITS = {
    "draws": "beside(lambda: volume.render(100, size=(320, 240)))",
    "on_pass": """
r = volume.renderer(size=(800, 600), rays=True)
beside(lambda: r.render(100, ambient_rays=8, on_pass=lambda p: p.rgb is not None))
""",
    "on_pass_sleeps": """
r = volume.renderer(size=(320, 240))
beside(lambda: r.render(100, on_pass=lambda p: time.sleep(1.3)))
""",
    "passes": """
r = volume.renderer(size=(800, 600), rays=True)
g = r.passes(100, ambient_rays=8)
next(g)
""",
    "quick": "beside(lambda: volume.renderer(size=(640, 480), quick=True, bounds=True))",
    "compresses": "beside(lambda: isowave.compress(voxels, tolerance=0.5))",
    "extracts": "beside(lambda: volume.extract(100))",
    "casts": "rays = np.ones((9999, 6))\nbeside(lambda: volume.cast_rays(rays, 100))",
    "sys_exit": """
r = volume.renderer(size=(320, 240))
beside(lambda: volume.render(100))
r.render(100, on_pass=lambda p: sys.exit())
""",
}


def run(script):
    return subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=300
    )


@pytest.mark.parametrize("what", EXITS)
def test_python_ends_quietly_while_something_is_at_work(what):
    done = run(VOLUME + EXITS[what])
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


FORKED = """
import multiprocessing, os
renderer = volume.renderer(size=(64, 48))
renderer.render(100)
calls = {
    "renderer": lambda: renderer.render(100),
    "camera": lambda: renderer.camera(100),
    "another": lambda: volume.renderer(size=(64, 48)).render(100),
    "volume": lambda: volume.render(100, size=(64, 48)),
    "extract": lambda: volume.extract(100),
    "devices": lambda: isowave.devices(),
}
def work(name):
    try:
        return calls[name]() and "no error"
    except isowave.Error as error:
        return str(error)
def host():
    small = isowave.compress(voxels[:8, :8, :8], exact=True)
    return bool((volume[:] == voxels).all() and (small[:] == voxels[:8, :8, :8]).all())
with multiprocessing.get_context("fork").Pool(1) as pool:
    for name in calls:
        assert "'spawn'" in pool.apply_async(work, [name]).get(60), name
    assert pool.apply_async(host).get(60)
child = os.fork()
if child == 0:
    del renderer, volume
    sys.exit()
assert os.waitpid(child, 0)[1] == 0
"""


def test_forked_processes_get_an_error_at_once():
    done = run(VOLUME + FORKED)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.fixture(scope="module")
def volume():
    return isowave.compress(sphere_voxels(), tolerance=0.01)


def test_threads_look_at_a_frame_in_turns(volume):
    renderer = volume.renderer(size=SIZE, cache_blocks=16)
    expected = renderer.render(6).rgb
    wrong, late = [], []

    def look(progress):
        pictures = []
        threads = [threading.Thread(target=lambda: pictures.append(progress.rgb)) for _ in "four"]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        if len(pictures) != 4 or not all(np.array_equal(pictures[0], p) for p in pictures):
            wrong.append(progress.passes)

    def look_on(progress):
        """As long as the frame lasts, and longer."""
        try:
            while True:
                progress.rgb
        except isowave.Error as error:
            late.append(str(error))

    assert np.array_equal(renderer.render(6, on_pass=look).rgb, expected)
    assert not wrong
    threads = []

    def leave(progress):
        threads.append(threading.Thread(target=look_on, args=[progress]))
        threads[-1].start()

    assert np.array_equal(renderer.render(6, on_pass=leave).rgb, expected)
    for thread in threads:
        thread.join()
    assert len(late) == len(threads) > 1 and all("over" in text for text in late)


def test_a_renderer_is_not_used_in_its_own_on_pass(volume):
    renderer = volume.renderer(size=SIZE, rays=True)
    rays = np.ones((1, 6))
    volume.render(6, size=SIZE)
    host = isowave._core.host_renderer(volume._core, 0)
    calls = [
        (renderer, lambda: renderer.camera(6)),
        (renderer, lambda: renderer.render(6)),
        (renderer, lambda: renderer.cast_rays(rays, 6)),
        (volume, lambda: volume.render(6, size=SIZE)),
        (volume, lambda: volume.camera(6)),
        (volume, lambda: volume.cast_rays(rays, 6)),
        (volume, lambda: volume.verify(6)),
    ]
    for drawn, call in calls:
        with pytest.raises(isowave.Error, match="at work"):
            drawn.render(6, size=SIZE, on_pass=lambda progress: call() and None)
    for call in [c for drawn, c in calls if drawn is renderer]:
        with pytest.raises(isowave.Error, match="at work"):
            for _ in renderer.passes(6):
                call()
        assert call() is not None
    slow = volume.renderer(size=SIZE, cache_blocks=16)  # so that there are several passes
    first, second = slow.passes(6), slow.passes(7)
    next(first)
    with pytest.raises(isowave.Error, match="at work"):
        next(second)
    first.close()


def test_passes_may_be_dropped_by_any_thread(volume):
    renderer = volume.renderer(size=SIZE, cache_blocks=16)
    kept = [renderer.passes(6)]
    next(kept[0])
    thread = threading.Thread(target=kept.clear)
    thread.start()
    thread.join(60)
    assert not thread.is_alive() and renderer.render(6).complete


def test_the_call_alone_decides_whether_a_budget_is_enough():
    voxels = (np.random.default_rng(0).random((24, 25, 26)) * 255).astype(np.uint8)
    volume = isowave.compress(voxels, exact=True)
    budget = 100_000_000
    assert volume.render(100, size=SIZE, memory_budget=budget).complete
    for _ in range(2):
        with pytest.raises(isowave.Error, match="budget"):
            volume.render(100, size=SIZE, memory_budget=budget, ambient_rays=1)
        with pytest.raises(isowave.Error, match="budget"):
            volume.render(100, size=SIZE, memory_budget=1000)
    assert volume.render(100, size=SIZE, ambient_rays=1).complete
    assert volume.render(100, size=SIZE, memory_budget=budget).complete
    assert volume.cast_rays(np.ones((1, 6)), 100, device="cpu")["t_hit"].shape == (1,)


def test_no_rays_hit_nothing(volume):
    for shape in ((0, 6), (3, 0, 6)):
        for device in (None, "cpu"):
            found = volume.cast_rays(np.zeros(shape), 6, device=device)
            lead = shape[:-1]
            assert found["t_hit"].shape == lead and found["t_hit"].dtype == np.float32
            for name, dtype in (("normals", "f4"), ("position", "f4"), ("cell", "u4")):
                assert found[name].shape == (*lead, 3) and found[name].dtype == dtype


def test_hits_beyond_float32_are_an_error(volume):
    for device in (None, "cpu"):
        with pytest.raises(isowave.Error, match="ray 1 hits"):
            volume.cast_rays([[0, 0, 0, 1, 1, 1], [14, 12, -5, 0, 0, 1e-39]], 6, device=device)


def test_arguments_of_a_wrong_type_are_named(volume):
    voxels = np.arange(64, dtype=np.uint8).reshape(4, 4, 4)
    render, make = volume.render, volume.renderer
    cases = {
        "rate": [lambda v: isowave.compress(voxels, rate=v), -1, 8.0, "8", True],
        "exact": [lambda v: isowave.compress(voxels, exact=v), 1, "yes"],
        "levels": [lambda v: isowave.compress(voxels, levels=v), 2.5, -1],
        "tolerance": [lambda v: isowave.compress(voxels, tolerance=v), "1", 1j, True],
        "map_nan": [lambda v: isowave.compress(voxels, map_nan=v), "0"],
        "progress": [lambda v: isowave.compress(voxels, progress=v), 5],
        "samples": [lambda v: render(6, samples=v), -1, 1.5],
        "ambient_rays": [lambda v: render(6, ambient_rays=v), 2.5, -1],
        "isovalue": [lambda v: render(v), "6", None, b"6"],
        "size": [lambda v: render(6, size=v), 5, (64.5, 48), (1, 2, 3), (-1, 5)],
        "camera": [lambda v: render(6, camera=v), "front", 5],
        "outputs": [lambda v: render(6, size=SIZE, outputs=v), "rgb"],
        "max_surface_error": [lambda v: render(6, max_surface_error=v), "1"],
        "color": [lambda v: render(6, size=SIZE, color=v), 5, (1, 2), ("a", "b", "c")],
        "memory_budget": [lambda v: make(memory_budget=v), 1e9, 600.5, -1],
        "Renderer's levels": [lambda v: make(levels=v), 1, "no"],
        "on_pass": [lambda v: render(6, size=SIZE, on_pass=v), 5, lambda progress: "x"],
        "normals": [lambda v: volume.extract(6, normals=v), "smooth"],
    }
    for name, (call, *values) in cases.items():
        for value in values:
            with pytest.raises((TypeError, ValueError)) as raised:
                call(value)
            assert name.split()[-1] in str(raised.value), (name, value)
            assert "\n" not in str(raised.value)


def test_numbers_of_numpy_are_numbers(volume):
    voxels = np.arange(64, dtype=np.uint8).reshape(4, 4, 4)
    isowave.compress(voxels, exact=np.bool_(True), levels=np.int64(1))
    isowave.compress(voxels, rate=np.uint8(8), num_threads=np.int32(1))
    isowave.compress(voxels, tolerance=np.float32(0.5), spacing=np.ones(3, np.float32))
    renderer = volume.renderer(size=np.array(SIZE), rays=np.bool_(True), samples=np.int64(1))
    image = renderer.render(
        np.float32(6),
        size=np.array(SIZE),
        color=np.ones(3),
        ambient_rays=np.uint8(1),
        camera=isowave.Camera(np.zeros(3), np.ones(3), fovy=np.float32(60)),
        on_pass=lambda progress: np.bool_(False),
    )
    assert not image.complete


def test_paths_may_be_bytes(tmp_path, volume):
    volume.save(bytes(tmp_path / "a.zfp"))
    assert isowave.open(bytes(tmp_path / "a.zfp")).shape == volume.shape


def test_label_maps_of_simpleitk_are_refused():
    sitk = pytest.importorskip("SimpleITK")
    for dtype in (np.uint8, np.uint16, np.uint32):
        image = sitk.GetImageFromArray(np.ones((8, 8, 8), dtype))
        with pytest.raises(TypeError, match="label map"):
            isowave.compress(sitk.LabelImageToLabelMap(image), tolerance=1)


@pytest.mark.parametrize("work", ["quick=False", "quick=True", "extract"])
def test_ctrl_c_does_not_wait_until_all_kernels_are_compiled(tmp_path, work):
    """A renderer that is made, one that is waited for, a mesh. Few kernels are there then."""
    make = f"r = volume.renderer(size=(32, 24), device='cpu', bounds=True, {work})"
    script = f"""
import numpy as np, isowave
volume = isowave.compress(np.random.default_rng(0).random((9, 9, 9)).astype("f4"), tolerance=0.01)
print("begins", flush=True)
try:
    {"volume.extract(0.5, device='cpu')" if work == "extract" else f"{make}; r.wait()"}
except KeyboardInterrupt:
    print("stopped")
"""
    settings = {**os.environ, "POCL_CACHE_DIR": str(tmp_path), "OCL_ICD_VENDORS": "pocl.icd"}
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=settings, text=True) as process:
        assert process.stdout.readline() == "begins\n"
        for _ in range(600):
            if len([*tmp_path.rglob("*.so")]) > 1:
                break
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=300)[0] == "stopped\n"
        assert process.returncode == 0
    num_kernels = len([*tmp_path.rglob("*.so")])
    assert num_kernels < 8, num_kernels  # all are 20 or more
