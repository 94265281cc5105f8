"""Series of volumes, turntables and movies."""

import itertools
import pathlib
import resource
import subprocess
import threading

import numpy as np
import pytest
from conftest import FUEL, sphere_voxels

import isowave

SIZE = (64, 48)


def nrrd(path, array, more=""):
    """A file of uint8 voxels, whose axes are those of the array in reverse."""
    sizes = " ".join(str(n) for n in reversed(array.shape))
    header = f"NRRD0004\ntype: uint8\nencoding: raw\ndimension: {array.ndim}\nsizes: {sizes}\n"
    path.write_bytes(f"{header}{more}\n".encode() + array.astype(np.uint8).tobytes())


def steps_of(count):
    """(t, z, y, x): a ball that shrinks, away from the middle of the box."""
    ball = np.roll(sphere_voxels((12, 14, 16)), 2, axis=2)
    return np.stack([np.clip(100 - 8 * ball - 3 * t, 0, 255) for t in range(count)]).astype(
        np.uint8
    )


@pytest.fixture
def folder(tmp_path):
    for t, array in enumerate(steps_of(12)):
        nrrd(tmp_path / f"s_{t}.nrrd", array)
    return tmp_path


def same(volume, array):
    return np.array_equal(volume[...], array.astype(np.float32))


def test_patterns_lists_and_arrays_are_the_same_series(folder):
    arrays = steps_of(12)
    nrrd(folder / "all.nrrd", arrays)
    listed = [folder / f"s_{t}.nrrd" for t in range(12)]
    for source in (folder / "s_*.nrrd", str(folder / "s_*.nrrd"), listed, folder / "all.nrrd",
                   arrays, list(map(str, listed))):  # fmt: skip
        series = isowave.open_series(source)
        assert len(series) == 12
        assert repr(series) == "<isowave.Series of 12 steps>"
        assert all(same(series[t], arrays[t]) for t in (11, 2, 0))
        assert same(series[-1], arrays[11])
        assert [same(v, a) for v, a in zip(series, arrays, strict=True)] == [True] * 12
        part = series[10:2:-4]
        assert len(part) == 2 and same(part[1], arrays[6])
        assert [same(v, arrays[t]) for v, t in zip(part, (10, 6), strict=True)] == [True] * 2
    assert pathlib.Path(isowave.open_series(folder / "s_*.nrrd").names[10]).name == "s_10.nrrd"
    assert isowave.open_series(folder / "all.nrrd").names[3].endswith("all.nrrd, step 3")
    backwards = isowave.open_series(listed[::-1])
    assert same(backwards[0], arrays[11])
    assert len(isowave.open_series(FUEL)) == 1


def test_options_are_those_of_compress_and_open(folder):
    arrays = steps_of(3)
    series = isowave.open_series(arrays, tolerance=4, spacing=(3, 2, 1), origin=(1, 2, 3))
    assert series[1].spacing == (3, 2, 1) and series[1].origin == (1, 2, 3)
    assert 0 < series[1].max_error <= 4
    assert series[1].compression == isowave.compress(arrays[1], tolerance=4).compression
    of_files = isowave.open_series(folder / "s_?.nrrd", rate=8, spacing=(3, 2, 1))
    assert of_files[1].spacing == (3, 2, 1) and of_files[1].bits_per_voxel == 8
    series[0].save(folder / "z_0.zfp")
    series[1].save(folder / "z_1.zfp")
    saved = isowave.open_series(folder / "z_*.zfp")
    assert np.array_equal(saved[1][...], series[1][...])
    with pytest.raises(isowave.Error, match="compressed already"):
        isowave.open_series(folder / "z_*.zfp", rate=8)


def test_iteration_prepares_the_next_step_in_a_thread():
    opened = []
    at_work = threading.Event()
    go_on = threading.Event()

    def load(step):
        opened.append((step, threading.current_thread() is threading.main_thread()))
        if step == 1:
            at_work.set()
            assert go_on.wait(60)
        return isowave.compress(steps_of(3)[step])

    series = isowave.Series(["a", "b", "c"], load)
    volumes = iter(series)
    first = next(volumes)  # while the second is being read
    assert at_work.wait(60)
    assert same(first, steps_of(3)[0])
    go_on.set()
    assert same(next(volumes), steps_of(3)[1])
    assert same(next(volumes), steps_of(3)[2])
    with pytest.raises(StopIteration):
        next(volumes)
    assert [step for step, _ in opened] == [0, 1, 2], "each is opened once"
    assert not opened[1][1] and not opened[2][1], "by a thread"


