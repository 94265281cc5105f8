"""Several and translucent surfaces in one picture."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from conftest import FUEL, sphere_voxels

import isowave
from isowave import ClipPlane, Surface

RADIUS = 9.0  # of the isovalue 0; that of 5 has 4
MIDDLE = np.array((25.0, 31.5, 42.0))  # in the world: x, y, z
SIZE = (64, 48)
CAMERA = isowave.Camera((25, 31.5, 82), (25, 31.5, 42), (0, 1, 0), 40)
BOTH = [Surface(0, "#3060c0", 0.5), Surface(5, "#dbbd87")]
HALF = ClipPlane.through(MIDDLE, (0, 0, -1))
DEVICES = ["host", "cpu"]


@pytest.fixture(scope="module")
def ball() -> isowave.Volume:
    """Values fall with the distance from MIDDLE."""
    voxels = RADIUS - sphere_voxels((25, 24, 31))
    return isowave.compress(voxels, exact=True, levels=2, origin=(30, 20, 10))


@pytest.mark.parametrize("device", DEVICES)
def test_a_translucent_surface_is_seen_through(ball: isowave.Volume, device: str) -> None:
    renderer = ball.renderer(size=SIZE, device=device, surfaces=2)
    outer = renderer.render(0, camera=CAMERA, color="#3060c0")
    inner = renderer.render(5, camera=CAMERA)
    image = renderer.render(camera=CAMERA, surfaces=BOTH)
    assert image.rgb is not None and outer.rgb is not None and inner.rgb is not None
    mixed = (outer.rgb.astype(float) + inner.rgb) / 2
    is_inner = inner.depth < np.inf
    assert is_inner.sum() > 50
    assert np.abs(image.rgb - mixed)[is_inner].max() <= 1
    alone = renderer.render(camera=CAMERA, surfaces=[Surface(0, "#3060c0")])
    assert np.array_equal(alone.rgb, outer.rgb)
    assert image.surfaces[0] == Surface(0.0, (0x30 / 255, 0x60 / 255, 0xC0 / 255), 0.5)
    assert "isovalues 0, 5>" in repr(image) and "isovalue 0>" in repr(alone)


@pytest.mark.parametrize("device", DEVICES)
def test_errors_are_those_of_the_first_crossing(device: str) -> None:
    voxels = RADIUS - sphere_voxels((25, 24, 31))
    volume = isowave.compress(voxels, rate=20, origin=(30, 20, 10))
    options = {"camera": CAMERA, "size": SIZE, "device": device}
    image = volume.render(
        surfaces=BOTH, outputs=("depth", "bounds"), max_surface_error=2.0, **options
    )
    assert image.depth is not None and image.bounds is not None
    is_hit = np.isfinite(image.depth)
    assert is_hit.sum() > 500 and np.mean(image.bounds[is_hit] <= 2.0) > 0.95
    detail = image.statistics["detail"]
    assert detail["voxel_pixels"] == 0 < detail["voxel_error"]
    outer = volume.render(0, outputs=("bounds",), voxel_error=detail["voxel_error"], **options)
    assert np.array_equal(image.bounds, outer.bounds)
    sample = volume.render(surfaces=BOTH, max_surface_error=2.0, by="sample", **options)
    assert sample.statistics["detail"]["voxel_error"] > 0


@pytest.mark.parametrize("device", DEVICES)
def test_arrays_are_those_of_the_first_crossing(ball: isowave.Volume, device: str) -> None:
    renderer = ball.renderer(size=SIZE, device=device, surfaces=2)
    outputs = ("rgb", "depth", "normals", "surface", "cap")
    outer = renderer.render(0, camera=CAMERA, outputs=outputs)
    image = renderer.render(camera=CAMERA, surfaces=BOTH[::-1], outputs=outputs)
    assert image.depth is not None and image.surface is not None and image.cap is not None
    assert np.array_equal(image.depth, outer.depth)
    assert np.array_equal(image.normals, outer.normals)
    is_hit = np.isfinite(image.depth)
    assert image.surface.dtype == np.int8 and image.cap.dtype == np.bool_
    assert np.array_equal(image.surface, np.where(is_hit, 1, -1)) and not image.cap.any()
    assert np.array_equal(outer.surface, np.where(is_hit, 0, -1))
    statistics = image.statistics
    assert statistics["hits"] == is_hit.sum() and statistics["rays_cut"] == 0
    assert statistics["layers"] == 2 and statistics["layer_hits"] == 2 * is_hit.sum()
    assert outer.statistics["layers"] == outer.statistics["layer_hits"] == 0
    cut = renderer.render(camera=CAMERA, surfaces=BOTH, outputs=outputs, clip=[HALF])
    assert cut.surface is not None and cut.cap is not None
    assert (cut.surface[cut.cap] == 1).sum() > 50  # the cap of the inner one is in front
    assert (cut.surface[cut.cap] == 0).sum() > 200
    plain = renderer.render(camera=CAMERA, surfaces=BOTH)
    assert plain.surface is None and plain.cap is None


def test_files_have_the_programs_bits(program: Any, tmp_path: Any) -> None:
    volume = isowave.open(FUEL, exact=True)
    surfaces = [Surface(10, "skin", 0.3), Surface(40, opacity=0.5), Surface(120, "#ff8000")]
    for options, more in (
        ((), {}),
        (("--transparent", "--samples", 2), {"transparent": True, "samples": 2}),
        (
            ("--normals", "cell", "--background", "black"),
            {"normals": "cell", "background": "black"},
        ),
    ):
        program("render", FUEL, "--exact", "--size", "64x48", "--reference",
                "--surface", "10,skin,0.3", "--surface", "40,,0.5", "--surface", "120,#FF8000",
                "-o", tmp_path / "twin.png", *options)  # fmt: skip
        expected = (tmp_path / "twin.png").read_bytes()
        for device in DEVICES:
            image = volume.render(surfaces=surfaces, size=SIZE, device=device, **more)
            image.save(tmp_path / "a.png")
            assert (tmp_path / "a.png").read_bytes() == expected, (device, options)


def test_a_volume_makes_the_renderer_that_is_needed(ball: isowave.Volume) -> None:
    volume = isowave.compress(RADIUS - sphere_voxels((25, 24, 31)), exact=True)
    more: dict[str, Any] = {"size": SIZE, "device": "cpu"}
    volume.render(0, **more)
    first = volume._renderer
    volume.render(surfaces=BOTH, **more)
    second = volume._renderer
    assert first is not None and second is not None and second is not first
    assert (first._can["surfaces"], second._can["surfaces"]) == (0, 2)
    volume.render(0, **more)
    volume.render(surfaces=BOTH[:1], **more)
    assert volume._renderer is second
    volume.render(0, ambient_rays=1, **more)
    assert volume._renderer is not None and volume._renderer._can["surfaces"] == 2


def test_pictures_after_each_pass_end_with_the_whole_one(ball: isowave.Volume) -> None:
    renderer = ball.renderer(size=SIZE, device="cpu", cache_blocks=64, surfaces=2)
    whole = renderer.render(camera=CAMERA, surfaces=BOTH)
    pictures = list(renderer.passes(camera=CAMERA, surfaces=BOTH))
    assert len(pictures) > 1 and np.array_equal(pictures[-1].rgb, whole.rgb)


def test_the_camera_sees_all_surfaces(ball: isowave.Volume) -> None:
    renderer = ball.renderer(size=SIZE, device="host")
    assert renderer.camera(surfaces=BOTH) == renderer.camera(0) != renderer.camera(5)
    assert ball.camera(surfaces=BOTH, size=SIZE, device="host") == renderer.camera(0)
    assert renderer.render(surfaces=BOTH).camera == renderer.camera()


def test_transparent_pictures_and_others_with_alpha(ball: isowave.Volume) -> None:
    image = ball.render(surfaces=BOTH, camera=CAMERA, size=SIZE, transparent=True)
    alpha = image.rgba[..., 3]
    inner = np.isfinite(ball.render(5, camera=CAMERA, size=SIZE).depth)
    assert (alpha[inner] == 255).all()
    once = alpha[~inner & (alpha != 0)]
    assert (abs(once - 191.25) <= 1).all() and once.size > 100  # two crossings of 0.5
    opaque = ball.render(surfaces=BOTH, camera=CAMERA, size=SIZE)
    assert (opaque.rgba[..., 3] == 255).all()


def test_scenes_are_put_together_step_by_step(ball: isowave.Volume) -> None:
    empty = ball.scene()
    scene = empty.surface(0, "#3060c0", opacity=0.5).surface(5, "#dbbd87")
    assert scene.surfaces == tuple(BOTH) and empty.surfaces == ()
    assert scene.clip(HALF).clip([HALF]).planes == (HALF, HALF) and scene.planes == ()
    image = scene.clip(HALF).render(size=SIZE, camera=CAMERA)
    same = ball.render(surfaces=BOTH, clip=[HALF], size=SIZE, camera=CAMERA)
    assert np.array_equal(image.rgb, same.rgb)
    assert scene.camera(size=SIZE, device="host") == ball.camera(0, size=SIZE, device="host")
    assert ball.scene().surface("auto").surfaces[0].isovalue == ball.suggested_isovalues()[0]
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.surfaces = ()  # type: ignore[misc]
    with pytest.raises(TypeError, match="give an isovalue, or surfaces"):
        empty.render()


def test_colors_have_defaults_and_names(ball: isowave.Volume) -> None:
    surfaces = [Surface(value) for value in range(8)]
    image = ball.render(surfaces=surfaces, size=SIZE, camera=CAMERA)
    colors = [surface.color for surface in image.surfaces]
    assert colors[0] == (219 / 255, 189 / 255, 135 / 255) and len(set(colors)) == 8
    named = ball.render(0, size=SIZE, camera=CAMERA, color="orange", background="black")
    same = ball.render(0, size=SIZE, camera=CAMERA, color="#ffa500", background=(0, 0, 0))
    assert np.array_equal(named.rgb, same.rgb)


def test_surfaces_that_cannot_be_drawn_are_refused(ball: isowave.Volume) -> None:
    renderer = ball.renderer(size=SIZE, device="host")

    def refuse(says: str, surfaces: Any = BOTH, **request: Any) -> None:
        with pytest.raises((isowave.Error, TypeError, ValueError), match=says) as raised:
            renderer.render(surfaces=surfaces, camera=CAMERA, **request)
        assert "\n" not in str(raised.value)

    refuse("9 surfaces are more than a frame can have", [Surface(v / 2) for v in range(9)])
    refuse("two surfaces have the isovalue 0", [Surface(0), Surface(0.0)])
    refuse("NaN", [Surface(math.nan)])
    refuse("an opacity of 0 is out of range", [Surface(0, opacity=0)])
    refuse("an opacity of 2 is out of range", [Surface(0, opacity=2)])
    refuse("there is no colour 'bones': give #RRGGBB, or one of bone,", [Surface(0, "bones")])
    refuse("give red, green and blue, from 0 to 1", [Surface(0, (0, 1, 2))])
    refuse("Surface.isovalue='0': give a number", [Surface("0")])  # type: ignore[arg-type]
    refuse("Surface.opacity=None: give a number", [Surface(0, opacity=None)])  # type: ignore
    refuse("surfaces=5: give an isowave.Surface", [5])
    refuse("surfaces=.*: give a list of isowave.Surface", Surface(0))
    refuse("isovalue and surfaces: give one of both", isovalue=0)
    refuse("give an isovalue, or surfaces", [])
    refuse("color: surfaces have colours of their own", color="red")
    glass = [Surface(0, opacity=0.5), Surface(1, opacity=0.9)]
    refuse("end at surfaces of opacity 1, and there is none", glass, ambient_rays=1)
    refuse("leave out max_image_error", max_image_error=0.1)
    refuse("leave out time_budget_ms", time_budget_ms=1)
    refuse("errors are bounded of whole surfaces", outputs=("bounds",), clip=[HALF])
    on_device = ball.renderer(size=SIZE, device="cpu", surfaces=1)
    with pytest.raises(isowave.Error, match="needs a renderer that was made with surfaces=2"):
        on_device.render(surfaces=BOTH)
    with pytest.raises(ValueError, match="surfaces=9: give a whole number from 0 to 8"):
        ball.renderer(surfaces=9)
