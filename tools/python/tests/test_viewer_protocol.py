"""What the viewer's messages may be, and that nothing else does harm."""

from __future__ import annotations

import copy
import itertools
import json
import os
import random
from dataclasses import replace
from typing import Any

import pytest
from viewer_fakes import PLAIN_WISH, FakeVolume

from isowave import Annotations, Camera, ClipPlane, ColorMap, Series, Slice, Surface
from isowave._request import Request
from isowave.viewer.protocol import (
    VERSION,
    Ack,
    Budget,
    Hello,
    PageFile,
    Probe,
    ProtocolError,
    SceneFile,
    Wish,
    check,
    parse,
)
from isowave.viewer.scene import Scene
from isowave.viewer.session import Session

CAMERA = {"eye": [0, 0, 5], "at": [0, 0, 0], "up": [0, 1, 0], "fovy_deg": 60}
SURFACE = {"isovalue": 80, "color": [1, 0.5, 0], "opacity": 0.5}
OPAQUE = {**SURFACE, "opacity": 1}
PLANE = {"normal": [1, 0, 0], "offset": 5}
WISH = PLAIN_WISH | {
    "id": 7,
    "size": [64, 48],
    "camera": CAMERA,
    "color": [1, 0.5, 0],
    "background": [1, 1, 1],
    "samples": 2,
    "max_error": 0.5,
    "by": "sample",
    "ambient": 16,
    "clip": [{"normal": [0, 0.5, -1], "offset": -20}],
    "caps": False,
}
COLOR_MAP = {"colors": "magma", "by": "axis", "axis": [0, 0, 1], "range": [-1, 5.5]}
LABELS = {"labels": [3, 65535], "color": [1, 0.5, 0], "opacity": 0.5}
SLICE = {"normal": [0, 0.5, -1], "offset": 9, "opacity": 0.5, "clipped": False}
SLICE_MAP = {"colors": "magma", "range": [5.5, -1]}
SHADOW = {"rays": 16, "angle": 6}
LIT = {"light": [0, 1, 0], "shadow": SHADOW}
ANNOTATIONS = {"what": ["axes", "caption"], "units": "mm", "title": "größer"}
WEIGHTS = {"ambient": 0.1, "diffuse": 0, "specular": 0.2, "above": 3}


