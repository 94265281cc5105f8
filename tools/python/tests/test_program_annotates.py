"""`isowave render --annotate` of the wheel, whose program has no Cairo: Pillow draws."""

import base64
import io
import re
import shutil
import subprocess
import sys

import file_writers as write
import numpy as np
import pytest
from conftest import FUEL, TOP
from PIL import Image
from test_files_program import command

import isowave
from isowave._page import ENGINE
from isowave._program import PROGRAM

SIZE = (320, 240)
RENDER = ("render", FUEL, "--exact", "--device", "host", "--size", "320x240")
TITLE = FUEL.name


@pytest.fixture(scope="module")
def fuel():
    return isowave.open(FUEL, exact=True)


def render(*options):
    done = command(*RENDER, *options)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


def pixels(path):
    return np.asarray(Image.open(path))


def expect_refused(says, *options, program=command):
    done = program(*RENDER, *options)
    assert done.returncode == 1 and says in done.stderr and done.stderr.count("\n") == 1, done


@pytest.mark.skipif(not ENGINE.is_file(), reason="the package has no engine for pages")
def test_pages_of_the_program_have_annotations(tmp_path, fuel):
    scene = fuel.scene().surface(40).annotate(units="mm")
    scene.save(tmp_path / "s.json")
    done = command(
        "export", FUEL, "--exact", "--scene", tmp_path / "s.json", "-o", "p.html", cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    image = scene.render(camera=fuel.camera(40, size=(1280, 720)), device="host")
    html = (tmp_path / "p.html").read_text()
    data = re.search(r"data:image/png;base64,([^\"]*)", html)[1]
    expected = image.annotated(units="mm", title=TITLE)
    assert np.array_equal(pixels(io.BytesIO(base64.b64decode(data))), expected)


@pytest.mark.parametrize(
    "options, look",
    [
        ((), {}),
        (
            ("--color-by", "y", "--color-map", "magma"),
            {"color_map": isowave.ColorMap("magma", "y")},
        ),
        (("--transparent", "--samples", "2"), {"transparent": True, "samples": 2}),
        (("--slice", "z,16"), {"slices": [isowave.Slice("z", 16)]}),
        (("--background", "black,#405080"), {"background": "black", "background_top": "#405080"}),
    ],
)
def test_pictures_are_those_of_python(tmp_path, fuel, options, look):
    render("-i", "40", *options, "--annotate", "all", "--units", "mm", "-o", tmp_path / "a.png")
    image = fuel.render(40, size=SIZE, device="host", **look)
    expected = image.annotated(units="mm", title=TITLE)
    assert np.array_equal(pixels(tmp_path / "a.png"), expected)


def test_scenes_options_and_titles(tmp_path, fuel):
    picture, scene = tmp_path / "a.png", tmp_path / "scene.json"
    scenes = fuel.scene().surface(40, opacity=0.5).surface(100).annotate("caption", units="nm")
    scenes.save(scene)
    image = scenes.render(size=SIZE, device="host")
    whole = ("render", "--scene", scene, "--exact", "--device", "host", "--size", "320x240")

    def drawn(*options):
        done = command(*whole, *options, "-o", picture)
        assert done.returncode == 0, done.stderr
        return pixels(picture)

    assert np.array_equal(drawn(), image.annotated(title=TITLE))
    assert np.array_equal(drawn("--annotate", "none"), image.rgb)
    assert np.array_equal(drawn("--title=µ"), image.annotated(title="µ"))
    expected = image.annotated(("axes", "scale-bar"), units="km", title=TITLE)
    assert np.array_equal(drawn("--annotate=axes,scale-bar", "--units", "km"), expected)
    saved = tmp_path / "saved.json"
    drawn("--title", "head", "--save-scene", saved)
    assert isowave.open_scene(saved).annotations == isowave.Annotations(("caption",), "nm", "head")


def test_all_of_several_pictures_and_movies(tmp_path, fuel):
    views = ("-i", "40", "--orbit", "2", "--annotate", "axes")
    render(*views, "-o", tmp_path / "a.png")
    for view, camera in enumerate(isowave.Camera.orbit(fuel, 2, size=SIZE)):
        image = fuel.render(40, size=SIZE, device="host", camera=camera)
        assert np.array_equal(pixels(tmp_path / f"a_iso40_view{view}.png"), image.annotated("axes"))
    times = ("-i", "40", "--time-budget", "10000", "--refined", tmp_path / "r.png")
    render(*times, "--annotate", "axes", "-o", tmp_path / "b.png")
    expected = fuel.render(40, size=SIZE, device="host").annotated("axes")
    assert np.array_equal(pixels(tmp_path / "r.png"), expected)
    assert np.array_equal(pixels(tmp_path / "b.png"), expected)
    passes = ("-i", "40", "--annotate", "axes", "--progress-dir", tmp_path / "passes")
    render(*passes, "-o", tmp_path / "p.png")
    assert np.array_equal(pixels(tmp_path / "p.png"), expected)
    if shutil.which("ffmpeg"):
        render(*views, "--movie", tmp_path / "a.mp4")
        assert (tmp_path / "a.mp4").stat().st_size > 1000


def test_files_of_packages_have_their_names(tmp_path):
    voxels = write.VOXELS
    write.tiff(tmp_path / "a.tif")
    done = command(
        *("render", tmp_path / "a.tif", "-i", voxels.mean(), "--device", "host", "--exact"),
        *("--size", "320x240", "--annotate", "caption", "-o", tmp_path / "a.png"),
    )
    assert done.returncode == 0, done.stderr
    volume = isowave.open(tmp_path / "a.tif", exact=True)
    image = volume.render(float(voxels.mean()), size=SIZE, device="host")
    assert np.array_equal(pixels(tmp_path / "a.png"), image.annotated("caption", title="a.tif"))


def test_what_cannot_be_is_one_line(tmp_path):
    picture = tmp_path / "a.png"
    one = ("-i", "40", "-o", picture)
    expect_refused("--annotate axis: there are", *one, "--annotate", "axis")
    expect_refused("-: cannot write to standard output", "-i", "40", "--annotate=all", "-o", "-")
    expect_refused("--title x: nothing is annotated", *one, "--title", "x")
    depth = ("-i", "40", "--annotate", "all", "--depth", tmp_path / "d.npy")
    expect_refused("--annotate: no picture is annotated: give --output", *depth)
    annotated = (*one, "--annotate", "all")

    def without_pillow(*arguments):
        code = "import sys; sys.modules['PIL'] = None; from isowave._program import main; "
        started = [sys.executable, "-c", f"{code}sys.exit(main())", *map(str, arguments)]
        return subprocess.run(started, capture_output=True, text=True, check=False)

    expect_refused("annotations need Pillow: pip install", *annotated, program=without_pillow)

    def alone(*arguments):
        return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)

    expect_refused("this isowave was built without Cairo", *annotated, program=alone)
    assert not picture.exists() and not (tmp_path / "d.npy").exists()


def test_it_needs_no_library_of_the_system():
    done = subprocess.run(["ldd", PROGRAM], capture_output=True, text=True, check=True)
    assert "cairo" not in done.stdout.lower()
    assert '"pillow>=' in (TOP / "pyproject.toml").read_text().partition("[project.opt")[0]
