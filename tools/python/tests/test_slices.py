"""Slices: planes of a ramp whose value is x, which say their own place by their colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isowave
from isowave import ClipPlane, ColorMap, Slice, Surface

SIZE = (48, 40)
CAMERA = isowave.Camera((-40.0, 10.0, 11.0), (12.0, 11.5, 11.5), (0, 1, 0), 40)
MIDDLE = (SIZE[1] // 2, SIZE[0] // 2)
GRAY = ColorMap("gray", range=(0, 20))


@pytest.fixture(scope="module")
def ramp() -> isowave.Volume:
    return isowave.compress(np.broadcast_to(np.arange(24, dtype="f4"), (24, 24, 24)), exact=True)


def draw(ramp: isowave.Volume, *slices: Slice, **more: object) -> isowave.Image:
    arguments: dict[str, object] = {"slice_map": GRAY, "camera": CAMERA, "size": SIZE}
    arguments |= {"outputs": ("rgb", "depth", "surface", "cap"), "background": "black"}
    return ramp.render(slices=slices, **arguments | more)  # type: ignore[arg-type]


def test_a_slice_has_its_voxels_gray(ramp: isowave.Volume) -> None:
    image = draw(ramp, Slice("x", 5), isovalue=21)
    assert image.rgb[MIDDLE].tolist() == 3 * [round(255 * 5 / 20)]
    assert image.depth[MIDDLE] == pytest.approx(45, rel=1e-2)
    assert image.surface[MIDDLE] == 1 and image.cap[MIDDLE]


def test_slices_and_surfaces_are_blended_in_their_order(ramp: isowave.Volume) -> None:
    behind = Slice.through((16, 0, 0), "x")
    image = draw(ramp, Slice((-2, 0, 0), -8, 0.25), behind, isovalue=20.5)
    expected = 255 * (0.25 * 4 / 20 + 0.75 * 16 / 20)
    assert image.rgb[MIDDLE].tolist() == pytest.approx(3 * [expected], abs=1)
    hidden = draw(ramp, Slice("x", 16), surfaces=[Surface(8.0, "red")])
    assert hidden.surface[MIDDLE] == 0


def test_the_volume_s_range_is_the_default(ramp: isowave.Volume) -> None:
    image = draw(ramp, Slice("x", 5), isovalue=21, slice_map="gray")
    assert image.rgb[MIDDLE].tolist() == 3 * [round(255 * 5 / 23)]


def test_clipping_planes_cut_what_is_not_whole(ramp: isowave.Volume) -> None:
    clip = [ClipPlane((1, 0, 0), 10)]
    assert draw(ramp, Slice("x", 5), isovalue=21, clip=clip).depth[MIDDLE] > 50
    whole = draw(ramp, Slice("x", 5, clipped=False), isovalue=21, clip=clip)
    assert whole.depth[MIDDLE] == pytest.approx(45, rel=1e-2)
    surface = draw(ramp, surfaces=[Surface(8.0, clipped=False)], clip=clip)
    assert surface.depth[MIDDLE] == pytest.approx(48, rel=1e-2)


def test_scenes_have_slices(ramp: isowave.Volume, tmp_path: Path) -> None:
    scene = ramp.scene().surface(21, "bone").slice("x", 5, 0.5).slice("y", 11, clipped=False)
    scene = scene.clip(ClipPlane((1, 0, 0), 3)).look(slice_map=GRAY).seen_from(CAMERA)
    scene.save(tmp_path / "scene.json")
    again = isowave.open_scene(tmp_path / "scene.json", volume=ramp)
    assert again.slices[1] == Slice((0.0, 1.0, 0.0), 11.0, 1.0, False)
    assert (again.render(size=SIZE).rgb == scene.render(size=SIZE).rgb).all()


@pytest.mark.parametrize(
    "slices, message",
    [
        ([Slice("w")], "Slice.normal 'w'"),
        ([Slice((0, 0, 0))], "a slice's normal is 0 0 0"),
        ([Slice("x", float("nan"))], "Slice.offset|a slice's offset"),
        ([Slice("x", opacity=0)], "an opacity of 0"),
        (8 * [Slice("x")], "1 surfaces and 8 slices"),
        (["x"], "slices"),
    ],
)
def test_bad_slices_are_refused(ramp: isowave.Volume, slices: list[Slice], message: str) -> None:
    with pytest.raises((isowave.Error, ValueError, TypeError), match=message):
        draw(ramp, *slices, isovalue=21)


def test_a_renderer_must_be_made_for_them(ramp: isowave.Volume) -> None:
    renderer = isowave.Renderer(ramp, size=SIZE, device="cpu")
    with pytest.raises(isowave.Error, match="slices needs a renderer .* surfaces=1"):
        renderer.render(21, slices=[Slice("x", 5)])
