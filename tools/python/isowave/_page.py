"""Pages that show a volume in any browser, without a server."""

from __future__ import annotations

import os
from typing import Any

from isowave import _core, _loader

ENGINE = _loader.PACKAGE / "page.html.gz"  # of a wheel that has one


def save_page(
    volume: Any, fields: dict[str, Any], path: str | os.PathLike[str], title: str
) -> None:
    """Writes a page. fields: those of isowave::Scene. Raises TypeError, Error."""
    core = getattr(volume, "_core", None)
    if not isinstance(core, _core.Volume):
        raise TypeError(f"a page shows a Volume, not {type(volume).__name__}")
    is_named = "ISOWAVE_PAGE" in os.environ or not ENGINE.is_file()
    _core.save_page(core, fields, os.fsdecode(path), "" if is_named else str(ENGINE), title)
