"""Files: exported pictures, the command that draws the same, dropped and recent scenes."""

from __future__ import annotations

import io
import json
import os
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import (
    FIREFOX,
    ROOT,
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
    saved_scene,
    screenshot,
    server,
    state,
    type_into,
    isovalue,
)
from PIL import Image
from viewer_fakes import FakeVolume

from isowave.viewer.server import Server


def exported(page: Any) -> Any:
    name, data = screenshot(page)
    assert name.endswith(".png")
    return Image.open(io.BytesIO(data))


@pytest.mark.skipif(FIREFOX, reason="Playwright does not tell of Firefox's downloads")
def test_pictures_are_exported_larger_and_clear(page: Any) -> None:
    pop = menu(page, "export")
    width, height = page.evaluate(
        f"(() => {{ const c = {ROOT}.querySelector('.picture'); return [c.width, c.height]; }})()"
    )
    wish = page.evaluate("document.querySelector('main').dataset.wish")
    for factor in (1, 2, 4):
        menu(page, "export").get_by_label(f"{factor}×").check()
        assert f"{factor * width} × {factor * height}" in pop.inner_text()
        picture = exported(page)
        assert picture.size == (factor * width, factor * height) and picture.mode == "RGB"
    keep(page, "export")
    menu(page, "export").get_by_label("1×").check()
    menu(page, "export").get_by_label("Transparent").check()
    clear = exported(page)
    alpha = np.asarray(clear)[:, :, 3]
    assert clear.mode == "RGBA" and alpha[2, 2] == 0 and alpha[height // 2, width // 2] == 255
    menu(page, "export").get_by_label("Transparent").uncheck()
    plain = np.asarray(exported(page))
    # The page's own picture was not touched.
    assert page.evaluate("document.querySelector('main').dataset.wish") == wish
    assert "is saved" in pop.locator(".export_progress").inner_text()
    assert (plain[2, 2] == 255).all() and page.problems == []


@pytest.mark.skipif(FIREFOX, reason="Playwright does not tell of Firefox's downloads")
def test_an_export_has_a_scale_bar_if_one_likes(open_page: Callable[..., Any]) -> None:
    volume = FakeVolume(anatomical=True)
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        pop = menu(page, "export")
        plain = np.asarray(exported(page))
        menu(page, "export").get_by_label("With a scale bar").check()
        assert (
            '"scale_bar":true'
            in menu(page, "export").get_by_label("The same picture").input_value()
        )
        assert '"units":"mm"' in menu(page, "export").get_by_label("The same picture").input_value()
        with_bar = np.asarray(exported(page))
        assert with_bar.shape == plain.shape and (with_bar != plain).any()
        assert "annotate" not in state(page)


def test_an_export_can_be_stopped_and_says_what_went_wrong(open_page: Callable[..., Any]) -> None:
    def before_pass(drawn: Any) -> None:
        if drawn.size[0] > 1200 and drawn.request.isovalue == 13:
            raise RuntimeError("the device was lost")

    with Server(fake_scene(FakeVolume(before_pass=before_pass))) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        assert changes(page, lambda: type_into(isovalue(page), "13"))
        pop = menu(page, "export")
        pop.get_by_label("2×").check()
        button(page, "Save PNG").click()
        pop.get_by_text("the device was lost").wait_for()
        assert button(page, "Save PNG").is_enabled() and not button(page, "Stop").is_visible()
        assert not page.locator(".note").is_visible()
        page.evaluate(f"{ROOT}.querySelector('[name=shot]').click()")
        page.evaluate(f"{ROOT}.querySelector('[name=stop_export]').click()")
        assert pop.locator(".export_progress").inner_text() == "Stopped."


def command(page: Any) -> str:
    return str(menu(page, "export").get_by_label("The same picture").input_value())


def test_the_command_says_all_that_the_page_shows(page: Any) -> None:
    page.get_by_label("Paper", exact=True).check()
    page.get_by_label("x from", exact=True).fill("20")
    rests(page)
    first, scene, end, last, _ = command(page).split("\n")
    words = shlex.split(last)
    assert first == "cat > ball_80.json << 'END'" and end == "END"
    assert words[:5] == ["isowave", "render", "ball.nrrd", "--scene", "ball_80.json"]
    assert words[words.index("--samples") + 1] == "2"
    assert words[words.index("--ambient") + 1] == "16"
    assert words[-2:] == ["-o", "ball_80.png"]
    fields = json.loads(scene)
    assert fields["surfaces"][0]["isovalue"] == 80
    assert fields["clip"] == [{"normal": [1, 0, 0], "offset": pytest.approx(12.6)}]
    menu(page, "export").get_by_label("Transparent").check()
    fields = json.loads(command(page).split("\n")[1])
    assert fields["transparent"] is True and "background" not in fields
    if not FIREFOX:
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        button(page, "Copy command").click()
        page.get_by_text("Copied").first.wait_for()
        assert page.evaluate("navigator.clipboard.readText()") == command(page)


@pytest.mark.skipif(FIREFOX, reason="once is enough")
def test_the_command_draws_the_same_picture(open_page: Callable[..., Any], tmp_path: Path) -> None:
    """With the library and the program: the exported file, pixel by pixel."""
    program = os.environ.get("ISOWAVE_PROGRAM") or shutil.which("isowave")
    if not program:
        pytest.skip("no program isowave: ISOWAVE_PROGRAM")
    import isowave

    fuel = Path(__file__).parents[3] / "tests/data/fuel_64x33x32_uint8.raw.gz"
    volume = isowave.open(str(fuel))
    with Server(fake_scene(volume, title=str(fuel), device="host")) as server:  # type: ignore
        page = open_page(viewport={"width": 700, "height": 420})
        page.goto(f"{server.url}#iso=20")
        rests(page)
        drag(page, 60, 30)
        page.get_by_label("Good", exact=True).check()
        rests(page)
        for clear in (False, True):
            menu(page, "export").get_by_label("Transparent").set_checked(clear)
            picture = np.asarray(exported(page))
            text = command(page).replace("isowave render", f"{program} render --device host", 1)
            subprocess.run(["bash", "-c", text], cwd=tmp_path, check=True, capture_output=True)
            (file,) = tmp_path.glob("*.png")
            assert np.array_equal(np.asarray(Image.open(file)), picture)
            file.unlink()


def test_names_are_words_of_a_shell(page: Any) -> None:
    words = page.evaluate(
        """async () => { const { shellWord } = await import(location.pathname + "view.js");
        return ["a.nrrd", "b c", "it's", "$(rm)", "é"].map(shellWord); }"""
    )
    assert words == ["a.nrrd", "'b c'", "'it'\\''s'", "'$(rm)'", "'é'"]


def test_the_address_is_shared(page: Any) -> None:
    if FIREFOX:
        pytest.skip("Firefox asks")
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    assert changes(page, lambda: drag(page, 50, 50))
    button(page, "Share").click()
    page.get_by_text("Copied").first.wait_for()
    assert page.evaluate("navigator.clipboard.readText()") == page.url


def drop(page: Any, name: str, text: str) -> None:
    page.evaluate(
        f"""([name, text]) => {{
        const files = new DataTransfer();
        files.items.add(new File([text], name));
        const stage = {ROOT}.querySelector(".stage");
        for (const type of ["dragover", "drop"]) stage.dispatchEvent(
            new DragEvent(type, {{ dataTransfer: files, bubbles: true, cancelable: true }}));
    }}""",
        [name, text],
    )


@pytest.mark.skipif(FIREFOX, reason="Playwright does not tell of Firefox's downloads")
def test_scenes_are_dropped_and_recent_ones_come_again(page: Any) -> None:
    before = state(page)
    text = saved_scene(page)
    type_into(isovalue(page), "120")
    rests(page)
    page.mouse.click(500, 300)
    drop(page, "first.json", text)
    page.wait_for_function("() => location.hash.includes('iso=80&')")
    rests(page)
    assert state(page)["iso"] == before["iso"]
    type_into(isovalue(page), "130")
    rests(page)
    recent = menu(page, "file").locator(".recent button")
    assert recent.count() == 2 and recent.first.inner_text() == "first.json"
    keep(page, "recent")
    recent.first.click()
    page.wait_for_function("() => location.hash.includes('iso=80&')")
    drop(page, "head.nrrd", "NRRD0004")
    page.locator(".note").get_by_text("isowave view FILE").wait_for()
    drop(page, "second.json", "{}")
    page.locator(".note").get_by_text("isowave_scene").wait_for()
    page.keyboard.press("Escape")
    assert menu(page, "file").locator(".recent button").count() == 2, "a bad one is not kept"
    # A page whose storage has something else works.
    page.evaluate("localStorage.setItem('isowave.scenes', '7')")
    page.keyboard.press("Escape")
    assert not menu(page, "file").locator(".recent").is_visible()
    assert page.problems == []


@pytest.mark.skipif(FIREFOX, reason="Playwright does not tell of Firefox's downloads")
def test_a_page_is_saved_or_an_error_told(open_page: Callable[..., Any]) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        menu(page, "export")
        with page.expect_download() as saved:
            button(page, "Save page").click()
        assert saved.value.suggested_filename == "ball_80.html"
        text = Path(saved.value.path()).read_text()
        assert text == "<!doctype html><title>ball.nrrd</title>[80.0]"

        def fail(*_: Any) -> None:
            raise ValueError("pages need the engine")

        volume.save_page = fail  # type: ignore[method-assign]
        menu(page, "export")
        button(page, "Save page").click()
        page.get_by_text("pages need the engine").wait_for()
        assert button(page, "Save page").is_enabled() and not page.problems
