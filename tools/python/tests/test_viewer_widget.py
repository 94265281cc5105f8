"""The widget: its kernel's side through a fake front end, and all of it in JupyterLab
and Voila."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import secrets
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from viewer_fakes import PLAIN_WISH, Drawn, FakeVolume

import isowave

pytest.importorskip("anywidget")
pillow = pytest.importorskip("PIL.Image")

from isowave.viewer import widget as widget_module  # noqa: E402
from isowave.viewer.front_end import PARTS, script  # noqa: E402
from isowave.viewer.protocol import VERSION  # noqa: E402
from isowave.viewer.widget import MAX_VIEWS, STILL_SIZE, Widget, show  # noqa: E402

TIMEOUT = 60  # seconds; for machines that are busy with other things
HELLO = {"type": "hello", "version": VERSION}


class FrontEnd:
    """What the kernel sent, by view; acknowledges pictures as view.js does."""

    def __init__(self, volume: FakeVolume) -> None:
        self.changed = threading.Condition()
        self.heads = dict[str, list[dict[str, Any]]]()
        self.pictures = list[bytes]()
        self.widget = show(volume, isovalue=80, size=(64, 48))
        self.widget.send = self._take

    def say(self, view: str, message: object) -> None:
        self.widget._handle_custom_msg({"view": view, "message": message}, [])

    def _take(self, content: dict[str, Any], buffers: list[bytes] | None = None) -> None:
        json.dumps(content, allow_nan=False)
        with self.changed:
            self.heads.setdefault(content["view"], []).append(content["message"])
            self.pictures += buffers or []
            self.changed.notify_all()
        message = content["message"]
        if message["type"] == "picture":
            self.say(content["view"], {"type": "ack", "frame": message["frame"]})

    def wait(self, view: str, **wanted: Any) -> None:
        def came() -> bool:
            heads = self.heads.get(view, [])
            return any(all(h.get(k) == v for k, v in wanted.items()) for h in heads)

        with self.changed:
            assert self.changed.wait_for(came, TIMEOUT), self.heads.get(view)


@pytest.fixture
def front() -> Iterator[FrontEnd]:
    front = FrontEnd(FakeVolume())
    yield front
    front.widget.close()
    assert not widget_module._scenes


def test_a_view_sees_its_wish(front: FrontEnd) -> None:
    front.say("a", HELLO)
    front.say("a", PLAIN_WISH)
    front.wait("a", type="picture", stage="lossless", wish=1)
    assert front.pictures[-1].startswith(b"\x89PNG")


def test_views_have_their_own_state(front: FrontEnd) -> None:
    for i, view in enumerate("abc"):
        front.say(view, HELLO)
        front.say(view, {**PLAIN_WISH, "isovalue": 50 + i})
    for i, view in enumerate("abc"):
        front.wait(view, type="picture", stage="lossless")
        pictures = [h for h in front.heads[view] if h["type"] == "picture"]
        assert {h["isovalue"] for h in pictures} == {50 + i}


def test_a_malformed_message_ends_one_view(front: FrontEnd) -> None:
    front.say("good", HELLO)
    front.say("bad", HELLO)
    front.say("bad", {**PLAIN_WISH, "isovalue": "x"})
    front.wait("bad", type="closed", retry=False)
    for odd in (None, 1, [], "x", {"view": "a"}, {"view": 5, "message": HELLO}, {"view": "x" * 99}):
        front.widget._handle_custom_msg(odd, [])
    front.say("unknown", PLAIN_WISH)
    front.say("good", PLAIN_WISH)
    front.wait("good", type="picture", stage="lossless")
    assert "unknown" not in front.heads


def test_views_that_are_gone_leave_nothing(front: FrontEnd) -> None:
    scene = front.widget._scene
    for i in range(100):
        front.say(f"view {i}", HELLO)
        if i % 2:
            front.say(f"view {i}", None)
    assert scene.num_clients <= MAX_VIEWS
    front.say("last", HELLO)
    front.say("last", PLAIN_WISH)
    front.wait("last", type="picture", stage="lossless")


def test_widgets_of_a_volume_share_a_renderer() -> None:
    volume = FakeVolume()
    one, two = FrontEnd(volume), FrontEnd(volume)
    assert one.widget._scene is two.widget._scene
    for front in (one, two):
        front.say("a", HELLO)
        front.say("a", PLAIN_WISH)
        front.wait("a", stage="whole")
    one.widget.close()
    one.widget.close()
    two.say("b", HELLO)
    two.say("b", PLAIN_WISH)
    two.wait("b", stage="whole")
    assert len(volume.renderers) == 1
    two.widget.close()
    assert not widget_module._scenes
    field = FakeVolume()
    shown = [show(volume, field=field), show(volume, field=field), show(volume)]
    assert len(widget_module._scenes) == 2, "with the field, and without"
    for widget in shown:
        widget.close()
    assert not widget_module._scenes


def test_an_exported_notebook_has_the_picture(
    front: FrontEnd, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the widget, which shows nothing without a kernel."""
    monkeypatch.setattr(widget_module, "STILL_SECONDS", TIMEOUT)
    images = images_of(front.widget)
    still = images["image/png"]
    assert [*images] == ["image/png"] and still == front.widget.still
    picture = pillow.open(io.BytesIO(still))
    assert picture.size == STILL_SIZE
    assert len(picture.getcolors(1 << 20)) > 2, "no ball"
    assert front.widget._scene.num_clients == 0
    assert images_of(front.widget) == images