def test_messages_are_read() -> None:
    assert check({"type": "hello", "version": VERSION}) == Hello()
    assert check({"type": "ack", "frame": 3}) == Ack(3)
    assert check({"type": "budget", "bytes": None}) == Budget(None)
    assert check({"type": "budget", "bytes": 5}) == Budget(5)
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 60)
    colors: dict[str, Any] = {"color": (1, 0.5, 0), "background": (1, 1, 1), "outputs": ("rgb",)}
    clip: dict[str, Any] = {"clip": [ClipPlane((0, 0.5, -1), -20)], "caps": False}
    more: dict[str, Any] = {
        "max_surface_error": 0.5,
        "by": "sample",
        "ambient_rays": 16,
        "progress": False,
    }
    asked = Request(80, camera, (64, 48), 2, **colors, **clip, **more)
    assert check(parse(json.dumps(WISH))) == Wish(7, asked)
    high = check({**WISH, "camera": {**CAMERA, "parallel_height": 7}})
    assert high == Wish(7, replace(asked, camera=replace(camera, parallel_height=7.0)))
    timed = check({**WISH, "max_error": None, "time_budget": 50})
    assert isinstance(timed, Wish) and timed.request.time_budget_ms == 50
    assert timed.request.by == "proof"  # there is no error to judge
    coarse = check({**WISH, "max_error": None, "time_budget": 50, "voxel_pixels": 2})
    assert isinstance(coarse, Wish) and coarse.request.voxel_pixels == 2
    deep = check({**WISH, "color_map": {**COLOR_MAP, "by": "depth"}})
    assert isinstance(deep, Wish) and deep.request.color is None and not deep.request.needs_field
    seen = check({**WISH, "by": "picture", "max_error": 0.01})
    assert isinstance(seen, Wish) and seen.request.max_image_error == 0.01
    assert (seen.request.max_surface_error, seen.request.by, seen.request.samples) == (
        None,
        "proof",
        2,
    )
    free = check({**WISH, "by": "picture", "max_error": None, "time_budget": 50})
    assert isinstance(free, Wish) and free.request.max_image_error is None
    layered = check({**WISH, **PLAIN, "surfaces": [SURFACE, {**SURFACE, "isovalue": 120}]})
    assert isinstance(layered, Wish) and layered.request.color is None
    surface = Surface(80, (1, 0.5, 0), 0.5)
    assert layered.request.surfaces == (surface, replace(surface, isovalue=120))
    mapped = check({**WISH, "color_map": COLOR_MAP, "lights": WEIGHTS, "light": [0, 1, 0]})
    assert isinstance(mapped, Wish) and mapped.request.color is None
    expected = Request(80, color_map=ColorMap("magma", (0, 0, 1), (-1, 5.5)), lights=WEIGHTS)
    assert mapped.request.color_map == expected.color_map
    assert mapped.request.lights == expected.lights and mapped.request.light == (0, 1, 0)
    whole = check({**WISH, "color_map": {**COLOR_MAP, "range": None}})
    assert isinstance(whole, Wish)
    assert whole.request.color_map == Request(80, color_map=ColorMap("magma")).color_map
    lit = check({**WISH, **LIT})
    assert isinstance(lit, Wish)
    assert (lit.request.shadow_rays, lit.request.light_angle) == (16, 6)
    bounced = check({**WISH, **LIT, "bounce": 9})
    assert isinstance(bounced, Wish) and bounced.request.bounce_rays == 9
    annotated = check({**WISH, "annotations": ANNOTATIONS})
    assert isinstance(annotated, Wish)
    assert annotated.annotations == Annotations(("axes", "caption"), "mm", "größer")
    graded = check({**WISH, "background_top": [0, 0.5, 1]})
    assert isinstance(graded, Wish) and graded.request.background_top == (0, 0.5, 1)
    for by in ("field", "caps", "labels"):
        shown = check({**WISH, "color_map": {**COLOR_MAP, "by": by}})
        assert isinstance(shown, Wish) and shown.request.color == (1, 0.5, 0), "without a value"
        expected = Request(80, color_map=ColorMap("magma", (0, 0, 1), (-1, 5.5), by))
        assert shown.request.color_map == expected.color_map
    assert check({"type": "scene", "text": "{}"}) == SceneFile("{}")
    assert check({"type": "page", "text": "{}"}) == PageFile("{}")
    sliced = check({**WISH, **PLAIN, "slices": [SLICE], "slice_map": SLICE_MAP, "step": 3})
    assert isinstance(sliced, Wish) and sliced.step == 3
    expected = Request(80, slice_map=ColorMap("magma", range=(5.5, -1)))
    assert sliced.request.slice_map == expected.slice_map and sliced.request.color == (1, 0.5, 0)
    labelled = check({**WISH, **PLAIN, "surfaces": [LABELS]})
    assert isinstance(labelled, Wish) and labelled.request.has_labels
    expected = Request(80, surfaces=[Surface(None, (1, 0.5, 0), 0.5, labels=[3, 65535])])
    assert labelled.request.surfaces == expected.surfaces and labelled.request.isovalues == []
    by_label = {**COLOR_MAP, "colors": "labels", "by": "labels", "range": None}
    colored = check({**WISH, **PLAIN, "surfaces": [LABELS], "color_map": by_label})
    assert isinstance(colored, Wish)
    assert colored.request.color_map == Request(80, color_map=ColorMap(by="labels")).color_map
    assert sliced.request.slices == (Slice((0, 0.5, -1), 9, 0.5, False),)


