"""Several and translucent surfaces in the viewer: the page's list, and the scene's renderers."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from browser_pages import (  # noqa: F401
    browser,
    button,
    changes,
    drag,
    fake_scene,
    isovalue,
    keep,
    open_page,
    rests,
    screenshot,
    state,
    type_into,
)
from conftest import FUEL
from PIL import Image
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run

import isowave
from isowave import Surface
from isowave.viewer.renderers import GIVE_BACK_SECONDS, NO_SURFACES
from isowave.viewer.scene import Scene
from isowave.viewer.server import Server

BOTH = [Surface(80, "#dbbd87", 0.5), Surface(120, "#56b4e9")]


def field(page: Any, name: str, number: int) -> Any:
    return page.get_by_label(f"{name} of surface {number}", exact=True)


def asked(page: Any, volume: FakeVolume) -> list[tuple[float, float]]:
    """Isovalues and opacities of the last picture's surfaces; none: it is of one opaque one."""
    rests(page)
    return [(each.isovalue, each.opacity) for each in volume.frames[-1].request.surfaces]


def test_surfaces_are_added_changed_and_removed(
    open_page: Callable[..., Any]
) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        assert asked(page, volume) == [] and state(page)["iso"] == "80"
        type_into(page.get_by_label("Accurate to"), "1")
        assert button(page, "Remove surface 1").is_disabled()
        assert button(page, "Show surface 1").is_disabled()
        # Added at suggested isovalues; the error is then the first hits'.
        assert changes(page, lambda: field(page, "Opacity", 1).fill("0.4"))
        button(page, "Add surface").click()
        assert asked(page, volume) == [(80, 0.4), (90.5, 0.5)]
        assert volume.frames[-1].request.max_surface_error == 1
        assert page.get_by_label("Time per picture").is_disabled()
        # The slider moves the surface that is selected.
        slider = page.get_by_label("Isovalue of surface 2 on the histogram")
        slider.fill("150")
        assert asked(page, volume) == [(80, 0.4), (150, 0.5)]
        field(page, "Colour", 1).focus()
        slider = page.get_by_label("Isovalue of surface 1 on the histogram")
        assert slider.input_value() == "80" and isovalue(page).input_value() == "80"
        type_into(field(page, "Isovalue", 1), "60")
        assert slider.input_value() == "60"
        assert changes(page, lambda: field(page, "Colour", 2).fill("#00ff00"))
        assert changes(page, lambda: field(page, "Opacity", 2).fill("1"))
        assert asked(page, volume) == [(60, 0.4), (150, 1)]
        assert volume.frames[-1].request.surfaces[1].color == (0, 1, 0)
        assert state(page)["surfaces"] == "60_dbbd87_0.4,150_00ff00_1" and "iso" not in state(page)
        keep(page, "surfaces")
        # Hidden, shown, and one opaque surface again, with its error.
        assert changes(page, lambda: button(page, "Show surface 1").click())
        assert asked(page, volume) == []
        request = volume.frames[-1].request
        assert (request.isovalue, request.color) == (150, (0, 1, 0))
        assert button(page, "Show surface 2").is_disabled()
        assert changes(page, lambda: button(page, "Show surface 1").click())
        assert changes(page, lambda: button(page, "Remove surface 1").click())
        assert asked(page, volume) == [] and (state(page)["iso"], state(page)["error"]) == (
            "150",
            "1",
        )
        assert not page.get_by_label("Time per picture").is_disabled()
        assert not page.problems


def test_the_address_keeps_surfaces(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url + "#surfaces=40_dbbd87_0.3,99.5_ff0000_0.05_hidden,150_0000ff_1")
        shown = [(40, 0.3), (150, 1)]
        assert asked(page, volume) == shown
        was = state(page)
        assert was["surfaces"] == "40_dbbd87_0.3,99.5_ff0000_0.05_hidden,150_0000ff_1"
        page.reload()
        assert asked(page, volume) == shown and state(page) == was
        button(page, "Show surface 2").click()
        assert asked(page, volume) == [(40, 0.3), (99.5, 0.05), (150, 1)]
        # What is not understood changes nothing.
        good = "1_ffffff_1"
        many = ",".join([good] * 9)
        for bad in ("", "x", "1", "1_red_1", "1_ffffff_0", "_ffffff_1", f"{good}_hidden", many):
            page.evaluate("text => location.hash = text", f"surfaces={bad}")
            assert asked(page, volume) == [(40, 0.3), (99.5, 0.05), (150, 1)], bad
        page.evaluate("location.hash = 'iso=70'")
        assert asked(page, volume) == [] and volume.frames[-1].request.isovalue == 70
        assert not page.problems


