"""Pages that show a volume without a server: as `isowave export`, save_html() and the viewer write
them, opened from a file in a headless browser.

ISOWAVE_PROGRAM      the program that was built, which draws the expected pictures
ISOWAVE_SCREENSHOTS  a folder for pictures of the pages
"""

from __future__ import annotations

import base64
import gzip
import io
import json
import os
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import FIREFOX, ROOT, browser, keep, menu, open_page, type_into
from PIL import Image
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, make_scene

import isowave
from isowave import _core
from isowave._annotate import annotations_for_core
from isowave._page import ENGINE
from isowave.viewer.protocol import PageFile

PROGRAM = os.environ.get("ISOWAVE_PROGRAM", "isowave")
FUEL = Path(__file__).resolve().parents[3] / "tests/data/fuel_64x33x32_uint8.raw.gz"
SCENE: dict[str, Any] = {
    "isowave_scene": 1,
    "surfaces": [
        {"isovalue": 10, "color": "skin", "opacity": 0.4},
        {"isovalue": 90, "color": "#3060c0"},
    ],
    "background": "#102030",
}
PIXELS = f"""() => {{
    const canvas = {ROOT}.querySelector(".picture");
    const {{ data }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let text = "";
    for (let i = 0; i < data.length; i += 4) text += String.fromCharCode(...data.slice(i, i + 3));
    return [canvas.width, canvas.height, btoa(text)];
}}"""

if "ISOWAVE_PAGE" not in os.environ and not ENGINE.is_file():
    pytest.skip("the package has no engine for pages: tools/wasm", allow_module_level=True)


@pytest.fixture(scope="module")
def volume() -> isowave.Volume:
    return isowave.open(FUEL)


