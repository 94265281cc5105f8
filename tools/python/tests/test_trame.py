"""examples/trame_view.py: the server, and two pages of it in headless Chromium."""

import base64
import io
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import FUEL, TOP

pytest.importorskip("trame")
httpx = pytest.importorskip("httpx")
pillow = pytest.importorskip("PIL.Image")

EXAMPLE = TOP / "tools/python/examples/trame_view.py"
PICTURE = "document.querySelector('img').src"
# The page shows a picture other than `before`, that of its newest wish.
SETTLED = """(before) => {
  const { busy, shown, wish, picture } = window.trame.state.state;
  const source = document.querySelector('img')?.src;
  return !busy && shown === String(wish) && source === picture && source !== before;
}"""

# trame-client 4.1.4 fetches its waiting sign while the page starts, and puts it in place of the
# page where it arrives later than that. Here it never arrives.
NO_WAITING_SIGN = """
const fetched = window.fetch;
window.fetch = (url, ...options) =>
  String(url).endsWith('loading.tpl') ? new Promise(() => {}) : fetched(url, ...options);
"""


@pytest.fixture(scope="module")
def url():
    process = subprocess.Popen(
        [sys.executable, "-u", EXAMPLE, FUEL, "--server", "--port", "0"],
        stdout=subprocess.PIPE,
        text=True,
    )
    lines = []
    for line in process.stdout:  # ends where the process does
        lines.append(line)
        found = re.search(r"http://[\w.]+:[1-9]\d*/", line)
        if found:
            break
    else:
        pytest.fail(f"no address: {lines}")
    yield found.group()
    process.terminate()
    process.stdout.close()
    process.wait()


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = os.environ.get("ISOWAVE_CHROMIUM") or shutil.which("chromium")
    if not chromium:
        pytest.skip("no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield browser
        browser.close()


def pixels(page):
    source = page.evaluate(PICTURE)
    assert source.startswith("data:image/jpeg;base64,")
    return np.asarray(pillow.open(io.BytesIO(base64.b64decode(source.split(",")[1])))).astype(int)


def share_of_surface(page):
    rgb = pixels(page)
    return (np.abs(rgb - rgb[0, 0]).max(-1) > 30).mean()


def wait_for_change(page, before=""):
    page.wait_for_function(SETTLED, arg=before, timeout=30_000)


def test_example_is_short():
    assert len(EXAMPLE.read_text().splitlines()) <= 80


def test_serves_a_page(url):
    answer = httpx.get(url, follow_redirects=True)
    assert answer.status_code == 200 and "<html" in answer.text


def test_two_sessions(url, browser):
    """Each has its own isovalue and camera."""
    first, second = browser.new_page(), browser.new_page()
    errors = []
    for page in (first, second):
        page.on("pageerror", lambda error: errors.append(error))
        page.add_init_script(NO_WAITING_SIGN)
        page.goto(url)
        page.wait_for_selector("img[src^=data]", timeout=30_000)
        wait_for_change(page)
    start = first.evaluate(PICTURE)
    assert second.evaluate(PICTURE) == start
    assert pixels(first).shape == (480, 640, 3) and pixels(first).std() > 5

    first.locator("input").fill("30")
    wait_for_change(first, start)
    assert "Isovalue 30.00" in first.inner_text("label")
    other_value = first.evaluate(PICTURE)
    assert second.evaluate(PICTURE) == start

    box = second.locator("img").bounding_box()
    second.mouse.move(box["x"] + 300, box["y"] + 200)
    second.mouse.down()
    second.mouse.move(box["x"] + 420, box["y"] + 240, steps=4)
    second.mouse.up()
    wait_for_change(second, start)
    # 120 pixels are 60 degrees, 40 are 20 more above; the isovalue stays.
    isovalue, turn, tilt, distance = second.evaluate("window.trame.state.get('wish')")
    assert (turn, tilt, distance) == (-30, 40, 1) and isovalue != 30
    assert first.evaluate(PICTURE) == other_value
    turned, shown = second.evaluate(PICTURE), share_of_surface(second)
    second.mouse.wheel(0, 300)
    wait_for_change(second, turned)
    assert 0 < share_of_surface(second) < shown  # from farther away
    assert not errors
    folder = os.environ.get("ISOWAVE_SCREENSHOTS")
    if folder:
        first.screenshot(path=f"{folder}/trame_first.png")
        second.screenshot(path=f"{folder}/trame_second.png")