PLAIN: dict[str, Any] = {"max_error": None, "ambient": 0}
BAD_WISHES: list[tuple[dict[str, Any], str]] = [
    ({"id": -1}, "id"),
    ({"id": 1.5}, "id"),
    ({"id": True}, "id"),
    ({"isovalue": "80"}, "isovalue"),
    ({"isovalue": None}, "isovalue"),
    ({"isovalue": 1e39}, "isovalue"),
    ({"isovalue": 10**400}, "isovalue"),
    ({"isovalue": float("nan")}, "isovalue"),
    ({"size": [0, 5]}, "size"),
    ({"size": [5]}, "size"),
    ({"size": [5, 8193]}, "size"),
    ({"size": "64x48"}, "size"),
    ({"samples": 9}, "samples"),
    ({"samples": 0}, "samples"),
    ({"ambient": 256}, "ambient"),
    ({"ambient": -1}, "ambient"),
    ({"ambient": 1.5}, "ambient"),
    ({"clip": PLANE}, "clip must be a list of at most 14 planes"),
    ({"clip": 15 * [PLANE]}, "clip must be a list of at most 14 planes"),
    ({"clip": [[1, 0, 0]]}, "a plane of clip must have normal and offset"),
    ({"clip": [{**PLANE, "more": 1}]}, "a plane of clip must have normal and offset"),
    ({"clip": [{**PLANE, "normal": [0, 0, 0]}]}, "normal must be a direction"),
    ({"clip": [{**PLANE, "normal": [2, 0, 0]}]}, "normal must be a number from -1 to 1"),
    ({"clip": [{**PLANE, "offset": float("nan")}]}, "offset"),
    ({"caps": 1}, "caps must be true or false"),
    ({"color_map": "magma"}, "color_map must have colors, by, axis and range"),
    ({"color_map": {**COLOR_MAP, "more": 1}}, "color_map must have colors, by, axis and range"),
    (
        {"color_map": {**COLOR_MAP, "by": "time"}},
        "by of color_map must be one of axis, depth, field",
    ),
    (
        {"color_map": {**COLOR_MAP, "by": ["axis"]}},
        "by of color_map must be one of axis, depth, field",
    ),
    (
        {"color_map": {**COLOR_MAP, "by": "field"}, "max_error": None, "time_budget": 9},
        "colours by the field are drawn without time_budget",
    ),
    ({"color_map": {**COLOR_MAP, "colors": "jet"}}, "colors must be one of viridis, magma"),
    ({"color_map": {**COLOR_MAP, "colors": []}}, "colors must be one of viridis, magma"),
    ({"color_map": {**COLOR_MAP, "axis": [0, 0, 0]}}, "axis must be a direction"),
    ({"color_map": {**COLOR_MAP, "axis": [0, 0, 2]}}, "axis must be a number from -1 to 1"),
    ({"color_map": {**COLOR_MAP, "range": [1]}}, "range must be two numbers"),
    ({"color_map": {**COLOR_MAP, "range": [5, 5]}}, "range must have two numbers that differ"),
    ({"light": [0, 0, 0]}, "light must be a direction"),
    ({"light": [0, 2, 0]}, "light must be a number from -1 to 1"),
    ({"light": "x"}, "light must be three numbers"),
    ({"lights": 1}, "lights must have ambient, diffuse, specular, above"),
    ({"lights": {"ambient": 1}}, "lights must have ambient, diffuse, specular, above"),
    ({"lights": {**WEIGHTS, "above": -1}}, "above must be a number from 0 to 10"),
    ({"shadow": SHADOW}, "shadow needs a light"),
    ({**LIT, "shadow": 16}, "shadow must have rays and angle, and nothing else"),
    ({**LIT, "shadow": {"rays": 16}}, "shadow must have rays and angle, and nothing else"),
    ({**LIT, "shadow": {**SHADOW, "rays": 0}}, "rays must be an integer from 1 to 255"),
    ({**LIT, "shadow": {**SHADOW, "rays": 256}}, "rays must be an integer from 1 to 255"),
    ({**LIT, "shadow": {**SHADOW, "angle": 0}}, "angle must be a number from 0.01 to 45"),
    ({**LIT, "shadow": {**SHADOW, "angle": 46}}, "angle must be a number from 0.01 to 45"),
    ({"bounce": 16}, "bounce needs a light"),
    ({**LIT, "bounce": 256}, "bounce must be an integer from 0 to 255"),
    ({**LIT, "bounce": None}, "bounce must be an integer"),
    ({"surfaces": SURFACE}, "surfaces must be a list of at most 8 surfaces"),
    ({**PLAIN, "surfaces": 9 * [SURFACE]}, "surfaces must be a list of at most 8 surfaces"),
    ({**PLAIN, "surfaces": [80]}, "a surface must have isovalue, color and opacity"),
    ({**PLAIN, "surfaces": [{**SURFACE, "more": 1}]}, "a surface must have isovalue"),
    ({**PLAIN, "surfaces": [{**SURFACE, "isovalue": float("nan")}]}, "isovalue must be a number"),
    ({**PLAIN, "surfaces": [{**SURFACE, "color": "red"}]}, "color must be three numbers"),
    ({**PLAIN, "surfaces": [{**SURFACE, "opacity": 0}]}, "opacity must be a number from 0.001"),
    ({**PLAIN, "surfaces": [{**SURFACE, "opacity": 1.1}]}, "opacity must be a number from 0.001"),
    ({**PLAIN, "surfaces": [SURFACE], "time_budget": 9}, "are drawn without time_budget"),
    ({**PLAIN, "surfaces": [SURFACE], "ambient": 8}, "ambient needs a surface of opacity 1"),
    ({**PLAIN, "surfaces": [SURFACE], **LIT}, "shadow needs a surface of opacity 1"),
    ({**PLAIN, "surfaces": [{**LABELS, "labels": []}]}, "labels must be a list of integers"),
    ({**PLAIN, "surfaces": [{**LABELS, "labels": 3}]}, "labels must be a list of integers"),
    ({**PLAIN, "surfaces": [{**LABELS, "labels": [-1]}]}, "a label must be an integer from 0 to"),
    ({**PLAIN, "surfaces": [{**LABELS, "labels": [65536]}]}, "a label must be an integer from 0"),
    ({**PLAIN, "surfaces": [{**LABELS, "labels": [1.5]}]}, "a label must be an integer from 0 to"),
    ({**PLAIN, "surfaces": [{**LABELS, "isovalue": 5}]}, "a surface must have labels, color and"),
    ({**PLAIN, "surfaces": [LABELS, SURFACE]}, "labels are drawn without isosurfaces"),
    ({**PLAIN, "surfaces": [LABELS], "slices": [SLICE]}, "labels are drawn without slices"),
    (
        {**PLAIN, "surfaces": [LABELS], "color_map": {**COLOR_MAP, "by": "caps"}},
        "labels are drawn without colours by the field",
    ),
    ({**PLAIN, "surfaces": [LABELS], "max_error": 1}, "surfaces are drawn without max_error"),
    ({"slices": SLICE}, "slices must be a list"),
    ({**PLAIN, "slices": 8 * [SLICE]}, "surfaces and slices must be at most 8 together"),
    (
        {**PLAIN, "slices": 7 * [SLICE], "surfaces": 2 * [SURFACE]},
        "surfaces and slices must be at most 8 together",
    ),
    ({**PLAIN, "slices": [SLICE], "time_budget": 9}, "slices are drawn without time_budget"),
    ({**PLAIN, "slices": ["z"]}, "a slice must have normal, offset, opacity and clipped"),
    ({**PLAIN, "slices": [{**SLICE, "more": 1}]}, "a slice must have normal, offset, opacity"),
    ({**PLAIN, "slices": [{**SLICE, "normal": [0, 0, 0]}]}, "normal must be a direction"),
    ({**PLAIN, "slices": [{**SLICE, "normal": "z"}]}, "normal must be three numbers"),
    ({**PLAIN, "slices": [{**SLICE, "offset": 1e19}]}, "offset must be a number"),
    ({**PLAIN, "slices": [{**SLICE, "offset": float("nan")}]}, "offset must be a number"),
    ({**PLAIN, "slices": [{**SLICE, "opacity": 0}]}, "opacity must be a number from 0.001"),
    ({**PLAIN, "slices": [{**SLICE, "clipped": 1}]}, "clipped must be true or false"),
    ({"slice_map": None}, "slice_map must have colors and range, and nothing else"),
    ({"slice_map": {**SLICE_MAP, "by": "axis"}}, "slice_map must have colors and range"),
    ({"slice_map": {**SLICE_MAP, "colors": "jet"}}, "colors must be one of viridis, magma"),
    ({"slice_map": {**SLICE_MAP, "colors": None}}, "colors must be one of viridis, magma"),
    ({"slice_map": {**SLICE_MAP, "range": [1]}}, "range must be two numbers"),
    ({"slice_map": {**SLICE_MAP, "range": [1, 1]}}, "range must have two numbers that differ"),
    ({"step": -1}, "step must be an integer from 0"),
    ({"step": 1.5}, "step must be an integer from 0"),
    ({"step": None}, "step must be an integer from 0"),
    ({"annotations": "all"}, "annotations must have what, units and title, and nothing else"),
    ({"annotations": {**ANNOTATIONS, "more": 1}}, "annotations must have what, units and title"),
    (
        {"annotations": {**ANNOTATIONS, "what": []}},
        "what must be a list of some of scale-bar, axes",
    ),
    ({"annotations": {**ANNOTATIONS, "what": ["all"]}}, "what must be a list of some of scale-bar"),
    ({"annotations": {**ANNOTATIONS, "what": [[]]}}, "what must be a list of some of scale-bar"),
    ({"annotations": {**ANNOTATIONS, "units": 1}}, "units must be a text of at most 16 letters"),
    ({"annotations": {**ANNOTATIONS, "units": 17 * "m"}}, "units must be a text of at most 16"),
    ({"annotations": {**ANNOTATIONS, "title": 81 * "a"}}, "title must be a text of at most 80"),
    ({"annotations": {**ANNOTATIONS, "title": "\ud800"}}, "title must be a text of at most 80"),
    ({"color": [0, 0, 1.01]}, "color"),
    ({"background": [0, 0]}, "background"),
    ({"background_top": [0, 0, 1.01]}, "background_top must be a number from 0 to 1"),
    ({"background_top": "red"}, "background_top must be three numbers"),
    ({"max_error": 0}, "max_error"),
    ({"max_error": -1}, "max_error"),
    ({"by": "luck"}, "by must be proof, sample or picture"),
    ({"by": ["proof"]}, "by must be proof, sample or picture"),
    ({"by": "picture", "max_error": 0}, "max_error must be a number from 1e-06 to 1"),
    ({"by": "picture", "max_error": 1.5}, "max_error must be a number from 1e-06 to 1"),
    ({"by": "picture", "max_error": 1, "time_budget": 100}, "not both"),
    ({**PLAIN, "by": "picture", "surfaces": [SURFACE], "max_error": 1}, "without max_error"),
    ({"by": "picture", "slices": [SLICE]}, "slices are drawn without max_error"),
    ({"max_error": None, "time_budget": 0.5}, "time_budget"),
    ({"max_error": 1, "time_budget": 100}, "not both"),
    ({"voxel_pixels": 1}, "voxel_pixels comes without max_error and labels"),
    ({"max_error": None, "voxel_pixels": None}, "voxel_pixels must be a number from 0 to 1000"),
    ({"max_error": None, "voxel_pixels": -1}, "voxel_pixels must be a number from 0 to 1000"),
    ({"camera": []}, "camera"),
    ({"camera": {**CAMERA, "more": 1}}, "camera"),
    ({"camera": {**CAMERA, "eye": [0, 0, 0]}}, "the same point"),
    ({"camera": {**CAMERA, "eye": [1e18, 0, 0], "at": [1e18, 1e-3, 0]}}, "the same point"),
    ({"camera": {**CAMERA, "up": [0, 0, -2]}}, "parallel"),
    ({"camera": {**CAMERA, "up": [0, 0, 0]}}, "parallel"),
    ({"camera": {**CAMERA, "eye": [1e19, 0, 0]}}, "eye"),
    ({"camera": {**CAMERA, "fovy_deg": 180}}, "fovy_deg"),
    ({"camera": {**CAMERA, "parallel_height": 0}}, "parallel_height must be a number"),
    ({"camera": {**CAMERA, "parallel_height": "5"}}, "parallel_height must be a number"),
    ({"camera": {**CAMERA, "fovy_deg": 0}}, "fovy_deg"),
    ({"more": 1}, "other keys"),
    ({"type": "dance"}, "no known type"),
    ({"type": ["wish"]}, "no known type"),
    ({"type": "ack"}, "lacks frame"),
]