def test_eight_surfaces_are_the_most(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page(viewport={"width": 360, "height": 700}, has_touch=True)
        page.goto(server.url)
        rests(page)
        button(page, "Panel").click()
        add = button(page, "Add surface")
        for _ in range(7):
            add.click()
        assert add.is_disabled()
        values = [value for value, _ in asked(page, volume)]
        assert len(set(values)) == 8 and {80, 90.5, 180.5} <= set(values)
        colors = {each.color for each in volume.frames[-1].request.surfaces}
        assert len(colors) == 8
        frame = "document.querySelector('main').shadowRoot.querySelector('.frame')"
        assert page.evaluate(f"{frame}.scrollWidth <= 360 && document.body.scrollWidth <= 360")
        for name in ("Remove surface 8", "Show surface 8"):
            box = button(page, name).bounding_box()
            assert box["x"] >= 0 and box["x"] + box["width"] <= 360 and box["width"] >= 24
        add.scroll_into_view_if_needed()
        keep(page, "surfaces_phone")
        # Two surfaces at one isovalue are refused in a line, and the picture stays.
        type_into(field(page, "Isovalue", 2), "80")
        page.get_by_text("two surfaces have the isovalue 80").wait_for()
        type_into(field(page, "Isovalue", 2), "81")
        rests(page)
        assert not page.get_by_text("two surfaces have").is_visible() and not page.problems


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_the_picture_is_that_of_the_package(
    open_page: Callable[..., Any], device: str  # noqa: F811
) -> None:
    volume = isowave.open(FUEL, exact=True)
    scene = Scene(volume, isovalue=10, device=device, size=(800, 600))
    with Server(scene) as server:
        page = open_page(viewport={"width": 700, "height": 500}, color_scheme="light")
        page.goto(server.url + "#surfaces=10_dbbd87_0.3,120_ff8000_1&background=ffffff")
        rests(page)
        name, png = screenshot(page)
        assert name == "isowave_10.png"
        picture = np.asarray(Image.open(io.BytesIO(png)))
        size = picture.shape[1], picture.shape[0]
        surfaces = [Surface(10, "#dbbd87", 0.3), Surface(120, "#ff8000")]
        image = volume.render(surfaces=surfaces, size=size, background="#ffffff", device="host")
        assert np.array_equal(picture, image.rgb)
        assert changes(page, lambda: field(page, "Opacity", 1).fill("0.8"))
        assert changes(page, lambda: drag(page, 60, 20))
        assert not page.problems


def test_a_device_has_room_for_surfaces_only_while_they_are_wished_for() -> None:
    volume, clock = FakeVolume(), Clock()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish()
    run(scene)
    assert volume.renderers[-1]["surfaces"] == 0
    for count, room in ((1, 1), (2, 2), (3, 4), (4, 4), (8, 8), (2, 8)):
        surfaces = [Surface(80 + i, (1, 0, 0), 0.5) for i in range(count)]
        wish = eye.wish(surfaces=surfaces, color=None)
        run(scene)
        eye.ack()
        assert volume.renderers[-1]["surfaces"] == room
        assert (wish, "whole") in eye.pictures
    assert len(volume.renderers) == 5
    eye.wish()
    run(scene)
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    assert volume.renderers[-1]["surfaces"] == 0 and eye.of_type("error") == []


def test_surfaces_without_memory_are_refused_and_the_others_drawn() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("needs 900 MiB") if options["surfaces"] > 2 else None

    volume, clock = FakeVolume(refuse=refuse), Clock()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    surfaces = [Surface(80 + i, (1, 0, 0), 0.5) for i in range(3)]
    good = eye.wish(surfaces=surfaces[:2], color=None)
    run(scene)
    eye.ack()
    bad = eye.wish(surfaces=surfaces, color=None)
    run(scene)
    errors = [(head["wish"], head["message"]) for head in eye.of_type("error")]
    assert errors == [(None, "needs 900 MiB"), (bad, NO_SURFACES)]
    again = eye.wish(surfaces=surfaces[:2], color=None)
    run(scene)
    assert (good, "whole") in eye.pictures and (again, "whole") in eye.pictures
    assert bad not in [wish for wish, _ in eye.pictures]
    assert len(eye.of_type("error")) == 2


def test_bounds_of_several_surfaces_are_asked_for() -> None:
    volume, clock = FakeVolume(), Clock()
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    eye.wish(surfaces=BOTH, color=None)
    for _ in range(3):
        run(scene)
        eye.ack()
        clock.now += 10
    run(scene)
    assert [stage for _, stage in eye.pictures] == ["first", "whole", "lossless"]
    assert len(eye.of_type("bounds")) == 1 and eye.of_type("error") == []
