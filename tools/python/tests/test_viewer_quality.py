"""The error of a picture in the viewer: what the page asks for, and how scenes draw it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from browser_pages import (  # noqa: F401
    asked,
    browser,
    button,
    fake_scene,
    keep,
    menu,
    open_page,
    rests,
    state,
    type_into,
)
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run

import isowave
from isowave.viewer.renderers import MAX_CAMERA_RAYS, TILE
from isowave.viewer.scene import Scene
from isowave.viewer.server import Server


def look(eye: Eye, clock: Clock) -> None:
    """Draws all stages of the client's wish."""
    for _ in range(3):
        run(eye.scene)
        eye.ack()
        clock.now += 10


def test_only_the_whole_picture_chooses_and_bounds_are_of_what_it_chose() -> None:
    clock, volume = Clock(), FakeVolume(num_levels=3)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(size=(64, 48), samples=4, max_image_error=0.01)
    look(eye, clock)
    requests = [frame.request for frame in volume.frames]
    assert [(r.size, r.samples, r.max_image_error, r.voxel_pixels) for r in requests] == [
        ((16, 12), 1, None, 0),
        ((64, 48), 4, 0.01, 0),
        ((16, 12), 1, None, 0.5 / 4),
    ]
    assert "bounds" in requests[-1].outputs and eye.of_type("bounds")[-1]["within_pixel"] > 0.6
    first, whole, lossless = eye.of_type("picture")
    assert (first["samples"], first["detail"]) == (1, None)
    for head in (whole, lossless):
        assert (head["samples"], head["size"], head["reduced"]) == (2, [64, 48], None)
        assert (head["detail"]["flip"], head["detail"]["reachable"]) == (0.008, True)
    eye.wish(size=(64, 48))
    look(eye, clock)
    assert volume.frames[-1].request.voxel_pixels == 0, "the next wish chose nothing"
    assert not eye.of_type("error")


def test_an_error_out_of_reach_is_told() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(samples=4, max_image_error=0.001)
    look(eye, clock)
    head = eye.of_type("picture")[-1]
    assert (head["samples"], head["detail"]["reachable"]) == (4, False)
    assert head["detail"]["advice"] == "allow more rays" and head["reduced"] is None


@pytest.mark.parametrize("error", [0.01, 0.001])
def test_a_server_with_a_limit_chooses_among_fewer_rays(error: float) -> None:
    """It says so only if the error is out of reach."""
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(640, 480), max_rays=100 * 100 * 9)
    eye = Eye(scene)
    eye.wish(size=(100, 100), samples=4, max_image_error=error)
    look(eye, clock)
    whole = volume.frames[1].request
    assert (whole.size, whole.samples) == ((100, 100), 3)
    assert (eye.of_type("picture")[-1]["reduced"] is None) == (error == 0.01)


def test_a_small_picture_gets_a_renderer_for_tiles() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    eye.wish(size=(64, 48), samples=2, max_image_error=0.01)
    look(eye, clock)
    assert [made["size"] for made in volume.renderers] == [(64, 48), TILE]
    assert eye.pictures[-1] == (1, "lossless") and not eye.of_type("error")


def test_a_device_without_memory_for_tiles_says_so_once() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("too large") if options["size"] == TILE else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock, size=(64, 48))
    eye = Eye(scene)
    for _ in range(2):
        eye.wish(size=(64, 48), samples=2, max_image_error=0.01)
        look(eye, clock)
        assert "fewer rays than a tile" in eye.of_type("error")[-1]["message"]
    assert len(volume.renderers) == 3, "the first, the one too large, the first again"


def test_the_plan_of_a_large_picture_keeps_its_pixels() -> None:
    scene = make_scene(FakeVolume(), Clock())
    eye = Eye(scene)
    eye.wish(size=(2560, 1440), samples=4, ambient_rays=16, max_image_error=0.01)
    assert eye.client.wish is not None
    plan = scene._renderers.plan(eye.client.wish)
    assert (plan.size, plan.samples, plan.ambient) == ((2560, 1440), 1, 16)
    assert plan.rays <= MAX_CAMERA_RAYS


