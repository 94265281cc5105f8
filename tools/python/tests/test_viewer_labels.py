"""Labels in the viewer: the page's list, addresses, scene files, and renderers of both kinds."""

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
    button,
    fake_scene,
    keep,
    open_page,
    rests,
    save_scene,
    screenshot,
    state,
    type_into,
)
from PIL import Image
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, Eye, make_scene, run, wish_of

import isowave
from isowave import ColorMap, Series, Slice, Surface
from isowave._color_map import color_map_of
from isowave.viewer import view
from isowave.viewer.renderers import GIVE_BACK_SECONDS
from isowave.viewer.server import Server
from isowave.viewer.steps import STEP_SECONDS

LABELS = Surface(None, (1, 0, 0), 0.5, labels=[3, 7])


def groups(page: Any, volume: FakeVolume) -> list[tuple[tuple[int, ...], float]]:
    """Labels and opacities of the last picture's surfaces."""
    return [(each.labels, each.opacity) for each in asked(page, volume).surfaces]


def of_group(page: Any, what: str, number: int) -> Any:
    return page.get_by_label(f"{what} group {number}", exact=True)


def test_labels_come_in_place_of_surfaces(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume, field=FakeVolume(), field_name="heat.zfp")) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        assert not page.locator(".of_labels").is_visible()
        button(page, "Add z").click()
        page.locator("[name=color_map]").select_option("magma")
        page.locator("[name=color_by]").select_option("field")
        assert asked(page, volume).slices != () and asked(page, volume).color_map is not None
        button(page, "Add labels").click()
        request = asked(page, volume)
        assert groups(page, volume) == [((1,), 1)]
        assert request.slices == () and request.color_map is None
        assert (
            page.locator(".of_labels").inner_text().startswith("Drawn in place of surfaces, slices")
        )
        for name in ("Add surface", "Add x"):
            assert button(page, name).is_disabled()
        for part in (".surfaces", ".slices", ".iso"):
            assert page.locator(part).first.evaluate("part => part.inert")
        for name in ("max_error", "by", "time_budget"):
            assert page.locator(f"[name={name}]").is_disabled()
        type_into(of_group(page, "Labels of", 1), "9, 3-5,4")
        of_group(page, "Opacity of", 1).fill("0.4")
        of_group(page, "Colour of", 1).fill("#00ff00")
        button(page, "Add labels").click()
        assert groups(page, volume) == [((3, 4, 5, 9), 0.4), ((10,), 1)]
        assert asked(page, volume).surfaces[0].color == (0, 1, 0)
        assert state(page)["labels"] == "3-5.9_00ff00_0.4,10_dbbd87_1"
        keep(page, "labels")
        # What is no list of labels changes nothing, and is marked.
        for bad in ("", "x", "65536", "5-3", "1-200", "1,,2", "-1", "1.5"):
            of_group(page, "Labels of", 1).fill(bad)
            assert of_group(page, "Labels of", 1).evaluate("e => e.matches(':invalid')"), bad
        assert groups(page, volume) == [((3, 4, 5, 9), 0.4), ((10,), 1)]
        assert screenshot(page)[0] == "ball_labels.png"
        page.reload()
        assert groups(page, volume) == [((3, 4, 5, 9), 0.4), ((10,), 1)]
        assert of_group(page, "Labels of", 1).input_value() == "3-5, 9"
        button(page, "Show group 1").click()
        assert groups(page, volume) == [((10,), 1)]
        button(page, "Remove group 1").click()
        # Without labels, the surface, the slice and its colours are there again.
        button(page, "Show group 1").click()
        request = asked(page, volume)
        assert request.surfaces == () and len(request.slices) == 1
        assert request.color_map is not None and not page.locator(".of_labels").is_visible()
        button(page, "Remove group 1").click()
        rests(page)
        assert "labels" not in state(page) and not page.problems