@pytest.fixture(scope="module")
def html(volume: isowave.Volume, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "fuel.html"
    volume.save_html(path, 10, title="Fuel <injection>")
    return path


def until(page: Any, holds: str) -> None:
    """Waits. The page's policy forbids wait_for_function(), which evaluates a text."""
    for _ in range(600):
        if page.evaluate(holds):
            return
        page.wait_for_timeout(100)
    pytest.fail(f"never: {holds}")


def rests(page: Any) -> None:
    """As browser_pages.rests()."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
    until(
        page,
        """(() => {
        const data = document.querySelector("main")?.dataset;
        return data?.pending === undefined && data?.wish === data?.shown
            && data?.stage === "lossless";
    })()""",
    )
    page.evaluate(f"for (const row of {ROOT}.querySelectorAll('details')) row.open = true")


def state(page: Any) -> dict[str, str]:
    """What the page's address says."""
    parts = page.evaluate("location.hash").lstrip("#").split("&")
    return dict(part.split("=", 1) for part in parts)


def shown(page: Any) -> Any:
    """The picture that the page shows: RGB."""
    width, height, text = page.evaluate(PIXELS)
    pixels = np.frombuffer(base64.b64decode(text), np.uint8)
    return pixels.reshape(height, width, 3)


def opened(open_page: Callable[..., Any], path: Path, **options: Any) -> Any:
    page = open_page(**options)
    page.goto(path.as_uri())
    rests(page)
    return page


def drawn_by_program(page: Any, volume: Path, folder: Path, *more: str) -> Any:
    """The program's picture of what the page shows: by the command that the page tells."""
    menu(page, "export")
    command = page.locator("[name=command]").input_value()
    scene = json.loads(re.search(r"END'\n(.*)\nEND\n", command, re.DOTALL)[1])  # type: ignore
    (folder / "scene.json").write_text(json.dumps(scene))
    options = re.search(r"(--size .*) -o ", command)[1].split()  # type: ignore[index]
    subprocess.run(
        [PROGRAM, "render", volume, "--scene", "scene.json", *options, *more, "-o", "a.png"],
        cwd=folder,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    page.keyboard.press("Escape")
    return np.asarray(Image.open(folder / "a.png"))


def test_the_page_has_the_programs_bits_and_asks_no_server(
    open_page: Callable[..., Any], html: Path, tmp_path: Path
) -> None:
    page = opened(open_page, html)
    assert page.title() == "Fuel <injection> – isowave"
    assert np.array_equal(shown(page), drawn_by_program(page, FUEL, tmp_path))
    stages = [p["stage"] for p in page.evaluate("window.shownPictures")]
    assert stages[0] == "first" and stages[-1] == "lossless"
    assert page.locator("#poster").count() == 0
    assert page.problems == []
    assert {url.split(":")[0] for url in page.requested} <= {"file", "data", "blob"}
    # Firefox does not tell of the page itself.
    assert {url for url in page.requested if url.startswith("file")} <= {html.as_uri()}
    keep(page, "page_to_share")


def test_drags_isovalues_and_rays_are_drawn(
    open_page: Callable[..., Any], html: Path, tmp_path: Path
) -> None:
    page = opened(open_page, html)
    before, seen = state(page), shown(page)
    box = page.locator(".picture").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.evaluate("window.shownPictures.length = 0")
    page.mouse.move(box["x"] + 420, box["y"] + 240, steps=8)
    page.mouse.up()
    rests(page)
    assert state(page)["eye"] != before["eye"] and not np.array_equal(shown(page), seen)
    stages = [p["stage"] for p in page.evaluate("window.shownPictures")]
    assert stages[0] == "first" and stages[-1] == "lossless"
    number = page.locator("[name=isovalue]")
    type_into(number, "60")
    number.press("Enter")
    rests(page)
    assert state(page)["iso"] == "60"
    assert np.array_equal(shown(page), drawn_by_program(page, FUEL, tmp_path))
    # With rays of light, the sharp picture stays until the whole one is there.
    page.evaluate("window.shownPictures.length = 0")
    page.locator("[name=ambient]").select_option("8")
    rests(page)
    stages = [p["stage"] for p in page.evaluate("window.shownPictures")]
    assert stages[-2:] == ["sharp", "lossless"]
    assert np.array_equal(shown(page), drawn_by_program(page, FUEL, tmp_path))
    assert page.problems == []


def test_scenes_are_drawn_and_controls_without_an_engine_hidden(
    open_page: Callable[..., Any], volume: isowave.Volume, tmp_path: Path
) -> None:
    (tmp_path / "s.json").write_text(json.dumps(SCENE))
    isowave.open_scene(tmp_path / "s.json", volume=volume).save_html(tmp_path / "s.html")
    page = opened(open_page, tmp_path / "s.html")
    assert page.locator(".surfaces li").count() == 2
    assert np.array_equal(shown(page), drawn_by_program(page, FUEL, tmp_path))
    for name in ("max_error", "time_budget", "budget"):
        assert not page.locator(f"[name={name}]").is_visible(), name
    for name in ("samples", "ambient", "units"):
        assert page.locator(f"[name={name}]").is_visible(), name
    keep(page, "page_of_a_scene")


def outside(groups: list[dict[str, Any]], picture: Any) -> Any:
    """Where annotations change nothing."""
    mask = np.ones(picture.shape[:2], bool)
    for group in groups:
        (left, top), (right, bottom) = group["begin"], group["end"]
        mask[top:bottom, left:right] = False
    return mask


def test_annotations_are_where_the_library_has_them(
    open_page: Callable[..., Any], volume: isowave.Volume, tmp_path: Path
) -> None:
    what = ["scale-bar", "axes", "color-bar", "caption"]
    scene = volume.scene().surface(10).look(color_map="viridis")
    scene.annotate(what, units="mm", title="A title").save_html(tmp_path / "a.html")
    page = opened(open_page, tmp_path / "a.html")
    assert page.locator("[name=axes]").is_checked()
    assert page.locator("[name=units]").input_value() == "mm"
    picture, plain = shown(page), drawn_by_program(page, FUEL, tmp_path, "--annotate", "none")
    # The program's, by Cairo, are about the same: fonts and edges differ.
    by_cairo = drawn_by_program(page, FUEL, tmp_path)
    height, width = picture.shape[:2]
    file = isowave.open_scene(tmp_path / "scene.json", volume=volume)
    image = file.render(size=(width, height), device="host")
    wanted = isowave.Annotations(what, "mm", "A title")
    layout = _core.annotation_layout(
        annotations_for_core(wanted, True), image._fields, image.statistics["color_range"], None
    )
    assert len(layout) == 4
    mask = outside(layout, picture)
    assert np.array_equal(picture[mask], plain[mask])
    assert np.array_equal(plain[mask], by_cairo[mask])
    for group in layout:
        (left, top), (right, bottom) = group["begin"], group["end"]
        ours, cairos, none = (
            p[top:bottom, left:right].astype(int) for p in (picture, by_cairo, plain)
        )
        changed = np.abs(cairos - none).sum()
        assert np.abs(ours - none).sum() > 0.7 * changed
        assert np.abs(ours - cairos).sum() < 0.8 * changed
    keep(page, "page_with_annotations")
    # Small first pictures are enlarged for them, and a file has them, too.
    page.evaluate("window.shownPictures.length = 0")
    page.locator("[name=caption]").uncheck()
    rests(page)
    assert not np.array_equal(shown(page), picture)
    if not FIREFOX:
        menu(page, "export")
        with page.expect_download() as saved:
            page.locator("[name=shot]").click()
        assert np.array_equal(np.asarray(Image.open(saved.value.path())), shown(page))
    assert page.problems == []


def test_a_parallel_view_turns_zooms_and_stays_parallel(
    open_page: Callable[..., Any], volume: isowave.Volume, tmp_path: Path
) -> None:
    camera = replace(volume.camera(10), parallel_height=40.0)
    volume.scene().surface(10).seen_from(camera).save_html(tmp_path / "p.html")
    page = opened(open_page, tmp_path / "p.html")
    seen = shown(page)
    assert float(state(page)["parallel"]) == pytest.approx(40, rel=0.5)  # as the page is wide
    assert np.array_equal(seen, drawn_by_program(page, FUEL, tmp_path))
    before = state(page)
    page.locator(".picture").focus()
    page.keyboard.press("+")
    page.keyboard.press("ArrowLeft")
    rests(page)
    after = state(page)
    assert float(after["parallel"]) < float(before["parallel"]) and after["eye"] != before["eye"]
    assert np.array_equal(shown(page), drawn_by_program(page, FUEL, tmp_path))
    box = page.locator(".picture").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    until(page, f"{ROOT}.querySelector('.readout').textContent")
    text = page.locator(".readout").text_content()
    assert float(text.split(" · ")[-1]) == pytest.approx(10, abs=0.01)


def test_colours_by_a_second_volume(
    open_page: Callable[..., Any], volume: isowave.Volume, tmp_path: Path
) -> None:
    z, y, x = np.indices((9, 9, 16), np.float32)
    heat = isowave.compress(x + 2 * y + 3 * z, spacing=(4, 4, 4))
    heat.save(tmp_path / "heat.zfp")
    field = isowave.open(tmp_path / "heat.zfp")
    by_field = isowave.ColorMap("magma", by="field")
    scene = volume.scene().surface(10).look(color_map=by_field, field=field)
    scene.save_html(tmp_path / "f.html")
    page = opened(open_page, tmp_path / "f.html")
    assert np.array_equal(shown(page), drawn_by_program(page, FUEL, tmp_path))
    box = page.locator(".picture").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    until(page, f"{ROOT}.querySelector('.readout').textContent")
    keep(page, "page_with_a_field")
    assert page.problems == []
    with pytest.raises(isowave.Error, match="a site has one volume"):
        scene.save_site(tmp_path / "site")


def test_a_saved_picture_is_the_one_that_is_shown(
    open_page: Callable[..., Any], html: Path
) -> None:
    if FIREFOX:
        pytest.skip("Playwright does not tell of Firefox's downloads")
    page = opened(open_page, html)
    menu(page, "export")
    with page.expect_download() as saved:
        page.locator("[name=shot]").click()
    assert saved.value.suggested_filename.endswith("_10.png")
    assert np.array_equal(np.asarray(Image.open(saved.value.path())), shown(page))
    camera = json.loads(Image.open(saved.value.path()).text["isowave cameras"])
    eye = [float(x) for x in state(page)["eye"].split(",")]
    assert camera["cameras"][0]["eye"] == pytest.approx(eye)


def test_what_is_under_the_cursor(open_page: Callable[..., Any], html: Path) -> None:
    page = opened(open_page, html)
    box = page.locator(".picture").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    until(page, f"{ROOT}.querySelector('.readout').textContent")
    text = page.locator(".readout").text_content()
    assert float(text.split(" · ")[-1]) == pytest.approx(10, abs=0.01)


@pytest.mark.skipif(FIREFOX, reason="WebDriver BiDi cannot switch Firefox's JavaScript off")
def test_the_poster_shows_without_javascript(
    open_page: Callable[..., Any], html: Path, volume: isowave.Volume
) -> None:
    page = open_page(java_script_enabled=False)
    page.goto(html.as_uri())
    poster = page.locator("#poster img")
    assert poster.is_visible()
    data = poster.get_attribute("src").split(",")[1]
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))
    camera = volume.camera(10, size=(1280, 720))
    assert np.array_equal(picture, volume.render(10, camera=camera, device="host").rgb)
    keep(page, "page_without_javascript")


