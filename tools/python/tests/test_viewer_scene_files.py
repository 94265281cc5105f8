"""Scene files, colour maps and further clipping planes in the viewer's page and command."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
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
    menu,
    open_page,
    open_scene,
    rests,
    saved_scene,
    screenshot,
    state,
    type_into,
)
from conftest import FUEL
from PIL import Image
from viewer_fakes import FakeVolume
from viewer_scenes import Clock, make_scene

import isowave
from isowave import ClipPlane, _scene_file
from isowave._color_map import color_map_of
from isowave._source_file import SourceFile
from isowave.viewer import command, view
from isowave.viewer import server as server_module
from isowave.viewer.protocol import SceneFile
from isowave.viewer.scene import Scene
from isowave.viewer.server import Server

SCENE = {
    "isowave_scene": 1,
    "camera": {"eye": [40, 5, 60], "at": [8, 8, 8]},
    "surfaces": [
        {"isovalue": 80, "color": "bone", "opacity": 0.5},
        {"isovalue": 120, "color": "#0000ff"},
    ],
    "clip": [{"normal": [0, 0, -2], "offset": -24}],
    "caps": False,
    "background": "black",
    "background_top": "red",
    "color_map": "magma",
    "color_axis": [0, 3, 0],
    "color_low": 2,
    "color_high": 9,
    "above": 0.6,
    "light_direction": [0, 2, 0],
}
SLICED = {"slices": [{"normal": [1, 0, 0]}]}


def test_files_are_opened_and_saved(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        open_scene(page, json.dumps(SCENE))
        request = asked(page, volume)
        bone = tuple(isowave._core.parse_color("bone"))
        assert [each.isovalue for each in request.surfaces] == [80, 120]
        assert request.surfaces[0].color == pytest.approx(bone, abs=1e-6)
        assert request.surfaces[0].opacity == 0.5
        assert request.clip == (ClipPlane((0, 0, -1), -12),) and not request.caps
        assert request.camera == isowave.Camera((40, 5, 60), (8, 8, 8))
        assert request.background == (0, 0, 0) and request.background_top == (1, 0, 0)
        wanted = color_map_of(isowave.ColorMap("magma", (0, 1, 0), (2, 9)))
        assert request.color_map == wanted
        assert request.light == (0, 1, 0)
        assert request.lights["above"] == pytest.approx(0.6) and request.lights["ambient"] > 0
        assert page.locator("[name=color_map]").input_value() == "magma"
        assert page.get_by_label("Offset of plane 1").input_value() == "-12"
        keep(page, "scene")
        # The address keeps all of it, and so does a file.
        page.reload()
        assert asked(page, volume).color_map == wanted
        assert volume.frames[-1].request.clip == request.clip
        assert volume.frames[-1].request.lights == pytest.approx(request.lights)
        assert volume.frames[-1].request.light == request.light
        assert volume.frames[-1].request.background_top == (1, 0, 0)
        text = saved_scene(page)
        fields = isowave._core.parse_scene(text)
        assert [each["isovalue"] for each in fields["surfaces"]] == [80, 120]
        assert fields["clip"] == [{"normal": [0, 0, -1], "offset": -12}]
        page.get_by_role("button", name="Remove plane 1").click()
        assert asked(page, volume).clip == ()
        open_scene(page, text)
        again = asked(page, volume)
        assert again.clip == request.clip and again.surfaces == request.surfaces
        assert again.camera == request.camera and again.color_map == wanted
        assert again.light == request.light and again.background_top == (1, 0, 0)
        assert not page.problems


def test_a_saved_scene_gives_the_state_back(open_page: Callable[..., Any]) -> None:  # noqa: F811
    """Also colours by depth, which follow the view, and the box; and undo that before."""
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        page.get_by_label("Depth", exact=True).check()
        page.get_by_label("x from", exact=True).fill("20.5")
        page.get_by_label("z to", exact=True).fill("77")
        page.get_by_role("button", name="Add plane").click()
        page.locator("[name=background]").evaluate(
            "e => { e.value = '#ffffff'; e.dispatchEvent(new Event('input')); }"
        )
        rests(page)
        before, text = state(page), saved_scene(page)
        fields = isowave._core.parse_scene(text)
        assert fields["color_by_depth"] and not fields["color_by_field"]
        assert len(fields["clip"]) == 3 and before["map"] == "viridis,depth"
        page.get_by_label("One", exact=True).check()
        page.get_by_role("button", name="Remove plane 1").click()
        page.get_by_label("x from", exact=True).fill("0")
        page.get_by_label("z to", exact=True).fill("100")
        page.locator(".picture").press("3")
        rests(page)
        other = state(page)
        assert other != before
        open_scene(page, text)
        rests(page)
        assert state(page) == before
        page.locator("[name=undo]").click()
        rests(page)
        assert state(page) == other
        page.locator("[name=redo]").click()
        rests(page)
        assert state(page) == before and saved_scene(page) == text
        assert not page.problems


def test_a_saved_scene_names_the_files(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume(source=SourceFile("/data/run.h5", "scan/ct", "t=3,c=0"))
    heat = FakeVolume(source=SourceFile("/data/heat.h5", "T", "t=1"))
    with Server(fake_scene(volume, field=heat)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        parts = ("volume", "dataset", "index", "field", "field_dataset", "field_index")

        def saved() -> list[str]:
            fields = isowave._core.parse_scene(saved_scene(page))
            return [fields[name] for name in parts]

        of_volume = ["/data/run.h5", "scan/ct", "t=3,c=0"]
        assert saved() == [*of_volume, "", "", ""]
        page.get_by_label("Field", exact=True).check()
        rests(page)
        assert saved() == [*of_volume, "/data/heat.h5", "T", "t=1"]
        text = menu(page, "export").get_by_label("The same picture").input_value()
        assert "\nisowave render --scene ball_80.json --size" in text
        assert '"dataset":"scan/ct"' in text


def test_bad_files_are_one_line_and_change_nothing(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        before = state(page)
        note = page.locator(".note")
        high = {**SCENE, "camera": {**SCENE["camera"], "parallel_height": 1e30}}  # type: ignore
        for text, why in (
            ("[", "no JSON from byte"),
            ('{"isowave_scene": 1}', "surfaces is missing"),
            (json.dumps({**SCENE, "surfaces": [{"isovalue": 1, "opacity": 2}]}), "opacity of 2"),
            (json.dumps(high), "from 1e-18 to 1e18"),
            (json.dumps({**SCENE, "clip": 9 * SCENE["clip"]}), "up to 8"),  # type: ignore
            (json.dumps({**SCENE, **SLICED, "slice_table": 256 * ["red"]}), "no tables of colours"),
            (json.dumps({**SCENE, **SLICED, "slice_low": 0, "slice_high": 1e30}), "up to 1e18"),
            (
                json.dumps({**SCENE, "slices": [{"normal": [1, 0, 0], "offset": 1e30}]}),
                "shows slices up to 1e18 from the origin",
            ),
            (json.dumps({**SCENE, "slices": 7 * [{"normal": [1, 0, 0]}]}), "give at most 8"),
            (
                json.dumps({**SCENE, "surfaces": [{"isovalue": 1, "clipped": False}]}),
                "cuts all surfaces",
            ),
            (json.dumps({**SCENE, "color_high": 1e30}), "values up to 1e18"),
            (
                json.dumps({**SCENE, "clip": [{"normal": [1, 0, 0], "offset": 1e30}]}),
                "up to 1e18 from",
            ),
            (json.dumps({**SCENE, "shadow_rays": 256}), "256 shadow rays"),
            (json.dumps({**SCENE, "color_by_field": True}), "no second volume to colour by"),
            (" " * 9000, "big.json is too large for a scene of this page"),
        ):
            open_file(page, "big.json", text)
            note.get_by_text(why).wait_for()
        assert state(page) == before and not page.problems
        plain = volume.frames[0].request
        for frame in volume.frames:  # bounds may have been looked for meanwhile
            request = frame.request
            assert (request.surfaces, request.clip, request.color) == ((), (), plain.color)


def test_the_light_stays_where_it_is(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        assert asked(page, volume).light is None
        page.locator("[name=light]").select_option("stays")
        camera = asked(page, volume).camera
        back = np.subtract(camera.eye, camera.at) / np.linalg.norm(
            np.subtract(camera.eye, camera.at)
        )
        light = volume.frames[-1].request.light
        assert light @ back == pytest.approx(0.5**0.5)  # as the light above, which turns
        assert light @ np.array(camera.up) == pytest.approx(0.5**0.5)
        page.locator(".picture").focus()
        page.keyboard.press("ArrowLeft")
        assert asked(page, volume).light == light and volume.frames[-1].request.camera != camera
        page.locator("[name=light]").select_option("turns")
        assert asked(page, volume).light is None and not page.problems


def test_the_background_goes_to_another_colour(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        assert asked(page, volume).background_top is None
        top = page.get_by_label("Upper edge")
        assert not top.is_visible()
        page.get_by_label("Gradient").check()
        request = asked(page, volume)
        assert request.background == (1, 1, 1) and request.background_top is not None
        top.fill("#ff0000")
        assert asked(page, volume).background_top == (1, 0, 0) and state(page)["top"] == "ff0000"
        keep(page, "gradient")
        page.reload()
        assert asked(page, volume).background_top == (1, 0, 0) and top.input_value() == "#ff0000"
        page.evaluate("location.hash = 'iso=90&top=red'")
        assert asked(page, volume).background_top == (1, 0, 0), "no colour changes nothing"
        page.get_by_label("Gradient").uncheck()
        assert asked(page, volume).background_top is None and not top.is_visible()
        assert "top" not in state(page)
        page.get_by_label("Gradient").check()
        assert asked(page, volume).background_top == (1, 0, 0), "the last colour is kept"
        assert not page.problems


def test_colours_follow_an_axis(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        along = page.get_by_label("Colours by")
        rests(page)
        assert along.is_disabled()
        page.locator("[name=color_map]").select_option("viridis")
        assert asked(page, volume).color_map == color_map_of("viridis")
        along.select_option("x")
        assert asked(page, volume).color_map == color_map_of(isowave.ColorMap("viridis", "x"))
        page.locator("[name=color_map]").select_option("gray")
        assert asked(page, volume).color_map == color_map_of(isowave.ColorMap("gray", "x"))
        assert state(page)["map"] == "gray,1,0,0"
        page.evaluate("location.hash = 'iso=90&map=gray,1,0,0,9,2'")
        backwards = color_map_of(isowave.ColorMap("gray", "x", (9, 2)))
        assert asked(page, volume).color_map == backwards
        page.evaluate("location.hash = 'iso=90&map=gray,1,0,0'")
        for bad in ("jet,1,0,0", "gray,0,0,0", "gray,1,0,0,5", "gray,1,0,0,5,5", "gray"):
            page.evaluate(f"location.hash = 'iso=90&map={bad}'")
            assert asked(page, volume).color_map == color_map_of(isowave.ColorMap("gray", "x"))
        page.locator("[name=color_map]").select_option("own")
        assert asked(page, volume).color_map is None and along.is_disabled()
        # There is no field here: not in the list, nor by an address.
        assert along.locator("[value=field]").is_disabled()
        page.goto(server.url + "#iso=90&map=gray,field")
        page.reload()
        assert asked(page, volume).color_map is None
        assert not page.problems


def test_the_range_of_colours_has_both_ends(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        low, high = page.locator("[name=color_low]"), page.locator("[name=color_high]")
        assert low.is_disabled() and high.is_disabled()
        page.locator("[name=color_map]").select_option("gray")
        assert asked(page, volume).color_map == color_map_of("gray")
        type_into(low, "5")
        high.focus()
        assert asked(page, volume).color_map == color_map_of("gray"), "the other one is missing"
        assert high.evaluate("field => !field.validity.valid")
        page.locator("[name=caps]").uncheck()
        assert asked(page, volume).color_map == color_map_of("gray") and low.input_value() == "5"
        type_into(high, "5")
        low.focus()
        assert asked(page, volume).color_map == color_map_of("gray"), "the same value"
        type_into(high, "-2.5")
        low.focus()
        wanted = color_map_of(isowave.ColorMap("gray", range=(5, -2.5)))
        assert asked(page, volume).color_map == wanted
        assert state(page)["map"] == "gray,0,0,1,5,-2.5"
        page.reload()
        assert asked(page, volume).color_map == wanted
        assert (low.input_value(), high.input_value()) == ("5", "-2.5")
        type_into(low, "")
        type_into(high, "")
        low.focus()
        assert asked(page, volume).color_map == color_map_of("gray")
        assert not page.problems


def test_shadows_need_a_light_that_stays(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        shadow, angle = page.locator("[name=shadow]"), page.locator("[name=light_angle]")
        assert shadow.is_disabled() and angle.is_disabled()
        page.locator("[name=light]").select_option("stays")
        assert asked(page, volume).shadow_rays == 0
        shadow.select_option("hard")
        request = asked(page, volume)
        assert request.shadow_rays == 1 and request.light is not None and angle.is_disabled()
        shadow.select_option("soft")
        request = asked(page, volume)
        assert (request.shadow_rays, request.light_angle) == (16, 3)
        type_into(angle, "7.5")
        shadow.focus()
        assert asked(page, volume).light_angle == 7.5 and state(page)["shadow"] == "16,7.5"
        page.reload()
        request = asked(page, volume)
        assert (request.shadow_rays, request.light_angle) == (16, 7.5)
        text = saved_scene(page)
        fields = isowave._core.parse_scene(text)
        assert (fields["shadow_rays"], fields["light_angle"]) == (16, 7.5)
        assert fields["light_direction"] == pytest.approx(list(request.light))
        # Several surfaces have them, too, if one is opaque.
        page.get_by_role("button", name="Add surface").click()
        request = asked(page, volume)
        assert (len(request.surfaces), request.shadow_rays, request.light_angle) == (2, 16, 7.5)
        page.get_by_label("Opacity of surface 1", exact=True).fill("0.4")
        request = asked(page, volume)
        assert [each.opacity for each in request.surfaces] == [0.4, 0.5]
        assert request.shadow_rays == 0 and shadow.is_disabled()
        assert isowave._core.parse_scene(saved_scene(page))["shadow_rays"] == 0
        open_scene(page, text)
        request = asked(page, volume)
        assert (request.shadow_rays, request.light_angle) == (16, 7.5)
        page.locator("[name=light]").select_option("turns")
        assert asked(page, volume).shadow_rays == 0 and shadow.is_disabled()
        for bad in ("0,3", "256,3", "1.5,3", "16", "16,0", "16,46", "16,3,1", "a,3"):
            page.goto(server.url + f"#iso=90&light=0,1,0&shadow={bad}")
            page.reload()
            assert asked(page, volume).shadow_rays == 0, bad
        assert not page.problems


def test_light_bounces_if_it_stays_and_a_surface_is_opaque(
    open_page: Callable[..., Any],  # noqa: F811
) -> None:
    volume = FakeVolume()
    with Server(fake_scene(volume)) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        bounce = page.locator("[name=bounce]")
        assert bounce.is_disabled() and not bounce.is_checked()
        page.locator("[name=light]").select_option("stays")
        assert asked(page, volume).bounce_rays == 0
        bounce.check()
        request = asked(page, volume)
        assert request.bounce_rays == 16 and request.light is not None
        assert state(page)["bounce"] == "16"
        page.reload()
        assert asked(page, volume).bounce_rays == 16 and bounce.is_checked()
        text = saved_scene(page)
        assert isowave._core.parse_scene(text)["bounce_rays"] == 16
        open_scene(page, text.replace('"bounce_rays": 16', '"bounce_rays": 40'))
        assert asked(page, volume).bounce_rays == 40 and state(page)["bounce"] == "40"
        page.locator("[name=add]").click()
        assert asked(page, volume).bounce_rays == 40 and bounce.is_enabled()
        assert not page.problems


def test_colours_are_by_the_field(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = FakeVolume()
    with Server(fake_scene(volume, field=FakeVolume(), field_name="heat.zfp")) as server:
        page = open_page()
        page.goto(server.url)
        rests(page)
        by = page.locator("[name=color_by]")
        page.locator("[name=color_map]").select_option("magma")
        by.select_option("field")
        request = asked(page, volume)
        assert request.color_map == color_map_of(isowave.ColorMap("magma", by="field"))
        assert request.color is not None, "of hits without a value"
        assert state(page)["map"] == "magma,field"
        assert "Field at the hits" in page.locator(".facts").inner_text()
        assert "3 to 250.5" in page.locator(".facts").inner_text()
        assert page.locator("[name=time_budget]").is_disabled()
        type_into(page.locator("[name=color_low]"), "1")
        type_into(page.locator("[name=color_high]"), "9")
        by.focus()
        ranged = color_map_of(isowave.ColorMap("magma", by="field", range=(1, 9)))
        assert asked(page, volume).color_map == ranged
        text = saved_scene(page)
        fields = isowave._core.parse_scene(text)
        assert fields["field"] == "heat.zfp" and fields["color_by_field"]
        assert (fields["color_low"], fields["color_high"]) == (1, 9)
        # Several surfaces have these colours, too.
        page.get_by_role("button", name="Add surface").click()
        request = asked(page, volume)
        assert len(request.surfaces) == 2 and request.color_map == ranged
        assert isowave._core.parse_scene(saved_scene(page))["color_by_field"]
        open_scene(page, text)
        assert asked(page, volume).color_map == ranged
        by.select_option("caps")
        shown = asked(page, volume).color_map
        assert shown == color_map_of(isowave.ColorMap("magma", by="caps"))
        open_scene(page, saved_scene(page))
        assert asked(page, volume).color_map == shown
        page.reload()
        assert asked(page, volume).color_map == shown and state(page)["map"] == "magma,caps"
        by.select_option("x")
        assert asked(page, volume).color_map == color_map_of(isowave.ColorMap("magma", "x"))
        for bad in ("magma,toString", "magma,field,1", "magma,field,1,1", "magma,field,1,1e30"):
            page.goto(server.url + f"#iso=90&map={bad}")
            page.reload()
            assert asked(page, volume).color_map is None, bad
        assert not page.problems


def test_the_picture_is_that_of_the_scene(open_page: Callable[..., Any]) -> None:  # noqa: F811
    volume = isowave.open(FUEL, exact=True)
    scene = volume.scene().surface(20, "orange", opacity=0.4).surface(120)
    scene = scene.clip(ClipPlane((0, 1, 0), 14)).look(color_map="viridis", background="white")
    scene = scene.look(background_top="blue")
    text = json.dumps(isowave._scene.scene_fields(scene))
    with Server(Scene(volume, scene=text, device="host", size=(800, 600))) as server:
        page = open_page(viewport={"width": 700, "height": 500})
        page.goto(server.url)
        rests(page)
        keep(page, "scene_gradient")
        shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
        expected = scene.render(size=(shown.shape[1], shown.shape[0]), device="host").rgb
        assert np.array_equal(shown, expected)
        # Another address is not overruled.
        page.goto(server.url + "#iso=30")
        page.reload()
        rests(page)
        assert state(page)["iso"] == "30"
        assert not page.problems


def test_shadows_and_fields_are_those_of_the_library(
    open_page: Callable[..., Any]  # noqa: F811
) -> None:
    volume = isowave.open(FUEL, exact=True)
    ramp = np.linspace(0, 1, 64, dtype=np.float32)
    field = isowave.compress(np.broadcast_to(ramp, (32, 33, 64)), exact=True)
    cut = volume.scene().surface(20, "orange").clip(ClipPlane((0, -1, 0), -17))
    lit = cut.look(light=(1, 1, 1), shadow_rays=4, light_angle=9.0, background="white")
    by_field = lit.look(color_map=isowave.ColorMap("magma", by="field"), field=field)
    caps = cut.look(color_map=isowave.ColorMap("gray", by="caps"), background="white")
    for name, scene in (("shadows", lit), ("field", by_field), ("caps", caps)):
        with view(scene, device="host", block=False, open_browser=False, notebook=False) as server:
            page = open_page(viewport={"width": 900, "height": 640})
            page.goto(server.url)
            rests(page)
            keep(page, f"scene_{name}")
            shown = np.asarray(Image.open(io.BytesIO(screenshot(page)[1])))
            expected = scene.render(size=(shown.shape[1], shown.shape[0]), device="host").rgb
            assert np.array_equal(shown, expected), name
            assert not page.problems


def test_scenes_are_read_by_the_server() -> None:
    scene = make_scene(FakeVolume(), Clock())
    heard: list[dict[str, Any]] = []
    client = scene.join(lambda head, data: heard.append(head))
    assert client is not None
    scene.receive(client, SceneFile(json.dumps(SCENE)))
    assert heard[-1]["fields"]["surfaces"][1]["color"] == [0, 0, 1]
    other = {**SCENE, "volume": "/absent.nrrd", "field": "/absent.zfp", "color_by_field": True}
    scene.receive(client, SceneFile(json.dumps(other)))
    assert heard[-1]["type"] == "scene", "no file is opened for a client"
    scene.receive(client, SceneFile('{"a\\nb'))
    assert heard[-1]["type"] == "error" and "\n" not in heard[-1]["message"]


def test_the_command_takes_scenes(tmp_path: Path) -> None:
    parser = command.make_parser()
    file = tmp_path / "scene.json"

    def fields(*arguments: str) -> dict[str, Any]:
        return command.scene_of(parser.parse_args(arguments))

    assert fields("head.nrrd") == {}
    with pytest.raises(ValueError, match="give a volume, or a scene"):
        fields()
    file.write_text(json.dumps(SCENE))
    with pytest.raises(ValueError, match="names no volume"):
        fields("--scene", str(file))
    assert len(fields("head.nrrd", "--scene", str(file))["surfaces"]) == 2
    for option in (("--isovalue", "5"), ("--color-by", "z"), ("--color-map", "gray")):
        with pytest.raises(ValueError, match=f"{option[0]}: --scene says what is drawn"):
            fields("head.nrrd", "--scene", str(file), *option)
    file.write_text(json.dumps({**SCENE, "volume": "head.nrrd"}))
    assert fields("--scene", str(file))["volume"] == str(tmp_path / "head.nrrd")
    json.dumps(fields("--scene", str(file)))  # as the page gets it
    by_field = {**SCENE, "volume": "head.nrrd", "color_by_field": True}
    file.write_text(json.dumps(by_field))
    with pytest.raises(ValueError, match='it names none: add "field", a file'):
        fields("--scene", str(file))
    file.write_text("{}")
    with pytest.raises(isowave.Error, match="isowave_scene"):
        fields("--scene", str(file))


def test_the_command_takes_a_field(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = list[tuple[str, dict[str, Any]]]()

    def open_any(path: str, **options: Any) -> FakeVolume:
        opened.append((Path(path).name, options))
        return FakeVolume()

    def served(*arguments: str) -> dict[str, Any]:
        """What the server is started with."""
        seen = dict[str, Any]()

        def fail(volume: Any, **options: Any) -> None:
            seen.update(options, volume=volume)
            raise OSError("enough")

        opened.clear()
        monkeypatch.setattr(server_module, "serve", fail)
        assert command.main([*arguments, "--no-browser"]) == 1
        return seen

    monkeypatch.setattr(command, "open_volume", open_any)
    monkeypatch.setattr(_scene_file, "open_volume", open_any)
    monkeypatch.chdir(tmp_path)
    for name in ("heat.nrrd", "heat.zfp", "1,2"):
        Path(name).touch()
    given = served("head.nrrd")
    assert given["field"] is None and given["color_map"] is None
    given = served("head.raw", "--color-by", "heat.nrrd", "--rate", "8", "--spacing", "2")
    assert opened == [("heat.nrrd", {"rate": 8}), ("head.raw", {"rate": 8, "spacing": (2, 2, 2)})]
    assert given["field"] is not given["volume"] and given["field_name"] == "heat.nrrd"
    assert color_map_of(given["color_map"]) == color_map_of(isowave.ColorMap(by="field"))
    given = served("head.raw", "--color-by", "heat.zfp,0,40", "--rate", "8", "--color-map", "gray")
    assert opened[0] == ("heat.zfp", {}), "it is compressed already"
    ranged = isowave.ColorMap("gray", range=(0, 40), by="field")
    assert color_map_of(given["color_map"]) == color_map_of(ranged)
    given = served("head.nrrd", "--color-by", "volume")
    assert given["field"] is given["volume"] and len(opened) == 1
    assert served("head.nrrd", "--color-by", "1,2")["field_name"] == "1,2"
    file = tmp_path / "scene.json"
    scene = {**SCENE, "volume": "head.nrrd", "field": "heat.nrrd", "color_by_field": True}
    file.write_text(json.dumps(scene))
    assert served("--scene", str(file))["field_name"] == "heat.nrrd"
    parts = {"dataset": "ct", "index": "t=3", "field_dataset": "T", "field_index": "t=1"}
    file.write_text(json.dumps({**scene, **parts}))
    served("--scene", str(file), "--field-index", "t=2")
    assert opened == [
        ("heat.nrrd", {"dataset": "T", "index": "t=2"}),
        ("head.nrrd", {"dataset": "ct", "index": "t=3"}),
    ]
    served("other.nrrd", "--scene", str(file))
    assert opened[1] == ("other.nrrd", {}), "they are of the scene's volume"
    file.write_text(json.dumps({**scene, "color_by_field": False}))
    assert served("--scene", str(file))["field"] is None, "its colours do not need it"
