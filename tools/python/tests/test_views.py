"""Cameras that see a side of a volume, and how they move."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import isowave
from conftest import FUEL

SIZE = (64, 48)
SIDES = ("front", "back", "left", "right", "top", "bottom", "iso")
#: Index axes x, y, z lead along the world's -z, x and -y.
LYING = np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])


def volume(anatomical: bool = False) -> isowave.Volume:
    z, y, x = np.indices((7, 9, 12))
    array = (x + 2 * y + 3 * z).astype(np.float32)
    return isowave.compress(
        array, spacing=(2, 3, 0.5), origin=(1, -5, 7), direction=LYING, anatomical=anatomical
    )


def axes(camera: isowave.Camera) -> tuple[np.ndarray, np.ndarray]:
    """Forward, and to the right, of length 1."""
    forward = np.subtract(camera.at, camera.eye)
    right = np.cross(forward, camera.up)
    return forward / np.linalg.norm(forward), right / np.linalg.norm(right)


def largest_places(camera: isowave.Camera, of: isowave.Volume, size: tuple[int, int]) -> float:
    """How far from the middle the box's corners are in the picture; 1: at the edge."""
    forward, right = axes(camera)
    up = np.cross(right, forward)
    corners = np.array(np.meshgrid(*[(0, n - 1) for n in of.shape[::-1]])).reshape(3, -1).T
    world = np.array(of.origin[::-1]) + corners * of.spacing[::-1] @ of.direction.T
    to = world - camera.eye
    half = to @ forward * math.tan(math.radians(camera.fovy) / 2)
    if camera.parallel_height is not None:
        half = np.full(8, camera.parallel_height / 2)
    return max(abs(to @ right / half).max() * size[1] / size[0], abs(to @ up / half).max())


def test_sides_of_a_patient_and_of_other_volumes():
    patient, other = volume(True), volume()
    assert patient.anatomical and patient.up == (0, 0, 1)
    assert not other.anatomical and other.up == (0, 1, 0)
    looks = {
        "front": ((0, 1, 0), (0, 0, -1)),
        "back": ((0, -1, 0), (0, 0, 1)),
        "left": ((-1, 0, 0), (1, 0, 0)),
        "right": ((1, 0, 0), (-1, 0, 0)),
        "top": ((0, 0, -1), (0, -1, 0)),
        "bottom": ((0, 0, 1), (0, 1, 0)),
    }
    for side, expected in looks.items():
        for each, forward in zip((patient, other), expected):
            camera = getattr(isowave.Camera, side)(each, size=SIZE)
            assert np.allclose(axes(camera)[0], forward, atol=1e-12), side
            assert camera == isowave.Camera.of(each, side, size=SIZE)
    assert isowave.Camera.front(other, up=(0, 0, 2)).up == (0, 0, 1)
    assert np.allclose(axes(isowave.Camera.front(other, up=(0, 0, 2)))[0], (0, 1, 0))


@pytest.mark.parametrize("size", [(64, 48), (30, 90)])
def test_the_box_fills_the_picture(size):
    of = volume()
    for side in ("corner", *SIDES):
        camera = isowave.Camera.of(of, side, size=size)
        assert largest_places(camera, of, size) == pytest.approx(0.95)
        zoomed = isowave.Camera.of(of, side, size=size, zoom=2)
        assert largest_places(zoomed, of, size) == pytest.approx(1.9)
        again = camera.zoomed(2)
        assert again.eye == zoomed.eye and again.fovy == pytest.approx(zoomed.fovy)
    assert of.render(9, size=size).camera == isowave.Camera.of(of, size=size)
    orbit = isowave.Camera.orbit(of, 2, size=size)
    assert all(largest_places(camera, of, size) < 1.3 for camera in orbit)


def test_fit_keeps_the_direction():
    of = volume()
    for height in (None, 3.0):
        start = isowave.Camera((1, 2, 30), (4, -2, 5), (0.2, 1, 0), 35, height)
        camera = start.fit(of, (30, 90))
        assert largest_places(camera, of, (30, 90)) == pytest.approx(0.95)
        assert np.allclose(axes(camera), axes(start)) and camera.up == start.up


