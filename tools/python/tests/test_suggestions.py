"""Suggested isovalues, and "auto" wherever an isovalue is taken."""

import numpy as np
import pytest
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run

import isowave

SIDE = 32


def ball(inside: float, outside: float, dtype: type) -> np.ndarray:
    z, y, x = np.indices((SIDE, SIDE, SIDE)) - (SIDE - 1) / 2
    is_inside = np.sqrt(x**2 + y**2 + z**2) < SIDE / 3
    return np.where(is_inside, inside, outside).astype(dtype)


@pytest.fixture(scope="module")
def volume() -> isowave.Volume:
    return isowave.compress(ball(200, 20, np.uint8), exact=True)


def test_the_first_isovalue_is_between_two_materials(volume):
    suggested = volume.suggested_isovalues()
    assert 100 < suggested[0] < 120
    assert all(isinstance(value, float) for value in suggested)
    suggested.clear()  # not the volume's own list
    assert volume.suggested_isovalues() != []


def test_voxels_without_data_suggest_nothing(volume):
    array = ball(200, 20, np.float32)
    array[:16] = np.nan
    assert abs(isowave.compress(array).suggested_isovalues()[0] - 110) < 2
    assert isowave.compress(array, no_data=200).suggested_isovalues() == []


def test_auto_is_the_first_suggestion_everywhere(volume):
    first = volume.suggested_isovalues()[0]
    image, given = (volume.render(i, size=(64, 48), device="host") for i in ("auto", first))
    assert image.isovalue == first and np.isfinite(image.depth).any()
    assert np.array_equal(image.rgb, given.rgb)
    assert volume.camera("auto", device="host") == volume.camera(first, device="host")
    mesh, expected = volume.extract("auto"), volume.extract(first)
    assert len(mesh.faces) and np.array_equal(mesh.vertices, expected.vertices)
    ray = [[-99, SIDE / 2, SIDE / 2, 1, 0, 0]]
    assert volume.cast_rays(ray, "auto")["t_hit"] == volume.cast_rays(ray, first)["t_hit"]
    assert volume.verify("auto", size=(64, 48))["hits"] > 0
    renderer = volume.renderer(size=(64, 48), device="host")
    assert renderer.render("auto").isovalue == first
    assert [*renderer.passes("auto")][-1].isovalue == first
    assert renderer.camera("auto") == renderer.camera(first)


@pytest.mark.parametrize("array", [np.full((8, 8, 8), 7, np.uint8), np.full((8, 8, 8), np.nan)])
def test_a_volume_of_one_value_has_no_auto(array):
    volume = isowave.compress(array)
    assert volume.suggested_isovalues() == []
    for draw in (
        volume.render,
        volume.extract,
        volume.camera,
        volume.renderer(device="host").render,
    ):
        with pytest.raises(isowave.Error, match="isovalue='auto': .*: give a number$"):
            draw("auto")


def test_other_texts_are_no_isovalues(volume):
    for draw in (volume.render, volume.extract):
        with pytest.raises(TypeError, match="isovalue='Auto': give a number"):
            draw("Auto")


def test_the_first_isovalue_is_suggested() -> None:
    none, failing = FakeVolume(suggested=()), FakeVolume(fail_suggesting=True)
    for volume, expected in ((FakeVolume(), 90.5), (none, 127.5), (failing, 127.5)):
        scene = make_scene(volume, Clock(), isovalue=None)
        eye = Eye(scene)
        assert eye.of_type("welcome")[0]["isovalue"] == expected
        run(scene)
        assert len(eye.of_type("histogram")[0]["counts"]) == 256
    auto = Eye(make_scene(FakeVolume(), Clock(), isovalue="auto"))
    assert auto.of_type("welcome")[0]["isovalue"] == 90.5
