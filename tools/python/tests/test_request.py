"""What a frame is asked for, before the compiled part sees it."""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any

import numpy as np
import pytest

import isowave
from isowave._color_map import CheckedColorMap
from isowave._request import Request

PLANE = "ClipPlane(normal=(1, 0, 0), offset=0.0)"
NO_COLOR = (
    "there is no colour 'reddish': give #RRGGBB, or one of bone, skin, muscle, blood, white, "
    "black, gray, red, orange, yellow, green, cyan, blue, purple, magenta, brown"
)
CAMERA = isowave.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 45)


def test_its_fields_are_the_arguments_of_render() -> None:
    fields = [(field.name, field.default) for field in dataclasses.fields(Request)]
    given = inspect.signature(isowave.Renderer.render).parameters.values()
    arguments = [(each.name, each.default) for each in given if each.name != "self"]
    assert fields[0][0] == arguments[0][0] == "isovalue"
    assert fields[1:] == arguments[1:]


class Volume:
    """One whose isovalues are all numbers."""

    def _isovalue(self, isovalue: float) -> float:
        return isovalue


#: Those of the test below, as isowave::FrameRequest has them.
FIELDS: dict[str, Any] = {
    "eye": (0, 0, 5),
    "at": (0, 0, 0),
    "up": (0, 1, 0),
    "fovy_degrees": 45,
    "parallel_height": None,
    "isovalue": 80,
    "width": 64,
    "height": 48,
    "samples": 2,
    "surface": (1, 0.5, 0),
    "background": (0, 0.5, 1),
    "background_top": (1, 0.25, 0),
    "above": 0.25,
    "light_direction": (0, 1, 2),
    "shadow_rays": 7,
    "light_angle": 4,
    "bounce_rays": 3,
    "transparent": False,
    "normals": "cell",
    "clip": [{"normal": (0, 0, 2), "offset": 3}],
    "caps": False,
    "surfaces": [],
    "slices": [{"normal": (0, 1, 0), "offset": 4, "opacity": 0.5, "clipped": False}],
    "slice_map": "magma",
    "slice_table": (),
    "slice_low": None,
    "slice_high": None,
    "voxel_pixels": 2,
    "voxel_error": 3,
    "max_surface_error": 1,
    "by": "sample",
    "max_image_error": 0.25,
    "series": 2
    * [
        {
            "eye": (0, 0, 5),
            "at": (0, 0, 0),
            "up": (0, 1, 0),
            "fovy_degrees": 45,
            "parallel_height": None,
        }
    ],
    "time_budget_ms": 4000,
    "ambient_rays": 5,
    "want_picture": True,
    "want_depth": False,
    "want_normals": False,
    "want_positions": False,
    "want_field": False,
    "want_hits": False,
    "want_bounds": True,
}