@pytest.mark.parametrize("change, message", BAD_WISHES)
def test_wishes_that_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ProtocolError, match=message):
        check({**WISH, **change})


@pytest.mark.parametrize("key", WISH)
def test_no_key_may_be_missing(key: str) -> None:
    with pytest.raises(ProtocolError):
        check({k: v for k, v in WISH.items() if k != key})


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[]", "not a JSON object"),
        ("1", "not a JSON object"),
        ('{"type": "ack", "frame": NaN}', "NaN"),
        ('{"type": "ack", "frame": -Infinity}', "Infinity"),
        ('{"type": "ack", "frame": 1, "frame": 2}', "twice"),
        ("[" * 5000, "not JSON"),
        ('{"a":' * 1500, "not JSON"),
        ("9" * 8000, "not JSON|not a JSON object"),
        ('"' + "x" * 8192 + '"', "longer than 8192"),
        ("\udcff", "not JSON"),
        ('"' + "é" * 5000 + '"', "longer than 8192"),
    ],
)
def test_texts_that_are_refused(text: str, message: str) -> None:
    with pytest.raises(ProtocolError, match=message):
        parse(text)


def test_another_version_is_told_to_reload() -> None:
    with pytest.raises(ProtocolError, match="reload"):
        check({"type": "hello", "version": VERSION + 1})


