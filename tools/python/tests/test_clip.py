"""Clipping planes: what of a ball is drawn, against closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import sphere_voxels

import isowave
from isowave import ClipPlane, clip_box

RADIUS = 9.0
MIDDLE = np.array((25.0, 31.5, 42.0))  # in the world: x, y, z
EYE = MIDDLE + (12, 9, 30)
SIZE = (72, 60)
CAMERA = isowave.Camera(tuple(EYE), tuple(MIDDLE), (0, 1, 0), 40)  # type: ignore[arg-type]
OBLIQUE = ClipPlane.through(MIDDLE + (1, 0, 0), (1, -2, -3))


@pytest.fixture(scope="module")
def ball() -> isowave.Volume:
    """Values fall with the distance from MIDDLE; RADIUS is the isovalue 0."""
    return isowave.compress(
        RADIUS - sphere_voxels((25, 24, 31)), exact=True, levels=2, origin=(30, 20, 10)
    )


def rays_of(camera: isowave.Camera, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    """(height, width, 3): unit directions through the middles of the pixels."""
    width, height = size
    eye, at, up = (np.array(v) for v in (camera.eye, camera.at, camera.up))
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    half = math.tan(math.radians(camera.fovy) / 2)
    x = half * (2 * (np.arange(width) + 0.5) - width) / height
    y = half * (height - 2 * (np.arange(height) + 0.5)) / height
    rays = forward + x[None, :, None] * right + y[:, None, None] * np.cross(right, forward)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def expected(
    clip: Sequence[ClipPlane], caps: bool
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Depth of the clipped ball, and which rays neither graze it nor pass an edge.

    The surface of the trilinear field is up to 0.03 voxels within the ball: h^2 / 8 RADIUS along
    each of two axes. Along a ray that does not graze, that is at most 0.08.
    """
    rays = rays_of(CAMERA, SIZE)
    begin, end = np.zeros(rays.shape[:2]), np.full(rays.shape[:2], np.inf)
    for plane in clip:
        normal = np.array(plane.normal)
        along, before = rays @ normal, EYE @ normal - plane.offset
        begin = np.where(along > 0, np.maximum(begin, -before / along), begin)
        end = np.where(along < 0, np.minimum(end, -before / along), end)
    nearest = rays @ (MIDDLE - EYE)
    off = np.linalg.norm(EYE + nearest[..., None] * rays - MIDDLE, axis=-1)
    half = np.sqrt(np.maximum(0, RADIUS**2 - off**2))
    enter, leave = nearest - half, nearest + half
    late = begin if caps else leave
    depth = np.where(enter >= begin, enter, np.where(leave > begin, late, np.inf))
    depth = np.where((off < RADIUS) & (depth < end), depth, np.inf)
    events = np.stack((enter, leave, begin, end))
    gaps = [np.abs(a - b) for i, a in enumerate(events) for b in events[:i] if a is not b]
    return depth, np.where(half > 0, (half > 3.5) & (np.min(gaps, axis=0) > 0.2), off > RADIUS)


CLIPS = {
    "whole": [],
    "half": [ClipPlane.through(MIDDLE, (0, 0, -1))],
    "oblique": [OBLIQUE],
    "two": [OBLIQUE, ClipPlane.through(MIDDLE, (0, 0.25, 0))],
    "box": clip_box(MIDDLE - (3, 5, 20), MIDDLE + (6, 4, 5)),
    "nothing": [ClipPlane((1, 0, 0), 1000)],
}


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_what_is_in_all_half_spaces_is_drawn(ball: isowave.Volume, device: str) -> None:
    renderer = ball.renderer(size=SIZE, device=device)
    for name, clip in CLIPS.items():
        for caps in (True, False):
            image = renderer.render(0, camera=CAMERA, clip=clip, caps=caps)
            depth, is_sure = expected(clip, caps)
            assert image.depth is not None and image.position is not None
            assert is_sure.mean() > 0.5, name
            assert np.allclose(image.depth[is_sure], depth[is_sure], atol=0.1), (name, caps)
            for plane in clip:
                height = image.position @ np.array(plane.normal) - plane.offset
                assert not (height < -1e-3).any(), "a hit outside a half space"


def test_caps_are_flat_and_face_away_from_what_stays(ball: isowave.Volume) -> None:
    image = ball.render(0, size=SIZE, camera=CAMERA, clip=[OBLIQUE], device="host")
    open_cut = ball.render(0, size=SIZE, camera=CAMERA, clip=[OBLIQUE], caps=False, device="host")
    assert image.depth is not None and image.normals is not None and open_cut.depth is not None
    is_cap = image.depth < open_cut.depth - 0.5
    assert is_cap.sum() > 300
    normal = np.array(OBLIQUE.normal) / np.linalg.norm(OBLIQUE.normal)
    along = rays_of(CAMERA, SIZE) @ normal
    distance = -(EYE @ normal - OBLIQUE.offset / np.linalg.norm(OBLIQUE.normal)) / along
    assert np.allclose(image.depth[is_cap], distance[is_cap], rtol=1e-5)
    assert np.allclose(image.normals[is_cap], -normal, atol=1e-5)


