"""Annotations of pictures: the compiled part says what is where, Pillow draws it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from isowave import _core
from isowave._checked import names

NAMES = ("scale-bar", "axes", "color-bar", "caption")
#: Pillow draws lines without shades of grey: larger, and then made smaller.
ENLARGED = 4


def annotations_of(
    what: str | Sequence[str], units: str, title: str, has_map: bool
) -> dict[str, Any]:
    """Fields of isowave::Annotations. Raises TypeError, ValueError."""
    for name, text in (("units", units), ("title", title)):
        if not isinstance(text, str):
            raise TypeError(f"{name}={text!r}: give a text")
    asked = names("what", (what,) if isinstance(what, str) else what)
    unknown = {*asked} - {*NAMES, "all"}
    if unknown:
        raise ValueError(f"what {', '.join(sorted(unknown))}: there are {', '.join(NAMES)}, all")
    is_all = "all" in asked
    wanted: dict[str, Any] = {
        name.replace("-", "_"): name in asked or (is_all and (name != "color-bar" or has_map))
        for name in NAMES
    }
    return {**wanted, "units": units, "title": title}


def draw(picture: npt.NDArray[np.uint8], groups: list[dict[str, Any]]) -> npt.NDArray[np.uint8]:
    """A copy of the picture with these groups over it."""
    try:
        import PIL.Image
        import PIL.ImageDraw
        import PIL.ImageFont
    except ImportError:
        raise _core.Error("annotations need Pillow: pip install 'isowave[annotations]'") from None
    result: npt.NDArray[np.uint8] = picture.copy()
    for group in groups:
        (left, top), (right, bottom) = group["begin"], group["end"]
        size = (ENLARGED * (right - left), ENLARGED * (bottom - top))
        canvas = PIL.Image.new("RGBA", size)
        _draw_group(PIL.ImageDraw.Draw(canvas), PIL.ImageFont, group)
        # Colours times alpha may be averaged.
        small = canvas.convert("RGBa").reduce(ENLARGED)
        _lay_over(result[top:bottom, left:right], np.frombuffer(small.tobytes(), np.uint8))
    return result


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
        try:
            font = fonts.load_default(ENLARGED * size)
        except TypeError:
            raise _core.Error(
                "annotations need Pillow 10.1 or later: pip install -U pillow"
            ) from None
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
