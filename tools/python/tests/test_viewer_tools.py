"""What one does in the picture and with the camera: tools, cube, places, menus of views."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from browser_pages import (
    DRAWN,
    FIREFOX,
    ROOT,
    asked,
    browser,
    button,
    changes,
    double_click,
    drag,
    eye,
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

MIDDLE = np.full(3, 31.5)


def middle_of(page: Any) -> tuple[float, float]:
    box = page.locator(".picture").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def tool(page: Any, name: str) -> None:
    page.locator(".tools").get_by_role("button", name=name, exact=True).click()


def at(page: Any) -> np.ndarray[Any, Any]:
    return np.array([float(x) for x in state(page)["at"].split(",")])


def planes(page: Any) -> list[list[float]]:
    text = state(page).get("planes", "")
    return [[float(x) for x in each.split("_")] for each in text.split(",") if each]


def handles(page: Any) -> list[tuple[float, float]]:
    """Middles of the handles over the picture."""
    boxes = page.evaluate(
        f"""() => [...{ROOT}.querySelectorAll(".handle")].map((h) => {{
        const {{ x, y, width, height }} = h.getBoundingClientRect();
        return [x + width / 2, y + height / 2]; }})"""
    )
    return [tuple(box) for box in boxes]


def drag_from(page: Any, place: tuple[float, float], dx: float, dy: float) -> None:
    page.mouse.move(*place)
    page.mouse.down()
    page.mouse.move(place[0] + dx, place[1] + dy, steps=4)
    page.mouse.up()


def click(page: Any, x: float, y: float) -> None:
    """On the picture; waits until it has led to a wish."""
    wish = page.evaluate("document.querySelector('main').dataset.wish")
    page.mouse.click(x, y)
    page.wait_for_function(
        "(before) => document.querySelector('main').dataset.wish !== before", arg=wish
    )
    rests(page)


def test_the_place_under_the_cursor_is_shown(page: Any) -> None:
    x, y = middle_of(page)
    page.mouse.move(x + 2, y + 2)
    readout = page.locator(".readout")
    readout.get_by_text("31.").wait_for()
    where, value = readout.inner_text().split(" · ")
    position = [float(v) for v in where.strip("()").split(",")]
    radius = 32 * (1 - 80 / 255)
    assert position == pytest.approx([31.5, 31.5, 31.5 + radius], abs=1.0)
    assert float(value) == pytest.approx(80, abs=3)
    keep(page, "hover")
    page.mouse.move(x - 300, y - 240)  # there is nothing
    page.wait_for_function(f"() => {ROOT}.querySelector('.readout').textContent === ''")
    assert page.problems == []


def test_a_patients_places_are_in_millimetres(open_page: Callable[..., Any]) -> None:
    with Server(fake_scene(FakeVolume(anatomical=True))) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.mouse.move(*middle_of(page))
        page.locator(".readout").get_by_text(") mm · ").wait_for()
        assert page.locator(".scale").inner_text().endswith(" mm")


def test_two_clicks_measure(page: Any) -> None:
    tool(page, "Measure")
    x, y = middle_of(page)
    for dx in (-60, 60):
        page.mouse.click(x + dx, y)
        page.wait_for_timeout(100)
    text = page.locator(".overlay text")
    text.wait_for()
    # Both are on a sphere, as far from the middle.
    pixel = 2 * np.linalg.norm(eye(page) - MIDDLE) * np.tan(np.radians(30))
    pixel /= page.locator(".picture").bounding_box()["height"]
    measured = float(text.text_content())
    assert 0.3 * 120 * pixel < measured < 120 * pixel
    keep(page, "measure")
    page.mouse.click(x, y + 30)  # begins again
    text.wait_for(state="detached")
    page.keyboard.press("Escape")
    assert page.locator(".overlay path").count() == 0
    assert page.locator("[name=tool_orbit]").get_attribute("aria-pressed") == "true"


def test_the_box_has_handles(page: Any) -> None:
    assert handles(page) == []
    tool(page, "Clip")
    before = handles(page)
    assert len(before) == 6
    right = max(before)
    drag_from(page, right, -80, 0)
    rests(page)
    clip = [float(x) for x in state(page)["clip"].split(",")]
    assert clip[:1] + clip[2:] == [0, 0, 100, 0, 100] and 60 < clip[1] < 95
    assert max(handles(page))[0] == pytest.approx(right[0] - 80, abs=2)
    assert (
        page.get_by_label("x to", exact=True).input_value() == pytest.approx(str(clip[1]))
        or abs(float(page.get_by_label("x to", exact=True).input_value()) - clip[1]) <= 0.5
    )
    keep(page, "box")
    page.get_by_role("button", name="Undo").click()
    rests(page)
    assert "clip" not in state(page)


def test_planes_come_by_clicks_and_have_handles(page: Any) -> None:
    tool(page, "Clip")
    x, y = middle_of(page)
    click(page, x + 20, y)
    ((nx, ny, nz, offset),) = planes(page)
    assert (nx, ny, nz) == pytest.approx((0, 0, -1), abs=1e-6)
    assert -offset == pytest.approx(31.5 + 32 * (1 - 80 / 255), abs=1)
    assert len(handles(page)) == 8
    # The arrow turns the plane about its middle.
    row = page.get_by_label("Offset of plane 1")
    page.keyboard.press("Escape")
    button(page, "Turn round plane 1").click()
    rests(page)
    assert planes(page)[0][3] == pytest.approx(-offset) and planes(page)[0][2] == 1
    row.fill("40")
    rests(page)
    assert planes(page)[0][3] == pytest.approx(40, abs=0.2)
    page.locator(".picture").press("3")
    rests(page)
    tool(page, "Clip")
    *_, centre, tip = handles(page)
    drag_from(page, tip, 30, -60)
    rests(page)
    normal = planes(page)[0][:3]
    assert np.linalg.norm(normal) == pytest.approx(1) and abs(normal[1]) > 0.2
    was = planes(page)
    drag_from(page, handles(page)[-2], 25, 0)
    rests(page)
    assert planes(page)[0][:3] == pytest.approx(was[0][:3]) and planes(page) != was
    keep(page, "plane")
    button(page, "Remove plane 1").click()
    rests(page)
    assert planes(page) == [] and page.problems == []


def test_planes_are_added_up_to_eight(page: Any) -> None:
    for _ in range(8):
        button(page, "Add plane").click()
    rests(page)
    assert len(planes(page)) == 8 and button(page, "Add plane").is_disabled()


def test_a_click_slices_and_handles_move_slices(page: Any) -> None:
    tool(page, "Slice")
    x, y = middle_of(page)
    click(page, x, y)
    (slice_text,) = state(page)["slices"].split(",")
    assert slice_text.startswith("0_0_1_")
    before = float(slice_text.split("_")[3])
    assert before == pytest.approx(31.5 + 32 * (1 - 80 / 255), abs=1)
    page.locator(".picture").press("3")
    rests(page)
    tool(page, "Slice")
    (handle,) = handles(page)
    drag_from(page, handle, 40, 0)
    rests(page)
    assert abs(float(state(page)["slices"].split("_")[3]) - before) > 2
    keep(page, "slice")
    assert page.problems == []


def test_a_double_click_turns_about_what_is_there(page: Any) -> None:
    x, y = middle_of(page)
    distance = np.linalg.norm(eye(page) - at(page))
    double_click(page, x + 60, y)
    page.wait_for_timeout(500)
    rests(page)
    radius = 32 * (1 - 80 / 255)
    assert np.linalg.norm(at(page) - MIDDLE) == pytest.approx(radius, abs=0.5)
    assert at(page)[0] > 33
    assert np.linalg.norm(eye(page) - at(page)) == pytest.approx(0.7 * distance, rel=1e-3)
    # Undone as one.
    page.locator(".picture").press("Control+z")
    rests(page)
    assert at(page) == pytest.approx(MIDDLE)


def test_the_pivot_tool_keeps_the_distance(page: Any) -> None:
    tool(page, "Pivot")
    distance = np.linalg.norm(eye(page) - at(page))
    x, y = middle_of(page)
    page.mouse.click(x, y - 70)
    page.wait_for_timeout(500)
    rests(page)
    assert at(page)[1] > 34
    assert np.linalg.norm(eye(page) - at(page)) == pytest.approx(distance, rel=1e-3)


def test_the_move_tool_moves(page: Any) -> None:
    tool(page, "Move")
    before = eye(page)
    assert changes(page, lambda: drag(page, 80, 0))
    assert eye(page)[0] < before[0] and eye(page)[1:] == pytest.approx(before[1:])
    tool(page, "Turn")
    assert changes(page, lambda: drag(page, 80, 0))
    assert abs(eye(page)[2] - before[2]) > 1


def test_alt_and_drag_and_keys_roll(page: Any) -> None:
    before = eye(page)

    def rolled() -> None:
        page.keyboard.down("Alt")
        drag(page, 0, 120)
        page.keyboard.up("Alt")

    assert changes(page, rolled)
    up = [float(x) for x in state(page)["up"].split(",")]
    assert eye(page) == pytest.approx(before) and abs(up[0]) > 0.1
    button_of = menu(page, "camera")
    button_of.get_by_role("button", name="Roll right").click()
    rests(page)
    assert [float(x) for x in state(page)["up"].split(",")] != pytest.approx(up)


@pytest.mark.parametrize("anatomical", [False, True])
def test_faces_of_the_cube_are_views(open_page: Callable[..., Any], anatomical: bool) -> None:
    """Front, back, left, right, top, bottom: as isowave::orientation_of() has them."""
    sides = {"front": (0, 0, 1), "right": (1, 0, 0), "top": (0, 1, 0)}
    letters = {"front": "z", "right": "x", "top": "y"}
    letters |= {"back": "−z", "left": "−x", "bottom": "−y"}
    if anatomical:
        sides = {"front": (0, -1, 0), "right": (-1, 0, 0), "top": (0, 0, 1)}
        letters = dict(front="A", back="P", right="R", left="L", top="S", bottom="I")
    opposite = {"front": "back", "right": "left", "top": "bottom"}
    sides |= {opposite[side]: tuple(-x for x in v) for side, v in sides.items()}
    volume = FakeVolume(anatomical=anatomical)
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        for side, direction in sides.items():
            menu(page, "camera").get_by_role("button", name=side.title(), exact=True).click()
            camera = asked(page, volume).camera
            back = np.subtract(camera.eye, camera.at)
            assert back / np.linalg.norm(back) == pytest.approx(direction)
            face = page.locator(f".cube [data-side={side}]")
            assert face.locator("text").text_content() == letters[side]
            assert page.locator(".cube g[display=inline]").count() == 1
        page.keyboard.press("Escape")
        page.locator(".picture").press("1")
        for _ in range(5):
            page.keyboard.press("ArrowLeft")
            page.keyboard.press("ArrowUp")
        rests(page)
        keep(page, f"cube_{anatomical}")
        seen = page.locator(".cube g[display=inline]")
        assert seen.count() == 3
        name = seen.first.get_attribute("data-side")
        seen.first.click()
        camera = asked(page, volume).camera
        back = np.subtract(camera.eye, camera.at)
        assert back / np.linalg.norm(back) == pytest.approx(sides[name])
        # And by the keyboard.
        page.locator(".picture").press("ArrowLeft")
        rests(page)
        left = page.locator(".cube g[display=inline]").last
        name = left.get_attribute("data-side")
        left.press("Enter")
        camera = asked(page, volume).camera
        back = np.subtract(camera.eye, camera.at)
        assert back / np.linalg.norm(back) == pytest.approx(sides[name])
        assert page.problems == []


def test_the_scale_bar_has_a_round_length_and_its_width(page: Any) -> None:
    for _ in range(3):
        width = page.locator(".scale i").bounding_box()["width"]
        value = float(page.locator(".scale span").inner_text())
        mantissa = value / 10 ** np.floor(np.log10(value) + 1e-9)
        assert min(abs(mantissa - n) for n in (1, 2, 5)) < 1e-6
        height = page.locator(".picture").bounding_box()["height"]
        pixel = 2 * np.linalg.norm(eye(page) - at(page)) * np.tan(np.radians(30)) / height
        assert width * pixel == pytest.approx(value, rel=0.02)
        page.locator(".picture").press("+")
        page.locator(".picture").press("+")
        rests(page)
    # One in the picture is enough.
    page.get_by_label("Scale bar", exact=True).check()
    assert not page.locator(".scale").is_visible()


def test_cameras_are_copied_and_pasted(page: Any) -> None:
    if not FIREFOX:
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    picture = page.evaluate(DRAWN)
    menu(page, "camera").get_by_role("button", name="Copy camera").click()
    page.get_by_text("Copied").first.wait_for()
    text = page.evaluate("navigator.clipboard.readText()")
    file = json.loads(text)
    assert file["fovy_deg"] == 60 and set(file["cameras"][0]) == {"eye", "at", "up"}
    assert [file["width"], file["height"]] == picture[:2]
    assert changes(page, lambda: drag(page, 100, 0))
    menu(page, "camera").get_by_role("button", name="Paste camera").click()
    page.get_by_label("Camera file (JSON)").fill(text)
    assert changes(page, lambda: page.get_by_role("button", name="Use it").click())
    assert page.evaluate(DRAWN) == picture
    assert not page.get_by_label("Camera file (JSON)").is_visible()


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "This is no camera: it must be JSON"),
        ("{}", '"cameras" with "eye", "at" and "up" is missing'),
        ('{"cameras": [{"eye": [0, 0], "at": [0, 0, 0]}]}', '"eye" must be three numbers'),
        ('{"cameras": [{"eye": [1, 2, 3], "at": [1, 2, 3]}]}', "are the same point"),
        ('{"cameras": [{"eye": [0, 5, 0], "at": [0, 0, 0]}]}', "parallel to the view"),
        (
            '{"fovy_deg": 200, "cameras": [{"eye": [0, 0, 5], "at": [0, 0, 0]}]}',
            "between 0 and 180",
        ),
        (
            '{"fovy_deg": "x", "cameras": [{"eye": [0, 0, 5], "at": [0, 0, 0]}]}',
            "between 0 and 180",
        ),
        ('{"cameras": [{"eye": [1e30, 0, 5], "at": [0, 0, 0]}]}', "too large"),
        ("[" * 3000, "This is no camera"),
    ],
)
def test_a_bad_camera_gets_a_readable_message(page: Any, text: str, message: str) -> None:
    menu(page, "camera").get_by_role("button", name="Paste camera").click()
    page.get_by_label("Camera file (JSON)").fill(text)
    page.get_by_role("button", name="Use it").click()
    assert message in page.locator(".problem").inner_text()
    if "same point" in message:
        keep(page, "bad_camera")
    page.keyboard.press("Escape")
    assert not page.get_by_label("Camera file (JSON)").is_visible()
    assert page.problems == []
