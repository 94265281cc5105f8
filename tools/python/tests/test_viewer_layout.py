"""The page's layout: menus, phone, notebook's cell, folded rows, density, what machines judge."""

from __future__ import annotations

from collections.abc import Callable
from importlib import util
from pathlib import Path
from typing import Any

import pytest
from browser_pages import (
    FIREFOX,
    ROOT,
    asked,
    browser,
    button,
    changes,
    drag,
    fake_scene,
    keep,
    menu,
    open_page,
    page,
    rests,
    server,
    state,
)
from viewer_fakes import FakeVolume

from isowave.viewer.server import Server

PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True}


def test_menus_open_one_at_a_time_and_close(page: Any) -> None:
    for name in ("file", "camera", "export", "info", "help"):
        pop = menu(page, name)
        assert pop.is_visible() and page.locator(".pop:visible").count() == 1
        box = pop.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 1000
        assert box["y"] + box["height"] <= 640
        keep(page, f"menu_{name}")
    page.keyboard.press("Escape")
    assert page.locator(".pop:visible").count() == 0
    focused = page.evaluate(f"{ROOT}.activeElement.name")
    assert focused == "help_menu"
    menu(page, "info")
    page.mouse.click(400, 300)
    assert page.locator(".pop:visible").count() == 0


def test_engine_s_words_are_in_a_popover(page: Any) -> None:
    assert not page.locator(".facts").is_visible() and not page.locator(".device").is_visible()
    menu(page, "info")
    assert "Passes" in page.locator(".facts").inner_text()
    assert "fake device" in page.locator(".device").inner_text()


def test_what_is_certain_is_said_on_the_picture(page: Any) -> None:
    certain = page.locator(".certain")
    certain.get_by_text("Certain within 1 px: 66.6 %").wait_for()
    drag(page, 10, 0)
    page.wait_for_function(f"() => {ROOT}.querySelector('.certain').textContent === ''")


def test_advanced_rows_are_folded(open_page: Callable[..., Any], server: Server) -> None:
    page = open_page()
    page.goto(server.url)
    page.locator(".certain").get_by_text("Certain").wait_for()
    assert not page.get_by_label("Device memory").is_visible()
    page.get_by_text("Advanced").click()
    assert page.get_by_label("Device memory").is_visible()


def test_budgets_are_told_in_the_field_s_unit(open_page: Callable[..., Any]) -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        text = "memory budget: 1048576 bytes is too small: 127068867 would do"
        return RuntimeError(text) if options["memory_budget"] == 1 << 20 else None

    with Server(fake_scene(FakeVolume(refuse=refuse))) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.get_by_label("Device memory").fill("1")
        page.keyboard.press("Enter")
        page.get_by_text("memory budget: 1 MiB is too small: 122 MiB would do").wait_for()


def test_looks_are_qualities_of_pictures(open_page: Callable[..., Any]) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        assert page.get_by_label("Draft", exact=True).is_checked()
        for name, rays in (("Good", (2, 0)), ("Paper", (2, 16)), ("Draft", (1, 0))):
            page.get_by_label(name, exact=True).check()
            request = asked(page, volume)
            assert (request.samples, request.ambient_rays) == rays
            # The sharp picture came first, and was on the page until then.
            shown = [p["stage"] for p in page.evaluate("window.shownPictures")]
            last = len(shown) - shown[::-1].index("first") if "first" in shown else 0
            after = [stage for stage in shown[last:] if stage != "pass"]
            assert after[-3:] == (["sharp"] if rays != (1, 0) else after[:-2][-1:]) + [
                "whole",
                "lossless",
            ]
        page.get_by_label("Soft shade").select_option("8")
        rests(page)
        assert page.locator("[name=preset]:checked").count() == 0


def test_a_long_picture_says_how_far_it_is(open_page: Callable[..., Any]) -> None:
    def before_pass(drawn: Any) -> None:
        import time

        if drawn.request.ambient_rays:
            time.sleep(0.3)

    with Server(fake_scene(FakeVolume(before_pass=before_pass, passes=8))) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.get_by_label("Paper", exact=True).check()
        page.get_by_text("Adding light and detail … ").wait_for()
        keep(page, "adding")
        rests(page)
        assert not page.locator(".work").is_visible()


def test_colours_are_one_by_depth_or_by_an_axis(open_page: Callable[..., Any]) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        assert page.get_by_label("One", exact=True).is_checked()
        assert page.get_by_label("Field", exact=True).is_disabled()
        page.get_by_label("Depth", exact=True).check()
        request = asked(page, volume)
        assert request.color_map.by == "depth" and request.color is None
        page.locator(".picture").press("3")
        assert asked(page, volume).color_map.by == "depth"
        assert state(page)["map"] == "viridis,depth"
        page.reload()
        rests(page)
        assert page.get_by_label("Depth", exact=True).is_checked()
        button(page, "Reset view").click()
        assert asked(page, volume).color_map.by == "depth"
        page.get_by_label("Axis", exact=True).check()
        assert asked(page, volume).color_map.axis == (0, 0, 1)
        page.get_by_label("One", exact=True).check()
        assert asked(page, volume).color_map is None and page.problems == []