VALID: list[dict[str, Any]] = [
    WISH,
    {"type": "hello", "version": VERSION},
    {"type": "ack", "frame": 0},
    {"type": "budget", "bytes": 1 << 30},
    {**WISH, "camera": None},
    {**WISH, "by": "picture", "max_error": 0.01},
    {**WISH, **PLAIN, "surfaces": [SURFACE]},
    {**WISH, **LIT, "color_map": {**COLOR_MAP, "by": "caps"}},
    {**WISH, **PLAIN, "slices": [SLICE, SLICE], "slice_map": SLICE_MAP},
    {**WISH, "step": 2},
    {**WISH, "size": [200, 150], "annotations": ANNOTATIONS},
    {**WISH, **PLAIN, "surfaces": [LABELS, {**LABELS, "labels": [7]}]},
    {**WISH, **PLAIN, "surfaces": [LABELS], "color_map": {**COLOR_MAP, "by": "labels"}},
]
ODD: list[Any] = [
    None, True, False, 0, 1, -1, 2**31, 2**53, 2**64, 10**300, 10**400, 0.0, -0.0, 1e-320, 1e308,
    float("nan"), float("inf"), -float("inf"), "", "wish", "\0", "\ud800", "é" * 99, [], {}, [[]],
    [1, 2, 3], [1e18, -1e18, 1e18], [0, 0, 0], {"eye": 0}, "__proto__", "constructor",
]  # fmt: skip


