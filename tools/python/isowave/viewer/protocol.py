"""The messages of the viewer: what a front end (view.js) may say, and what is refused.

A front end sends JSON objects; `parse` and `check` turn them into the classes below or raise
`ProtocolError`, whose text is one line that a person can read. Anything that is not exactly one of
these messages is an error: unknown and missing keys, NaN, numbers out of range, a camera that
looks nowhere.

    {"type": "hello", "version": 1}
    {"type": "wish", "id": 7, "isovalue": 80, "size": [1280, 720],
     "camera": {"eye": [x, y, z], "at": [x, y, z], "up": [x, y, z], "fovy_deg": 60} | null,
     "color": [r, g, b], "background": [r, g, b], "background_top": [r, g, b] | null,
     "samples": 1, "max_error": 0.5 | null,
     "by": "proof" | "sample" | "picture", "time_budget": 100 | null, "voxel_pixels": 0,
     "ambient": 0,
     "clip": [{"normal": [1, 0, 0], "offset": 20}], "caps": true,
     "surfaces": [{"isovalue": 80, "color": [r, g, b], "opacity": 0.5}], or
                 [{"labels": [3, 7], "color": [r, g, b], "opacity": 0.5}],
     "color_map": {"colors": "viridis", "by": "axis" | "depth" | "field" | "caps" | "labels",
                   "axis": [0, 0, 1], "range": [low, high] | null} | null,
     "slices": [{"normal": [0, 0, 1], "offset": 9, "opacity": 1, "clipped": true}],
     "slice_map": {"colors": "gray", "range": [low, high] | null}, "step": 0,
     "annotations": {"what": ["scale-bar", "axes", "color-bar", "caption"], "units": "mm",
                     "title": "a head"} | null,
     "lights": {"ambient": 0.15, "diffuse": 0.5, "specular": 0.2, "above": 0.45} | null,
     "light": [x, y, z] | null, "shadow": {"rays": 16, "angle": 3} | null, "bounce": 0,
     "transparent": false}
    {"type": "ack", "frame": 3}
    {"type": "probe", "id": 5, "at": [0.5, 0.25]}
    {"type": "budget", "bytes": 600000000 | null}
    {"type": "scene", "text": "a scene file's"}
    {"type": "page", "text": "a scene file's"}

A camera in parallel projection has "parallel_height", too. max_error is in pixels of the surface,
by proof or by sample; or, by picture, FLIP of the picture, and then samples are the most rays of a
pixel that may be chosen. voxel_pixels is that of a Request, and comes without max_error and labels.

Without surfaces, one opaque surface is drawn, of the wish's isovalue and color. Surfaces come in
place of these. Surfaces and slices come without time_budget and max_error by picture, labels
without any max_error; surfaces and slices are 8 at most together. Ambient rays, shadow and bounce
need a surface of opacity 1. bounce needs a light. Surfaces are those of isovalues, or of labels
without slices and colours by the field's values. step is that of a series; 0 for a volume. The
annotations' title is the volume's name if it is empty. transparent: the lossless picture has
alpha. A probe asks what is seen at a place of the last picture, from 0 at its left and upper edge
to 1.

Answers are dicts with a "type": welcome, status, histogram, picture (with bytes), progress, bounds,
probe, scene, page (with bytes), error; view.js describes them.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from isowave._annotate import NAMES, Annotations
from isowave._camera import Camera
from isowave._clip import ClipPlane
from isowave._color_map import BY, BY_FIELD, ColorMap
from isowave._core import color_map_names
from isowave._request import LIGHTS, Request
from isowave._slice import Slice
from isowave._surface import MAX_LABEL, MAX_SURFACES, Surface

VERSION: Final = 13
MAX_MESSAGE_BYTES: Final = 8192
MAX_SIDE: Final = 8192  # pixels of a picture along each axis
MAX_SAMPLES: Final = 8  # rays of a pixel along each axis, as the library has it
MAX_AMBIENT: Final = 255  # rays of a hit, as the library has it; shadow and bounce rays, too
MIN_ANGLE: Final = 0.01  # of a light [degrees]
MAX_ANGLE: Final = 45  # as the library has it
MAX_PLANES: Final = 14  # as the library has it
MIN_IMAGE_ERROR: Final = 1e-6  # FLIP
MIN_OPACITY: Final = 1e-3  # of a surface
MAX_LIGHT: Final = 10  # weight of a light
MAX_UNITS: Final = 16  # letters of an annotation's units
MAX_TITLE: Final = 80  # letters of an annotation's title
MAX_TIME_BUDGET: Final = 10_000  # ms
MAX_VOXEL_PIXELS: Final = 1000
MAX_FLOAT32: Final = 3.4028234663852886e38
MAX_LENGTH: Final = 1e18  # of a camera's coordinates [world units]
MAX_RAYS: Final = 150_000_000  # of a client's picture, with those of its hits
MAX_ID: Final = 2**53 - 1  # what JavaScript counts to


class ProtocolError(ValueError):
    """A message that no front end of ours sends. Its text says why, in one line."""


@dataclass(frozen=True)
class Hello:
    """The first message of a front end."""


@dataclass(frozen=True)
class Wish:
    """What a front end wants to see. Only the newest wish of a client counts.

    request      the whole picture, with a size; without a camera: the surface fills the picture
    step         of the series, from 0
    annotations  over the picture, or None; without a title, they have the volume's name
    """

    id: int  # grows with each wish of a client
    request: Request
    step: int = 0
    annotations: Annotations | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width, height [pixels]."""
        assert self.request.size is not None
        return self.request.size