def test_a_scene_is_what_the_exported_notebook_shows() -> None:
    volume: Any = FakeVolume()
    scene = isowave.Scene(volume, (isowave.Surface(80, "red", 0.5), isowave.Surface(120, "blue")))
    widget: Any = isowave.view(scene.look(background="black"), notebook=True)
    widget._repr_mimebundle_()
    drawn = volume.frames[-1].request
    assert [each.isovalue for each in drawn.surfaces] == [80, 120]
    assert (drawn.background, drawn.size) == ((0, 0, 0), STILL_SIZE)
    widget.close()


def images_of(widget: Widget) -> dict[str, bytes]:
    bundle: Any = widget._repr_mimebundle_()
    data = bundle[0] if isinstance(bundle, tuple) else bundle
    assert "application/vnd.jupyter.widget-view+json" in data
    return {
        kind: base64.b64decode(each) for kind, each in data.items() if kind.startswith("image/")
    }


def test_a_slow_picture_does_not_keep_the_widget_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(widget_module, "STILL_SECONDS", 0.1)
    go = threading.Event()
    widget = show(FakeVolume(before_pass=lambda drawn: go.wait(TIMEOUT) and None), isovalue=80)
    assert images_of(widget) == {}
    go.set()
    widget.close()


def test_the_best_picture_so_far_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(widget_module, "STILL_SECONDS", TIMEOUT)

    def only_small_ones(drawn: Drawn) -> None:
        if drawn.size == STILL_SIZE:
            raise RuntimeError("no memory")

    widget = show(FakeVolume(before_pass=only_small_ones), isovalue=80)
    (kind,) = images_of(widget)
    assert kind == "image/jpeg"
    widget.close()


def test_the_kernel_says_that_it_is_there(front: FrontEnd) -> None:
    front.say("a", "alive")
    front.wait("a", type="alive")
    assert not front.widget._sessions


def test_a_widget_has_the_steps_of_a_series() -> None:
    series = isowave.Series(["a.zfp", "b.zfp"], lambda step: FakeVolume())  # type: ignore
    front = FrontEnd(series)  # type: ignore[arg-type]
    front.say("a", HELLO)
    front.wait("a", type="welcome", steps=["a.zfp", "b.zfp"])
    front.say("a", {**PLAIN_WISH, "step": 1})
    front.wait("a", type="picture", stage="lossless", step=1)
    front.say("a", {**PLAIN_WISH, "id": 2, "step": 2})
    front.wait("a", type="closed", message="step must be an integer from 0 to 1")
    front.widget.close()


def test_the_widget_carries_the_module() -> None:
    module = script()
    assert str(Widget._esm) == module and module.count("export default") == 1
    assert not re.search(r"^\s*import\b", module, re.MULTILINE)
    parts = Path(widget_module.__file__).parent.glob("*.js")
    assert {part.name for part in parts} == set(PARTS)


#: Shows the module's widget with a model without a kernel; what it is sent is in `sent`.
ALONE = """async ([module, still]) => {
  const url = URL.createObjectURL(new Blob([module], { type: "text/javascript" }));
  const { default: widget } = await import(url);
  const bytes = Uint8Array.from(atob(still), (c) => c.charCodeAt(0));
  window.sent = [];
  window.heard = {};
  const model = {
    get: (name) => ({ height: 400, still: new DataView(bytes.buffer) })[name],
    on: (name, act) => { heard[name] = act; }, off: () => {},
    send: (content) => sent.push(content),
  };
  const el = document.body.appendChild(document.createElement("div"));
  window.end = widget.render({ model, el });
}"""


def test_a_page_without_a_kernel(page: Any) -> None:
    """Shows the picture; says that no kernel answers; nothing is red meanwhile (B11)."""
    stream = io.BytesIO()
    pillow.new("RGB", (96, 54), (10, 200, 30)).save(stream, "png")
    page.goto("about:blank")
    page.evaluate(ALONE, [script(), base64.b64encode(stream.getvalue()).decode()])
    page.wait_for_function(
        """() => { const canvas = document.querySelector("div").firstChild.shadowRoot
          .querySelector("canvas.picture");
        const [r, g, b] = canvas.getContext("2d").getImageData(48, 27, 1, 1).data;
        return canvas.width === 96 && `${r} ${g} ${b}` === "10 200 30"; }"""
    )
    field = page.get_by_role("spinbutton", name="Isovalue", exact=True)
    assert field.evaluate("e => e.matches(':invalid')")
    color = "e => getComputedStyle(e).borderColor"
    assert field.evaluate(color) == page.locator("[name=budget]").evaluate(color), "red"
    note = page.locator(".note")
    page.get_by_text("The kernel does not answer. If it is busy, pictures follow.").wait_for()
    view, alive = page.evaluate(
        "() => [sent[0].view, sent.filter(s => s.message === 'alive').length]"
    )
    assert alive == 1
    page.evaluate("(view) => heard['msg:custom']({ view, message: { type: 'alive' } })", view)
    assert note.is_hidden()
    page.evaluate("() => heard['comm_live_update']()")
    assert note.text_content() == "The kernel was restarted: run the cell again."
    page.evaluate("() => end()")
    assert page.evaluate("() => sent.at(-1).message") is None


