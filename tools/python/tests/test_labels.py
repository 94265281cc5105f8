"""Surfaces of labels: those of their indicators, drawn by a device and by the host."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import isowave
from isowave import ClipPlane, Slice, Surface

SIZE = (48, 40)


@pytest.fixture(scope="module")
def voxels() -> np.ndarray:
    """Two balls that touch, 3 and 65535, and a small one of 7."""
    z, y, x = np.mgrid[:24, :25, :26]

    def ball(middle: tuple[int, int, int], radius: float) -> np.ndarray:
        return (z - middle[0]) ** 2 + (y - middle[1]) ** 2 + (x - middle[2]) ** 2 < radius**2

    labels = np.zeros(z.shape, np.uint16)
    labels[ball((11, 12, 8), 6)] = 3
    labels[ball((11, 12, 18), 6)] = 65535
    labels[ball((17, 18, 13), 3)] = 7
    return labels


@pytest.fixture(scope="module")
def volume(voxels: np.ndarray) -> isowave.Volume:
    return isowave.compress(voxels, exact=True)


def indicator(voxels: np.ndarray, *labels: int) -> isowave.Volume:
    return isowave.compress(np.isin(voxels, labels).astype(np.uint8), exact=True)


def test_a_label_s_surface_is_that_of_its_indicator(
    volume: isowave.Volume, voxels: np.ndarray
) -> None:
    image = volume.render(surfaces=[Surface(labels=[65535, 7], color="red")], size=SIZE)
    of_both = indicator(voxels, 65535, 7)
    expected = of_both.render(surfaces=[Surface(0.5, "red")], size=SIZE, device="cpu")
    assert image.camera == expected.camera
    assert (image.rgb == expected.rgb).all() and (image.depth == expected.depth).all()
    assert (image.normals == expected.normals).all()
    assert "labels 7, 65535" in repr(image)
    on_host = volume.render(surfaces=image.surfaces, size=SIZE, device="host")
    assert on_host.camera == image.camera and (on_host.rgb == image.rgb).all()


def test_a_volume_draws_labels_and_isosurfaces_in_turn(volume: isowave.Volume) -> None:
    first = volume.render(surfaces=[Surface(labels=3)], size=SIZE)
    volume.render(1, size=SIZE, ambient_rays=2)
    again = volume.render(surfaces=[Surface(labels=(3,)), Surface(labels=[7])], size=SIZE)
    assert first.depth is not None and np.isfinite(first.depth).any() and again.rgb is not None


def test_surfaces_have_colours_by_label(volume: isowave.Volume, tmp_path: Path) -> None:
    """Light alone is left out: each pixel of the surface has the colour of one of its labels."""
    colors = np.zeros((256, 3))
    colors[3], colors[255], colors[7] = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    by_label = isowave.ColorMap(colors, by="labels")
    flat = {"lights": {"ambient": 1, "diffuse": 0, "specular": 0, "above": 0}}
    scene = volume.scene().labels([3, 65535, 7]).look(color_map=by_label, **flat)
    image = scene.render(size=SIZE, device="cpu")
    assert image.rgb is not None and image.depth is not None
    seen = {tuple(color) for color in image.rgb[np.isfinite(image.depth)]}
    assert seen == {(255, 0, 0), (0, 255, 0), (0, 0, 255)}
    assert (scene.render(size=SIZE, device="host").rgb == image.rgb).all()
    scene.save(tmp_path / "scene.json")
    opened = isowave.open_scene(tmp_path / "scene.json", volume=volume)
    assert (opened.render(size=SIZE).rgb == image.rgb).all()
    named = volume.render(surfaces=[Surface(labels=3)], color_map=isowave.ColorMap(by="labels"))
    assert named.rgb is not None
    with pytest.raises(ValueError, match="there are axis, depth, field, caps, labels"):
        volume.render(3, color_map=isowave.ColorMap(by="label"))


def test_colours_by_what_is_no_label_are_one_line(volume: isowave.Volume) -> None:
    heat = isowave.compress(np.zeros((5, 5, 5), np.float32))
    with pytest.raises(isowave.Error, match="the field's voxels are no labels"):
        volume.render(1, size=SIZE, field=heat, color_map=isowave.ColorMap(by="labels"))


def test_one_renderer_draws_other_labels(volume: isowave.Volume) -> None:
    renderer = volume.renderer(size=SIZE, surfaces=2, labels=True)
    camera = renderer.camera(surfaces=[Surface(labels=[3, 65535])])
    draw = {"camera": camera, "outputs": ("rgb", "surface")}
    both = renderer.render(surfaces=[Surface(labels=3), Surface(labels=65535)], **draw)
    assert both.surface is not None and {*both.surface.ravel()} == {-1, 0, 1}
    one = renderer.render(surfaces=[Surface(labels=3)], **draw)
    assert one.surface is not None and {*one.surface.ravel()} == {-1, 0}
    assert len(renderer.turntable(3, surfaces=[Surface(labels=3)])) == 3
    with pytest.raises(isowave.Error, match="this renderer draws labels alone"):
        renderer.render(3)


def test_scenes_have_labels(volume: isowave.Volume, tmp_path: Path) -> None:
    scene = volume.scene().labels(3, "red", opacity=0.3).labels([7, 65535], clipped=False)
    scene = scene.clip(ClipPlane((1, 0, 0), 8))
    scene.save(tmp_path / "scene.json")
    stored = json.loads((tmp_path / "scene.json").read_text())["surfaces"]
    assert [each["labels"] for each in stored] == [[3], [7, 65535]]
    assert not any("isovalue" in each for each in stored)
    again = isowave.open_scene(tmp_path / "scene.json", volume=volume)
    assert again.surfaces[0].labels == (3,) and again.surfaces[0].isovalue is None
    assert (again.render(size=SIZE).rgb == scene.render(size=SIZE).rgb).all()
    assert again.camera() == scene.camera()


@pytest.mark.parametrize(
    "surfaces, message",
    [
        ([Surface(labels=[65536])], "Surface.labels=65536"),
        ([Surface(labels=[-1])], "Surface.labels=-1"),
        ([Surface(labels="3")], "Surface.labels='3'"),
        ([Surface(labels=[2.5])], "Surface.labels=2.5"),
        ([Surface()], "give an isovalue, or labels"),
        ([Surface(3, labels=[3])], "not both"),
        ([Surface(labels=[3]), Surface(3)], "give all labels"),
    ],
)
def test_what_is_no_label_is_refused(
    volume: isowave.Volume, surfaces: list[Surface], message: str
) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        volume.render(surfaces=surfaces, size=SIZE)


@pytest.mark.parametrize(
    "more, message",
    [
        ({"max_surface_error": 2}, "without max_surface_error"),
        ({"voxel_pixels": 1}, "without voxel_pixels"),
        ({"time_budget_ms": 1000}, "without time_budget_ms"),
        ({"slices": [Slice("x", 5)]}, "without slices"),
    ],
)
def test_what_labels_are_drawn_without_is_refused(
    volume: isowave.Volume, more: dict[str, object], message: str
) -> None:
    with pytest.raises(isowave.Error, match=message):
        volume.render(surfaces=[Surface(labels=3)], size=SIZE, **more)  # type: ignore[arg-type]


def test_volumes_that_are_no_segmentation_are_refused(voxels: np.ndarray) -> None:
    with pytest.raises(isowave.Error, match="voxels of type float32 are no labels"):
        isowave.compress(voxels.astype("f4"), exact=True).renderer(surfaces=1, labels=True)
    with pytest.raises(isowave.Error, match="with a loss"):
        isowave.compress(voxels, rate=8).renderer(surfaces=1, labels=True)
    plain = isowave.compress(voxels, exact=True).renderer(size=SIZE, surfaces=1)
    with pytest.raises(isowave.Error, match="labels needs a renderer that was made with"):
        plain.render(surfaces=[Surface(labels=3)])


def test_the_viewer_takes_scenes_of_labels(volume: isowave.Volume, tmp_path: Path) -> None:
    pytest.importorskip("simplejpeg")
    from isowave.viewer import messages

    volume.scene().labels(3).save(tmp_path / "scene.json")
    answer = messages.scene((tmp_path / "scene.json").read_text())
    assert answer["type"] == "scene" and answer["fields"]["surfaces"][0]["labels"] == [3]
