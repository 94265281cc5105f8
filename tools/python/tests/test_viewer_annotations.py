"""Annotations in the viewer: scale bar, axes, colour bar and caption in the pictures it sends."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import (  # noqa: F401
    asked,
    browser,
    fake_scene,
    keep,
    open_file,
    open_page,
    open_scene,
    rests,
    saved_scene,
    screenshot,
    state,
    type_into,
)
from conftest import FUEL
from numpy.typing import NDArray
from PIL import Image
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run, wish_of

import isowave
from isowave import Annotations, ColorMap, Series
from isowave.viewer import command, view
from isowave.viewer import server as server_module
from isowave.viewer.protocol import Wish
from isowave.viewer.server import Server

ALL = ("scale-bar", "axes", "color-bar", "caption")
BARLESS = ("scale-bar", "axes", "caption")  # without colours that a bar explains
SCENE = {"isowave_scene": 1, "surfaces": [{"isovalue": 80}], "color_map": "magma"}
SIZE = (320, 240)


def pictures(eye: Eye) -> dict[str, NDArray[np.uint8]]:
    """The last picture of each stage."""
    heads = [head for head in eye.heads if head["type"] == "picture"]
    return {h["stage"]: np.asarray(Image.open(io.BytesIO(eye.data[h["frame"]]))) for h in heads}


def seen(wanted: Annotations | None) -> dict[str, NDArray[np.uint8]]:
    """The pictures of one wish, those of passes among them."""
    clock, volume = Clock(), FakeVolume()
    volume.before_pass = lambda drawn: setattr(clock, "now", clock.now + 0.1)
    scene = make_scene(volume, clock, title="ball.nrrd")
    eye = Eye(scene)
    scene.receive(eye.client, replace(wish_of(1, size=SIZE), annotations=wanted))
    for _ in range(50):
        eye.ack()
        if not scene.step():
            clock.now += 0.2
    assert not eye.of_type("error")
    return pictures(eye)


def test_all_stages_are_annotated() -> None:
    """First pictures are made as large as the whole one, so that texts are legible."""
    plain = seen(None)
    annotated = seen(Annotations(("axes", "caption"), "", ""))
    assert {*plain} == {*annotated} == {"first", "pass", "whole", "lossless"}
    assert plain["first"].shape == (60, 80, 3)
    for stage, picture in annotated.items():
        assert picture.shape == (240, 320, 3), stage
    changed = (annotated["lossless"] != plain["lossless"]).any(axis=2)
    assert changed[:60, :160].any() and changed[180:, :160].any(), "caption and axes"
    assert not changed[:, 200:].any() and not changed[100:160].any()


def test_titles_are_those_of_the_volume_unless_one_is_given() -> None:
    caption = Annotations(("caption",), "", "")
    own, named, other = (
        seen(replace(caption, title=title))["lossless"]
        for title in ("", "ball.nrrd", "another ball")
    )
    assert np.array_equal(own, named) and not np.array_equal(own, other)


def test_series_have_the_steps_names() -> None:
    caption = Annotations(("caption",), "", "")
    shown = []
    for names in (["a.raw", "first.raw"], ["b.raw", "second.raw"]):
        volume, clock = FakeVolume(), Clock()
        series: Any = Series(names, lambda step: volume)  # type: ignore[arg-type,return-value]
        scene = make_scene(series, clock, title="a series")
        eye = Eye(scene)
        wish = replace(wish_of(1, size=SIZE), annotations=caption, step=1)
        scene.receive(eye.client, wish)
        run(scene)
        shown.append(pictures(eye)["whole"])
    assert not np.array_equal(*shown)


def test_small_pictures_have_none() -> None:
    for size in ((199, 160), (300, 149)):
        scene = make_scene(FakeVolume(), Clock())
        eye = Eye(scene)
        wanted = Annotations(("axes",), "", "")
        scene.receive(eye.client, replace(wish_of(1, size=size), annotations=wanted))
        run(scene)
        assert not eye.of_type("error")
        assert pictures(eye)["whole"].shape == (size[1], size[0], 3)


def test_a_bar_without_colours_is_an_error_of_one_client() -> None:
    """Pages send none."""
    scene = make_scene(FakeVolume(), Clock())
    eye, other = Eye(scene), Eye(scene)
    bar = Annotations(("color-bar",), "", "")
    scene.receive(eye.client, replace(wish_of(1, size=SIZE), annotations=bar))
    other.wish()
    run(scene)
    (error,) = eye.of_type("error")
    assert error["wish"] == 1 and "a colour bar needs a colour map" in error["message"]
    assert other.pictures[-1] == (1, "whole") and not other.of_type("error")


def test_pages_are_told_which_come_first() -> None:
    def told(**options: Any) -> Any:
        scene = make_scene(FakeVolume(), Clock(), **options)
        return Eye(scene).of_type("welcome")[0]["annotations"]

    assert told() is None
    everything = {"what": [*ALL], "units": "", "title": ""}
    assert told(annotations=Annotations()) == everything
    assert told(annotations=Annotations(["caption", "axes"], "µm", "a")) == {
        "what": ["axes", "caption"],
        "units": "µm",
        "title": "a",
    }
    assert told(annotations=Annotations(())) == {**everything, "what": []}
    with pytest.raises(TypeError, match="annotations='all': give isowave.Annotations"):
        told(annotations="all")
    with pytest.raises(ValueError, match="units must be a text of at most 16 letters"):
        told(annotations=Annotations(units=17 * "m"))
    with pytest.raises(ValueError, match="title must be a text of at most 80 letters"):
        told(annotations=Annotations(title=81 * "a"))


def test_the_command_line_says_which_come_first(tmp_path: Path) -> None:
    parser = command.make_parser()

    def first(*arguments: str) -> Annotations | None:
        parsed = parser.parse_args(["head.nrrd", *arguments])
        return command.annotations_of(parsed, command.scene_of(parsed))

    assert first() is None
    assert first("--annotate", "all") == Annotations("all")
    assert first("--annotate", "axes,caption", "--units", "mm") == Annotations(
        ("axes", "caption"), "mm"
    )
    assert first("--annotate", "none") == Annotations(())
    file = tmp_path / "scene.json"
    scene = "--scene", str(file)
    annotations = {"axes": True, "units": "km", "title": "a head"}
    file.write_text(json.dumps({**SCENE, "annotations": annotations}))
    assert first(*scene) is None, "the page takes the scene's"
    assert first(*scene, "--units", "mm") == Annotations(("axes",), "mm", "a head")
    assert first(*scene, "--annotate", "caption") == Annotations(("caption",), "km", "a head")
    assert first(*scene, "--annotate", "none") == Annotations((), "km", "a head")
    with pytest.raises(ValueError, match="--units mm: nothing is annotated: give --annotate"):
        first("--units", "mm")
    with pytest.raises(ValueError, match="--units mm: nothing is annotated"):
        first(*scene, "--annotate", "none", "--units", "mm")
    for text, wrong in (("axis", "axis"), ("axes,", ""), ("axes,none", "none"), ("", "")):
        with pytest.raises(ValueError, match=f"'{wrong}' is none of scale-bar, axes, color-bar"):
            command.parse_annotations(text)


def test_the_command_serves_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "open_volume", lambda path: FakeVolume())
    served = dict[str, Any]()

    def fail(volume: Any, **options: Any) -> None:
        served.update(options)
        raise OSError("enough")

    def error_of(*arguments: str) -> str:
        try:
            assert command.main(["ball.nrrd", "--no-browser", *arguments]) == 1
        except SystemExit as ended:
            assert ended.code == 1
        return capsys.readouterr().err

    too_long = error_of("--annotate", "all", "--units", 17 * "m")
    assert too_long == "isowave view: units must be a text of at most 16 letters\n"
    unknown = error_of("--annotate", "axis")
    assert unknown.startswith("isowave view: argument --annotate: 'axis' is none of scale-bar, ")
    assert unknown.count("\n") == 1
    monkeypatch.setattr(server_module, "serve", fail)
    assert error_of("--annotate", "all") == "isowave view: enough\n"
    assert served["annotations"] == Annotations("all")


def annotations_wished(server: Server) -> list[Any]:
    """Gets those of each wish from now on."""
    wishes: list[Any] = []
    take = server.scene.receive

    def note(client: Any, message: Any) -> None:
        if isinstance(message, Wish):
            wishes.append(message.annotations)
        take(client, message)

    server.scene.receive = note  # type: ignore[method-assign]
    return wishes


def test_scene_files_have_them(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        wishes = annotations_wished(server)
        page = open_page()
        page.goto(server.url)

        def wished() -> Any:
            rests(page)
            return wishes[-1]

        assert wished() is None
        assert "annotations" not in json.loads(saved_scene(page))
        own = {"axes": True, "color_bar": True, "units": "µm", "title": "a ball"}
        open_scene(page, json.dumps({**SCENE, "annotations": own}))
        full = Annotations(("axes", "color-bar"), "µm", "a ball")
        assert wished() == full and state(page)["annotate"] == "axes,color-bar"
        assert page.get_by_label("Axes").is_checked()
        assert not page.get_by_label("Caption").is_checked()
        assert page.get_by_label("Title").input_value() == "a ball"
        text = saved_scene(page)
        assert json.loads(text)["annotations"] == own
        fields = isowave._core.parse_scene(text)
        assert fields["annotations"]["color_bar"] and not fields["annotations"]["scale_bar"]
        # Without a colour map, the file has no bar.
        page.locator("[name=color_map]").select_option("own")
        rests(page)
        assert "color_bar" not in json.loads(saved_scene(page))["annotations"]
        # What the page cannot show changes nothing.
        long = json.dumps({**SCENE, "annotations": {"title": 81 * "a"}})
        open_file(page, "long.json", long)
        note = page.locator(".note")
        note.get_by_text("annotations.title: this page shows up to 80 letters.").wait_for()
        assert wished() == Annotations(("axes",), "µm", "a ball")
        open_scene(page, json.dumps(SCENE))
        assert wished() is None and "units" not in state(page)
        open_scene(page, text)
        assert wished() == full and not page.problems


def test_pages_show_the_first_ones(open_page: Callable[..., Any]) -> None:  # noqa: F811
    own = {"axes": True, "units": "km"}
    scene = json.dumps(isowave._core.parse_scene(json.dumps({**SCENE, "annotations": own})))
    for options, first in (
        ({"annotations": Annotations("all", "mm")}, Annotations(BARLESS, "mm")),
        ({"scene": scene}, Annotations(("axes",), "km")),
        ({"scene": scene, "annotations": Annotations(("caption",))}, Annotations(("caption",))),
        ({"scene": scene, "annotations": Annotations(())}, None),
    ):
        with Server(fake_scene(FakeVolume(), **options)) as server:
            wishes = annotations_wished(server)
            page = open_page()
            page.goto(server.url)
            rests(page)
            assert wishes[-1] == first
            # Another address is not overruled.
            page.goto(server.url + "#iso=30&annotate=scale-bar")
            page.reload()
            rests(page)
            assert wishes[-1] == Annotations(("scale-bar",)) and not page.problems


def test_the_page_asks_for_them(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        wishes = annotations_wished(server)
        plain = screenshot(page)[1]

        def wished() -> Any:
            rests(page)
            return [wish for wish in wishes if wish is not None][-1]

        page.get_by_label("Axes").check()
        assert wished() == Annotations(("axes",), "", "")
        page.get_by_label("Caption").check()
        page.get_by_label("Scale bar", exact=True).check()
        assert wished().what == ("scale-bar", "axes", "caption")
        bar = page.get_by_label("Colour bar")
        assert bar.is_disabled(), "there are no colours that it explains"
        page.locator("[name=color_map]").select_option("magma")
        bar.check()
        type_into(page.get_by_label("Units"), "µm")
        title = page.get_by_label("Title")
        assert title.get_attribute("placeholder") == "ball.nrrd"
        type_into(title, "a ball, & more=1")
        full = Annotations(ALL, "µm", "a ball, & more=1")
        assert wished() == full
        keep(page, "annotations")
        assert state(page)["annotate"] == ",".join(ALL)
        page.reload()
        assert wished() == full and title.input_value() == "a ball, & more=1"
        # Without the map, there is no bar until there are slices.
        page.locator("[name=color_map]").select_option("own")
        assert wished().what == ("scale-bar", "axes", "caption") and bar.is_disabled()
        page.get_by_role("button", name="Add z", exact=True).click()
        assert wished() == full and bar.is_checked()
        page.evaluate("location.hash = 'iso=80&annotate=axes,legend&units=mm'")
        page.evaluate("location.hash = 'iso=80&annotate=axes&units=mmmmmmmmmmmmmmmmm'")
        assert wished() == full, "what is not understood changes nothing"
        page.evaluate("location.hash = 'iso=80&annotate=axes'")
        assert wished() == Annotations(("axes",), "", "")
        page.get_by_label("Axes").uncheck()
        rests(page)
        assert wishes[-1] is None and "annotate" not in state(page)
        page.get_by_role("button", name="Remove slice 1").click()
        rests(page)
        assert screenshot(page)[1] == plain and not page.problems


def test_screenshots_are_those_of_the_library(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = isowave.open(FUEL, exact=True)
    scene = volume.scene().surface(20, "orange", opacity=0.4).surface(120).slice("z", 16)
    scene = scene.look(color_map=ColorMap("viridis", "x"), background="white", slice_map="magma")
    scene = scene.annotate(units="mm", title="fuel")
    with view(scene, device="host", block=False, open_browser=False, notebook=False) as server:
        for name, viewport in (
            ("wide", {"width": 1000, "height": 640}),
            ("narrow", {"width": 360, "height": 740}),
        ):
            page = open_page(viewport=viewport)
            page.goto(server.url)
            rests(page)
            if name == "narrow":
                page.get_by_role("button", name="Panel").click()
                rests(page)  # with the size that the view is then reset for
                page.get_by_role("button", name="Reset view").click()
            rests(page)
            shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
            size = (shown.shape[1], shown.shape[0])
            image = scene.render(size=size, device="host")
            assert np.array_equal(shown, image.annotated()), name
            page.locator("[name=title]").scroll_into_view_if_needed()
            keep(page, f"annotations_{name}")
            page.locator(".picture").scroll_into_view_if_needed()
            keep(page, f"annotations_{name}_picture")
            assert not page.problems