def test_meanwhile_the_host_draws_one_ray_a_pixel() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    renderers = scene._renderers
    renderers.host = FakeVolume(on_host=True).renderer(device="host", size=(1, 1), samples=1)
    renderers.renderer, renderers._made, renderers.is_making = None, None, True
    eye.wish(size=(64, 48), samples=4, max_image_error=0.01)
    run(scene)
    whole = eye.of_type("picture")[-1]
    assert (whole["stage"], whole["samples"], whole["detail"]) == ("whole", 1, None)
    assert whole["reduced"] is None and not eye.of_type("error")


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_a_real_renderer_keeps_the_error(device: str) -> None:
    z, y, x = np.mgrid[-1:1:64j, -1:1:64j, -1:1:64j]
    ball = np.sqrt(x**2 + y**2 + z**2).astype(np.float32)
    volume, clock = isowave.compress(ball, tolerance=0.001, levels=2), Clock()
    scene = Scene(volume, isovalue=0.8, device=device, clock=clock, start=False)
    eye = Eye(scene)
    eye.wish(0.8, size=(80, 60), samples=4, max_image_error=0.05)
    look(eye, clock)
    assert not eye.of_type("error")
    head = eye.of_type("picture")[-1]
    detail = head["detail"]
    assert head["stage"] == "lossless" and detail["reachable"]
    assert 0 < detail["flip"] <= detail["highest_flip"] <= 0.05
    assert head["samples"] == detail["samples"] <= 4
    assert detail["voxel_pixels"] == eye.client.voxel_pixels > 0, "a ball is smooth"
    assert 0 < eye.of_type("bounds")[-1]["within_pixel"] <= 1
    scene.close()


@pytest.mark.parametrize("levels", [1, 3])
def test_coarser_levels_are_drawn_where_there_are_some(levels: int) -> None:
    clock, volume = Clock(), FakeVolume(num_levels=levels)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(size=(64, 48), voxel_pixels=2.0)
    look(eye, clock)
    drawn = [frame.request.voxel_pixels for frame in volume.frames]
    assert drawn == ([2, 2, 0.5] if levels > 1 else [0, 0, 0]), "bounds are of what is drawn"
    assert not eye.of_type("error") and eye.of_type("welcome")[-1]["levels"] == levels