def poster_of(path: Path) -> Any:
    """Pixels of a page's picture."""
    data = re.search(r'<img[^>]*src="data:image/png;base64,([^"]*)"', path.read_text())
    assert data
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data[1]))))


def test_the_poster_has_the_annotations(volume: isowave.Volume, tmp_path: Path) -> None:
    look = {"color_map": "viridis"}
    scene = volume.scene().surface(10).look(**look).annotate(units="mm", title="A title")
    camera = volume.camera(10, size=(1280, 720))
    image = volume.render(10, camera=camera, device="host", **look)
    expected = image.annotated(units="mm", title="A title")
    assert not np.array_equal(expected, image.rgb)
    scene.save_html(tmp_path / "a.html")
    assert np.array_equal(poster_of(tmp_path / "a.html"), expected)
    scene.save_site(tmp_path / "site")
    assert np.array_equal(poster_of(tmp_path / "site/index.html"), expected)
    # As the viewer's button does it.
    scene.save(tmp_path / "s.json")
    fields = _core.parse_scene((tmp_path / "s.json").read_text())
    volume.save_page(fields, tmp_path / "v.html", "A view", None)
    assert np.array_equal(poster_of(tmp_path / "v.html"), expected)
    # Without a title, that of the page.
    scene.annotate("caption").save_html(tmp_path / "b.html", title="Fuel, burning")
    expected = image.annotated("caption", title="Fuel, burning")
    assert np.array_equal(poster_of(tmp_path / "b.html"), expected)


