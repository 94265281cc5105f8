"""Slices in the viewer: the page's list, addresses, scene files, and the renderer's pictures."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from browser_pages import (  # noqa: F401
    asked,
    browser,
    button,
    fake_scene,
    keep,
    open_page,
    rests,
    save_scene,
    screenshot,
    state,
    type_into,
)
from conftest import FUEL
from PIL import Image
from viewer_fakes import SIDE, FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run

import isowave
from isowave import ColorMap, Slice, Surface
from isowave._slice import slice_map_of
from isowave.viewer import view
from isowave.viewer.renderers import GIVE_BACK_SECONDS
from isowave.viewer.scene import REST_SECONDS
from isowave.viewer.server import Server

MIDDLE = (SIDE - 1) / 2  # of the volume's box, which begins at 0
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def of_slice(page: Any, what: str, number: int) -> Any:
    return page.get_by_label(f"{what} slice {number}", exact=True)


def test_slices_are_added_moved_and_removed(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        assert asked(page, volume).slices == () and not page.locator(".slice_look").is_visible()
        type_into(page.get_by_label("Accurate to"), "1")
        page.keyboard.press("Enter")
        assert asked(page, volume).max_surface_error == 1
        button(page, "Add z").click()
        request = asked(page, volume)
        assert request.slices == (Slice(Z, MIDDLE),) and request.max_surface_error == 1
        assert request.slice_map == slice_map_of("gray") and request.surfaces == ()
        assert page.get_by_label("Time per picture").is_disabled(), "not with slices"
        button(page, "Add x").click()
        of_slice(page, "Position of", 2).fill(str(SIDE - 1))
        of_slice(page, "Opacity of", 2).fill("0.4")
        assert asked(page, volume).slices == (Slice(Z, MIDDLE), Slice(X, SIDE - 1.0, 0.4))
        type_into(of_slice(page, "Offset of", 1), "12.25")
        of_slice(page, "Clipping planes cut", 1).uncheck()
        moved = (Slice(Z, 12.25, clipped=False), Slice(X, SIDE - 1.0, 0.4))
        assert asked(page, volume).slices == moved
        assert abs(float(of_slice(page, "Position of", 1).input_value()) - 12.25) < 0.2
        page.locator("[name=slice_colors]").select_option("magma")
        type_into(page.locator("[name=slice_low]"), "9")
        page.locator("[name=slice_high]").focus()
        assert asked(page, volume).slice_map == slice_map_of("magma"), "the other one is missing"
        type_into(page.locator("[name=slice_high]"), "2")
        page.locator("[name=slice_low]").focus()
        colors = slice_map_of(ColorMap("magma", range=(9, 2)))
        assert asked(page, volume).slice_map == colors
        page.locator(".slices").scroll_into_view_if_needed()
        keep(page, "slices")
        assert state(page)["slices"] == "0_0_1_12.25_1_whole,1_0_0_63_0.4"
        assert state(page)["slice_map"] == "magma,9,2"
        # What is no number changes nothing. The address keeps all.
        type_into(of_slice(page, "Offset of", 1), "")
        assert asked(page, volume).slices == moved
        page.reload()
        assert asked(page, volume).slices == moved and asked(page, volume).slice_map == colors
        button(page, "Remove slice 1").click()
        assert asked(page, volume).slices == moved[1:]
        button(page, "Remove slice 1").click()
        assert asked(page, volume).max_surface_error == 1 and "slices" not in state(page)
        assert page.get_by_label("Accurate to").is_enabled() and not page.problems


def test_addresses_of_slices(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url + "#iso=80&slices=0.6_0.8_0_5_0.5&slice_map=viridis")
        kept = (Slice((0.6, 0.8, 0), 5, 0.5),)
        assert asked(page, volume).slices == kept
        assert page.locator(".slices span").first.inner_text() == "n"
        good = "1_0_0_5_1"
        for bad in ("", "x", "1_0_0_5", "2_0_0_5_1", "0_0_0_5_1", "1_0_0_1e19_1", "1_0_0_5_0",
                    "1_0_0_5_2", "1_0_0__1", f"{good}_half", ",".join(8 * [good])):  # fmt: skip
            page.evaluate("text => location.hash = text", f"slices={bad}")
            assert asked(page, volume).slices == kept, bad
        for bad in ("jet", "gray,5", "gray,5,5", "gray,5,1e30", "gray,5,6,7"):
            page.evaluate("text => location.hash = text", f"slice_map={bad}")
            assert asked(page, volume).slice_map == slice_map_of("viridis"), bad
        # There are never more than 8 surfaces and slices.
        surfaces = ",".join(f"{value}_ffffff_0.5" for value in range(10, 80, 10))
        many = ",".join(3 * [good])
        page.evaluate("text => location.hash = text", f"surfaces={surfaces}&slices={many}")
        request = asked(page, volume)
        assert (len(request.surfaces), request.slices) == (7, (Slice(X, 5),))
        assert not page.problems


def test_eight_surfaces_and_slices_are_the_most(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page(viewport={"width": 360, "height": 700}, has_touch=True)
        page.goto(server.url)
        rests(page)
        button(page, "Panel").click()
        button(page, "Add surface").click()
        for axis in "xyzxyz":
            assert button(page, "Add surface").is_enabled()
            button(page, f"Add {axis}").click()
        for name in ("Add surface", "Add x", "Add y", "Add z"):
            assert button(page, name).is_disabled()
        request = asked(page, volume)
        assert len(request.surfaces) == 2 and len(request.slices) == 6
        assert request.slices[1] == Slice(Y, MIDDLE)
        frame = "document.querySelector('main').shadowRoot.querySelector('.frame')"
        assert page.evaluate(f"{frame}.scrollWidth <= 360 && document.body.scrollWidth <= 360")
        page.locator(".slices").scroll_into_view_if_needed()
        keep(page, "slices_narrow")
        button(page, "Remove slice 3").click()
        assert button(page, "Add z").is_enabled() and button(page, "Add surface").is_enabled()
        assert not page.problems


def test_slices_go_through_scene_files(
    open_page: Callable[..., Any], tmp_path: Path  # noqa: F811
) -> None:
    scene = {"isowave_scene": 1, "surfaces": [{"isovalue": 80}], "slice_map": "viridis"}
    slices = [{"normal": [0, 0, 2], "offset": 24, "opacity": 0.5, "clipped": False},
              {"normal": [0, 5, 0]}]  # fmt: skip
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({**scene, "slices": slices, "slice_low": 7, "slice_high": 250}))
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        colors = slice_map_of(ColorMap("viridis", range=(7, 250)))
        for _ in range(2):
            page.get_by_label("Scene file").set_input_files(file)
            page.locator(".slices li").nth(1).wait_for()
            request = asked(page, volume)
            assert request.slices == (Slice(Z, 12, 0.5, False), Slice(Y))
            assert request.slice_map == colors
            with page.expect_download() as saved:
                save_scene(page)
            saved.value.save_as(file)
            button(page, "Remove slice 2").click()
        fields = isowave._core.parse_scene(file.read_text())
        assert fields["slice_map"] == "viridis" and fields["slice_high"] == 250
        assert fields["slices"][0] == {
            "normal": [0, 0, 1], "offset": 12, "opacity": 0.5, "clipped": False}  # fmt: skip
        assert not page.problems


def test_a_renderer_is_made_for_slices() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    assert [options["surfaces"] for options in volume.renderers] == [0]
    eye.ack()
    eye.wish(slices=[Slice("z", 9), Slice("x", 5)])
    run(scene)
    assert [options["surfaces"] for options in volume.renderers] == [0, 1]
    assert eye.pictures[-1] == (2, "whole") and not eye.of_type("error")
    # Bounds are those of first hits.
    eye.ack()
    clock.now += REST_SECONDS
    run(scene)
    eye.ack()
    clock.now += 10
    run(scene)
    assert eye.pictures[-1] == (2, "lossless") and [h["wish"] for h in eye.of_type("bounds")] == [2]
    eye.wish(surfaces=[Surface(80, opacity=0.5), Surface(90)], slices=[Slice("z", 9)], color=None)
    run(scene)
    assert [options["surfaces"] for options in volume.renderers] == [0, 1, 2]
    eye.ack()
    eye.wish()
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    assert volume.renderers[-1]["surfaces"] == 0


def test_the_picture_is_that_of_the_library(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = isowave.open(FUEL, exact=True)
    scene = volume.scene().surface(20, "orange").slice("z", 15).slice("y", 12, 0.6, clipped=False)
    scene = scene.clip(isowave.ClipPlane((-1, 0, 0), -30)).look(
        slice_map=ColorMap("magma", range=(0, 60)), background="white"
    )
    with view(scene, device="host", block=False, open_browser=False, notebook=False) as server:
        page = open_page(viewport={"width": 900, "height": 640})
        page.goto(server.url)
        rests(page)
        keep(page, "scene_slices")
        shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
        expected = scene.render(size=(shown.shape[1], shown.shape[0]), device="host").rgb
        assert np.array_equal(shown, expected) and not page.problems