def test_colours_by_the_field_are_a_press_away(open_page: Callable[..., Any]) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume, field=FakeVolume(), field_name="heat.nrrd")) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.get_by_label("Field", exact=True).check()
        assert asked(page, volume).color_map.by == "field"
        x, y = 380, 300
        page.mouse.move(x, y)
        page.locator(".readout").get_by_text(" · ").wait_for()
        assert page.locator(".readout").inner_text().count(" · ") == 2


@pytest.mark.skipif(FIREFOX, reason="the density is Chromium's to set")
def test_another_density_is_drawn_anew(page: Any) -> None:
    """B10: a window that comes to another screen."""
    width = page.evaluate(f"{ROOT}.querySelector('.picture').width")
    wish = page.evaluate("document.querySelector('main').dataset.wish")
    session = page.context.new_cdp_session(page)
    for ratio in (2, 1):
        session.send(
            "Emulation.setDeviceMetricsOverride",
            {"width": 1000, "height": 640, "deviceScaleFactor": ratio, "mobile": False},
        )
        page.wait_for_function(
            f"(width) => {ROOT}.querySelector('.picture').width === width", arg=ratio * width
        )
        rests(page)
    assert page.evaluate("document.querySelector('main').dataset.wish") != wish


def test_a_phone_has_the_picture_and_a_sheet_of_three_stops(
    open_page: Callable[..., Any], server: Server
) -> None:
    page = open_page(**PHONE)
    page.goto(server.url)
    rests(page)
    sheet, grip = page.locator(".sheet"), page.locator(".grip")
    picture = page.locator(".picture").bounding_box()
    assert (picture["width"], picture["y"] + picture["height"]) == (390, 844)
    tops = []
    for stop in range(3):
        box = sheet.bounding_box()
        assert box["y"] + box["height"] == pytest.approx(844, abs=1)
        tops.append(box["y"])
        keep(page, f"phone_{stop}")
        grip.click()
    assert tops[0] > 700 and 350 < tops[1] < 500 and tops[2] < 60
    assert sheet.bounding_box()["y"] == tops[0]
    assert page.locator(".histogram").is_visible() and not page.locator(".panel").is_visible()
    # Dragged up, it stays where it was let go.
    x, y = 195, tops[0] + 10
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 330, steps=5)
    page.mouse.up()
    assert sheet.bounding_box()["y"] == tops[1]
    button(page, "Panel").click()
    assert sheet.bounding_box()["y"] == tops[0]
    for name in ("file", "camera", "export", "info", "help"):
        box = menu(page, name).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.problems == []


@pytest.mark.parametrize("width", [1100, 700, 460])
def test_a_notebook_s_cell_has_room_for_the_picture(
    open_page: Callable[..., Any], server: Server, width: int
) -> None:
    page = open_page(viewport={"width": width, "height": 360})
    page.goto(server.url)
    rests(page)
    keep(page, f"cell_{width}")
    stage = page.locator(".stage").bounding_box()
    assert stage["height"] > 240 and stage["width"] >= width - 275
    tools, cube = (page.locator(s).bounding_box() for s in (".tools", ".cube"))
    assert tools["y"] >= stage["y"] and cube["x"] + cube["width"] <= width
    assert tools["y"] + tools["height"] <= 360
    assert changes(page, lambda: drag(page, 0, -60))


@pytest.mark.skipif(FIREFOX, reason="once is enough")
@pytest.mark.parametrize("look", ["light", "dark", "phone"])
def test_axe_finds_nothing(open_page: Callable[..., Any], server: Server, look: str) -> None:
    found = util.find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        pytest.skip("no axe-playwright-python")
    script = (Path(found.origin).parent / "axe.min.js").read_text()
    options: dict[str, Any] = PHONE if look == "phone" else {}
    scheme = "dark" if look == "dark" else "light"
    page = open_page(color_scheme=scheme, reduced_motion="reduce", **options)
    page.goto(server.url)
    rests(page)
    page.mouse.move(300, 300)
    if look == "phone":
        page.locator(".grip").click()
    button(page, "Add surface").click()
    button(page, "Add plane").click()
    button(page, "Add z").click()
    rests(page)
    page.evaluate(script)  # outside of the page's policy
    for name in (None, "file", "camera", "export", "info", "help"):
        if name:
            menu(page, name)
        if name == "camera":
            button(page, "Paste camera").click()
        result = page.evaluate("axe.run({ resultTypes: ['violations'] })")
        seen = [(v["id"], v["nodes"][0]["target"]) for v in result["violations"]]
        assert seen == [], name
