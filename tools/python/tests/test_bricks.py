"""Processes that draw a volume together: the bits of one, and what goes wrong is raised at all."""

import json
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import FUEL

import isowave

pytest.importorskip("mpi4py", reason="mpi4py is not installed: pip install mpi4py")
RANKS = 3


@pytest.fixture(scope="module")
def levelled(tmp_path_factory):
    path = tmp_path_factory.mktemp("levels") / "fuel.zfp"
    isowave.open(FUEL, exact=True, levels=2).save(path)
    return path


@pytest.fixture(scope="module")
def drawn(tmp_path_factory, levelled):
    """What the processes have drawn, and their errors."""
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun: apt install openmpi-bin")
    folder = tmp_path_factory.mktemp("bricks")
    # Kernels are compiled here, once: each process would compile them all.
    isowave.open(FUEL, exact=True).renderer(size=(96, 64), samples=2, rays=True)
    isowave.open(FUEL, exact=True).renderer(size=(64, 48), surfaces=2)
    for bounds in (False, True):
        isowave.open(levelled).renderer(size=(64, 48), levels=True, bounds=bounds)
    program = pathlib.Path(__file__).with_name("draw_bricks.py")
    mpirun = ["mpirun", "-q", "--oversubscribe", "--bind-to", "none", "--allow-run-as-root"]
    command = [*mpirun, "-n", RANKS, sys.executable, program, FUEL, levelled, folder]
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return dict(np.load(folder / "pictures.npz")), json.loads((folder / "errors.json").read_text())


def expect(pictures, name, image):
    for array in ("rgb", "depth", "normals", "bounds"):
        expected = getattr(image, array)
        if expected is None:
            assert f"{name}_{array}" not in pictures
        else:
            np.testing.assert_array_equal(pictures[f"{name}_{array}"], expected)
    assert pictures[f"{name}_hits"] == image.statistics["hits"] > 100


def test_the_bits_of_one_process(drawn):
    pictures, _ = drawn
    volume = isowave.open(FUEL, exact=True)
    renderer = volume.renderer(size=(96, 64), samples=2, rays=True)
    outputs = ("rgb", "depth", "normals")
    plain = renderer.render(40, outputs=outputs)
    expect(pictures, "plain", plain)
    expect(pictures, "again", plain)
    samples = renderer.render(40, samples=2, size=(48, 32), normals="cell", outputs=outputs)
    expect(pictures, "samples", samples)
    ambient = renderer.render(40, ambient_rays=3, color="#3070b0", outputs=outputs)
    expect(pictures, "ambient", ambient)
    for samples in (1, 2):
        image = renderer.render(40, size=(48, 32), samples=samples, transparent=True)
        np.testing.assert_array_equal(pictures[f"rgba{samples}"], image.rgba)
    camera = isowave.Camera.orbit(volume, 3)[1]
    expect(pictures, "orbit", renderer.render(90, camera=camera, outputs=("rgb", "depth")))
    camera = renderer.turntable(3, 90)[1]
    expect(pictures, "turntable", renderer.render(90, camera=camera, outputs=("rgb", "depth")))
    expect(pictures, "depth", renderer.render(90, outputs=("depth",)))


def test_surfaces(drawn):
    pictures, _ = drawn
    fuel = isowave.open(FUEL, exact=True)
    renderer = fuel.renderer(size=(64, 48), surfaces=2, rays=True, field=fuel)
    both = [isowave.Surface(20, "skin", 0.4), isowave.Surface(90, "blue")]
    outputs = ("rgb", "depth", "normals")
    expect(pictures, "surfaces", renderer.render(surfaces=both, outputs=outputs))
    slices = [isowave.Slice("z", 14), isowave.Slice("x", 30, 0.5)]
    expect(
        pictures,
        "slices",
        renderer.render(
            surfaces=both, slices=slices, slice_map="magma", ambient_rays=2, outputs=outputs
        ),
    )
    image = renderer.render(
        90,
        clip=[isowave.ClipPlane((0, 0, 1), 12)],
        color_map=isowave.ColorMap(by="field"),
        outputs=("rgb", "field"),
    )
    np.testing.assert_array_equal(pictures["field_rgb"], image.rgb)
    np.testing.assert_array_equal(pictures["field"], image.field)
    assert np.isfinite(image.field).any()