def test_addresses_of_labels(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page(viewport={"width": 360, "height": 700}, has_touch=True)
        page.goto(server.url + "#iso=80&labels=1-3_ff0000_0.5_hidden,7_00ff00_1")
        kept = [((7,), 1)]
        assert groups(page, volume) == kept
        good = "1_ffffff_1"
        for bad in ("", "x", "1", "1_red_1", "1_ffffff_0", "70000_ffffff_1", "1+2_ffffff_1",
                    "0-200_ffffff_1", ",".join(9 * [good])):  # fmt: skip
            page.evaluate("text => location.hash = text", f"labels={bad}")
            assert groups(page, volume) == kept, bad
        button(page, "Panel").click()
        for _ in range(6):
            button(page, "Add labels").click()
        assert button(page, "Add labels").is_disabled() and len(groups(page, volume)) == 7
        frame = "document.querySelector('main').shadowRoot.querySelector('.frame')"
        assert page.evaluate(f"{frame}.scrollWidth <= 360 && document.body.scrollWidth <= 360")
        page.locator(".groups").scroll_into_view_if_needed()
        keep(page, "labels_narrow")
        assert not page.problems


def test_volumes_of_other_numbers_have_no_labels(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    for volume in (
        FakeVolume(source_dtype=np.dtype(np.float32)),
        FakeVolume(source_dtype=np.dtype(np.int16), value_range=(-1, 255)),
    ):
        with Server(fake_scene(volume)) as server:
            page = open_page()
            page.goto(server.url + "#iso=80&labels=7_00ff00_1")
            assert asked(page, volume).surfaces == () and "labels" not in state(page)
            page.evaluate("location.hash = 'labels=5_ffffff_1'")
            assert asked(page, volume).surfaces == () and "labels" not in state(page)
            assert not button(page, "Add labels").is_visible() and not page.problems
            scene = {"isowave_scene": 1, "surfaces": [{"labels": [3]}]}
            buffer = json.dumps(scene).encode()
            page.get_by_label("Scene file").set_input_files(
                {"name": "a.json", "mimeType": "application/json", "buffer": buffer}
            )
            page.locator(".note").get_by_text("The volume has no labels").wait_for()
            assert asked(page, volume).surfaces == ()


def test_labels_go_through_scene_files(
    open_page: Callable[..., Any], tmp_path: Path  # noqa: F811
) -> None:
    surfaces = [{"labels": [7, 3], "color": "#ff0000", "opacity": 0.5}, {"labels": [65535]}]
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({"isowave_scene": 1, "surfaces": surfaces}))
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        for _ in range(2):
            page.get_by_label("Scene file").set_input_files(file)
            page.locator(".groups li").nth(1).wait_for()
            assert groups(page, volume) == [((3, 7), 0.5), ((65535,), 1)]
            with page.expect_download() as saved:
                save_scene(page)
            saved.value.save_as(file)
            button(page, "Remove group 2").click()
        fields = isowave._core.parse_scene(file.read_text())
        assert [each["labels"] for each in fields["surfaces"]] == [[3, 7], [65535]]
        # A file of isovalues takes them away; one with too many labels changes nothing.
        many = {"isowave_scene": 1, "surfaces": [{"labels": list(range(129))}]}
        file.write_text(json.dumps(many))
        page.get_by_label("Scene file").set_input_files(file)
        page.locator(".note").get_by_text("up to 128 labels of a surface").wait_for()
        assert groups(page, volume) == [((3, 7), 0.5)]
        file.write_text(json.dumps({"isowave_scene": 1, "surfaces": [{"isovalue": 90}]}))
        page.get_by_label("Scene file").set_input_files(file)
        page.locator(".groups li").first.wait_for(state="detached")
        request = asked(page, volume)
        assert request.isovalue == 90 and not request.has_labels and not page.problems


def test_renderers_of_labels_and_of_isosurfaces_take_turns() -> None:
    clock, volume = Clock(), FakeVolume()
    scene = make_scene(volume, clock)
    one, two = Eye(scene), Eye(scene)
    one.wish()
    two.wish(surfaces=[LABELS, Surface(None, "blue", labels=[9])], color=None)
    run(scene)
    clock.now += STEP_SECONDS
    run(scene)
    for eye in (one, two):
        assert eye.pictures == [(1, "first"), (1, "whole")] and not eye.of_type("error")
    made = [(r["labels"], r["surfaces"], r["bounds"]) for r in volume.renderers]
    assert made == [(False, 0, True), (True, 2, False)], "no renderer is made twice"
    one.ack()
    one.wish(slices=[Slice("z", 9)])
    run(scene)
    clock.now += STEP_SECONDS
    run(scene)
    assert one.pictures[-1] == (2, "whole")
    assert volume.renderers[2]["labels"] is False, "the last one drew labels"


def test_a_device_without_memory_for_labels_draws_the_rest() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("no memory") if options["labels"] else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    wish = eye.wish(surfaces=[LABELS], color=None)
    run(scene)
    assert ("no memory", wish) in [(h["message"], h["wish"]) for h in eye.of_type("error")]
    eye.ack()
    wish = eye.wish()
    run(scene)
    assert eye.pictures[-1] == (wish, "whole")


BY_LABEL = ColorMap(by="labels")


def labels_in_colours(**more: Any) -> dict[str, Any]:
    return {"surfaces": [LABELS], "color": None, **more}


@pytest.mark.parametrize("on_host", [False, True])
def test_labels_give_colours_to_their_surfaces(on_host: bool) -> None:
    """The field is the volume itself, and only while somebody wants these colours."""
    clock, volume = Clock(), FakeVolume(on_host=on_host)
    scene = make_scene(volume, clock)
    one, two = Eye(scene), Eye(scene)
    one.wish(**labels_in_colours(color_map=BY_LABEL))
    run(scene)
    two.wish(**labels_in_colours())
    run(scene)
    for eye in (one, two):
        assert eye.pictures == [(1, "first"), (1, "whole")] and not eye.of_type("error")
    made = [(each["labels"], each["field"]) for each in volume.renderers]
    assert made == [(False, None), (not on_host, volume)], "both have one renderer"
    scene.leave(one.client)
    clock.now += GIVE_BACK_SECONDS
    run(scene)
    fields = [each["field"] for each in volume.renderers[2:]]
    assert fields == ([] if on_host else [None]), "its memory goes back"


@pytest.mark.parametrize("on_host", [False, True])
def test_a_second_volume_s_labels_come_first(on_host: bool) -> None:
    """Isosurfaces, too, have their colours. A second volume of other numbers has no labels."""
    clock, volume, atlas = Clock(), FakeVolume(on_host=on_host), FakeVolume()
    scene = make_scene(volume, clock, field=atlas)
    eye = Eye(scene)
    wishes = [{"color_map": BY_LABEL}, {"color_map": ColorMap(by="field")}]
    for wish in (*wishes, labels_in_colours(color_map=BY_LABEL)):
        eye.wish(**wish)
        run(scene)
        eye.ack()
        assert eye.pictures[-1] == (eye.wishes, "whole") and not eye.of_type("error")
    assert {id(each["field"]) for each in volume.renderers} == {id(atlas)}
    assert len(volume.renderers) == (1 if on_host else 2)
    heat = FakeVolume(source_dtype=np.dtype(np.float32))
    volume = FakeVolume(on_host=on_host)
    scene = make_scene(volume, clock, field=heat)
    eye = Eye(scene)
    for wish in (labels_in_colours(color_map=BY_LABEL), {"color_map": ColorMap(by="field")}):
        eye.wish(**wish)
        run(scene)
        eye.ack()
        assert eye.pictures[-1] == (eye.wishes, "whole") and not eye.of_type("error")
    assert [each["field"] for each in volume.renderers] == [heat, volume, heat]


def test_a_device_without_memory_for_label_colours_draws_the_rest() -> None:
    def refuse(options: dict[str, Any]) -> Exception | None:
        return RuntimeError("no memory") if options["field"] else None

    clock, volume = Clock(), FakeVolume(refuse=refuse)
    scene = make_scene(volume, clock)
    eye = Eye(scene)
    wish = eye.wish(**labels_in_colours(color_map=BY_LABEL))
    run(scene)
    assert ("no memory", wish) in [(h["message"], h["wish"]) for h in eye.of_type("error")]
    eye.ack()
    wish = eye.wish(**labels_in_colours())
    run(scene)
    assert eye.pictures[-1] == (wish, "whole")


def test_the_hosts_renderer_draws_both() -> None:
    clock, volume = Clock(), FakeVolume(on_host=True)
    series = Series(["a", "b"], lambda step: volume)  # type: ignore[arg-type,return-value]
    scene = make_scene(series, clock, field=series)  # type: ignore[arg-type]
    eye = Eye(scene)
    for step in (0, 1):
        made = len(volume.renderers)
        looks: list[dict[str, Any]] = [{"surfaces": [LABELS], "color": None}]
        looks.append({"color_map": ColorMap("gray", by="caps")})
        for look in looks:
            eye.ack()
            eye.wishes += 1
            wish = replace(wish_of(eye.wishes, size=(64, 48), **look), step=step)
            scene.receive(eye.client, wish)
            run(scene)
            assert eye.pictures[-1] == (eye.wishes, "whole") and not eye.of_type("error")
        assert len(volume.renderers) == made + step


def open_scene(page: Any, scene: dict[str, Any]) -> None:
    buffer = json.dumps({"isowave_scene": 1, **scene}).encode()
    page.get_by_label("Scene file").set_input_files(
        {"name": "a.json", "mimeType": "application/json", "buffer": buffer}
    )


def test_colours_by_label_are_a_choice(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        by, colors = page.locator("[name=color_by]"), page.locator("[name=color_map]")
        assert by.locator("[value=labels]").is_disabled(), "there are none"
        button(page, "Add labels").click()
        colors.select_option("labels")
        wanted = color_map_of(BY_LABEL)
        assert asked(page, volume).color_map == wanted and by.input_value() == "labels"
        assert page.locator("[name=color_low]").is_disabled()
        assert state(page)["map"] == "labels,labels"
        page.reload()
        assert asked(page, volume).color_map == wanted
        colors.select_option("magma")
        assert asked(page, volume).color_map == color_map_of(ColorMap("magma", by="labels"))
        by.select_option("z")
        assert asked(page, volume).color_map == color_map_of(ColorMap("magma"))
        by.select_option("labels")
        assert asked(page, volume).color_map == wanted, "each label has a colour of its own"
        by.select_option("x")
        assert asked(page, volume).color_map == color_map_of(ColorMap("viridis", "x"))
        by.select_option("labels")
        with page.expect_download() as saved:
            save_scene(page)
        text = Path(saved.value.path()).read_text()
        fields = isowave._core.parse_scene(text)
        assert fields["color_by_label"] and str(fields["field"]) == "volume"
        # Without labels, surfaces have their own colours until labels are drawn again.
        button(page, "Remove group 1").click()
        assert asked(page, volume).color_map is None
        open_scene(page, json.loads(text))
        request = asked(page, volume)
        assert request.color_map.by == "labels" and request.has_labels
        before = state(page)
        colours = {"color_map": "labels", "color_by_field": True, "color_by_label": True}
        for surfaces, field in (([{"isovalue": 5}], "volume"), ([{"labels": [5]}], "atlas.nrrd")):
            open_scene(page, {"surfaces": surfaces, "field": field, **colours})
            page.locator(".note").get_by_text("no second volume to colour by").wait_for()
        assert state(page) == before and not page.problems


def test_isosurfaces_have_colours_by_a_second_volumes_labels(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    colours = {"color_map": "labels", "color_by_field": True, "color_by_label": True}
    scene = {"surfaces": [{"isovalue": 90}], "field": "atlas.nrrd", **colours}
    volume = FakeVolume()
    with Server(fake_scene(volume, field=FakeVolume(), field_name="atlas.nrrd")) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.locator("[name=color_map]").select_option("labels")
        assert asked(page, volume).color_map == color_map_of(BY_LABEL)
        page.locator("[name=color_map]").select_option("own")
        open_scene(page, scene)
        request = asked(page, volume)
        assert request.isovalue == 90 and request.color_map == color_map_of(BY_LABEL)
        with page.expect_download() as saved:
            save_scene(page)
        fields = isowave._core.parse_scene(Path(saved.value.path()).read_text())
        assert fields["color_by_label"] and str(fields["field"]) == "atlas.nrrd"
        assert not page.problems
    heat = FakeVolume(source_dtype=np.dtype(np.float32))
    with Server(fake_scene(volume, field=heat, field_name="heat.zfp")) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        assert page.locator("[name=color_by] [value=labels]").is_disabled()
        open_scene(page, scene)
        page.locator(".note").get_by_text("has no labels to colour by").wait_for()
        assert asked(page, volume).color_map is None and not page.problems


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_the_picture_is_that_of_the_library(
    open_page: Callable[..., Any], device: str  # noqa: F811
) -> None:
    z, y, x = np.mgrid[:24, :25, :26]
    voxels = np.zeros(z.shape, np.uint16)
    voxels[(z - 11) ** 2 + (y - 12) ** 2 + (x - 8) ** 2 < 36] = 3
    voxels[(z - 11) ** 2 + (y - 12) ** 2 + (x - 18) ** 2 < 36] = 65535
    volume = isowave.compress(voxels, exact=True)
    scene = volume.scene().labels(3, "red", opacity=0.5).labels(65535, "skin")
    scene = scene.look(background="white")
    with view(scene, device=device, block=False, open_browser=False, notebook=False) as server:
        page = open_page(viewport={"width": 900, "height": 640})
        page.goto(server.url)
        rests(page)
        keep(page, f"scene_labels_{device}")
        shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
        size = (shown.shape[1], shown.shape[0])
        expected = scene.render(size=size, device="host").rgb
        assert np.array_equal(shown, expected)
        page.locator("[name=color_map]").select_option("labels")
        rests(page)
        keep(page, f"scene_label_colours_{device}")
        shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
        expected = scene.look(color_map=BY_LABEL).render(size=size, device="host").rgb
        assert np.array_equal(shown, expected)
        # Isosurfaces are drawn as before when the labels are hidden.
        for number in (1, 2):
            button(page, f"Show group {number}").click()
        rests(page)
        assert state(page)["labels"].count("hidden") == 2 and not page.problems