def test_all_requests_are_clipped_with_the_same_bits(ball: isowave.Volume) -> None:
    on_host = ball.renderer(size=SIZE, device="host")
    able = {"levels": True, "time_budget": True, "rays": True}
    on_device = ball.renderer(size=SIZE, device="cpu", **able)
    for more in (
        {},
        {"caps": False},
        {"ambient_rays": 3},
        {"time_budget_ms": 1e6},
        {"voxel_pixels": 9},
    ):
        options = {"camera": CAMERA, "clip": CLIPS["box"], **more}
        a, b = (renderer.render(0, **options) for renderer in (on_host, on_device))
        assert np.array_equal(a.rgb, b.rgb) and np.array_equal(a.depth, b.depth), more
    last = [image.rgb for image in on_device.passes(0, camera=CAMERA, clip=[OBLIQUE])][-1]
    assert np.array_equal(last, on_host.render(0, camera=CAMERA, clip=[OBLIQUE]).rgb)


def test_planes_that_cannot_be_drawn_are_refused(ball: isowave.Volume) -> None:
    renderer = ball.renderer(size=SIZE, device="host")

    def refuse(says: str, **request: object) -> None:
        with pytest.raises(isowave.Error, match=says):
            renderer.render(0, **{"clip": [OBLIQUE], **request})  # type: ignore[arg-type]

    refuse("15 clipping planes: up to 14 can be drawn", clip=15 * [OBLIQUE])
    refuse("normal is 0 0 0: give a direction", clip=[ClipPlane((0, 0, 0))])
    refuse("normal is nan 0 0: give a direction", clip=[ClipPlane((math.nan, 0, 0))])
    refuse("offset is inf: give a number", clip=[ClipPlane((1, 0, 0), math.inf)])
    refuse("errors are proven of whole surfaces: leave out clip", max_surface_error=1.0)
    refuse("errors are bounded of whole surfaces: leave out clip", outputs=("bounds",))
    renderer.render(0, camera=CAMERA, clip=14 * [OBLIQUE])


def test_the_box_around_a_volume() -> None:
    """Index axis x is along the world's y, y along -x, and z leans."""
    direction = np.array(((0, -1, 0), (1, 0, 0.6), (0, 0, 0.8)))
    volume = isowave.compress(
        sphere_voxels((11, 7, 6)),
        exact=True,
        origin=(3, 2, 1),
        spacing=(2, 3, 4),
        direction=direction,
    )
    begin, end = volume.box
    index = np.array([[5 * (i & 1), 6 * (i >> 1 & 1), 10 * (i >> 2)] for i in range(8)])
    corners = (1, 2, 3) + (index * (4, 3, 2)) @ direction.T
    assert np.allclose((begin, end), (corners.min(axis=0), corners.max(axis=0)))
    camera = volume.renderer(size=SIZE, device="host").camera(2)
    whole = volume.render(2, size=SIZE, camera=camera, device="host")
    around: dict[str, Any] = {"clip": clip_box(begin, end), "caps": False}
    same = volume.render(2, size=SIZE, camera=camera, device="host", **around)
    assert np.array_equal(whole.rgb, same.rgb)


def test_planes_and_boxes() -> None:
    assert ClipPlane.through((1, 2, 3), (0, 0, 2)) == ClipPlane((0, 0, 2), 6)
    assert clip_box((1, 2, 3), (4, 5, 6)) == [
        ClipPlane((1, 0, 0), 1),
        ClipPlane((-1, 0, 0), -4),
        ClipPlane((0, 1, 0), 2),
        ClipPlane((0, -1, 0), -5),
        ClipPlane((0, 0, 1), 3),
        ClipPlane((0, 0, -1), -6),
    ]
    everywhere = math.inf
    assert clip_box((-everywhere,) * 3, (everywhere, 7, everywhere)) == [ClipPlane((0, -1, 0), -7)]
    with pytest.raises(ValueError, match="the box ends at 2.0 along y, and begins at 2.0"):
        clip_box((1, 2, 3), (4, 2, 6))
    with pytest.raises(ValueError, match="begins at nan"):
        clip_box((math.nan, 2, 3), (4, 5, 6))
    with pytest.raises(TypeError, match="point='123': give 3 numbers"):
        ClipPlane.through("123", (0, 0, 1))  # type: ignore[arg-type]