NOTEBOOK_CELL = """\
import sys
sys.path[:0] = {paths!r}
from viewer_fakes import FakeVolume
from isowave.viewer import view
view(FakeVolume(), isovalue=80, title="ball", height=420)
"""


@pytest.fixture(scope="module")
def jupyter(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], str]]:
    """The URL of a path of a JupyterLab with a notebook that shows the widget, ball.ipynb."""
    pytest.importorskip("jupyterlab")
    folder = tmp_path_factory.mktemp("jupyter")
    paths = [str(Path(__file__).parent), str(Path(isowave.__file__).parents[1])]
    cell = NOTEBOOK_CELL.format(paths=paths)
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    notebook = {"nbformat": 4, "nbformat_minor": 5, "metadata": kernel, "cells": [
        {"cell_type": "code", "id": "a", "metadata": {}, "source": cell, "outputs": [],
         "execution_count": None}]}  # fmt: skip
    (folder / "ball.ipynb").write_text(json.dumps(notebook))
    token = secrets.token_hex(16)
    folders = ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR")
    environment = {**os.environ, **{name: str(folder / name) for name in folders}}
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ip=127.0.0.1"]
    command += ["--port=0", f"--IdentityProvider.token={token}", f"--ServerApp.root_dir={folder}"]
    command += ["--LabApp.news_url=", "--LabApp.check_for_updates_class="]
    command[-1] += "jupyterlab.NeverCheckForUpdate"
    log = folder / "server.log"
    with log.open("w") as output:
        process = subprocess.Popen(command, stderr=output, stdout=output, env=environment)
    try:
        url = None
        for _ in range(10 * TIMEOUT):
            url = url or re.search(r"http://127\.0\.0\.1:(\d+)/lab\?token=", log.read_text())
            if url or process.poll() is not None:
                break
            threading.Event().wait(0.1)
        assert url, log.read_text()
        yield lambda path: f"http://127.0.0.1:{url[1]}/{path}?token={token}"
    finally:
        process.terminate()
        process.wait(TIMEOUT)


@pytest.fixture(scope="module")
def page() -> Iterator[Any]:
    """A page of Chromium."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = os.environ.get("ISOWAVE_CHROMIUM") or shutil.which("chromium")
    if not chromium:
        pytest.skip("no Chromium")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(1000 * TIMEOUT)
        yield page
        browser.close()


def drag(page: Any) -> None:
    """Waits for the first whole picture, and for that of the view after."""
    view = page.locator("[data-stage=lossless]")
    view.wait_for()
    box = page.get_by_role("application").bounding_box()
    before = view.get_attribute("data-shown")
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 180, steps=5)
    page.mouse.up()
    page.wait_for_function(
        f"""() => {{ const {{ wish, shown, stage }} =
        document.querySelector("[data-lm-suppress-shortcuts][data-stage]").dataset;
        return Number(shown) > {before} && wish === shown && stage === "lossless"; }}"""
    )


def keep_screenshot(page: Any, name: str) -> None:
    if os.environ.get("ISOWAVE_SCREENSHOTS"):
        page.screenshot(path=f"{os.environ['ISOWAVE_SCREENSHOTS']}/{name}.png")


def test_in_jupyterlab(jupyter: Callable[[str], str], page: Any) -> None:
    page.goto(jupyter("lab/tree/ball.ipynb"))
    page.get_by_text("| Idle").wait_for()  # the kernel's status; before, keys are lost
    page.locator(".jp-Notebook .cm-content").first.click()
    page.keyboard.press("Shift+Enter")
    drag(page)
    # Keys are the picture's, not the notebook's: 0 0 would restart the kernel.
    page.get_by_role("application").focus()
    page.keyboard.press("0")
    page.keyboard.press("0")
    page.keyboard.press("ArrowLeft")
    assert page.get_by_role("dialog").count() == 0
    keep_screenshot(page, "jupyterlab")


def test_in_voila(jupyter: Callable[[str], str], page: Any) -> None:
    """A page without JupyterLab's front end."""
    pytest.importorskip("voila")
    page.goto(jupyter("voila/render/ball.ipynb"))
    drag(page)
    keep_screenshot(page, "voila")