def test_a_step_that_fails_is_told_when_it_is_due(folder):
    bad = np.zeros((3, 8, 8, 8), np.float32)
    bad[:, 2:5, 2:5, 2:5] = 1
    bad[1, 0, 0, 0] = np.inf
    volumes = iter(isowave.open_series(bad))
    next(volumes)
    with pytest.raises(isowave.Error, match="infinite"):
        next(volumes)
    (folder / "s_11.nrrd").write_bytes((folder / "s_11.nrrd").read_bytes()[:-1])
    with pytest.raises(isowave.Error, match="s_11.nrrd: truncated"):
        isowave.open_series(folder / "s_*.nrrd")
    nrrd(folder / "s_11.nrrd", steps_of(1)[0][:-1])
    with pytest.raises(isowave.Error, match="s_11.nrrd has 16x14x11 voxels"):
        isowave.open_series(folder / "s_*.nrrd")


@pytest.mark.parametrize(
    "source, options, error, text",
    [
        ("absent*.nrrd", {}, isowave.Error, "no file has such a name"),
        ("absent.nrrd", {}, isowave.Error, "no such file"),
        ([], {}, isowave.Error, "without a file"),
        (3, {}, TypeError, "give a pattern, a list of paths or an array"),
        (np.zeros((4, 4, 4)), {}, TypeError, r"an array \(t, z, y, x\)"),
        ([1, 2], {}, TypeError, "give a pattern"),
        (np.zeros((2, 4, 4, 4)), {"shape": (4, 4, 4)}, TypeError, "are for files"),
        ("a*.nrrd", {"origin": (0, 0, 0)}, TypeError, "files say it themselves"),
        ("a*.nrrd", {"rate": "8"}, TypeError, "rate="),
    ],
)
def test_what_is_no_series_is_refused(source, options, error, text):
    with pytest.raises(error, match=text):
        isowave.open_series(source, **options)