def test_arguments_reach_the_request_by_their_names(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {
        "camera": CAMERA,
        "size": (64, 48),
        "samples": 2,
        "color": (1.0, 0.5, 0.0),
        "color_map": None,
        "background": (0.0, 0.5, 1.0),
        "background_top": (1.0, 0.25, 0.0),
        "lights": {"above": 0.25},
        "light": (0.0, 1.0, 2.0),
        "shadow_rays": 7,
        "light_angle": 4.0,
        "bounce_rays": 3,
        "transparent": False,
        "normals": "cell",
        "clip": (isowave.ClipPlane((0.0, 0.0, 2.0), 3.0),),
        "caps": False,
        "surfaces": (),
        "slices": (isowave.Slice((0.0, 1.0, 0.0), 4.0, 0.5, False),),
        "slice_map": CheckedColorMap("magma", (), (0.0, 0.0, 1.0), None),
        "outputs": ("rgb", "bounds"),
        "max_surface_error": 1.0,
        "by": "sample",
        "max_image_error": 0.25,
        "series": (CAMERA, CAMERA),
        "voxel_pixels": 2.0,
        "voxel_error": 3.0,
        "time_budget_ms": 4000.0,
        "ambient_rays": 5,
        "on_pass": print,
        "progress": False,
    }
    assert [*given] == [field.name for field in dataclasses.fields(Request)][1:]
    monkeypatch.setattr(isowave.Renderer, "draw", lambda self, request: request)
    renderer = object.__new__(isowave.Renderer)
    monkeypatch.setattr(renderer, "volume", Volume(), raising=False)
    request: Any = renderer.render(80, **given)
    assert {field: getattr(request, field) for field in given} == given
    assert request.for_core() == FIELDS


def test_values_are_python_s_own() -> None:
    request = Request(
        np.float32(80),
        isowave.Camera(np.array((0, 0, 5)), [0, 0, 0]),  # type: ignore[arg-type]
        np.array((64, 48)),
        color="#ff8000",
        clip=[isowave.ClipPlane(np.array((1, 0, 0)), np.int8(2))],  # type: ignore[arg-type]
        ambient_rays=np.uint8(3),
    )
    assert request == Request(
        80.0,
        isowave.Camera((0, 0, 5), (0, 0, 0)),
        (64, 48),
        color=(1, 128 / 255, 0),
        clip=(isowave.ClipPlane((1, 0, 0), 2),),
        ambient_rays=3,
    )
    assert type(request.isovalue) is float and type(request.ambient_rays) is int
    assert request.camera is not None and type(request.camera.eye) is tuple
    assert type(request.clip[0].normal) is tuple and type(request.clip[0].offset) is float


@pytest.mark.parametrize(
    ("argument", "value", "says"),
    [
        ("isovalue", "80", "isovalue='80': give a number"),
        ("camera", (0, 0, 5), "camera=(0, 0, 5): give an isowave.Camera"),
        ("series", 3, "series=3: give a list of cameras"),
        ("series", [3], "camera=3: give an isowave.Camera"),
        ("camera", isowave.Camera((0, 0), (0, 0, 0)), "Camera.eye=(0, 0): give 3 numbers"),
        ("size", 64, "size=64: give width and height"),
        ("samples", 1.5, "samples=1.5: give a whole number"),
        ("color", "reddish", f"{NO_COLOR}, or red, green, blue from 0 to 1"),
        ("background", (1, 2, 3), "color (1.0, 2.0, 3.0): give red, green and blue, from 0 to 1"),
        ("background_top", "reddish", f"{NO_COLOR}, or red, green, blue from 0 to 1"),
        ("transparent", 1, "transparent=1: give True or False"),
        ("normals", "flat", "normals 'flat': give 'smooth' or 'cell'"),
        ("clip", isowave.ClipPlane((1, 0, 0)), f"clip={PLANE}: give a list of clipping planes"),
        ("clip", [(1, 0, 0)], "clip=(1, 0, 0): give an isowave.ClipPlane"),
        ("clip", [isowave.ClipPlane((1, 0))], "ClipPlane.normal=(1, 0): give 3 numbers"),
        ("caps", 1, "caps=1: give True or False"),
        (
            "outputs",
            ("rgb", "a"),
            "outputs a: there are rgb, depth, normals, position, bounds, surface, cap, field",
        ),
        ("max_surface_error", "1", "max_surface_error='1': give a number"),
        ("max_image_error", "small", "max_image_error='small': give a number"),
        ("by", "luck", "by 'luck': give 'proof' or 'sample'"),
        ("voxel_pixels", None, "voxel_pixels=None: give a number"),
        ("voxel_error", True, "voxel_error=True: give a number"),
        ("time_budget_ms", "1 s", "time_budget_ms='1 s': give a number"),
        ("ambient_rays", -1, "ambient_rays=-1: give a whole number from 0 to 4294967295"),
        ("on_pass", 1, "on_pass=1: give a function"),
    ],
)
def test_an_argument_of_another_kind_is_named(argument: str, value: Any, says: str) -> None:
    arguments: dict[str, Any] = {"isovalue": 80, argument: value}
    with pytest.raises((TypeError, ValueError)) as raised:
        Request(**arguments)
    assert str(raised.value) == says


def test_surfaces_have_colors_and_give_the_isovalue() -> None:
    surface = isowave.Surface(np.float32(2), "#ff8000", 0.5)
    request = Request(0.0, CAMERA, (64, 48), surfaces=[surface, isowave.Surface(3)])
    assert request.isovalue == 2 and request.isovalues == [2, 3]
    assert dataclasses.replace(request, samples=2).surfaces == request.surfaces
    assert request.for_core()["surfaces"] == [
        {
            "isovalue": 2,
            "color": (1, 128 / 255, 0),
            "opacity": 0.5,
            "clipped": True,
            "mapped": True,
        },
        {
            "isovalue": 3,
            "color": (0x56 / 255, 0xB4 / 255, 0xE9 / 255),
            "opacity": 1,
            "clipped": True,
            "mapped": True,
        },
    ]
    assert Request(7).isovalues == [7]
    assert Request(7, outputs=("cap",), camera=CAMERA, size=(1, 1)).for_core()["want_hits"]


@pytest.mark.parametrize(
    ("more", "needs"),
    [
        ({}, {}),
        ({"max_surface_error": 1.0}, {"bounds": "max_surface_error"}),
        ({"max_surface_error": 1.0, "by": "sample"}, {"levels": "max_surface_error"}),
        ({"outputs": ("bounds",)}, {"bounds": "max_surface_error"}),
        ({"voxel_pixels": 1.0}, {"levels": "voxel_pixels"}),
        ({"time_budget_ms": 1.0}, {"time_budget": "time_budget_ms"}),
        ({"ambient_rays": 1}, {"rays": "ambient_rays"}),
    ],
)
def test_it_says_what_its_renderer_must_be_made_with(
    more: dict[str, Any], needs: dict[str, str]
) -> None:
    assert Request(80, **more).needs == needs