@dataclass(frozen=True)
class Ack:
    """The front end has shown the picture with this number, or left it out for a newer one."""

    frame: int


@dataclass(frozen=True)
class Budget:
    """A new memory budget for the renderer, which all clients share. None: the default one."""

    bytes: int | None


@dataclass(frozen=True)
class SceneFile:
    """A scene file that the front end opens: it gets the scene's fields, or an error."""

    text: str


@dataclass(frozen=True)
class PageFile:
    """A scene that the front end saves as a page: it gets the bytes, or an error."""

    text: str


@dataclass(frozen=True)
class Probe:
    """A question what is seen at a place of the last picture. at: x, y, 0 to 1."""

    id: int
    at: tuple[float, float]


Message = Hello | Wish | Ack | Budget | SceneFile | PageFile | Probe


class TokenBucket:
    """Limits how often something happens: `rate` times a second, `burst` times at once."""

    def __init__(
        self, rate: float, burst: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate, self._burst, self._clock = rate, burst, clock
        self._tokens, self._then = burst, clock()

    def take(self) -> bool:
        """Whether it may happen now."""
        now = self._clock()
        self._tokens = min(self._burst, self._tokens + (now - self._then) * self._rate)
        self._then = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True


def parse(text: str) -> dict[str, Any]:
    """A message's JSON object, still to be checked. Raises ProtocolError."""
    if len(text) > MAX_MESSAGE_BYTES or len(text.encode("utf-8", "replace")) > MAX_MESSAGE_BYTES:
        raise ProtocolError(f"a message is longer than {MAX_MESSAGE_BYTES} bytes")
    try:
        content = json.loads(text, parse_constant=_no_constant, object_pairs_hook=_no_duplicates)
    except ProtocolError:
        raise
    except (ValueError, RecursionError):
        raise ProtocolError("a message is not JSON") from None
    if not isinstance(content, dict):
        raise ProtocolError("a message is not a JSON object")
    return content


def check(content: object) -> Message:
    """The message that a JSON object is. Raises ProtocolError."""
    if not isinstance(content, dict):
        raise ProtocolError("a message is not an object")
    kind = content.get("type")
    reader = _READERS.get(kind) if isinstance(kind, str) else None
    if reader is None:
        raise ProtocolError("a message has no known type")
    keys, read = reader
    if lacking := [key for key in keys if key not in content]:
        raise ProtocolError(f"a message of type {kind} lacks {', '.join(lacking)}")
    if content.keys() != keys.keys():
        raise ProtocolError(f"a message of type {kind} has other keys than {', '.join(keys)}")
    return read(content)


def first_line(error: Exception) -> str:
    """Text of an error, in one line of bounded length."""
    lines = str(error).strip().splitlines()
    return (lines[0] if lines else type(error).__name__)[:500]


def _no_constant(name: str) -> object:
    raise ProtocolError(f"a message contains {name}")


def _no_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ProtocolError("a message contains a key twice")
    return result


def _integer(value: object, low: int, high: int, what: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise ProtocolError(f"{what} must be an integer from {low} to {high}")
    return value


def _number(value: object, low: float, high: float, what: str) -> float:
    # Python's integers have no bounds: they are compared before they become floats.
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not low <= value <= high:
        raise ProtocolError(f"{what} must be a number from {low:g} to {high:g}")
    return float(value)


def _triple(value: object, low: float, high: float, what: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise ProtocolError(f"{what} must be three numbers")
    x, y, z = (_number(v, low, high, what) for v in value)
    return x, y, z


def _optional_triple(
    value: object, low: float, high: float, what: str
) -> tuple[float, float, float] | None:
    return None if value is None else _triple(value, low, high, what)


def _camera(value: object) -> Camera | None:
    if value is None:
        return None
    needed = {"eye", "at", "up", "fovy_deg"}
    if not isinstance(value, dict) or value.keys() - {"parallel_height"} != needed:
        raise ProtocolError(
            "camera must have eye, at, up, fovy_deg, perhaps parallel_height, and nothing else"
        )
    eye, at, up = (_triple(value[k], -MAX_LENGTH, MAX_LENGTH, k) for k in ("eye", "at", "up"))
    fovy = _number(value["fovy_deg"], 1e-3, 179.999, "fovy_deg")
    forward = tuple(a - e for a, e in zip(at, eye))
    length, height = math.hypot(*forward), math.hypot(*up)
    if length <= 1e-12 * max(map(abs, at + eye)) or length == 0:
        raise ProtocolError("camera: eye and at are the same point")
    cosine = sum(f / length * (u / height if height else 0) for f, u in zip(forward, up))
    if height == 0 or abs(cosine) > 1 - 1e-12:
        raise ProtocolError("camera: up is parallel to the view, or zero")
    high = value.get("parallel_height")
    if high is not None:
        high = _number(high, 1 / MAX_LENGTH, MAX_LENGTH, "parallel_height")
    return Camera(eye, at, up, fovy, high)


def _plane(value: object) -> ClipPlane:
    if not isinstance(value, dict) or value.keys() != {"normal", "offset"}:
        raise ProtocolError("a plane of clip must have normal and offset, and nothing else")
    normal = _triple(value["normal"], -1, 1, "normal")
    if math.hypot(*normal) < 1e-3:
        raise ProtocolError("normal must be a direction")
    return ClipPlane(normal, _number(value["offset"], -MAX_LENGTH, MAX_LENGTH, "offset"))


def _clip(value: object) -> tuple[ClipPlane, ...]:
    if not isinstance(value, list) or len(value) > MAX_PLANES:
        raise ProtocolError(f"clip must be a list of at most {MAX_PLANES} planes")
    return tuple(_plane(plane) for plane in value)


def _surface(value: object) -> Surface:
    own = "labels" if isinstance(value, dict) and "labels" in value else "isovalue"
    if not isinstance(value, dict) or value.keys() != {own, "color", "opacity"}:
        raise ProtocolError(f"a surface must have {own}, color and opacity, and nothing else")
    color = _triple(value["color"], 0, 1, "color")
    opacity = _number(value["opacity"], MIN_OPACITY, 1, "opacity")
    if own == "labels":
        return Surface(None, color, opacity, labels=_labels(value["labels"]))
    isovalue = _number(value["isovalue"], -MAX_FLOAT32, MAX_FLOAT32, "isovalue")
    return Surface(isovalue, color, opacity)


def _labels(value: object) -> tuple[int, ...]:
    if not isinstance(value, list) or not value:
        raise ProtocolError("labels must be a list of integers")
    return tuple(_integer(label, 0, MAX_LABEL, "a label") for label in value)


def _refuse_quality(content: dict[str, Any], drawn: str, are_labels: bool) -> None:
    """Refuses what pictures of several surfaces and slices do not keep."""
    if content["time_budget"] is not None:
        raise ProtocolError(f"{drawn} are drawn without time_budget")
    if content["max_error"] is not None and (are_labels or content["by"] == "picture"):
        raise ProtocolError(f"{drawn} are drawn without max_error")


def _surfaces(content: dict[str, Any]) -> tuple[Surface, ...]:
    value = content["surfaces"]
    if not isinstance(value, list) or len(value) > MAX_SURFACES:
        raise ProtocolError(f"surfaces must be a list of at most {MAX_SURFACES} surfaces")
    surfaces = tuple(_surface(surface) for surface in value)
    if len({bool(surface.labels) for surface in surfaces}) == 2:
        raise ProtocolError("surfaces of labels are drawn without isosurfaces")
    if surfaces and surfaces[0].labels and content["slices"]:
        raise ProtocolError("labels are drawn without slices")
    if surfaces:
        _refuse_quality(content, "surfaces", bool(surfaces[0].labels))
    if surfaces and all(surface.opacity < 1 for surface in surfaces):
        for name in ("ambient", "shadow"):
            if content[name]:
                raise ProtocolError(f"{name} needs a surface of opacity 1")
    return surfaces


def _slice(value: object) -> Slice:
    keys = {"normal", "offset", "opacity", "clipped"}
    if not isinstance(value, dict) or value.keys() != keys:
        raise ProtocolError(
            "a slice must have normal, offset, opacity and clipped, and nothing else"
        )
    plane = _plane({name: value[name] for name in ("normal", "offset")})
    opacity = _number(value["opacity"], MIN_OPACITY, 1, "opacity")
    return Slice(plane.normal, plane.offset, opacity, _flag(value["clipped"], "clipped"))


def _slices(content: dict[str, Any]) -> tuple[Slice, ...]:
    value, count = content["slices"], max(1, len(content["surfaces"]))
    if not isinstance(value, list):
        raise ProtocolError("slices must be a list")
    if value and count + len(value) > MAX_SURFACES:
        raise ProtocolError(f"surfaces and slices must be at most {MAX_SURFACES} together")
    if value:
        _refuse_quality(content, "slices", False)
    return tuple(_slice(each) for each in value)


def _slice_map(value: object) -> ColorMap:
    if not isinstance(value, dict) or value.keys() != {"colors", "range"}:
        raise ProtocolError("slice_map must have colors and range, and nothing else")
    return ColorMap(_colors(value["colors"]), range=_range(value["range"]))


def _colors(value: object) -> str:
    if not isinstance(value, str) or value not in color_map_names():
        raise ProtocolError(f"colors must be one of {', '.join(color_map_names())}")
    return value


def _range(value: object) -> tuple[float, float] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise ProtocolError("range must be two numbers")
    low, high = (_number(limit, -MAX_LENGTH, MAX_LENGTH, "range") for limit in value)
    if low == high:
        raise ProtocolError("range must have two numbers that differ")
    return low, high


def _color_map(value: object) -> ColorMap | None:
    if value is None:
        return None
    if not isinstance(value, dict) or value.keys() != {"colors", "by", "axis", "range"}:
        raise ProtocolError("color_map must have colors, by, axis and range, and nothing else")
    colors, by = _colors(value["colors"]), value["by"]
    if by not in BY:
        raise ProtocolError(f"by of color_map must be one of {', '.join(BY)}")
    axis = _triple(value["axis"], -1, 1, "axis")
    if math.hypot(*axis) < 1e-3:
        raise ProtocolError("axis must be a direction")
    return ColorMap(colors, axis, _range(value["range"]), by)


def _lights(value: object) -> dict[str, float] | None:
    if value is None:
        return None
    if not isinstance(value, dict) or value.keys() != {*LIGHTS}:
        raise ProtocolError(f"lights must have {', '.join(LIGHTS)}, and nothing else")
    return {name: _number(value[name], 0, MAX_LIGHT, name) for name in LIGHTS}


def _light(value: object) -> tuple[float, float, float] | None:
    if value is None:
        return None
    light = _triple(value, -1, 1, "light")
    if math.hypot(*light) < 1e-3:
        raise ProtocolError("light must be a direction")
    return light


def _shadow(content: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a Request."""
    value = content["shadow"]
    if value is None:
        return {}
    if not isinstance(value, dict) or value.keys() != {"rays", "angle"}:
        raise ProtocolError("shadow must have rays and angle, and nothing else")
    if content["light"] is None:
        raise ProtocolError("shadow needs a light")
    return {
        "shadow_rays": _integer(value["rays"], 1, MAX_AMBIENT, "rays"),
        "light_angle": _number(value["angle"], MIN_ANGLE, MAX_ANGLE, "angle"),
    }


def _background(content: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a Request. A transparent picture has no background."""
    background = _triple(content["background"], 0, 1, "background")
    top = _optional_triple(content["background_top"], 0, 1, "background_top")
    if _flag(content["transparent"], "transparent"):
        return {"transparent": True}
    return {"background": background, "background_top": top}


def _bounce(content: dict[str, Any]) -> int:
    """Least number of rays that bring light."""
    rays = _integer(content["bounce"], 0, MAX_AMBIENT, "bounce")
    if rays and content["light"] is None:
        raise ProtocolError("bounce needs a light")
    return rays


def _error(content: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a Request."""
    value, by = content["max_error"], content["by"]
    if by not in ("proof", "sample", "picture"):
        raise ProtocolError("by must be proof, sample or picture")
    if value is None:
        return {}
    if content["time_budget"] is not None:
        raise ProtocolError("a picture keeps max_error or time_budget, not both")
    if by == "picture":
        return {"max_image_error": _number(value, MIN_IMAGE_ERROR, 1, "max_error")}
    return {"max_surface_error": _number(value, 1e-3, 1e3, "max_error"), "by": by}


def _voxel_pixels(content: dict[str, Any], surfaces: tuple[Surface, ...]) -> float:
    pixels = _number(content["voxel_pixels"], 0, MAX_VOXEL_PIXELS, "voxel_pixels")
    if pixels and (content["max_error"] is not None or (surfaces and surfaces[0].labels)):
        raise ProtocolError("voxel_pixels comes without max_error and labels")
    return pixels


def _annotations(value: object) -> Annotations | None:
    if value is None:
        return None
    if not isinstance(value, dict) or value.keys() != {"what", "units", "title"}:
        raise ProtocolError("annotations must have what, units and title, and nothing else")
    what = value["what"]
    if not isinstance(what, list) or not what or any(name not in NAMES for name in what):
        raise ProtocolError(f"what must be a list of some of {', '.join(NAMES)}")
    units = checked_text(value["units"], MAX_UNITS, "units")
    return Annotations(tuple(what), units, checked_text(value["title"], MAX_TITLE, "title"))


def checked_text(value: object, most: int, what: str) -> str:
    """A text. most: of its letters. Raises ProtocolError."""
    # Half of a surrogate pair is no letter.
    if not isinstance(value, str) or len(value) > most or re.search("[\ud800-\udfff]", value):
        raise ProtocolError(f"{what} must be a text of at most {most} letters")
    return value


def _flag(value: object, what: str) -> bool:
    if not isinstance(value, bool):
        raise ProtocolError(f"{what} must be true or false")
    return value


def _optional(value: object, low: float, high: float, what: str) -> float | None:
    return None if value is None else _number(value, low, high, what)


def _read_hello(content: dict[str, Any]) -> Hello:
    if _integer(content["version"], 0, MAX_ID, "version") != VERSION:
        raise ProtocolError("the page is of another version of isowave: reload it")
    return Hello()


def _read_wish(content: dict[str, Any]) -> Wish:
    size = content["size"]
    if not isinstance(size, list) or len(size) != 2:
        raise ProtocolError("size must be two integers")
    time_budget = _optional(content["time_budget"], 1, MAX_TIME_BUDGET, "time_budget")
    surfaces, color = _surfaces(content), _triple(content["color"], 0, 1, "color")
    color_map = _color_map(content["color_map"])
    by_field = color_map is not None and color_map.by in BY_FIELD
    is_value = by_field and color_map is not None and color_map.by != "labels"
    if is_value and surfaces and surfaces[0].labels:
        raise ProtocolError("labels are drawn without colours by the field")
    if by_field and time_budget is not None:
        raise ProtocolError("colours by the field are drawn without time_budget")
    request = Request(
        isovalue=_number(content["isovalue"], -MAX_FLOAT32, MAX_FLOAT32, "isovalue"),
        camera=_camera(content["camera"]),
        size=(_integer(size[0], 1, MAX_SIDE, "size"), _integer(size[1], 1, MAX_SIDE, "size")),
        samples=_integer(content["samples"], 1, MAX_SAMPLES, "samples"),
        color=None if surfaces or (color_map and not by_field) else color,
        color_map=color_map,
        lights=_lights(content["lights"]),
        light=_light(content["light"]),
        **_shadow(content),
        bounce_rays=_bounce(content),
        **_background(content),
        clip=_clip(content["clip"]),
        caps=_flag(content["caps"], "caps"),
        surfaces=surfaces,
        slices=_slices(content),
        slice_map=_slice_map(content["slice_map"]),
        outputs=("rgb",),
        **_error(content),
        time_budget_ms=time_budget,
        voxel_pixels=_voxel_pixels(content, surfaces),
        ambient_rays=_integer(content["ambient"], 0, MAX_AMBIENT, "ambient"),
        progress=False,
    )
    step = _integer(content["step"], 0, MAX_ID, "step")
    wish_id = _integer(content["id"], 0, MAX_ID, "id")
    return Wish(wish_id, request, step, _annotations(content["annotations"]))


def _read_ack(content: dict[str, Any]) -> Ack:
    return Ack(_integer(content["frame"], 0, MAX_ID, "frame"))


def _read_budget(content: dict[str, Any]) -> Budget:
    value = content["bytes"]
    return Budget(None if value is None else _integer(value, 1, MAX_ID, "bytes"))


def _read_probe(content: dict[str, Any]) -> Probe:
    at = content["at"]
    if not isinstance(at, list) or len(at) != 2:
        raise ProtocolError("at must be two numbers")
    x, y = (_number(part, 0, 1, "at") for part in at)
    return Probe(_integer(content["id"], 0, MAX_ID, "id"), (x, y))


def _read_scene(content: dict[str, Any]) -> SceneFile:
    if not isinstance(content["text"], str):
        raise ProtocolError("text must be a text")
    return SceneFile(content["text"])


def _read_page(content: dict[str, Any]) -> PageFile:
    return PageFile(_read_scene(content).text)


_READERS: Final[dict[str, tuple[dict[str, None], Callable[[dict[str, Any]], Message]]]] = {
    "hello": (dict.fromkeys(("type", "version")), _read_hello),
    "wish": (
        dict.fromkeys(
            "type id isovalue size camera color background background_top samples max_error by"
            " time_budget voxel_pixels ambient clip caps surfaces color_map slices slice_map"
            " lights light shadow bounce step annotations transparent".split()
        ),
        _read_wish,
    ),
    "ack": (dict.fromkeys(("type", "frame")), _read_ack),
    "budget": (dict.fromkeys(("type", "bytes")), _read_budget),
    "scene": (dict.fromkeys(("type", "text")), _read_scene),
    "page": (dict.fromkeys(("type", "text")), _read_page),
    "probe": (dict.fromkeys(("type", "id", "at")), _read_probe),
}
