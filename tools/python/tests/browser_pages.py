"""The viewer's page in a browser: how tests open it, act on it, and look at it.

Fixtures are imported by name.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from viewer_fakes import FakeVolume

from isowave import viewer
from isowave.viewer.front_end import script
from isowave.viewer.scene import Scene
from isowave.viewer.server import Server

playwright = pytest.importorskip("playwright.sync_api")
FIREFOX = os.environ.get("ISOWAVE_BROWSER") == "firefox"
if FIREFOX:
    PROGRAM = shutil.which("firefox-esr") or shutil.which("firefox")
else:
    PROGRAM = os.environ.get("ISOWAVE_CHROMIUM") or shutil.which("chromium")
if not PROGRAM:
    package = "firefox-esr" if FIREFOX else "chromium"
    pytest.skip(f"no browser: apt-get install {package}", allow_module_level=True)

WIDTH, HEIGHT = 1000, 640
ROOT = "document.querySelector('main').shadowRoot"
DOWNLOADS = tempfile.TemporaryDirectory(prefix="isowave_downloads_")
# Tells which pictures were shown, from the beginning.
WATCH = """
window.shownPictures = [];
document.addEventListener("isowave:shown", (e) => window.shownPictures.push(e.detail));
"""
# What tells pictures apart: their size and a sum of their pixels. (In its PNGs Firefox tells pages
# apart, too.)
DRAWN = """() => {
    const canvas = document.querySelector("main").shadowRoot.querySelector(".picture");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let sum = 0;
    for (const value of data) sum = (Math.imul(sum, 31) + value) | 0;
    return [canvas.width, canvas.height, sum];
}"""


def fake_scene(volume: FakeVolume, title: str = "ball.nrrd", **options: Any) -> Scene:
    return Scene(
        volume,
        isovalue=80,
        title=title,
        **options,
    )


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as started:
        if FIREFOX:  # the distribution's own, by WebDriver BiDi
            preferences = {
                "dom.events.testing.asyncClipboard": True,  # Firefox pastes without asking
                "ui.prefersReducedMotion": 1,
            }
            browser = started.firefox.launch(
                executable_path=PROGRAM,
                channel="moz-firefox",
                firefox_user_prefs=preferences,
                downloads_path=DOWNLOADS.name,
            )
        else:
            browser = started.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server(fake_scene(FakeVolume())) as server:
        yield server


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[..., Any]]:
    """Opens pages, each with a browser context of its own, and closes them."""
    contexts = []

    def open_page(**options: Any) -> Any:
        options.setdefault("viewport", {"width": WIDTH, "height": HEIGHT})
        context = browser.new_context(accept_downloads=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.add_init_script(WATCH)
        page.set_default_timeout(60000)  # for machines that are busy with other things
        page.problems, page.requested = [], []
        page.on("console", lambda m: m.type == "error" and page.problems.append(m.text))
        page.on("pageerror", lambda e: page.problems.append(str(e)))
        page.on("request", lambda r: page.requested.append(r.url))
        return page

    yield open_page
    for context in contexts:
        context.close()


def rests(page: Any) -> None:
    """Waits until what was done is a wish, and its lossless picture is shown; unfolds all rows."""
    # Some events, such as those of another size or hash, come with the next frame of the page.
    page.evaluate(
        """() => new Promise((done) => {
        requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done)));
    })"""
    )
    page.wait_for_function(
        """() => {
        const { wish, shown, stage, pending } = document.querySelector("main").dataset;
        return pending === undefined && wish === shown && stage === "lossless";
    }"""
    )
    page.evaluate(f"for (const row of {ROOT}.querySelectorAll('details')) row.open = true")


def menu(page: Any, name: str) -> Any:
    """Opens a menu of the top bar: file, camera, export, info or help."""
    button = page.locator(f"[name={name}_menu]")
    if button.get_attribute("aria-expanded") == "false":
        button.click()
    return page.locator(f"#{name}_pop")


def asked(page: Any, volume: FakeVolume) -> Any:
    """The request of the last picture."""
    rests(page)
    drawn = (frame.request for frame in reversed(volume.frames))
    return next(request for request in drawn if "rgb" in request.outputs)  # not of bounds


def button(page: Any, name: str) -> Any:
    return page.get_by_role("button", name=name, exact=True)


@pytest.fixture
def page(open_page: Callable[..., Any], server: Server) -> Any:
    page = open_page()
    page.goto(server.url)
    rests(page)
    return page


def keep(page: Any, name: str) -> None:
    folder = os.environ.get("ISOWAVE_SCREENSHOTS")
    if folder:
        Path(folder).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=str(Path(folder) / f"{name}.png"))


def drag(page: Any, dx: float, dy: float, **how: Any) -> None:
    page.mouse.move(300, 250)
    page.mouse.down(**how)
    page.mouse.move(300 + dx, 250 + dy, steps=5)
    page.mouse.up(**how)


def isovalue(page: Any) -> Any:
    """The field of that name."""
    return page.get_by_label("Isovalue", exact=True).last


def type_into(field: Any, text: str) -> None:
    """In place of what is there. fill() does not replace it in Firefox."""
    field.click()
    field.press("Control+A")
    field.press("Delete")
    field.type(text)


def double_click(page: Any, x: float, y: float) -> None:
    if FIREFOX:  # where two clicks of Playwright's are none
        page.locator(".picture").dispatch_event("dblclick", {"clientX": x, "clientY": y})
    else:
        page.mouse.dblclick(x, y)


def screenshot(page: Any) -> tuple[str, bytes]:
    """Name and bytes of the file that the button of that name gives."""
    button = menu(page, "export").get_by_role("button", name="Save PNG")
    if not FIREFOX:
        with page.expect_download() as download:
            button.click()
        page.keyboard.press("Escape")
        return download.value.suggested_filename, Path(download.value.path()).read_bytes()
    button.click()  # Playwright does not tell of Firefox's downloads
    for _ in range(600):
        files = [path for path in Path(DOWNLOADS.name).iterdir() if path.suffix == ".png"]
        if files and files[0].stat().st_size > 0:
            return files[0].name, files[0].read_bytes()
        time.sleep(0.1)
    raise TimeoutError("no download")


def open_file(page: Any, name: str, text: str) -> None:
    page.get_by_label("Scene file").set_input_files(
        {"name": name, "mimeType": "application/json", "buffer": text.encode()}
    )


def open_scene(page: Any, text: str) -> None:
    """Opens a file that is read, and waits for its wish."""
    wish = page.evaluate("document.querySelector('main').dataset.wish")
    open_file(page, "scene.json", text)
    page.wait_for_function(
        "(before) => document.querySelector('main').dataset.wish !== before", arg=wish
    )


def save_scene(page: Any) -> None:
    menu(page, "file").get_by_role("button", name="Save scene").click()
    page.keyboard.press("Escape")


def saved_scene(page: Any) -> str:
    with page.expect_download() as saved:
        save_scene(page)
    assert saved.value.suggested_filename == "scene.json"
    return Path(saved.value.path()).read_text()


def changes(page: Any, act: Callable[[], None]) -> bool:
    """Whether the picture is another one after something was done."""
    before = page.evaluate(DRAWN)
    act()
    rests(page)
    return bool(page.evaluate(DRAWN) != before)


def state(page: Any) -> dict[str, str]:
    hash_text = page.evaluate("location.hash").lstrip("#")
    return dict(part.split("=") for part in hash_text.split("&"))


def eye(page: Any) -> np.ndarray[Any, Any]:
    return np.array([float(x) for x in state(page)["eye"].split(",")])


def answer_from_files(page: Any, url: str) -> None:
    root = Path(viewer.__file__).parent

    def answer(route: Any) -> None:
        is_script = route.request.url.endswith(".js")
        route.fulfill(
            body=script() if is_script else (root / "page.html").read_text(),
            content_type="text/javascript" if is_script else "text/html",
        )

    page.route(url + "**", answer)


CONTRAST = """() => {
  const root = document.querySelector("main").shadowRoot;
  const parse = (c) => c.match(/[\\d.]+/g).map(Number);
  const light = (c) => { const [r, g, b] = parse(c).map((v) => { v /= 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const back = (e) => { for (; e; e = e.parentElement ?? e.getRootNode().host) {
    const c = getComputedStyle(e).backgroundColor; const p = parse(c);
    if (p.length < 4 || p[3] === 1) return c; } return "rgb(255, 255, 255)"; };
  const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p);
    return (x + 0.05) / (y + 0.05); };
  return [...root.querySelectorAll("*")].filter((e) => e.checkVisibility() &&
      ([...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()) || e.matches("input")))
    .map((e) => [e.className || e.localName, ratio(getComputedStyle(e).color, back(e))]);
}"""