def mutated(value: Any, chance: random.Random) -> Any:
    """The value, with something else in some place."""
    roll = chance.random()
    if isinstance(value, dict) and value and roll < 0.85:
        result = dict(value)
        key = chance.choice(list(result))
        if roll < 0.1:
            del result[key]
        elif roll < 0.2:
            result[str(chance.choice(ODD))] = chance.choice(ODD)
        else:
            result[key] = mutated(result[key], chance)
        return result
    if isinstance(value, list) and value and roll < 0.85:
        at = chance.randrange(len(value))
        if roll < 0.1:
            return value[:at] + value[at + 1 :]
        return value[:at] + [mutated(value[at], chance)] + value[at + 1 :]
    if isinstance(value, (int, float)) and abs(value) < 1e300 and roll < 0.5:
        return value * chance.choice([-1, 0.5, 2, 1e9, 1e-9]) + chance.choice([0, 1, -1, 1e-9])
    return copy.deepcopy(chance.choice(ODD))


def mutated_text(text: str, chance: random.Random) -> str:
    at, to = sorted(chance.randrange(len(text) + 1) for _ in range(2))
    middle = "".join(
        chr(chance.choice([chance.randrange(128), chance.randrange(0x110000)])) for _ in range(3)
    )
    return chance.choice([text[:at], text[:at] + middle + text[to:], text[:at] + text[to:] * 2])