def test_the_page_asks_for_levels_of_detail(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume(num_levels=3)
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        voxels, facts = page.get_by_label("Voxels up to"), page.locator(".facts")
        asked(page, volume)
        type_into(voxels, "1.5")
        page.keyboard.press("Enter")
        assert asked(page, volume).voxel_pixels == 1.5 and state(page)["voxels"] == "1.5"
        assert "voxels up to 1.5 px apart" in facts.inner_text()
        assert not page.locator(".of_levels").is_visible()
        command = menu(page, "export").get_by_label("The same picture").input_value()
        assert "--voxel-pixels 1.5 " in command
        # With a time, too; an error comes in place of it.
        type_into(page.get_by_label("Time per picture"), "200")
        page.keyboard.press("Enter")
        request = asked(page, volume)
        assert (request.voxel_pixels, request.time_budget_ms) == (1.5, 200)
        page.reload()
        assert asked(page, volume).voxel_pixels == 1.5
        type_into(page.get_by_label("Accurate to"), "2")
        page.keyboard.press("Enter")
        request = asked(page, volume)
        assert (request.voxel_pixels, request.max_surface_error) == (0, 2)
        assert voxels.input_value() == "" and "voxels" not in state(page)
        type_into(voxels, "4")
        page.keyboard.press("Enter")
        request = asked(page, volume)
        assert (request.voxel_pixels, request.max_surface_error) == (4, None)
        for text in ("0", "-1", "2000"):
            type_into(voxels, text)
            page.keyboard.press("Enter")
            assert voxels.evaluate("e => e.matches(':invalid')"), text
        type_into(voxels, "")
        page.keyboard.press("Enter")
        assert asked(page, volume).voxel_pixels == 0 and page.problems == []


def test_a_volume_of_one_level_says_how_to_get_more(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(f"{server.url}#voxels=3")
        assert asked(page, volume).voxel_pixels == 0
        page.locator("details:has(.of_levels)").evaluate("e => { e.open = true; }")
        assert page.get_by_label("Voxels up to").is_disabled()
        assert "--levels all" in page.locator(".of_levels").inner_text()


def test_the_page_asks_for_an_error_of_the_picture(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        error, facts = page.get_by_label("Accurate to"), page.locator(".facts")
        asked(page, volume)
        type_into(error, "2")
        page.keyboard.press("Enter")
        assert (
            asked(page, volume).max_surface_error == 2
            and not page.locator(".of_picture").is_visible()
        )
        # Pixels are no FLIP: the number goes, and the limits are others.
        page.get_by_label("Judged by").select_option("picture")
        request = asked(page, volume)
        assert (request.max_surface_error, request.max_image_error, request.samples) == (
            None,
            None,
            1,
        )
        assert error.input_value() == "" and page.locator(".of_error").inner_text() == "FLIP"
        assert "64 rays a pixel at full detail" in page.locator(".of_picture").inner_text()
        for text in ("0", "1.5", "-1"):
            type_into(error, text)
            page.keyboard.press("Enter")
            assert error.evaluate("e => e.matches(':invalid')"), text
            assert asked(page, volume).max_image_error is None
        # Rays are chosen, up to 16 unless somebody says how many.
        type_into(error, "0.01")
        page.keyboard.press("Enter")
        request = asked(page, volume)
        assert (request.max_surface_error, request.max_image_error, request.samples) == (
            None,
            0.01,
            4,
        )
        assert page.get_by_label("Most rays per pixel").input_value() == "4"
        assert "4 rays a pixel" in facts.inner_text()
        assert "FLIP 0.008, at most 0.01 with 95 % confidence" in facts.inner_text()
        assert state(page)["error"] == "0.01" and state(page)["by"] == "picture"
        keep(page, "picture_error")
        page.get_by_label("Most rays per pixel").select_option("4")
        assert asked(page, volume).samples == 2
        type_into(error, "0.002")
        page.keyboard.press("Enter")
        rests(page)
        assert "FLIP 0.002 is out of reach: allow more rays" in facts.inner_text()
        # What is asked for is in the address.
        page.reload()
        request = asked(page, volume)
        assert (request.max_image_error, request.samples) == (0.002, 2)
        # Not with several surfaces.
        button(page, "Add surface").click()
        request = asked(page, volume)
        assert (request.max_image_error, request.samples, len(request.surfaces)) == (None, 2, 2)
        assert error.is_disabled() and not page.locator(".of_picture").is_visible()
        button(page, "Remove surface 2").click()
        assert asked(page, volume).max_image_error == 0.002
        # What was given last counts.
        type_into(page.get_by_label("Time per picture"), "200")
        page.keyboard.press("Enter")
        request = asked(page, volume)
        assert (request.max_image_error, request.time_budget_ms) == (None, 200)
        assert "error" not in state(page) and page.problems == []


@pytest.mark.parametrize(
    "hash_text, expected",
    [
        ("error=0.02&by=picture", (None, 0.02, 4)),
        ("error=0.02&by=picture&samples=8", (None, 0.02, 8)),
        ("error=0.02", (0.02, None, 1)),
        ("error=2&by=picture", (None, None, 1)),
        ("error=0.0005", (None, None, 1)),
        ("by=picture&ms=50", (None, None, 1)),
        ("error=0.02&by=constructor", (0.02, None, 1)),
    ],
)
def test_addresses_of_errors(
    open_page: Callable[..., Any], hash_text: str, expected: tuple[Any, ...]  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page(viewport={"width": 400, "height": 300})
        page.goto(f"{server.url}#{hash_text}")
        request = asked(page, volume)
        assert (request.max_surface_error, request.max_image_error, request.samples) == expected
        # In an open page, a number in pixels is no FLIP.
        page.evaluate("location.hash = '#error=0.5&by=picture'")
        assert asked(page, volume).max_image_error == 0.5
        page.evaluate("location.hash = '#error=0.5'")
        request = asked(page, volume)
        assert (request.max_surface_error, request.max_image_error) == (0.5, None)
        page.evaluate("location.hash = '#by=picture'")
        request = asked(page, volume)
        assert (request.max_surface_error, request.max_image_error) == (None, None)
        assert page.problems == []
