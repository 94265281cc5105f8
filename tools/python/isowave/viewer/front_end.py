"""The front end: one ES module in parts, since a notebook takes no more than one."""

from __future__ import annotations

from importlib import resources
from typing import Final

PARTS: Final = (
    "state.js",
    "moves.js",
    "clip.js",
    "surfaces.js",
    "looks.js",
    "quality.js",
    "slices.js",
    "labels.js",
    "annotations.js",
    "time.js",
    "scenes.js",
    "facts.js",
    "history.js",
    "menus.js",
    "histogram.js",
    "cube.js",
    "overlay.js",
    "tools.js",
    "gestures.js",
    "cameras.js",
    "export.js",
    "markup.js",
    "styles.js",
    "view.js",
    "homes.js",
)


def script() -> str:
    folder = resources.files(__package__)
    return "\n".join(folder.joinpath(part).read_text() for part in PARTS)