def test_pictures_of_passes(drawn):
    pictures, _ = drawn
    fuel = isowave.open(FUEL, exact=True)
    renderer = fuel.renderer(size=(64, 48), surfaces=2, rays=True)
    for name, scene in (
        ("one", {"isovalue": 40}),
        (
            "layers",
            {
                "surfaces": [isowave.Surface(20, "skin", 0.4), isowave.Surface(90, "blue")],
                "slices": [isowave.Slice("z", 14), isowave.Slice("x", 30, 0.5)],
                "ambient_rays": 1,
            },
        ),
    ):
        image = renderer.render(size=(48, 32), outputs=("rgb", "depth", "normals"), **scene)
        expect(pictures, f"passes of {name}", image)


def test_bounced_light(drawn):
    pictures, _ = drawn
    renderer = isowave.open(FUEL, exact=True).renderer(size=(64, 48), bounce=True)
    outputs = ("rgb", "depth", "normals")
    image = renderer.render(40, bounce_rays=4, light=(1, 1, 0.5), outputs=outputs)
    expect(pictures, "bounce", image)


def test_labels(drawn):
    pictures, _ = drawn
    fuel = isowave.open(FUEL, exact=True)
    renderer = fuel.renderer(size=(64, 48), surfaces=2, labels=True, field=fuel)
    groups = [
        isowave.Surface(labels=[90, 91, 92]),
        isowave.Surface(labels=range(20, 40), opacity=0.4),
    ]
    colors = isowave.ColorMap(by="labels")
    image = renderer.render(surfaces=groups, color_map=colors, outputs=("rgb", "depth", "normals"))
    expect(pictures, "labels", image)


def test_levels_of_detail(drawn, levelled):
    pictures, _ = drawn
    renderer = isowave.open(levelled).renderer(size=(64, 48), levels=True)
    outputs = ("rgb", "depth", "normals")
    expect(pictures, "levels", renderer.render(40, voxel_pixels=1.5, outputs=outputs))
    expect(pictures, "level", renderer.render(40, voxel_error=2.0, outputs=outputs))


def test_bounds_of_the_error(drawn, levelled):
    pictures, _ = drawn
    renderer = isowave.open(levelled).renderer(size=(64, 48), levels=True, bounds=True)
    expect(
        pictures,
        "bounded",
        renderer.render(40, max_surface_error=0.5, outputs=("rgb", "depth", "bounds")),
    )
    renderer = isowave.open(FUEL, rate=8).renderer(size=(64, 48), bounds=True)
    expect(pictures, "rated", renderer.render(40, voxel_error=2.0, outputs=("bounds", "depth")))


@pytest.mark.parametrize(
    ("case", "text"),
    [
        ("isovalue", "rank 1 has another request than rank 0"),
        ("surfaces", "made with_surfaces"),
        ("labels", "labels needs a renderer that was made with labels=True"),
        ("field", "no field to colour by"),
        ("no field", "reads folders of TIFF and DICOM files, and zarr"),
        ("bounce", "made with_bounce"),
        ("neither", "give an isovalue, or surfaces"),
        ("auto", "isovalue='auto': no process sees the whole volume: give a number"),
        ("auto camera", "isovalue='auto': no process sees the whole volume: give a number"),
        ("turntable", "num_views=0: give 1 to 100,000"),
        ("camera", "some processes give a camera"),
        ("color", "there is no colour 'bluish': give #RRGGBB"),
        ("transparent", "rank 1 has another request than rank 0"),
        ("outputs", "outputs position: bricks have rgb, depth, normals, bounds"),
        ("in on_pass", "the picture has no alpha"),
        ("answer", "what on_pass returns"),
        ("one on_pass", "rank 1 has another request than rank 0"),
        ("time", "a BrickRenderer draws without time_budget_ms"),
        ("max_surface_error", "made with_bounds"),
        ("no error", "an error of 0 pixels cannot be kept"),
        ("too large", "960"),
        ("levels", "bricks have levels of detail that are in a .zfp file"),
        ("compressed", "is compressed already"),
        ("missing", "rank 0: "),
        ("volume", "rank 1 has another volume than rank 0"),
        ("bricks", f"{RANKS} processes draw a brick each"),
    ],
)
def test_errors_are_raised_at_all(drawn, case, text):
    _, errors = drawn
    assert all(text in (error or "nothing") for error in errors[case]), errors[case]