def test_what_annotating_raises_is_raised(
    volume: isowave.Volume, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("no letters")

    monkeypatch.setattr("isowave._page.draw", fail)
    with pytest.raises(ValueError, match="no letters"):
        volume.scene().surface(10).annotate().save_html(tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


def test_without_webassembly_one_line_says_so(open_page: Callable[..., Any], html: Path) -> None:
    page = open_page()
    page.add_init_script("delete globalThis.WebAssembly")
    page.goto(html.as_uri())
    page.get_by_text("This browser has no WebAssembly: only a picture is shown.").wait_for()
    assert page.locator("#poster img").is_visible() and page.problems == []


@pytest.mark.parametrize("part", ["volume", "module"])
def test_damaged_pages_say_so(
    open_page: Callable[..., Any], html: Path, tmp_path: Path, part: str
) -> None:
    text = html.read_text()
    begin = text.index(">", text.index(f'id="{part}"')) + 1
    end = text.index("<", begin)
    middle = begin + (end - begin) // 8 * 4
    (tmp_path / "damaged.html").write_text(text[:middle] + text[end:])  # half is missing
    page = open_page()
    page.goto((tmp_path / "damaged.html").as_uri())
    line = page.locator("#line")
    until(page, "!/Opening|JavaScript/.test(document.querySelector('#line').innerText)")
    said = {"volume": "The volume of this page cannot be opened: ", "module": "The engine"}
    assert line.inner_text().startswith(said[part]) and "\n" not in line.inner_text().strip()
    assert page.locator("#poster img").is_visible()


def test_a_dropped_volume_is_opened_here(
    open_page: Callable[..., Any], html: Path, tmp_path: Path
) -> None:
    page = opened(open_page, html)
    values = np.fromfunction(lambda z, y, x: x + y + z, (9, 8, 7))
    head = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 7 8 9\nencoding: raw\n\n"
    (tmp_path / "ramp.nrrd").write_bytes(head + values.astype(np.uint8).tobytes())

    def drop(path: Path) -> None:
        page.evaluate(
            f"""([name, text]) => {{
            const data = new DataTransfer();
            data.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
            {ROOT}.querySelector(".stage").dispatchEvent(
                new DragEvent("drop", {{ dataTransfer: data, bubbles: true }}));
        }}""",
            [path.name, base64.b64encode(path.read_bytes()).decode()],
        )

    drop(tmp_path / "ramp.nrrd")
    until(page, f"{ROOT}.querySelector('.title').textContent === 'ramp.nrrd'")
    rests(page)
    assert "7 × 8 × 9 uint8" in page.locator(".volume").text_content()
    assert np.array_equal(shown(page), drawn_by_program(page, tmp_path / "ramp.nrrd", tmp_path))
    # What is no volume is one line, and the one before stays.
    (tmp_path / "bad.nrrd").write_bytes(b"NRRD0004\ntype: uint8\n\n")
    drop(tmp_path / "bad.nrrd")
    until(page, f"/bad.nrrd:/.test({ROOT}.querySelector('.note').textContent)")
    assert page.locator(".title").text_content() == "ramp.nrrd" and page.problems == []


def test_a_phones_page(open_page: Callable[..., Any], html: Path) -> None:
    page = opened(open_page, html, viewport={"width": 390, "height": 740}, has_touch=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert len(np.unique(shown(page))) > 10
    keep(page, "page_on_a_phone")


def test_wrong_pages_are_one_line(volume: isowave.Volume, tmp_path: Path) -> None:
    with pytest.raises(isowave.Error, match="HTML"):
        volume.save_html(tmp_path / "a.png", 10)
    scene = volume.scene().surface(10, clipped=False)
    with pytest.raises(isowave.Error, match="clipped"):
        scene.save_html(tmp_path / "a.html")
    other: Any = isowave.Scene(object(), (isowave.Surface(10),))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="a page shows a Volume"):
        other.save_html(tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


def test_the_engine_is_small_and_evaluates_no_texts() -> None:
    file = Path(os.environ.get("ISOWAVE_PAGE", ENGINE))
    page = gzip.decompress(file.read_bytes()).decode()
    for place in ("TITLE", "POSTER", "SCENE", "VOLUME", "FIELD"):
        assert page.count(f"@ISOWAVE_{place}@") == 1
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]  # type: ignore
    assert "default-src 'none'" in policy and "unsafe-eval" not in policy.replace(
        "'wasm-unsafe-eval'", ""
    )
    assert "eval(" not in page and "new Function" not in page
    engine = re.search(r'id="module">([^<]*)<', page)[1]  # type: ignore[index]
    code = re.search(r'id="code">(.*?)</script>', page, re.DOTALL)[1]  # type: ignore[index]
    assert len(base64.b64decode(engine)) + len(gzip.compress(code.encode())) <= 406_000


def test_pages_are_written_by_the_server() -> None:
    scene = make_scene(FakeVolume(), Clock())
    heard: list[tuple[dict[str, Any], bytes | None]] = []
    client = scene.join(lambda head, data: heard.append((head, data)))
    assert client is not None
    scene.receive(client, PageFile(json.dumps(SCENE)))
    head, data = heard[-1]
    assert head == {"type": "page"} and data is not None and b"<title>" in data
    scene.receive(client, PageFile('{"a\\nb'))
    head, data = heard[-1]
    assert head["type"] == "error" and data is None and "\n" not in head["message"]