def test_fuzz() -> None:
    """Each message is taken or refused, and the scene draws for others as before."""
    count, seed = int(os.environ.get("ISOWAVE_FUZZ_MESSAGES", "10000")), 20261124
    chance = random.Random(seed)
    volume = FakeVolume(passes=1)
    ticks = itertools.count()
    scene = Scene(
        Series(["a", "b", "c"], lambda step: volume),  # type: ignore[arg-type,return-value]
        isovalue=80,
        size=(16, 16),
        clock=lambda: next(ticks) * 0.1,
        start=False,
    )
    sent: list[dict[str, Any]] = []

    def post(head: dict[str, Any], data: bytes | None) -> None:
        json.dumps(head, allow_nan=False)
        sent.append(head)

    refused = taken = 0
    session: Session | None = None
    for i in range(count):
        if session is None:
            session = Session(scene, post, rate=1e9, burst=1e9)
            session.receive({"type": "hello", "version": VERSION})
        message = copy.deepcopy(chance.choice(VALID))
        for _ in range(chance.randrange(3)):
            message = mutated(message, chance) if isinstance(message, dict) else message
        if isinstance(message, dict) and isinstance(message.get("size"), list):
            message["size"] = [min(s, 20) if isinstance(s, int) else s for s in message["size"]]
        if isinstance(message, dict) and message.get("id") == 7:
            message["id"] = i
        text = json.dumps(message)
        if chance.random() < 0.3:
            text = mutated_text(text, chance)
        try:
            session.receive(parse(text))
            taken += 1
        except ProtocolError as error:
            assert str(error) and "\n" not in str(error), text
            refused += 1
            session.close()
            session = None
        if i % 50 == 0:
            while scene.step():
                pass
    print(f"seed {seed}: {taken} taken, {refused} refused, {len(sent)} answers")
    assert taken > count / 20 and refused > count / 20
    if session is not None:
        session.close()
    assert scene.num_clients == 0
    # Somebody else sees a picture.
    sent.clear()
    other = Session(scene, post)
    other.receive({"type": "hello", "version": VERSION})
    other.receive({**WISH, "id": 1})
    while scene.step():
        other.receive({"type": "ack", "frame": sum(h["type"] == "picture" for h in sent)})
    assert "whole" in [h["stage"] for h in sent if h["type"] == "picture"]


def test_probes_are_places_of_a_picture() -> None:
    assert check({"type": "probe", "id": 3, "at": [0, 0.25]}) == Probe(3, (0.0, 0.25))
    for at in ([0], [0, 1.01], [-0.1, 0], "ab", [0, "1"], [0, None], [True, 0], None):
        with pytest.raises(ProtocolError):
            check({"type": "probe", "id": 3, "at": at})


def test_transparent_pictures_have_no_background() -> None:
    wish = check({**PLAIN_WISH, "transparent": True, "background_top": [1, 0, 0]})
    assert isinstance(wish, Wish) and wish.request.transparent
    assert wish.request.background is None and wish.request.background_top is None
    with pytest.raises(ProtocolError):
        check({**PLAIN_WISH, "transparent": 1})