def test_cameras_turn_about_up():
    start = isowave.Camera((5, 0, 0), (0, 0, 0), (0, 0, 2))
    assert np.allclose(start.turned(90).eye, (0, 5, 0)) and np.allclose(
        start.turned(90).up, (0, 0, 2)
    )
    raised = start.turned(0, above=30)
    assert np.allclose(raised.eye, (5 * math.cos(math.pi / 6), 0, 2.5)) and raised.up == (0, 0, 1)
    assert start.turned(0, 200).eye[2] == pytest.approx(5 * math.sin(math.radians(89)))
    assert start.turned(0, -200).eye[2] == pytest.approx(-5 * math.sin(math.radians(89)))
    top = isowave.Camera.top(volume())
    turned = top.turned(90, up=(0, 1, 0))
    assert np.allclose(turned.eye, top.eye) and np.allclose(axes(turned)[1], (0, 0, -1), atol=1e-9)
    looking = start.look_at((5, 1, 0), up=(0, 0, 1))
    assert looking.at == (5, 1, 0) and looking.eye == (5, 0, 0) and looking.up == (0, 0, 1)


@pytest.mark.parametrize(
    ("act", "error", "text"),
    [
        (
            lambda v: isowave.Camera.of(v, "side"),
            ValueError,
            "view 'side': there are corner, front",
        ),
        (lambda v: isowave.Camera.front(v, up=(0, 0, 0)), isowave.Error, "give a direction"),
        (lambda v: isowave.Camera.front(v, up="z"), TypeError, "up="),
        (lambda v: isowave.Camera.front(v, zoom=0), isowave.Error, "give 0.01 to 1000"),
        (lambda v: isowave.Camera.front(v, size=3), TypeError, "size"),
        (lambda v: isowave.Camera.front(v).zoomed(0), ValueError, "give 0.01 to 1000"),
        (lambda v: isowave.Camera.front(v).turned("a"), TypeError, "degrees="),
        (lambda v: isowave.Camera.front(v).turned(1, up=(0, 0, 0)), ValueError, "no direction"),
        (lambda v: isowave.Camera.front(v).look_at(3), TypeError, "point="),
        (lambda v: isowave.Camera((0, 0, 1), (0, 0, 1)).fit(v), isowave.Error, "the same point"),
        (lambda v: isowave.compress(v, anatomical=1), TypeError, "anatomical="),
    ],
)
def test_what_cannot_be_is_one_line(act, error, text):
    with pytest.raises(error, match=text) as raised:
        act(volume())
    assert "\n" not in str(raised.value)


def test_views_are_the_programs(program, tmp_path):
    of = isowave.open(FUEL)
    for arguments, camera in (
        (["--view", "iso"], isowave.Camera.iso(of, size=SIZE)),
        (["--view", "left", "--up=-z"], isowave.Camera.left(of, size=SIZE, up=(0, 0, -1))),
        (["--zoom", "2"], isowave.Camera.of(of, size=SIZE, zoom=2)),
        ([], isowave.Camera.of(of, size=SIZE)),
        (["--orbit", "1"], isowave.Camera.orbit(of, 1, size=SIZE)[0]),
    ):
        file = tmp_path / "c.json"
        program("render", FUEL, "-i", 40, "--size", "64x48", "--device", "host", *arguments,
                "--save-camera", file, "-o", tmp_path / "p.png")  # fmt: skip
        saved = json.loads(file.read_text())
        for key in ("eye", "at", "up"):
            assert saved["cameras"][0][key] == pytest.approx(getattr(camera, key), abs=1e-12)
        assert saved["fovy_deg"] == pytest.approx(camera.fovy)


def test_images_of_packages_say_that_they_are_a_patients():
    sitk = pytest.importorskip("SimpleITK")
    nibabel = pytest.importorskip("nibabel")
    array = np.arange(6 * 5 * 4, dtype=np.uint8).reshape(6, 5, 4)
    assert isowave.compress(sitk.GetImageFromArray(array)).anatomical
    assert isowave.compress(nibabel.Nifti1Image(array, np.diag([1, 2, 3, 1]))).anatomical
    assert not isowave.compress(array).anatomical
    assert not isowave.compress(sitk.GetImageFromArray(array), anatomical=False).anatomical
