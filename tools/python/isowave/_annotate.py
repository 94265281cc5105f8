"""Annotations of pictures: the compiled part says what is where, Pillow draws it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._checked import names

NAMES = ("scale-bar", "axes", "color-bar", "caption")
#: Pillow draws lines without shades of grey: larger, and then made smaller.
ENLARGED = 4
#: With letters such as µ and Å: of Linux, Windows and macOS.
FONTS = ("DejaVuSans.ttf", "arial.ttf", "Arial.ttf")


@dataclass(frozen=True)
class Annotations:
    """What is drawn over a picture; arguments as Image.annotated(). Raises TypeError, ValueError.

    A Scene keeps them, and isowave.view() shows them at first.
    """

    what: str | Sequence[str] = "all"  #: afterwards a tuple of names
    units: str = ""
    title: str = ""

    def __post_init__(self) -> None:
        for name in ("units", "title"):
            text = getattr(self, name)
            if not isinstance(text, str):
                raise TypeError(f"{name}={text!r}: give a text")
        asked = names("what", (self.what,) if isinstance(self.what, str) else self.what)
        unknown = ", ".join(sorted({*asked} - {*NAMES, "all"}))
        if unknown:
            raise ValueError(f"what {unknown}: there are {', '.join(NAMES)}, all")
        object.__setattr__(self, "what", asked)


def annotations_for_core(wanted: Annotations, has_bar: bool) -> dict[str, Any]:
    """As fields of isowave::Annotations. has_bar: whether "all" has a colour bar."""
    is_all = "all" in wanted.what
    return {
        **{
            key_of(name): name in wanted.what or (is_all and (name != "color-bar" or has_bar))
            for name in NAMES
        },
        "units": wanted.units,
        "title": wanted.title,
    }


def annotations_from_core(fields: dict[str, Any]) -> Annotations:
    """Fields of isowave::Annotations as a value."""
    what = tuple(name for name in NAMES if fields[key_of(name)])
    return Annotations(what, fields["units"], fields["title"])


def key_of(name: str) -> str:
    """The field of isowave::Annotations."""
    return name.replace("-", "_")


def annotated(
    picture: npt.NDArray[np.uint8],
    fields: dict[str, Any],
    ranges: tuple[Any, Any],
    wanted: Annotations,
) -> npt.NDArray[np.uint8]:
    """A copy of a picture with annotations, as Image.annotated() describes them.

    fields  of its isowave::FrameRequest, whose size is the picture's
    ranges  of its colours and of its slices' colours: "color_range" and "slice_range" of its
            frame's statistics
    """
    has_bar = any(fields.get(name) for name in ("color_map", "color_table", "slices"))
    layout = _core.annotation_layout(annotations_for_core(wanted, has_bar), fields, *ranges)
    return draw(picture, layout)


def draw(picture: npt.NDArray[np.uint8], groups: list[dict[str, Any]]) -> npt.NDArray[np.uint8]:
    """A copy of the picture with these groups over it."""
    try:
        import PIL.Image
        import PIL.ImageDraw
        import PIL.ImageFont
    except ImportError:
        raise _core.Error("annotations need Pillow: pip install pillow") from None
    result: npt.NDArray[np.uint8] = picture.copy()
    for group in groups:
        (left, top), (right, bottom) = group["begin"], group["end"]
        _lay_over(result[top:bottom, left:right], _drawn(PIL, json.dumps(group)))
    return result


@lru_cache(maxsize=32)  # while a view turns, most groups stay as they are
def _drawn(pillow: Any, group_text: str) -> npt.NDArray[np.uint8]:
    """A group that is given as JSON: red, green and blue times alpha, and alpha."""
    group = json.loads(group_text)
    (left, top), (right, bottom) = group["begin"], group["end"]
    size = (ENLARGED * (right - left), ENLARGED * (bottom - top))
    canvas = pillow.Image.new("RGBA", size)
    _draw_group(pillow.ImageDraw.Draw(canvas), pillow.ImageFont, group)
    # Colours times alpha may be averaged.
    small = canvas.convert("RGBa").reduce(ENLARGED)
    return np.frombuffer(small.tobytes(), np.uint8)


def _draw_group(on: Any, fonts: Any, group: dict[str, Any]) -> None:
    left, top = group["begin"]
    halo, halo_color = group["halo"], _rgb(group["halo_color"])

    def places(points: Any) -> list[tuple[float, float]]:
        return [(ENLARGED * (x - left), ENLARGED * (y - top)) for x, y in points]

    def line(points: Any, width: float, color: Any) -> None:
        ends = places(points)
        on.line(ends, color, round(ENLARGED * width), "curve")
        radius = ENLARGED * width / 2
        for x, y in ends:
            on.ellipse((x - radius, y - radius, x + radius, y + radius), color)

    def text(place: Any, anchor: float, size: float, words: str, color: Any, around: int) -> None:
        font = _font(fonts, ENLARGED * size, words)
        where = {0: "ls", 0.5: "ms", 1: "rs"}[anchor]
        on.text(places([place])[0], words, color, font, where, stroke_width=around)

    for points, width, _ in group["strokes"]:
        line(points, width + 2 * halo, halo_color)
    for place, anchor, size, words, _ in group["texts"]:
        text(place, anchor, size, words, halo_color, round(ENLARGED * halo))
    for begin, end, color in group["boxes"]:
        (x, y), (x_end, y_end) = places([begin, end])
        on.rectangle((x, y, x_end - 1, y_end - 1), _rgb(color))  # Pillow's ends are included
    for points, width, color in group["strokes"]:
        line(points, width, _rgb(color))
    for place, anchor, size, words, color in group["texts"]:
        text(place, anchor, size, words, _rgb(color), 0)


def _font(fonts: Any, size: float, words: str) -> Any:
    """Pillow's own font; for letters that it lacks, one of the system if there is one."""
    if not words.replace("…", "").isascii():
        for name in FONTS:
            try:
                return fonts.truetype(name, size)
            except OSError:
                continue
    try:
        return fonts.load_default(size)
    except TypeError:
        raise _core.Error("annotations need Pillow 10.1 or later: pip install -U pillow") from None


def _lay_over(part: npt.NDArray[np.uint8], drawn: npt.NDArray[np.uint8]) -> None:
    """drawn: red, green and blue times alpha, and alpha."""
    over = drawn.reshape(*part.shape[:2], 4).astype(np.float64)
    changed = over[..., 3] > 0
    over, below = over[changed], part[changed].astype(np.float64)
    share = over[:, 3:] / 255
    hidden = (1 - share) * (below[:, 3:] / 255 if part.shape[2] == 4 else 1)
    alpha = share + hidden
    mixed = np.rint((over[:, :3] + hidden * below[:, :3]) / alpha)
    if part.shape[2] == 4:
        mixed = np.hstack((mixed, np.rint(255 * alpha)))
    part[changed] = mixed.clip(0, 255).astype(np.uint8)


def _rgb(color: Any) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in color)
    return red, green, blue
