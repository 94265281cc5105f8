"""The front end: one ES module in parts, since a notebook takes no more than one."""

from __future__ import annotations

from importlib import resources
from typing import Final

PARTS: Final = (
    "state.js",
    "moves.js",
    "clip.js",
    "surfaces.js",
    "quality.js",
    "looks.js",
    "slices.js",
    "labels.js",
    "annotations.js",
    "time.js",
    "scenes.js",
    "facts.js",
    "markup.js",
    "view.js",
    "homes.js",
)


def script() -> str:
    folder = resources.files(__package__)
    return "\n".join(folder.joinpath(part).read_text() for part in PARTS)
