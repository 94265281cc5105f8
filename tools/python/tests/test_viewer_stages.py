"""What is on the page stays until something better is there: more rays, passes, places."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run

from isowave._camera import Camera
from isowave._request import Request
from isowave.viewer.hits import Hits, value_at
from isowave.viewer.messages import bins_of
from isowave.viewer.pictures import laid_over, opaque
from isowave.viewer.protocol import Probe

WHITE = np.array([255, 255, 255], np.uint8)


def pixels(eye: Eye, head: dict[str, Any]) -> NDArray[Any]:
    return np.asarray(Image.open(io.BytesIO(eye.data[head["frame"]])).convert("RGB"))


def acked(eye: Eye) -> None:
    eye.ack()


@pytest.mark.parametrize(
    "more", [dict(samples=2), dict(ambient_rays=16), dict(samples=2, ambient_rays=16)]
)
def test_more_rays_come_after_a_sharp_picture(more: dict[str, Any]) -> None:
    """B9: the sharp picture is whole, and stays until the one with more rays is whole."""
    clock = Clock()

    def before_pass(drawn: Any) -> None:
        clock.now += 1  # each pass is worth a picture
        eye.ack()

    volume = FakeVolume(before_pass=before_pass)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(**more)
    run(scene)
    eye.ack()
    clock.now += 1
    run(scene)
    stages = [stage for _, stage in eye.pictures]
    assert [s for s in stages if s != "pass"] == ["first", "sharp", "whole", "lossless"]
    assert "pass" not in stages[stages.index("sharp") :]
    drawn = [(f.request.samples, f.request.ambient_rays) for f in volume.frames]
    assert drawn[:3] == [(1, 0), (1, 0), (more.get("samples", 1), more.get("ambient_rays", 0))]
    # Meanwhile the page hears how far the picture is.
    sharp = next(i for i, h in enumerate(eye.heads) if h.get("stage") == "sharp")
    told = [h["percent"] for h in eye.heads[sharp:] if h["type"] == "progress"]
    assert told == sorted(told) and len(told) >= 2


def test_a_picture_that_a_time_left_coarse_is_finished_at_rest() -> None:
    """The coarse one stays until the whole one is there; passes go over it."""
    clock = Clock()

    def before_pass(drawn: Any) -> None:
        clock.now += 1
        eye.ack()

    volume = FakeVolume(before_pass=before_pass, is_coarse=True)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(time_budget_ms=50)
    while not volume.frames:
        scene.step()
    for _ in range(3):
        scene.step()
    assert len(volume.frames) == 1, "somebody who moves sends the next wish"
    run(scene)
    for _ in range(2):
        eye.ack()
        clock.now += 10
        run(scene)
    drawn = [(frame.request.time_budget_ms, frame.size) for frame in volume.frames]
    assert drawn[:2] == [(50, (64, 48)), (None, (64, 48))]
    complete = [h["complete"] for h in eye.of_type("picture") if h["stage"] == "whole"]
    assert complete == [False, True] and eye.pictures[-1] == (1, "lossless")
    assert "pass" in [stage for _, stage in eye.pictures]
    # The next wish has its time again; what is finished within it is drawn once.
    eye.wish(time_budget_ms=50)
    while volume.frames[-1].request.time_budget_ms is None:
        scene.step()
    volume.is_coarse = False
    second = eye.wish(time_budget_ms=50)
    count = len(volume.frames)
    run(scene)
    assert len(volume.frames) == count + 1
    assert [s for n, s in eye.pictures if n == second and s != "pass"] == ["whole"]


def test_a_plain_picture_is_drawn_once() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    assert [stage for _, stage in eye.pictures] == ["first", "whole"]


@pytest.mark.parametrize("background", [(1, 1, 1), (0, 0, 0), (0.2, 0.4, 0.9)])
def test_passes_never_show_background_in_place_of_the_first_picture(
    background: tuple[float, float, float],
) -> None:
    """B9: strips from the top; what is below them keeps the first picture."""
    clock = Clock()

    def before_pass(drawn: Any) -> None:
        clock.now += 1
        eye.ack()

    volume = FakeVolume(before_pass=before_pass, passes=4)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(size=(640, 480), background=background)
    run(scene)
    passes = [h for h in eye.of_type("picture") if h["stage"] == "pass"]
    assert len(passes) >= 2
    whole = pixels(eye, next(h for h in eye.of_type("picture") if h["stage"] == "whole"))
    behind = np.rint(255 * np.array(background)).astype(int)
    ball = np.abs(whole.astype(int) - behind).max(axis=2) > 40
    inner = ball[8:-8, 8:-8] & ball[:-16, 8:-8] & ball[16:, 8:-8]
    for head in passes:
        empty = np.abs(pixels(eye, head)[8:-8, 8:-8].astype(int) - behind).max(axis=2) < 12
        assert np.count_nonzero(empty & inner) < 0.001 * np.count_nonzero(inner)


def test_a_picture_laid_over_another_keeps_its_own_hits() -> None:
    under = np.full((2, 3, 3), 9, np.uint8)
    rgb = np.zeros((4, 6, 3), np.uint8)
    request = Request(1.0, background=(1, 0, 0), background_top=(0, 0, 1))
    rows = 1 - (np.arange(4) + 0.5) / 4
    rgb[:, :, 0], rgb[:, :, 2] = np.rint(255 * (1 - rows))[:, None], np.rint(255 * rows)[:, None]
    rgb[1, 2] = (5, 6, 7)
    over = laid_over(under, rgb, request)
    assert tuple(over[1, 2]) == (5, 6, 7)
    over[1, 2] = 9
    assert (over == 9).all()


def test_without_a_first_picture_passes_are_not_shown() -> None:
    """A wish whose picture was quick before has none; what is on the page is better."""
    clock = Clock()
    slow = [False]

    def before_pass(drawn: Any) -> None:
        clock.now += 1 if slow[0] else 0
        eye.ack()

    volume = FakeVolume(before_pass=before_pass)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    slow[0] = True
    wish = eye.wish(isovalue=90)
    run(scene)
    assert [stage for n, stage in eye.pictures if n == wish] == ["whole"]


def test_a_probe_says_what_is_seen_at_a_place() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(isovalue=100.0, size=(64, 64))
    run(scene)
    for at in ((0.5, 0.5), (0.0, 0.0)):
        scene.receive(eye.client, Probe(7, at))
    middle, corner = eye.of_type("probe")
    radius = 32 * (1 - 100 / 255)
    assert middle["id"] == 7
    assert middle["position"] == pytest.approx([31.5, 31.5, 31.5 + radius], abs=0.8)
    assert middle["value"] == pytest.approx(100, abs=3) and middle["field"] is None
    assert (corner["position"], corner["value"]) == (None, None)
    # A new wish has no hits yet: nothing is said that was true before.
    eye.wish(isovalue=120.0)
    scene.receive(eye.client, Probe(8, (0.5, 0.5)))
    assert eye.of_type("probe")[-1]["position"] is None


def test_a_probe_of_voxels_that_are_gone_has_a_place() -> None:
    clock, volume = Clock(), FakeVolume(refuse_voxels=True)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(size=(64, 64))
    run(scene)
    scene.receive(eye.client, Probe(1, (0.5, 0.5)))
    (answer,) = eye.of_type("probe")
    assert answer["position"] is not None and answer["value"] is None


def test_positions_and_values_are_those_of_the_volume() -> None:
    depth = np.full((4, 8), np.inf, np.float32)
    depth[1, 6] = 5
    camera = Camera((1, 2, 3), (1, 2, 0), (0, 1, 0), 90)
    hits = Hits(depth, camera, 0)
    assert hits.position((0.1, 0.1)) is None
    position = hits.position((0.8, 0.4))
    ray = np.array([2 * 6.5 / 8 - 1, 0, 0]) * 2 + [0, 1 - 2 * 1.5 / 4, -1]
    assert position == pytest.approx(np.array([1, 2, 3]) + 5 * ray / np.linalg.norm(ray))
    parallel = Hits(depth, replace(camera, parallel_height=2.0), 0).position((0.8, 0.4))
    assert parallel == pytest.approx(np.array([1, 2, 3]) + [ray[0], ray[1], -5])

    class Sheared(FakeVolume):
        def __getitem__(self, key: Any) -> Any:
            z, y, x = np.meshgrid(*(np.arange(64)[k] for k in key), indexing="ij")
            return (100 * z + 10 * y + x).astype(np.float32)

    volume = Sheared(spacing=(3.0, 2.0, 1.0), origin=(30.0, 20.0, 10.0))
    volume.direction = np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])
    index = np.array([4.5, 6.25, 7.0])  # x, y, z
    place = np.array([10, 20, 30]) + volume.direction @ ([1, 2, 3] * index)
    assert value_at(volume, place) == pytest.approx(700 + 62.5 + 4.5)
    assert value_at(volume, place + 1000) is None
    last = np.array([10, 20, 30]) + volume.direction @ (np.array([1, 2, 3]) * 63)
    assert value_at(volume, last) == pytest.approx(6300 + 630 + 63)


@pytest.mark.parametrize("values", [2, 13, 233, 256, 257, 1000, 4096, 65536])
def test_bins_of_integers_have_as_many_values_each(values: int) -> None:
    bins = bins_of(np.dtype(np.uint16), (3.0, values + 2.0))
    counts, _ = np.histogram(np.arange(3, values + 3), bins=bins, range=(3, values + 2))
    assert 1 <= bins <= 256
    # The last may have fewer; where edges drift past a value, one has one less.
    assert counts[:-1].max(initial=0) - counts[:-1].min(initial=values) <= 1 or bins == 1
    if values <= 256:
        assert bins == values and (counts == 1).all()


def test_other_values_have_256_bins() -> None:
    assert bins_of(np.dtype(np.float32), (0.0, 10.0)) == 256
    assert bins_of(np.dtype(np.uint8), (4.0, 4.0)) == 256


def test_a_transparent_picture_has_alpha_in_its_lossless_file_alone() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(size=(64, 64), transparent=True, background=None)
    run(scene)
    eye.ack()
    clock.now += 1
    run(scene)
    head = eye.of_type("picture")[-1]
    assert head["stage"] == "lossless"
    picture = Image.open(io.BytesIO(eye.data[head["frame"]]))
    assert picture.mode == "RGBA"
    alpha = np.asarray(picture)[:, :, 3]
    assert alpha[0, 0] == 0 and alpha[32, 32] == 255
    rgba = np.array([[[0, 0, 0, 0], [10, 20, 30, 255]]], np.uint8)
    assert opaque(rgba).tolist() == [[[255, 255, 255], [10, 20, 30]]]