def test_all_pictures_have_one_camera(folder):
    series = isowave.open_series(folder / "s_*.nrrd")[::5]
    images = list(series.render(60, size=SIZE, device="host"))
    camera = isowave.Camera.of(series[0], size=SIZE)
    assert [image.camera for image in images] == [camera] * 3
    fits = [series[t].camera(60, size=SIZE, device="host") for t in (0, 2)]
    assert fits[0] != fits[1] != camera, "else this proves nothing"
    for image, t in zip(images, (0, 5, 10), strict=True):
        alone = series[t // 5].render(60, size=SIZE, camera=camera, device="host")
        assert np.array_equal(image.rgb, alone.rgb)
    given = isowave.Camera((40, 6, 6), (8, 6, 6))
    chosen = list(series.render(60, size=SIZE, camera=given, color="red", device="host"))
    assert chosen[1].camera == given and chosen[1].rgb[24, 32, 0] > chosen[1].rgb[24, 32, 1]
    surfaces = [isowave.Surface(60), isowave.Surface(80)]
    assert next(series.render(size=SIZE, surfaces=surfaces, device="host")).surfaces
    suggested = series[0].suggested_isovalues()[0]
    assert [i.isovalue for i in series.render("auto", size=SIZE, device="host")] == [suggested] * 3
    with pytest.raises(TypeError, match="isovalue, or surfaces"):
        next(series.render())


def test_pictures_are_the_programs(program, folder):
    program("render", folder / "s_*.nrrd", "-i", 60, "--size", "64x48", "--device", "host",
            "--steps", "0:10:5", "-o", folder / "p.png")  # fmt: skip
    series = isowave.open_series(folder / "s_*.nrrd")[0:11:5]
    for t, image in zip(("00", "05", "10"), series.render(60, size=SIZE, device="host")):
        image.save(folder / "q.png")
        assert (folder / "q.png").read_bytes() == (folder / f"p_step{t}.png").read_bytes()


def test_turntables_are_the_programs(program, tmp_path):
    volume = isowave.open(FUEL)
    cameras = volume.turntable(3, 40, size=SIZE, device="host")
    assert len(cameras) == 3
    program("render", FUEL, "-i", 40, "--size", "64x48", "--turntable", 3, "--device", "host",
            "--fit", "surface", "-o", tmp_path / "p.png")  # fmt: skip
    for k, camera in enumerate(cameras):
        volume.render(40, size=SIZE, camera=camera, device="host").save(tmp_path / "q.png")
        assert (tmp_path / "q.png").read_bytes() == (tmp_path / f"p_iso40_view{k}.png").read_bytes()
    renderer = volume.renderer(size=SIZE, device="host")
    assert renderer.turntable(3, 40) == cameras
    assert renderer.turntable(1, 40) == [renderer.camera(40)]
    assert volume.turntable(2, surfaces=[isowave.Surface(40)], size=SIZE, device="host")
    for wrong, error in ((0, ValueError), (100_001, ValueError), ("3", TypeError)):
        with pytest.raises(error, match="give"):
            volume.turntable(wrong, 40)
    around = volume.turntable(3, size=SIZE)
    assert around == renderer.turntable(3) and around[0] != cameras[0]
    assert volume.turntable(1, size=SIZE) == [volume.camera(size=SIZE)]


def frames_of(path):
    """The frames of a movie, by ffmpeg: (frames, height, width, 3)."""
    size = subprocess.run(
        ["ffprobe", "-v", "error", "-show_entries", "stream=width,height,avg_frame_rate", "-of",
         "csv=p=0", path], capture_output=True, text=True, check=True)  # fmt: skip
    width, height, rate = size.stdout.strip().split(",")
    raw = subprocess.run(
        ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    )
    frames = np.frombuffer(raw.stdout, np.uint8).reshape(-1, int(height), int(width), 3)
    return frames.astype(np.int32), rate


def test_movies_have_all_pictures_in_their_order(tmp_path):
    volume = isowave.open(FUEL)
    images = [
        volume.render(40, size=SIZE, camera=camera, color=color, device="host")
        for camera, color in zip(
            volume.turntable(3, 40, size=SIZE, device="host"), ("red", "#0000ff", "green")
        )
    ]
    flat = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    path = tmp_path / "m.mp4"
    assert isowave.save_movie((i for i in (*images, flat)), path, fps=12.5) == 4
    frames, rate = frames_of(path)
    assert frames.shape == (4, 48, 64, 3) and rate == "25/2"
    for frame, image in itertools.zip_longest(frames, [*(i.rgb for i in images), flat]):
        means = frame.mean(axis=(0, 1)) - image.mean(axis=(0, 1))
        assert np.abs(means).max() < 3
    path.chmod(0o640)
    (tmp_path / "link.mp4").symlink_to(path)
    assert isowave.save_movie([flat], tmp_path / "link.mp4") == 1
    assert (tmp_path / "link.mp4").is_symlink() and path.stat().st_mode & 0o777 == 0o640
    assert len(frames_of(path)[0]) == 1


def test_movies_that_cannot_be_leave_the_old_file(tmp_path):
    path = tmp_path / "m.mp4"
    path.write_bytes(b"old")
    good = np.zeros((4, 6, 3), np.uint8)

    def fails_later():
        yield good
        raise KeyError("no more")

    for images, options, error, text in (
        ([], {}, ValueError, "there is none"),
        ([np.zeros((5, 6, 3), np.uint8)], {}, ValueError, "6x5 pixels: give an even"),
        ([good, np.zeros((4, 8, 3), np.uint8)], {}, ValueError, "8x4 pixels, the first 6x4"),
        ([good.astype(float)], {}, TypeError, "float64"),
        ([good[..., 0]], {}, TypeError, "uint8"),
        ([good], {"fps": 0}, ValueError, "0.1 to 1000"),
        ([good], {"fps": "25"}, TypeError, "fps"),
        (fails_later(), {}, KeyError, "no more"),
    ):
        with pytest.raises(error, match=text):
            isowave.save_movie(images, path, **options)
        assert path.read_bytes() == b"old" and len(list(tmp_path.iterdir())) == 1
    with pytest.raises(ValueError, match="end the name in .mp4"):
        isowave.save_movie([good], tmp_path / "m.avi")
    with pytest.raises(isowave.Error, match="no file in a folder"):
        isowave.save_movie([good], tmp_path / "absent" / "m.mp4")


def test_a_full_disk_keeps_the_old_file(tmp_path):
    path = tmp_path / "m.mp4"
    path.write_bytes(b"old")
    noise = np.random.default_rng(7).integers(0, 256, (30, 120, 160, 3), np.uint8)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, before[1]))
    try:
        with pytest.raises(isowave.Error, match="ffmpeg failed"):
            isowave.save_movie(noise, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == b"old" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("reads", [True, False])
def test_ffmpeg_that_fails_or_is_missing_is_one_line(tmp_path, monkeypatch, reads):
    programs = tmp_path / "programs"
    programs.mkdir()
    monkeypatch.setenv("PATH", str(programs))
    images = [np.zeros((480, 640, 3), np.uint8)] * 5
    with pytest.raises(isowave.Error, match="need the program ffmpeg"):
        isowave.save_movie(images, tmp_path / "m.mp4")
    script = programs / "ffmpeg"
    drain = "/bin/cat > /dev/null\n" if reads else ""
    script.write_text(f"#!/bin/sh\n{drain}echo first >&2\necho no such codec >&2\nexit 3\n")
    script.chmod(0o755)
    with pytest.raises(isowave.Error, match="^ffmpeg failed: no such codec$"):
        isowave.save_movie(images, tmp_path / "m.mp4")
    assert not (tmp_path / "m.mp4").exists()
