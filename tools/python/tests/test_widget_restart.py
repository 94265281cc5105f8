"""The widget's page and its kernel, joined by a comm, without JupyterLab: what a page shows when
its kernel falls silent, and when it was restarted (B11).

The kernel's side is the widget itself; the page has the model of it that a notebook's front end
would have.
"""

from __future__ import annotations

import base64
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from viewer_fakes import FakeVolume

pytest.importorskip("anywidget")

from browser_pages import PROGRAM, playwright  # noqa: E402

from isowave.viewer.front_end import script  # noqa: E402
from isowave.viewer.widget import Widget, show  # noqa: E402

TIMEOUT = 60  # seconds; for machines that are busy with other things

#: The front end's model: what the page sends to the kernel is in `sent`; hear() is a message of it.
MODEL = """async ([module, height]) => {
  const url = URL.createObjectURL(new Blob([module], { type: "text/javascript" }));
  const { default: widget } = await import(url);
  const listeners = {};
  window.sent = [];
  const model = {
    get: (name) => ({ height })[name],
    on: (name, act) => { (listeners[name] ??= []).push(act); },
    off: (name, act) => { listeners[name] = listeners[name].filter((each) => each !== act); },
    send: (content) => sent.push(content),
  };
  window.fire = (name, ...rest) => (listeners[name] ?? []).forEach((act) => act(...rest));
  window.hear = (content, texts) => fire("msg:custom", content, texts.map((text) =>
    new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer)));
  const el = document.body.appendChild(document.createElement("div"));
  window.end = widget.render({ model, el });
}"""


class Comm:
    """Joins a page to a kernel's widget, until the kernel is gone."""

    def __init__(self, page: Any) -> None:
        self.page, self.from_kernel = page, deque[tuple[Any, list[bytes]]]()
        self.widget: Widget | None = show(FakeVolume(), isovalue=80, size=(64, 48))
        self.widget.send = lambda content, buffers=None: self.from_kernel.append(
            (content, [bytes(each) for each in buffers or []])
        )

    def end_kernel(self) -> None:
        """As a kernel that is killed: no word of it."""
        widget, self.widget = self.widget, None
        assert widget is not None
        widget.close()
        self.from_kernel.clear()

    def carry_until(self, holds: Callable[[], Any]) -> None:
        """Carries messages both ways until something holds."""
        end = time.monotonic() + TIMEOUT
        while not holds():
            assert time.monotonic() < end, self.page.locator(".note").text_content()
            for content in self.page.evaluate("() => sent.splice(0)"):
                if self.widget is not None:
                    self.widget._handle_custom_msg(content, [])
            while self.from_kernel:
                content, buffers = self.from_kernel.popleft()
                texts = [base64.b64encode(each).decode() for each in buffers]
                self.page.evaluate("([content, texts]) => hear(content, texts)", [content, texts])
            self.page.wait_for_timeout(20)


@pytest.fixture
def comm() -> Iterator[Comm]:
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 900, "height": 600})
        errors: list[Any] = []
        page.on("pageerror", lambda error: errors.append(error))
        page.goto("about:blank")
        page.evaluate(MODEL, [script(), 400])
        comm = Comm(page)
        yield comm
        if comm.widget is not None:
            comm.end_kernel()
        browser.close()
    assert errors == []


def turn(page: Any) -> None:
    """A drag over the picture."""
    box = page.get_by_role("application").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.down()
    page.mouse.move(box["x"] + 260, box["y"] + 170, steps=3)
    page.mouse.up()


def test_a_restarted_kernel_is_noted(comm: Comm) -> None:
    page = comm.page
    note = page.locator(".note")
    comm.carry_until(lambda: page.locator("[data-stage=lossless]").count())
    assert note.is_hidden()
    turn(page)
    comm.carry_until(
        lambda: page.locator("[data-stage=lossless]").count() and not note.is_visible()
    )
    comm.end_kernel()
    assert note.is_hidden(), "the page has not asked yet"
    turn(page)
    comm.carry_until(note.is_visible)
    assert note.text_content() == (
        "The kernel does not answer. If it is busy, pictures follow. If it was restarted, run the "
        "cell again."
    )
    page.evaluate("() => fire('comm_live_update')")  # what a front end fires after a restart
    assert note.text_content() == "The kernel was restarted: run the cell again."
    turn(page)
    page.wait_for_timeout(100)
    assert note.is_visible(), "a drag does not hide it"


def test_a_kernel_that_was_busy_takes_the_note_away(comm: Comm) -> None:
    page = comm.page
    note = page.locator(".note")
    # No message is carried meanwhile.
    page.get_by_text("The kernel does not answer. If it is busy, pictures follow.").wait_for()
    comm.carry_until(lambda: page.locator("[data-stage=lossless]").count() and note.is_hidden())
