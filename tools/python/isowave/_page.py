"""Pages that show a volume in any browser: one file, or a folder for a server of files."""

from __future__ import annotations

import os
from typing import Any

from isowave import _core, _loader
from isowave._annotate import draw

ENGINE = _loader.PACKAGE / "page.html.gz"  # of a wheel that has one


def save_page(
    volume: Any, fields: dict[str, Any], path: str | os.PathLike[str], title: str, field: Any
) -> None:
    """Writes a page.

    fields  of isowave::Scene
    field   the second volume if colours are by one; otherwise it is not looked at
    Raises  TypeError, Error
    """
    is_used = fields.get("color_by_field") and fields.get("field") != "volume"
    second = _core_of(field) if is_used and field is not None else None
    _core.save_page(_core_of(volume), fields, os.fsdecode(path), _engine(), title, second, draw)


def save_site(
    volume: Any, fields: dict[str, Any], folder: str | os.PathLike[str], title: str
) -> None:
    """Writes a page and, beside it, its volume. Arguments and errors as save_page()."""
    _core.save_site(_core_of(volume), fields, os.fsdecode(folder), _engine(), title, draw)


def _core_of(volume: Any) -> _core.Volume:
    core = getattr(volume, "_core", None)
    if not isinstance(core, _core.Volume):
        raise TypeError(f"a page shows a Volume, not {type(volume).__name__}")
    return core


def _engine() -> str:
    """Its file; empty: the library finds it."""
    is_named = "ISOWAVE_PAGE" in os.environ or not ENGINE.is_file()
    return "" if is_named else str(ENGINE)
