"""The sliders of the viewer's page that clip the volume."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from browser_pages import browser, fake_scene, keep, open_page, rests, state  # noqa: F401
from viewer_fakes import SIDE, FakeVolume

from isowave import ClipPlane
from isowave.viewer.server import Server

MOST = SIDE - 1.0  # of the volume's box, which begins at 0


def asked(page: Any, volume: FakeVolume) -> tuple[tuple[ClipPlane, ...], bool]:
    """The planes of the last picture, and whether cuts have caps."""
    rests(page)
    request = volume.frames[-1].request
    return tuple(request.clip), request.caps


def test_sliders_clip_the_volume(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        assert asked(page, volume) == ((), True)
        slider = {
            name: page.get_by_label(name, exact=True) for name in ("x from", "y from", "y to")
        }
        slider["x from"].fill("25")
        assert asked(page, volume) == ((ClipPlane((1, 0, 0), MOST / 4),), True)
        slider["y to"].fill("50")
        page.get_by_label("Caps", exact=True).uncheck()
        planes = ClipPlane((1, 0, 0), MOST / 4), ClipPlane((0, -1, 0), -MOST / 2)
        assert asked(page, volume) == (planes, False)
        assert (state(page)["clip"], state(page)["caps"]) == ("25,100,0,50,0,100", "0")
        keep(page, "clip")
        # Both ends of an axis keep apart.
        slider["y from"].fill("80")
        planes = planes[0], ClipPlane((0, 1, 0), 0.49 * MOST), planes[1]
        assert slider["y from"].input_value() == "49"
        assert [plane.normal for plane in asked(page, volume)[0]] == [p.normal for p in planes]
        # The address keeps them.
        page.reload()
        rests(page)
        again, caps = asked(page, volume)
        assert (again, caps) == (planes, False)
        assert slider["y from"].input_value() == "49"
        assert page.locator(".facts").inner_text().count("Certain") == 0
        page.evaluate("location.hash = 'iso=80&clip=50,20,0,100,0,100'")  # no clip
        assert asked(page, volume) == (planes, False)
        assert not page.problems


def test_a_thumb_is_dragged_beside_the_other(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        slider = page.get_by_label("z to", exact=True)
        slider.scroll_into_view_if_needed()
        box = slider.bounding_box()
        left, right, y = box["x"] + 6, box["x"] + box["width"] - 6, box["y"] + box["height"] / 2
        for begin, end in ((right, (left + right) / 2), (left, left + (right - left) / 4)):
            page.mouse.move(begin, y)
            page.mouse.down()
            page.mouse.move(end, y, steps=4)
            page.mouse.up()
        near, far = asked(page, volume)[0]
        assert (near.normal, far.normal) == ((0, 0, 1), (0, 0, -1))
        assert abs(near.offset - MOST / 4) < 2 and abs(far.offset + MOST / 2) < 2
