"""Views in headless Chromium, if the page and the server do not take turns."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from browser_pages import asked, browser, fake_scene, open_page, rests  # noqa: F401
from viewer_fakes import FakeVolume

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
