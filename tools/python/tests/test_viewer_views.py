"""Views in headless Chromium, if the page and the server do not take turns."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from browser_pages import asked, browser, fake_scene, open_page, rests  # noqa: F401
from viewer_fakes import FakeVolume

from isowave._camera import Camera
from isowave.viewer.server import Server


def test_a_reset_is_kept_if_a_picture_comes_first(
    open_page: Callable[..., Any],  # noqa: F811
) -> None:
    """The picture was wished for before, and has the camera before."""
    gate = threading.Event()
    gate.set()
    volume = FakeVolume(before_pass=lambda drawn: gate.wait(30))
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        home = asked(page, volume).camera
        page.locator(".picture").focus()
        page.keyboard.press("ArrowLeft")
        assert asked(page, volume).camera != home
        gate.clear()
        page.keyboard.press("ArrowLeft")
        page.wait_for_function(
            "() => 'pending' in document.querySelector('main').dataset === false"
        )
        page.evaluate(
            """() => {
            window.frames_due = [];
            window.usual = window.requestAnimationFrame;
            window.requestAnimationFrame = (act) => window.frames_due.push(act);
        }"""
        )
        page.get_by_role("button", name="Reset view").click()
        gate.set()
        page.wait_for_function(
            """() => {
            const { wish, shown, stage } = document.querySelector("main").dataset;
            return wish === shown && stage === "lossless";
        }"""
        )
        page.evaluate(
            """() => {
            window.requestAnimationFrame = window.usual;
            for (const act of window.frames_due) act(performance.now());
        }"""
        )
        assert asked(page, volume).camera == home
        assert not page.problems


@pytest.mark.parametrize("anatomical", [False, True])
def test_keys_show_sides_and_turns_are_about_up(
    open_page: Callable[..., Any], anatomical: bool  # noqa: F811
) -> None:
    volume = FakeVolume(anatomical=anatomical)
    up = (0, 0, 1) if anatomical else (0, 1, 0)
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        home = asked(page, volume).camera
        distance = np.linalg.norm(np.subtract(home.eye, home.at))
        page.locator(".picture").focus()

        def pressed(key: str) -> Camera:
            page.keyboard.press(key)
            camera = asked(page, volume).camera
            back = np.subtract(camera.eye, camera.at)
            assert np.linalg.norm(back) == pytest.approx(distance) and camera.at == home.at
            return replace(camera, eye=tuple(back / distance))

        front = pressed("1")
        assert front.eye == pytest.approx((0, -1, 0) if anatomical else (0, 0, 1))
        assert front.up == pytest.approx(up)
        assert pressed("9").eye == pytest.approx(-np.array(front.eye))
        right = pressed("3")
        assert right.eye == pytest.approx((-1, 0, 0) if anatomical else (1, 0, 0))
        top = pressed("7")
        assert top.eye == pytest.approx(up) and top.up == pytest.approx(-np.array(front.eye))
        # From the top, too, the volume turns about its own up axis, without a jump.
        turned = pressed("ArrowUp")
        assert turned.up == pytest.approx(up)
        assert np.dot(turned.eye, up) > 0.99 and np.dot(turned.eye, front.eye) > 0.05
        assert not page.problems


def test_a_narrow_window_keeps_the_width_in_view(
    open_page: Callable[..., Any],  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        asked(page, volume)

        def resized(width: int, height: int) -> tuple[Camera, float, float]:
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(300)
            request = asked(page, volume)
            camera = request.camera
            away = float(np.linalg.norm(np.subtract(camera.eye, camera.at)))
            return camera, away, max(1.0, request.size[1] / request.size[0])

        # The view that was not moved is fitted anew; one that was keeps what it shows.
        _, home, wide = resized(900, 600)
        _, away, narrow = resized(300, 800)
        assert narrow > wide == 1.0 and away == pytest.approx(home * narrow)
        page.locator(".picture").focus()
        page.keyboard.press("ArrowLeft")
        moved = asked(page, volume).camera
        wider, grown, less_narrow = resized(360, 800)
        assert narrow > less_narrow > 1 and grown == pytest.approx(away * less_narrow / narrow)
        back = [np.subtract(camera.eye, camera.at) for camera in (moved, wider)]
        assert np.dot(*back) == pytest.approx(np.linalg.norm(back[0]) * np.linalg.norm(back[1]))
        assert not page.problems
