"""Pages that a front end saves: a volume with its scene, for browsers without a server."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from isowave._core import parse_scene

from . import messages
from .interfaces import VolumeLike
from .steps import Steps


def page_maker(
    steps: Steps, title: str, text: str, field: VolumeLike | None
) -> Callable[[], tuple[dict[str, Any], bytes | None]]:
    """A function that makes the message with the page of a scene, or an error.

    steps  whose lock is held now
    text   of a scene file
    field  the second volume
    """
    volume, is_series = steps.volume, len(steps) > 1

    def make() -> tuple[dict[str, Any], bytes | None]:
        try:
            if is_series:
                raise ValueError("a page shows one volume, and this is a series")
            with tempfile.TemporaryDirectory(prefix="isowave-") as folder:
                path = Path(folder) / "page.html"
                volume.save_page(parse_scene(text), path, title, field)
                return {"type": "page"}, path.read_bytes()
        except Exception as error:  # what the library says
            return messages.error(error, None), None

    return make
